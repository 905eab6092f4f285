"""The engine for several channels, with several updates in flight: sequencer, banks, commit."""

from itertools import pairwise, zip_longest
from typing import NamedTuple

from amaranth import *
from amaranth.lib import data
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out
from amaranth.utils import bits_for, exact_log2

from .datapath import captured_inputs, choose, constants, memory, operand_registers, operators
from .description import Port, Section, SystemComponent, program_facts, program_sections, status_ports
from .machine import StreamMachine
from .modulo_scheduler import modulo_schedule
from .pool import MemoryStyle
from .program import CONSTANT, NEXT, STATE, TURNED, StreamProgram
from .system import REFUSED, RESTARTED

__all__ = ["StreamEngine"]

READY, IN_CHANNEL, OUT_CHANNEL = "in_ready", "in_channel", "out_channel"


class StreamEngine(SystemComponent):
    """A system's equations for several channels on one pool of operators, one update every ``interval`` cycles.

    Parameters
    ----------
    system : System
        Equations and interface.
    pool : Pool
        Operators, without forwarding; the circuit contains only those that the equations use.
    channels : int
        Number of states, a power of two from 2 to 64.
    interval : int or None
        Cycles between two accepted samples. None: the least for which a schedule is found.

    Members
    -------
    *start*, in_ready : In(1), Out(1)
        A sample is taken, with its channel, at a clock edge at which both are high. The engine is ready every
        ``interval`` cycles. If no update is in flight at that time, it stays ready until a sample comes. It is not
        ready for a channel that has an update in flight, while the reset acts, and in the next ``recovery`` cycles.
        in_ready depends on in_channel in the same cycle.
    in_channel : In(log2(channels))
        Channel of the sample.
    *input ports* : In(format.width), or the number of bits given by the system
    *finish*, out_channel : Out(1), Out(log2(channels))
        High for one cycle per update, and its channel; samples finish in the order in which they came.
    *output ports* : Out(format.width)
        Hold from one finish to the next. A refused update does not change them.
    *status* : Out(len(status_names))
        Bits of the last finished update in the order of ``status_names``, if the system has a status port.

    All other members have the names that the system gives them.

    Latency: ``latency`` cycles from the edge that takes a sample to the edge that raises its finish,
    independent of other updates in flight.
    State: kept in two banks for each channel. An update reads one bank and writes the other, and its end makes the
    other bank the current one. If the system has a status port, an update in which a number was NaN or infinite is
    refused; its channel keeps its state. Without a status port, NaN and infinity pass through to outputs and state.
    After ``system.restart_after`` updates of a channel that were refused although every input was finite, the channel's
    next update starts from the reset state.
    Memory: the engine writes the constants and reset values, one in each interval, and one per cycle while no update is
    in flight. The bank of each channel and the count of its refusals are in memories, which a reset fills, one channel
    per cycle. Nothing else is read before it was written.
    Upsets: if the counter of the interval is wrong, all updates in flight are refused. An update is also refused if its
    channel, bank or freshness does not have the parity that it had when the sample was taken. A channel is busy only if
    a stage is valid and has its number. At each start of an interval the stages move on, and the last one ends. So from
    any contents of the registers every channel is free after as many intervals as an update has stages, plus one.
    Raises: ValueError if there is no schedule of that interval, for other numbers of channels, and for a pool that
    forwards results.
    """

    def __init__(self, system, pool, *, channels, interval=None):
        self._system = system
        self._program = StreamProgram(modulo_schedule(system.trace(pool), StreamMachine(pool), interval), channels)
        super().__init__({port.name: port.member for port in self.ports})

    @property
    def program(self):
        """The microprogram."""
        return self._program

    @property
    def channels(self):
        """Number of states that updates may belong to."""
        return self._program.channels

    @property
    def latency(self):
        """Cycles from the edge that takes a sample to the edge that raises its finish."""
        return self._program.schedule.commit + 1

    @property
    def recovery(self):
        """Cycles after a reset in which nothing is taken: first the microprogram is read; then each cycle writes a
        constant and marks a channel as fresh."""
        return self._filling + self._refreshes

    @property
    def _refreshes(self):
        """Cycles after a reset in which constants are written, and the channels are marked as fresh."""
        return max(len(self._program.constants), self.channels)

    @property
    def _filling(self):
        """Cycles from the address of a word to the word that acts, less those of a ROM that is read without an edge."""
        return 0 if self._program.schedule.pool.microcode is MemoryStyle.DISTRIBUTED else 2

    @property
    def ports(self):
        """The ports, in the order of the module."""
        system, program, meanings = self._system, self._program, self._system.port_meanings
        width, channel = program.format.width, exact_log2(program.channels)
        return (Port(system.start, In, 1, "offers a sample"),
                Port(READY, Out, 1, "high if an offered sample is taken; depends on in_channel"),
                Port(IN_CHANNEL, In, channel, "channel of the sample"),
                *(Port(name, In, system.input_width(name, program.format), meanings[name])
                  for name in system.input_ports),
                Port(system.finish, Out, 1, "high for one cycle with new outputs"),
                Port(OUT_CHANNEL, Out, channel, "channel of the outputs and the status"),
                *(Port(name, Out, width, meanings[name]) for name in system.output_ports),
                *status_ports(system, self.status_names))

    @property
    def sections(self):
        """Timing and microprogram, for the header of a Verilog file."""
        system = self._system
        timing = (
            f"A sample is taken at a rising edge of clk with {system.start} and {READY} high, with all inputs, which "
            f"may change afterwards. {READY} is high in one cycle in {self.interval}; if no update is in flight in "
            "that cycle, it stays high until a sample comes. It is low for a channel whose last update is in flight. "
            f"{system.finish} rises {self.latency} cycles after the edge that takes a sample, and is high for one "
            "cycle; updates finish in order. Outputs hold until the next finish. An update that is refused changes "
            "neither the outputs nor the state of its channel.")
        return Section("TIMING", paragraphs=(timing,)), *program_sections(self._program)

    @property
    def facts(self):
        """Figures as JSON values."""
        program = self._program
        return {"channels": program.channels, "interval_cycles": self.interval,
                "updates_under_way": program.schedule.stages,
                "main_memory_words": program.depth, "side_memory_words": sum(program.side_depths.values()),
                **program_facts(program, self.status_names)}

    @property
    def interval(self):
        """Cycles between two accepted samples, if samples are always offered."""
        return self._program.length

    @property
    def status_names(self):
        """Names of the status bits, lowest first."""
        if not self._system.status_port:
            return ()
        own = (*self._system.status, REFUSED, *([RESTARTED] if self._system.restart_after else []))
        return self._system.ordered_status(own)

    def elaborate(self, platform):
        m = Module()
        stages = self._stages()
        control = self._sequencer(m, stages)
        due = self._restart(m, control, stages)
        self._banks(m, control, stages, due)
        captured = self._inputs(m, control)
        word, write_main = self._word(m, control, stages)
        buses, condition = self._datapath(m, word, write_main, captured)
        self._judge(m, control, stages, word, buses if self.status_names else {})
        if self._system.restart_after:
            self._watch_inputs(m, control, stages, word, buses)
        if condition is not None:
            self._conditions(m, control, word, buses, condition)
        self._outputs(m, control, stages, buses, due)
        return m

    def _stages(self):
        """State of the update in each stage: Stages of lists of signals."""
        shapes = {"valid": 1, "channel": self.in_channel.shape(), "bank": 1, "fresh": 1, "parity": 1, "bad": 1,
                  "foreign": 1}
        count = self._program.schedule.stages
        return Stages(**{name: [Signal(shape, name=f"stage{stage}_{name}") for stage in range(count)]
                         for name, shape in shapes.items()})

    def _sequencer(self, m, stages):
        """The counter, and the acceptance of samples: a Control.

        The slot is the word of this cycle; the counter is one ahead of it. If no update is in flight, the counter waits
        for a sample. Else it continues, and an interval that begins without a sample is a stage without an update.
        """
        program, schedule = self._program, self._program.schedule
        length = program.length
        # A ROM that is read at an edge has been read before a first word acts: the counter starts before its end.
        first = length - self._filling
        cycle, slot = Signal(range(length), name="cycle", init=first % length), Signal(range(length), name="slot")
        following, goes = Signal(range(length), name="following"), Signal(name="goes")
        beginning, taken = Signal(name="beginning", init=not self._filling), Signal(name="taken")
        in_flight, occupied = Signal(name="in_flight"), Signal(name="occupied")
        start = getattr(self, self._system.start)
        turn = Signal(max(program.turning_bits, bits_for(self._refreshes - 1)), name="turn")
        waiting = Signal(name="waiting")
        # While the engine waits, it writes a constant per cycle. After a reset it takes nothing until all are there,
        # and until all channels are fresh.
        primed, clearing = Signal(name="primed"), Signal(name="clearing")
        with m.If(waiting & (turn == self._refreshes - 1)):
            m.d.sync += primed.eq(1)
        m.d.comb += [
            in_flight.eq(Cat(stages.valid).any()),
            occupied.eq(Cat(valid & (channel == self.in_channel)
                            for valid, channel in zip(stages.valid, stages.channel, strict=True)).any()),
            self.in_ready.eq(beginning & primed & ~occupied),
            taken.eq(start & self.in_ready),
            waiting.eq(beginning & ~in_flight & ~(start & primed)),
            goes.eq(~waiting), clearing.eq(waiting & ~primed)]
        if self._filling:
            ahead, coming = Signal(range(length), name="ahead", init=first + 1), Signal(range(length), name="coming")
            m.d.comb += [coming.eq(Mux(ahead == length - 1, 0, ahead + goes)), following.eq(Mux(goes, ahead, cycle))]
            m.d.sync += ahead.eq(coming)
        else:
            coming = following
            m.d.comb += following.eq(Mux(cycle == length - 1, 0, cycle + goes))
        m.d.sync += [cycle.eq(following), beginning.eq(following == 0), slot.eq(cycle)]
        commit, refuse = Signal(name="commit"), Signal(name="refuse")
        # Another counter, set by the beginnings, must agree with the slot.
        check, upset = Signal(range(length), name="check"), Signal(name="upset")
        m.d.sync += check.eq(Mux(beginning, 0, check + 1))
        # What is known of an update must be what it was when the sample was taken.
        known = [getattr(stages, name)[-1] for name in ("valid", "channel", "bank", "fresh", "parity")]
        m.d.comb += [upset.eq(slot != check), refuse.eq(stages.bad[-1] | upset | Cat(known).xor()),
                     commit.eq((slot == schedule.commit % length) & stages.valid[-1])]
        return Control(cycle, coming, goes, slot, beginning, waiting, clearing, taken, upset, turn, commit, refuse)

    def _restart(self, m, control, stages):
        """High if a refusal now would be the last of the limit with finite inputs: the channel then starts from its
        reset state. The counts are in a memory."""
        limit, channel, due = self._system.restart_after, stages.channel[-1], Signal(name="due")
        if not limit:
            return due
        m.submodules.refusals = refusals = Memory(shape=bits_for(limit), depth=self._program.channels, init=())
        before, after = refusals.read_port(domain="comb"), refusals.write_port()
        m.d.comb += [before.addr.eq(channel), due.eq(~stages.foreign[-1] & (before.data == limit - 1)),
                     after.addr.eq(Mux(control.clearing, control.turn, channel)),
                     after.data.eq(Mux(control.commit & control.refuse & ~due, before.data + 1, 0)),
                     after.en.eq(control.clearing | control.commit & ~(control.refuse & stages.foreign[-1]))]
        return due

    def _banks(self, m, control, stages, due):
        """The bank of each channel, and whether its state is fresh, in a memory; each update carries what it needs of
        them from stage to stage."""
        number, channel = self.in_channel, stages.channel[-1]
        shape = data.StructLayout({"bank": 1, "fresh": 1})
        m.submodules.current = current = Memory(shape=shape, depth=self._program.channels, init=())
        found, after = current.read_port(domain="comb"), current.write_port()
        with m.If(control.commit):
            m.d.sync += stages.valid[-1].eq(0)
        bank, fresh = found.data.bank, found.data.fresh
        m.d.comb += [found.addr.eq(number), after.addr.eq(Mux(control.clearing, control.turn, channel)),
                     after.data.bank.eq((stages.bank[-1] ^ ~control.refuse) & ~control.clearing),
                     after.data.fresh.eq(control.clearing | control.refuse),
                     after.en.eq(control.clearing | control.commit & (~control.refuse | due))]
        # While the counter waits, stages without an update are shifted repeatedly.
        with m.If(control.beginning):
            turned = ~control.turn if len(control.turn) == 1 else control.turn + 1
            m.d.sync += [control.turn.eq(turned), stages.valid[0].eq(control.taken), stages.channel[0].eq(number),
                         stages.bank[0].eq(bank), stages.fresh[0].eq(fresh),
                         stages.parity[0].eq(Cat(control.taken, number, bank, fresh).xor())]
            for signals in stages.valid, stages.channel, stages.bank, stages.fresh, stages.parity:
                m.d.sync += [later.eq(signal) for signal, later in pairwise(signals)]

    def _inputs(self, m, control):
        """Registers of the input ports, loaded at the start of each interval."""
        return list(captured_inputs(m, self, self._program, control.beginning).values())

    def _word(self, m, control, stages):
        """The word that acts, its addresses settled by what is known of each stage; and whether it writes to the main
        memory: what is written of a stage without an update is lost, but must not touch any state."""
        program = self._program
        style = program.schedule.pool.microcode
        registered = bool(self._filling)
        m.submodules.microcode = rom = Memory(shape=program.layout, depth=program.length, init=program.words,
                                              attrs=style.attributes("rom_style") if registered else {})
        fetch = rom.read_port(domain="sync" if registered else "comb")
        settled, word = Signal(program.layout, name="settled"), Signal(program.layout, name="word", reset_less=True)
        fetched = fetch.data
        if registered:
            # The word of the counter; the ROM's output is the next word.
            fetched = Signal(program.layout, name="fetched", reset_less=True)
            with m.If(control.goes):
                m.d.sync += fetched.eq(fetch.data)
        m.d.comb += [fetch.addr.eq(control.coming if registered else control.cycle), settled.eq(fetched)]
        m.d.sync += word.eq(settled)
        known = list(zip(stages.fresh, stages.bank, stages.channel, strict=True))
        low = program.index_bits

        def state(address, stage):
            fresh, bank, channel = known[stage]
            own = Cat(bank, channel, C(0, low - 1 - len(channel)), address[low:])
            return Mux(fresh, program.upper | address[:low], own)

        def next_state(address, stage):
            _, bank, channel = known[stage]
            return address | Cat(~bank, channel)

        def constant(address, _):
            return address | control.turn[:program.constant_bits]

        def settle(path, words):
            """The address of a part of the word, by its kind."""
            read, address = fetched, settled
            for name in path:
                read, address = read[name], address[name]
            with m.Switch(read.kind):
                for index, (kind, parameter) in enumerate(program.kinds):
                    with m.Case(index):
                        if kind == TURNED:
                            m.d.comb += address.address.eq(_turned(read.address, control.turn[:parameter]))
                        elif kind in words:
                            m.d.comb += address.address.eq(words[kind](read.address, parameter))

        for port in program.read_ports:
            for side in "ab":
                settle((f"port{port}", side), {STATE: state, NEXT: next_state})
        for bus in program.depths:
            settle((bus,), {STATE: next_state, CONSTANT: constant} if bus == "main" else {})
        enable = Signal()
        with m.Switch(fetched.main.kind):
            for index, (kind, stage) in enumerate(program.kinds):
                if kind == STATE:
                    with m.Case(index):
                        m.d.comb += enable.eq(fetched.main.enable & stages.valid[stage])
            with m.Default():
                m.d.comb += enable.eq(fetched.main.enable)
        if program.constants:
            with m.If(control.waiting):
                refresh = program.refresh
                m.d.comb += [enable.eq(1), settled.main.source.eq(refresh["source"]),
                             settled.main.address.eq(constant(refresh["address"], 0))]
        write_main = Signal()
        m.d.sync += write_main.eq(enable)
        return word, write_main

    def _datapath(self, m, word, write_main, captured):
        """Memories, operators and buses; returns the buses by name, and the condition of a choice, if any."""
        program, pool = self._program, self._program.schedule.pool
        m.submodules.main_memory = main = memory(program, program.depth, pool.operand_memory)
        memories = {"main": (main, write_main)}
        for name, depth in program.side_depths.items():
            m.submodules[f"{name}_memory"] = aside = memory(program, depth, pool.side_memory)
            memories[name] = aside, word[name].enable

        def fetch(fields):
            ports = []
            for name, (each, _) in memories.items():
                if name == "main":
                    ports.append(each.read_port())
                else:  # Amaranth calls the signals of the port after this variable.
                    from_side = each.read_port()
                    ports.append(from_side)
            m.d.comb += [port.addr.eq(fields.address) for port in ports]
            found = [port.data for port in ports]
            for _ in range(1, pool.read_ranks):
                ranks = [Signal.like(value, name="rank", reset_less=True) for value in found]
                m.d.sync += [rank.eq(value) for rank, value in zip(ranks, found, strict=True)]
                found = ranks
            for bit in fields.side if program.side_depths else []:
                found = [low if high is None else Mux(bit, high, low)
                         for low, high in zip_longest(found[::2], found[1::2])]
            return found[0]

        ports = operand_registers(m, program, word, fetch)
        components = {unit.name: unit.make() for unit in program.units}
        operators(m, program, word, components, ports)
        condition = None
        for unit in program.units:
            if unit.takes_condition:
                condition = Signal(reset_less=True)
                m.d.comb += components[unit.name].condition.eq(condition)
        results = {"input": Array(captured)[word.input],
                   **{name: component.result for name, component in components.items()}}
        if program.constants:
            read = constants(m, program, MemoryStyle.DISTRIBUTED).read_port(domain="comb")
            m.d.comb += read.addr.eq(word.main.address)
            results["constant"] = read.data
        buses = {}
        for name, (target, writes) in memories.items():
            buses[name] = bus = Signal(program.format.layout, name=f"{name}_bus")
            choose(m, bus, word[name].source, [results[source] for source in program.sources[name]])
            write = target.write_port()
            m.d.comb += [write.addr.eq(word[name].address), write.data.eq(bus), write.en.eq(writes)]
        return buses, condition

    def _judge(self, m, control, stages, word, buses):
        """Updates to refuse. What is not finite is found a cycle after it was on a bus, by the stage it belongs to."""
        found: list[list] = [[control.upset] for _ in stages.bad]
        for name, bus in buses.items():
            special, where = Signal(name=f"{name}_special"), Signal(word[name].stage.shape(), name=f"{name}_stage")
            m.d.sync += [special.eq(word[name].enable & (bus.exponent == self._program.format.exponent_special)),
                         where.eq(word[name].stage)]
            for stage, events in enumerate(found):
                events.append(special & (where == stage))
        self._collect(m, control, stages.bad, found, control.upset)

    def _watch_inputs(self, m, control, stages, word, buses):
        """Updates with an input that is not finite. It is found like a number that is not finite."""
        schedule, program = self._program.schedule, self._program
        reached = {(step.bus, (step.write + 1) // schedule.period) for step in schedule.steps if step.unit == "input"}
        found: list[list] = [[] for _ in stages.foreign]
        for name in {bus for bus, _ in reached}:
            foreign, where = Signal(name=f"{name}_foreign"), Signal(word[name].stage.shape(), name=f"{name}_origin")
            m.d.sync += [foreign.eq((word[name].source == program.sources[name].index("input"))
                                    & (buses[name].exponent == program.format.exponent_special)),
                         where.eq(word[name].stage)]
            for bus, stage in reached:
                if bus == name:
                    found[stage].append(foreign & (where == stage))
        self._collect(m, control, stages.foreign, found, 0)

    def _collect(self, m, control, flags, found, first):
        """A flag of each update: set by events in its stage, carried from stage to stage."""
        now = [flag | Cat(events).any() for flag, events in zip(flags, found, strict=True)]
        for flag, before, after in zip(flags, [first, *now], now, strict=False):
            m.d.sync += flag.eq(Mux(control.beginning, before, after))

    def _kept(self, m, control, node, value, until, name):
        """A part of a node's value on the bus, kept until a later cycle: registers, the newest first."""
        schedule, registers = self._program.schedule, []
        written = schedule.written[node]
        for each in range(-(-(until - written) // schedule.period)):
            register = Signal(len(value), name=f"{name}_{each}", reset_less=True)
            with m.If(control.slot == written % schedule.period):
                m.d.sync += register.eq(value)
            registers.append(register)
            value = register
        return registers

    def _conditions(self, m, control, word, buses, condition):
        """The condition of a choice: the sign of a value, kept in registers since it was on the bus."""
        program, schedule = self._program, self._program.schedule
        ages: dict = {}
        for node, age in program.conditions:
            ages[node] = max(ages.get(node, 0), age)
        signs = {node: self._kept(m, control, node, buses[schedule.bus[node]].sign,
                                  schedule.written[node] + 1 + age * schedule.period, f"condition{index}")
                 for index, (node, age) in enumerate(ages.items())}
        if signs:
            choice = Array([signs[node][age] for node, age in program.conditions])
            m.d.sync += condition.eq(choice[word.condition.index] ^ word.condition.negate)

    def _outputs(self, m, control, stages, buses, due):
        """The end of an update: finish, channel, status and outputs."""
        schedule, graph = self._program.schedule, self._program.graph
        m.d.sync += getattr(self, self._system.finish).eq(control.commit)

        def kept(node, part, name):
            return self._kept(m, control, node, part(buses[schedule.bus[node]]), schedule.commit, name)[-1]

        shown = [self.out_channel.eq(stages.channel[-1])]
        if self.status_names:
            status = {name: (kept(operand.node, lambda bus: bus.sign, name) ^ operand.negated) & ~control.refuse
                      for name, operand in graph.status.items()}
            status |= {REFUSED: control.refuse, RESTARTED: control.refuse & due}
            shown.append(getattr(self, self._system.status_port).eq(
                Cat(status.get(name, C(0)) for name in self.status_names)))
        with m.If(control.commit):
            m.d.sync += shown
        for port, node in graph.outputs.items():
            value = kept(node, lambda bus: bus.as_value(), f"{port}_d")
            with m.If(control.commit & ~control.refuse):
                m.d.sync += getattr(self, port).eq(value)


def _turned(address, turn):
    """An address to whose low bits ``turn`` is added."""
    if len(turn) == 1:
        return address ^ turn
    return Cat((address[:len(turn)] + turn)[:len(turn)], address[len(turn):])


class Stages(NamedTuple):
    """Signals by stage of an update: high if an update is in the stage, its channel, bank and freshness of the
    channel's state, and their parity when the sample was taken; high if a number was not finite, and if an input was
    not."""

    valid: list[Signal]
    channel: list[Signal]
    bank: list[Signal]
    fresh: list[Signal]
    parity: list[Signal]
    bad: list[Signal]
    foreign: list[Signal]


class Control(NamedTuple):
    """Signals of the sequencer: ``coming`` is the counter's next value, or the one after it if the ROM is read at an
    edge; ``goes`` is high if the counter continues, ``waiting`` while no update is in flight and no sample comes, and
    ``clearing`` if it waits after a reset; ``upset`` is high if the slot is wrong, ``turn`` counts the intervals for
    addresses."""

    cycle: Signal
    coming: Signal
    goes: Signal
    slot: Signal
    beginning: Signal
    waiting: Signal
    clearing: Signal
    taken: Signal
    upset: Signal
    turn: Signal
    commit: Signal
    refuse: Signal
