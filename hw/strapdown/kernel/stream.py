"""The machine that runs several updates at a time, each of a channel with a state of its own."""

from itertools import pairwise

from amaranth import *
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out
from amaranth.utils import exact_log2

from .description import Port, Section, SystemComponent, program_facts, program_sections, status_ports
from .modulo import modulo_schedule
from .stream_program import PLAIN, TURNED, StreamProgram

__all__ = ["StreamEngine"]

READY, IN_CHANNEL, OUT_CHANNEL, REFUSED = "in_ready", "in_channel", "out_channel", "refused"


class StreamEngine(SystemComponent):
    """A system's equations for several channels on one pool of operators, an update every ``interval`` cycles.

    Parameters
    ----------
    system : System
        Equations and interface, with a status port.
    pool : Pool
        Operators; those the equations do not use are left out.
    channels : int
        Number of states, a power of two.
    interval : int
        Cycles between two samples that are taken.

    Members
    -------
    *start*, in_ready : In(1), Out(1)
        A sample is taken at a clock edge at which both are high, with its channel. The engine is
        ready every ``interval`` cycles, and if nothing is under way then, until a sample comes; never
        for a channel that is under way. in_ready follows in_channel within the cycle.
    in_channel : In(log2(channels))
        Whose sample it is.
    *input ports* : In(format.width)
    *finish*, out_channel : Out(1), Out(log2(channels))
        High for one cycle an update, and whose it is; samples finish in the order in which they came.
    *output ports* : Out(format.width)
        Hold from one finish to the next. An update that is refused leaves them as they were.
    *status* : Out(len(status_names))
        Bits in the order of ``status_names``; of the update that finished last.

    All other members have the names that the system gives them.

    Latency: ``latency`` cycles from the edge that takes a sample to the one that raises its finish,
    whatever else is under way.
    State: of each channel in two banks; an update reads the one and writes the other, and its end
    makes the other the current one. An update is refused because a number in it was NaN or
    infinite; its channel keeps its state.
    Raises: ValueError if there is no schedule of that interval, or ``channels`` is no power of two.
    """

    def __init__(self, system, pool, *, channels, interval):
        self._system = system
        self._program = StreamProgram(modulo_schedule(system.trace(pool), pool, interval), channels)
        super().__init__({port.name: port.member for port in self.ports})

    @property
    def program(self):
        """The microprogram."""
        return self._program

    @property
    def latency(self):
        """Cycles from the edge that takes a sample to the one that raises its finish."""
        return self._program.schedule.commit + 1

    @property
    def ports(self):
        """The ports, in the order of the module."""
        system, program, meanings = self._system, self._program, self._system.port_meanings
        width, channel = program.format.width, exact_log2(program.channels)
        return (Port(system.start, In, 1, "offers a sample"),
                Port(READY, Out, 1, "high when an offered sample is taken; depends on in_channel"),
                Port(IN_CHANNEL, In, channel, "whose sample it is"),
                *(Port(name, In, width, meanings[name]) for name in system.input_ports),
                Port(system.finish, Out, 1, "high for one cycle with new outputs"),
                Port(OUT_CHANNEL, Out, channel, "whose outputs and status they are"),
                *(Port(name, Out, width, meanings[name]) for name in system.output_ports),
                *status_ports(system, self.status_names))

    @property
    def sections(self):
        """Timing and microprogram, for the header of a Verilog file."""
        system = self._system
        timing = (
            f"A sample is taken at a rising edge of clk with {system.start} and {READY} high, with all inputs, which "
            f"may change afterwards. {READY} is high in one cycle in {self.interval}, and if nothing is under way "
            "then, until a sample comes; but never for a channel whose last sample is under way. "
            f"{system.finish} rises {self.latency} cycles after that edge, for every sample, and is high for one "
            "cycle; samples finish in order. Outputs hold until the next finish. An update that is refused changes "
            "neither the outputs nor its channel's state.")
        return Section("TIMING", paragraphs=(timing,)), *program_sections(self._program)

    @property
    def facts(self):
        """Figures as JSON values."""
        program = self._program
        return {"channels": program.channels, "interval_cycles": self.interval,
                "updates_under_way": program.schedule.stages,
                "main_memory_words": program.depth, "side_memory_words": program.side_depth,
                **program_facts(program, self.status_names)}

    @property
    def interval(self):
        """Cycles between two samples that are taken, while there are any."""
        return self._program.length

    @property
    def status_names(self):
        """Names of the status bits, lowest first."""
        return (*self._system.status, REFUSED)

    def elaborate(self, platform):
        m = Module()
        program, schedule, graph = self._program, self._program.schedule, self._program.schedule.graph
        number, length, stages = program.format.layout, program.length, schedule.stages
        channel_shape = self.in_channel.shape()

        # Sequencer: ``word`` acts in this cycle, the counter is one ahead of it. With nothing under
        # way it waits for a sample; else it runs on, and a begin without a sample is a stage without an update.
        counter, slot = Signal(range(length), name="counter"), Signal(range(length), name="slot")
        following, goes = Signal(range(length), name="following"), Signal(name="goes")
        beginning, taken = Signal(name="beginning", init=1), Signal(name="taken")
        valid, channel, bank, fresh, bad = ([Signal(shape, name=f"stage{stage}_{name}") for stage in range(stages)]
                                            for name, shape in (("valid", 1), ("channel", channel_shape), ("bank", 1),
                                                                ("fresh", 1), ("bad", 1)))
        busy = Signal(program.channels)
        start, finish = getattr(self, self._system.start), getattr(self, self._system.finish)
        m.d.comb += [
            self.in_ready.eq(beginning & ~busy.bit_select(self.in_channel, 1)), taken.eq(start & self.in_ready),
            goes.eq(~beginning | taken | Cat(valid).any()),
            following.eq(Mux(counter == length - 1, 0, counter + goes))]
        m.d.sync += [counter.eq(following), beginning.eq(following == 0), slot.eq(counter)]

        # Banks by channel; what an update needs of them goes with it from stage to stage.
        banks, freshness = Signal(program.channels, name="banks"), Signal(program.channels, name="freshness", init=-1)
        turn, last = Signal(name="turn"), stages - 1
        commit, refuse = Signal(name="commit"), Signal(name="refuse")
        m.d.comb += [commit.eq((slot == schedule.commit % length) & valid[last]), refuse.eq(bad[last])]
        with m.If(commit):
            m.d.sync += valid[last].eq(0)
            with m.If(~refuse):
                m.d.sync += [banks.bit_select(channel[last], 1).eq(~bank[last]),
                             freshness.bit_select(channel[last], 1).eq(0)]
            m.d.sync += busy.bit_select(channel[last], 1).eq(0)
        with m.If(taken):
            m.d.sync += busy.bit_select(self.in_channel, 1).eq(1)
        # While the counter waits, stages without an update are handed on, again and again.
        with m.If(beginning):
            m.d.sync += [turn.eq(~turn), valid[0].eq(taken), channel[0].eq(self.in_channel),
                         bank[0].eq(banks.bit_select(self.in_channel, 1)),
                         fresh[0].eq(freshness.bit_select(self.in_channel, 1))]
            for signals in valid, channel, bank, fresh:
                m.d.sync += [later.eq(signal) for signal, later in pairwise(signals)]
        captured = [Signal(program.format.width, name=f"{port}_q", reset_less=True) for port in graph.inputs]
        with m.If(beginning):
            m.d.sync += [register.eq(getattr(self, port))
                         for register, port in zip(captured, graph.inputs, strict=True)]

        # A word on its way from the ROM: its addresses are settled by what is known of each stage.
        m.submodules.microcode = rom = Memory(shape=program.layout, depth=length, init=program.words)
        fetch = rom.read_port(domain="comb")
        settled, word = Signal(program.layout, name="settled"), Signal(program.layout, name="word")
        m.d.comb += [fetch.addr.eq(counter), settled.eq(fetch.data)]
        m.d.sync += word.eq(settled)
        upper = program.upper
        to_read = [Mux(each, upper, Cat(one, number_)) for each, one, number_ in zip(fresh, bank, channel, strict=True)]
        to_write = [Cat(~one, number_) for one, number_ in zip(bank, channel, strict=True)]

        def settle(read, address, words):
            """The address of a part of the word, by its kind."""
            with m.Switch(read.kind):
                with m.Case(PLAIN):
                    pass
                with m.Case(TURNED):
                    m.d.comb += address.eq(read.address ^ turn)
                for kind, word_ in enumerate(words, TURNED + 1):
                    with m.Case(kind):
                        m.d.comb += address.eq(read.address | word_)

        for port in program.read_ports:
            for side in "ab":
                name = f"port{port}"
                settle(fetch.data[name][side], settled[name][side].address, to_read)
        settle(fetch.data.main, settled.main.address, to_write)
        settle(fetch.data.side, settled.side.address, [])
        enable = Signal()
        # What is written of a stage without an update is lost, but must not touch any state.
        with m.Switch(fetch.data.main.kind):
            for stage, flag in enumerate(valid):
                with m.Case(TURNED + 1 + stage):
                    m.d.comb += enable.eq(fetch.data.main.enable & flag)
            with m.Default():
                m.d.comb += enable.eq(fetch.data.main.enable)
        write_main = Signal()
        m.d.sync += write_main.eq(enable)

        # Memories, and operands in registers.
        m.submodules.main_memory = main = Memory(shape=program.format.width, depth=program.depth, init=program.initial,
                                          attrs={"ram_style": "block"})
        m.submodules.side_memory = side_memory = Memory(shape=program.format.width, depth=program.side_depth, init=[],
                                                 attrs={"ram_style": "distributed"})
        ports = {}
        for port in program.read_ports:
            for side in "ab":
                fields = word[f"port{port}"][side]
                from_main, from_side = main.read_port(), side_memory.read_port()
                operand = Signal(number, name=f"port{port}_{side}", reset_less=True)
                m.d.comb += [from_main.addr.eq(fields.address), from_side.addr.eq(fields.address)]
                m.d.sync += operand.eq(Mux(fields.side, from_side.data, from_main.data)
                                       ^ (fields.negate << (program.format.width - 1)))
                ports[port, side] = operand

        # Operators.
        results = {"input": Array(captured)[word.input]}
        for unit in program.units:
            m.submodules[unit.name] = component = unit.make()
            results[unit.name] = component.result
            begin = Signal(name=f"{unit.name}_start")
            m.d.sync += begin.eq(word.start[unit.name])
            m.d.comb += component.start.eq(begin)
            for member, side in zip(unit.operands, "ab", strict=True):
                m.d.comb += getattr(component, member).eq(ports[schedule.read_port(unit.name), side])
            for mode in unit.modes.values():
                chosen = Signal(name=f"{unit.name}_{mode}", reset_less=True)
                m.d.sync += chosen.eq(word.mode[f"{unit.name}_{mode}"])
                m.d.comb += getattr(component, mode).eq(chosen)
            if any(len(step.node.operands) == 3 for step in schedule.steps if step.unit == unit.name):
                condition = Signal(reset_less=True)
                m.d.comb += component.condition.eq(condition)

        # Buses. What is not finite is found a cycle later, by the stage it belongs to.
        buses = {}
        found: list[list] = [[] for _ in range(stages)]
        for name, memory, writes in ("main", main, write_main), ("side", side_memory, word.side.enable):
            buses[name] = bus = Signal(number, name=f"{name}_bus")
            with m.Switch(word[name].source):
                for index, source in enumerate(program.sources[name]):
                    with m.Case(index):
                        m.d.comb += bus.eq(results[source])
            write = memory.write_port()
            m.d.comb += [write.addr.eq(word[name].address), write.data.eq(bus), write.en.eq(writes)]
            special, where = Signal(name=f"{name}_special"), Signal(word[name].stage.shape(), name=f"{name}_stage")
            m.d.sync += [special.eq(word[name].enable & (bus.exponent == program.format.exponent_special)),
                         where.eq(word[name].stage)]
            for stage in range(stages):
                found[stage].append(special & (where == stage))
        judged = [flag | Cat(events).any() for flag, events in zip(bad, found, strict=True)]
        for stage in range(stages):
            m.d.sync += bad[stage].eq(Mux(beginning, judged[stage - 1] if stage else 0, judged[stage]))

        def kept(node, value, until, name):
            """A part of what the bus shows of a node, kept until a later cycle."""
            written = schedule.written[node]
            for each in range(-(-(until - written) // length)):
                register = Signal(len(value), name=f"{name}_{each}", reset_less=True)
                with m.If(slot == written % length):
                    m.d.sync += register.eq(value)
                value = register
            return value

        signs = [kept(node, buses[schedule.bus[node]].sign, schedule.written[node] + 1, f"condition{index}")
                 for index, node in enumerate(program.conditions)]
        if signs:
            m.d.sync += condition.eq(Array(signs)[word.condition.index] ^ word.condition.negate)

        # The end of an update.
        m.d.sync += finish.eq(commit)
        status = [kept(operand.node, buses[schedule.bus[operand.node]].sign, schedule.commit, name) ^ operand.negated
                  for name, operand in graph.status.items()]
        with m.If(commit):
            m.d.sync += [self.out_channel.eq(channel[last]),
                         getattr(self, self._system.status_port).eq(Cat(*(bit & ~refuse for bit in status), refuse))]
        for port, node in graph.outputs.items():
            value = kept(node, buses[schedule.bus[node]].as_value(), schedule.commit, f"{port}_d")
            with m.If(commit & ~refuse):
                m.d.sync += getattr(self, port).eq(value)
        return m
