"""A core behind a bus: AXI4-Lite, and AXI4-Streams of samples and answers."""

from amaranth import *
from amaranth.lib import stream, wiring
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.wiring import In, Out
from amaranth.utils import exact_log2

from strapdown.bus import (
    ADDRESS_BITS,
    CYCLES_BITS,
    PLACE,
    REGISTER_BITS,
    AnswerSender,
    AxiLiteSlave,
    SampleFramer,
    StartControl,
    StreamMaster,
    stream_words,
)
from strapdown.config import Config
from strapdown.kernel.description import Port, Section, program_facts, program_sections

from .catalogue import main_module, make_core
from .core import Core
from .registers import register_table
from .top import Control, Top, Wrapper, through

__all__ = ["AXI_CONTROL", "AxiCore", "axi_core"]

AXI_CONTROL = Control(
    Port("aclk", In, 1, "clock, rising edge"),
    Port("aresetn", In, 1, "reset, active low, synchronous to aclk"), reset_level=0, reset_stages=0)
"""Clock and reset of the cores behind a bus."""

LITE_PORTS = (
    Port("s_axi_awaddr", In, ADDRESS_BITS, "address of a write, in bytes"),
    Port("s_axi_awprot", In, 3, "protection of a write; ignored"),
    Port("s_axi_awvalid", In, 1, "an address of a write is offered"),
    Port("s_axi_awready", Out, 1, "an offered address of a write is taken", init=1),
    Port("s_axi_wdata", In, REGISTER_BITS, "data of a write"),
    Port("s_axi_wstrb", In, REGISTER_BITS // 8, "bytes that are written"),
    Port("s_axi_wvalid", In, 1, "data of a write are offered"),
    Port("s_axi_wready", Out, 1, "offered data of a write are taken", init=1),
    Port("s_axi_bresp", Out, 2, "answer to a write: 0 OKAY, 2 SLVERR"),
    Port("s_axi_bvalid", Out, 1, "an answer to a write is offered"),
    Port("s_axi_bready", In, 1, "an offered answer to a write is taken"),
    Port("s_axi_araddr", In, ADDRESS_BITS, "address of a read, in bytes"),
    Port("s_axi_arprot", In, 3, "protection of a read; ignored"),
    Port("s_axi_arvalid", In, 1, "an address of a read is offered"),
    Port("s_axi_arready", Out, 1, "an offered address of a read is taken", init=1),
    Port("s_axi_rdata", Out, REGISTER_BITS, "data of a read"),
    Port("s_axi_rresp", Out, 2, "answer to a read: 0 OKAY, 2 SLVERR"),
    Port("s_axi_rvalid", Out, 1, "an answer to a read is offered"),
    Port("s_axi_rready", In, 1, "an offered answer to a read is taken"))
"""Ports of the AXI4-Lite slave."""

IRQ = Port("irq", Out, 1, "interrupt, active high: a flag is set that is enabled")


def stream_ports(prefix, flow, meaning, channel_bits):
    """Ports of an AXI4-Stream."""
    back = In if flow is Out else Out
    return (Port(f"{prefix}_tdata", flow, REGISTER_BITS, f"word of {meaning}"),
            Port(f"{prefix}_tlast", flow, 1, "the word is the last of a packet"),
            *((Port(f"{prefix}_tid", flow, channel_bits, "channel of the word"),) if channel_bits else ()),
            Port(f"{prefix}_tvalid", flow, 1, "a word is offered"),
            Port(f"{prefix}_tready", back, 1, "an offered word is taken"))


class AxiCore(Wrapper):
    """An engine behind an AXI4-Lite slave with the registers of a table, and between two AXI4-Streams.

    Parameters
    ----------
    engine : Engine or StreamEngine
        With a status port.
    table : RegisterTable
        The registers, as ``register_table`` makes them.
    error_response : str
        As in ``AxiLiteSlave``.

    Members
    -------
    s_axi_* : AXI4-Lite slave, 12 bits of address, 32 bits of data.
    s_axis_* : AXI4-Stream of samples, if the table has a field CONTROL.stream. A sample is ``table.sample_words``
        words. Taken while CONTROL.stream is 1.
    m_axis_* : AXI4-Stream of answers, ``table.answer_words`` words each: outputs and status. If the last word of a
        sample has TLAST, the last word of its answer has it.
    irq : Out(1)
        An interrupt flag is set that is enabled; a level, one cycle after the flag.

    Latency: that of the engine.
    Raises: ValueError if an answer takes longer than the interval of a StreamEngine; as ``AxiLiteSlave``.
    """

    def __init__(self, engine, table, *, error_response="slverr"):
        self._table, self._error_response = table, error_response
        self._streams = table.streams
        # The registers of a sample can also be loaded by the stream.
        samples = [register.name for word in table.samples for register in word.registers]
        self._slave = AxiLiteSlave(table, ("INTERRUPT_FLAGS", "bad_access"), error_response=error_response,
                                   loaded=samples if self._streams else ())
        bits = self._channel_bits = exact_log2(engine.channels)
        if self._streams and engine.channels > 1 and table.answer_words > engine.interval:
            raise ValueError(f"an answer of {table.answer_words} words takes longer than the interval of "
                             f"{engine.interval} cycles")
        streams = (*stream_ports("s_axis", In, "a sample", bits), *stream_ports("m_axis", Out, "an answer", bits))
        super().__init__(engine, name=table.name, title=f"{engine.title}, behind AXI4-Lite"
                         + " and AXI4-Stream" * self._streams,
                         added=(*LITE_PORTS, *(streams if self._streams else ()), IRQ),
                         hidden=tuple(port.name for port in engine.ports))

    @property
    def table(self):
        """The registers: a RegisterTable."""
        return self._table

    @property
    def streams(self):
        """Whether there are streams."""
        return self._streams

    @property
    def error_response(self):
        """Answer to a bad access: ``slverr`` or ``okay``."""
        return self._error_response

    @property
    def capacity(self):
        """Greatest number of updates in flight, and of answers that wait."""
        return 1 if self.channels == 1 else self.program.schedule.stages + 1

    @property
    def stream_interval(self):
        """Cycles from one update of the stream to the next, if no side of the streams waits."""
        return self.latency + self._table.answer_words + 2 if self.channels == 1 else self.engine.interval

    @property
    def sections(self):
        """Registers, streams, timing and microprogram."""
        table = self._table
        rows = [(f"0x{register.address:03X}", register.name, f"0x{register.reset:X}", register.meaning)
                for register in table]
        timing = (
            "An access can be taken in every cycle. Its answer is valid in the second cycle after it, if earlier "
            f"answers have been taken. An update takes {self.latency} cycles; its start is the second edge after the "
            "one that takes the write of CONTROL, or a later one if the core is not ready yet.")
        parts = [Section("REGISTERS", paragraphs=("Address, name, value after a reset, and meaning.",),
                         rows=tuple(rows)), Section("TIMING", paragraphs=(timing,))]
        if self._streams:
            streams = (
                f"A sample has {table.sample_words} words, an answer {table.answer_words}. The updates of a stream "
                f"follow each other every {self.stream_interval} cycles, if no side waits; then the next sample comes "
                "in while an update runs. A sample waits until its answer has room.")
            parts.append(Section("STREAMS", paragraphs=(streams,), rows=(
                ("sample", ", ".join(word.port for word in table.samples)),
                ("answer", ", ".join((*(word.port for word in table.outputs), self.system.status_port))))))
        return *parts, *program_sections(self.program)

    @property
    def facts(self):
        """Registers and figures as JSON values."""
        table = self._table
        registers = [
            {"name": register.name, "address": register.address, "meaning": register.meaning,
             "fields": [{"name": field.name, "low": field.low, "width": field.width, "access": field.access.value,
                         "reset": field.reset, "meaning": field.meaning} for field in register.fields]}
            for register in table]
        streams = {"sample_words": table.sample_words, "answer_words": table.answer_words,
                   "stream_interval_cycles": self.stream_interval} if self._streams else {}
        return {"registers": registers, **streams, **program_facts(self.program, self.engine.status_names)}

    def elaborate(self, platform):
        m = Module()
        m.submodules.slave = slave = self._slave
        restarting = self._reset(m, slave)
        m.submodules.starts = starts = DomainRenamer("core")(StartControl(self.capacity, self._channel_bits))
        m.d.comb += through(self, slave, {port.name: port.name.removeprefix("s_axi_") for port in LITE_PORTS})
        self._inputs(m, slave, starts, restarting)
        if self._streams:
            self._in_and_out(m, slave, starts, restarting)
        self._commands(m, slave, starts, restarting)
        self._results(m, slave, starts, restarting)
        return m

    def _reset(self, m, slave):
        """The clock domain ``core``, of the engine and the streams; returns its reset, which is a register."""
        restarting = Signal(init=1, reset_less=True)
        m.domains.core = ClockDomain(local=True)
        m.d.sync += restarting.eq(ResetSignal() | slave.control_core_reset)
        m.d.comb += [ClockSignal("core").eq(ClockSignal()), ResetSignal("core").eq(restarting)]
        return restarting

    def _inputs(self, m, slave, starts, restarting):
        """The engine, and its inputs from the registers."""
        m.submodules.engine = DomainRenamer("core")(self.engine)
        engine, system = self.engine, self.system
        for word in self._table.inputs:
            m.d.comb += getattr(engine, word.port).eq(Cat(slave.field(register.name) for register in word.registers))
        m.d.comb += [getattr(engine, system.start).eq(starts.start & ~restarting),
                     starts.finish.eq(getattr(engine, system.finish))]
        if self._channel_bits:
            m.d.comb += [engine.in_channel.eq(starts.start_channel), starts.ready.eq(engine.in_ready),
                         starts.channel.eq(slave.field("CHANNEL"))]
        else:
            # An engine without a port for it is ready if it is idle and its recovery from the reset is over.
            recovered = Signal(engine.recovery)
            m.d.core += recovered.eq(Cat(C(1), recovered))
            m.d.comb += starts.ready.eq(recovered[-1] & ~starts.in_flight)

    def _in_and_out(self, m, slave, starts, restarting):
        """The streams: samples to the registers, and answers from the outputs."""
        engine, table, bits = self.engine, self._table, self._channel_bits
        first = table.samples[0].registers[0].address >> PLACE
        m.submodules.framer = framer = DomainRenamer("core")(SampleFramer(table.sample_words, first, bits))
        m.submodules.sender = sender = DomainRenamer("core")(AnswerSender(table.answer_words, bits))
        wiring.connect(m, framer.load, slave.load)
        wiring.connect(m, framer.sample, starts.sample)
        m.d.comb += [
            framer.words.valid.eq(self.s_axis_tvalid), self.s_axis_tready.eq(framer.words.ready),
            framer.words.p.data.eq(self.s_axis_tdata), framer.words.p.last.eq(self.s_axis_tlast),
            framer.enable.eq(slave.field("CONTROL", "stream")), slave.locked.eq(slave.field("CONTROL", "stream")),
            slave.interrupt_flags_bad_frame_set.eq(framer.bad & ~restarting),
            sender.send.eq(starts.answer), sender.last.eq(starts.last), sender.words.eq(Cat(self._answer()))]
        if bits:
            m.d.comb += [framer.words.p.channel.eq(self.s_axis_tid), sender.channel.eq(engine.out_channel)]
        m.submodules.master = master = StreamMaster(bits)
        m.d.comb += through(self, master, {port: port.removeprefix("m_axis_") for port in self.signature.members
                                           if port.startswith("m_axis_")})
        answer, final = sender.answer, sender.final
        if self.capacity > 1:
            # Updates finish while answers wait. There is room for the answers of all that can be in flight.
            m.submodules.store = store = DomainRenamer("core")(SyncFIFOBuffered(
                width=len(answer.payload.as_value()) + 1, depth=self.capacity * table.answer_words))
            stored = stream.Signature(stream_words(bits)).create(path=("stored",))
            final = Signal(name="stored_final")
            m.d.comb += [store.w_en.eq(answer.valid), answer.ready.eq(store.w_rdy),
                         store.w_data.eq(Cat(answer.payload.as_value(), sender.final)), store.r_en.eq(stored.ready),
                         stored.valid.eq(store.r_rdy), Cat(stored.payload.as_value(), final).eq(store.r_data)]
            answer = stored
        wiring.connect(m, answer, master.words)
        m.d.comb += [
            master.drop.eq(restarting), starts.answered.eq(answer.valid & answer.ready & final),
            slave.status_streaming.eq((framer.partial | starts.answering) & ~restarting | self.m_axis_tvalid)]

    def _answer(self):
        """The words of an answer: outputs, then the status."""
        for word in self._table.outputs:
            value = getattr(self.engine, word.port)
            for low in range(0, word.width, REGISTER_BITS):
                yield _padded(value[low:low + REGISTER_BITS])
        yield _padded(getattr(self.engine, self.system.status_port))

    def _commands(self, m, slave, starts, restarting):
        """Commands of the bus, and the flags that they set."""
        refused = starts.busy | slave.control_core_reset
        if self._streams:
            refused |= slave.control_stream
        flags = [getattr(slave, f"interrupt_{kind}_{field.name}") for kind in ("flags", "enable")
                 for field in self._table["INTERRUPT_FLAGS"].fields]
        half = len(flags) // 2
        m.d.comb += [
            starts.command.eq(slave.control_start & ~refused),
            slave.interrupt_flags_overrun_set.eq(slave.control_start & refused),
            slave.status_busy.eq(starts.busy & ~restarting), slave.pause.eq(restarting | starts.waiting)]
        m.d.sync += self.irq.eq((Cat(flags[:half]) & Cat(flags[half:])).any())

    def _results(self, m, slave, starts, restarting):
        """The end of an update, the counters, and the snapshot."""
        engine, system, table = self.engine, self.system, self._table
        status, finished = getattr(engine, system.status_port), Signal()
        time = Signal(REGISTER_BITS)
        updates = Signal(REGISTER_BITS)
        number = Signal(REGISTER_BITS)
        cycles = Signal(CYCLES_BITS)
        m.d.sync += time.eq(time + 1)
        m.d.comb += [
            finished.eq(starts.finished & ~restarting), number.eq(updates + finished), starts.time.eq(time),
            slave.interrupt_flags_finish_set.eq(finished),
            slave.interrupt_flags_refused_set.eq(finished & status[engine.status_names.index("refused")]),
            slave.sample_time.eq(time), slave.updates.eq(updates), slave.cycles.eq(cycles)]
        with m.If(finished):
            m.d.sync += cycles.eq(starts.cycles)
        with m.If(slave.control_core_reset):
            m.d.sync += updates.eq(0)
        with m.Else():
            m.d.sync += updates.eq(number)
        # Outputs change in the cycle in which the update finishes, so its number is the next one.
        sources = {"SNAPSHOT_UPDATE": number, "SNAPSHOT_STATUS": status}
        if self._channel_bits:
            sources["SNAPSHOT_CHANNEL"] = engine.out_channel
        for word in table.outputs:
            for part, register in enumerate(word.registers):
                sources[register.name] = getattr(engine, word.port).word_select(part, REGISTER_BITS)
        for name, source in sources.items():
            for field in table[name].fields:
                shown = slave.field(name, field.name)
                copy = Signal(field.width, name=shown.name, init=field.reset)
                m.d.comb += shown.eq(copy)
                with m.If(slave.control_snapshot):
                    m.d.sync += copy.eq(source[field.low:field.high + 1])


def _padded(value):
    """A value as a word of a stream."""
    return Cat(value, C(0, REGISTER_BITS - len(value)))


def axi_core(config: Config, *, core: Core | None = None, streams: bool = True,
             error_response: str = "slverr") -> Top:
    """The main module of a configuration behind a bus, as a Top: INS_top_axi for an AttitudeConfig.

    Parameters
    ----------
    config : Config
    core : Core or None
        Its main module, if it exists already: scheduling takes seconds.
    streams : bool
        Whether there are AXI4-Streams of samples and answers.
    error_response : str
        Answer to a bad access: ``slverr``, or ``okay`` for processors that take an error answer for an abort.

    Raises: ValueError for a configuration with a clock enable, or whose main module has no equations or no status
    port; as ``AxiCore``.
    """
    if config.clock_enable:
        raise ValueError(f"configuration {config.name}: clock_enable must be false: a bus has no clock enable")
    core = core or make_core(main_module(config), config)
    table = register_table(core, config, streams=streams)
    return Top(AxiCore(core.engine, table, error_response=error_response), control=AXI_CONTROL)
