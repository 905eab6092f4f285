"""The engine for one update at a time: sequencer, two banks of state, commit."""

from functools import reduce
from operator import or_
from typing import NamedTuple

from amaranth import *
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from .datapath import captured_inputs, choose, memory, operand_registers, operators, read_constants
from .description import Port, Section, SystemComponent, program_facts, program_sections, status_ports
from .list_scheduler import list_schedule
from .machine import UpdateMachine
from .pool import MemoryStyle
from .program import UpdateProgram
from .system import IGNORED, REFUSED, RESTARTED

__all__ = ["Engine"]


class Engine(SystemComponent):
    """A system's equations on a pool of operators, one update per start.

    Parameters
    ----------
    system : System
        Equations and interface.
    pool : Pool
        Operators; the circuit contains only those that the equations use.

    Members
    -------
    *start*, *finish* : In(1), Out(1)
        The start is sampled at the clock edge while the engine is idle, together with all inputs.
        The finish falls at that edge and rises with the outputs. While the reset acts and at the next edge,
        starts are ignored.
    *input ports* : In(format.width), or the number of bits given by the system
    *output ports* : Out(format.width)
        Hold from one finish to the next; all change in one cycle. After a reset, outputs that are
        state words have their reset values; all others are zero.
    *status* : Out(len(status_names))
        Bits in the order of ``status_names``, if the system has a status port. They change with
        the finish; ``ignored`` is set by a start that is ignored and cleared by the next accepted start. During a
        reset all are low.

    All members have the names that the system gives them.

    Latency: ``latency`` cycles from the edge that takes the start to the edge that raises the
    finish, in every update. A new start can be taken at the next edge.
    State: kept in two banks. An update reads one bank and writes the other, and its last cycle makes the other bank
    the current one. An update is refused if it wrote NaN or infinity, in a system with a status port, or if its end
    does not come in the last cycle of the schedule. A refused update does not change state and outputs. After
    ``system.restart_after`` updates that were refused in a row although every input was finite, the next update starts
    from the reset state. A refused update with an input that is NaN or infinite does not change their count.
    Memory: each update writes the constants, and after a reset the state, before it reads them.
    Upsets: from any contents of the registers the engine is idle within twice the latency, if no start comes; the next
    update takes the latency, and its results follow from the state in memory.
    """

    def __init__(self, system, pool):
        self._system = system
        self._program = UpdateProgram(list_schedule(system.trace(pool), UpdateMachine(pool)))
        super().__init__({port.name: port.member for port in self.ports})

    @property
    def program(self):
        """The microprogram."""
        return self._program

    @property
    def channels(self):
        """Number of states that updates may belong to."""
        return 1

    @property
    def ports(self):
        """The ports, in the order of the module."""
        system, format, meanings = self._system, self._program.format, self._system.port_meanings
        return (Port(system.start, In, 1, "starts an update"),
                Port(system.finish, Out, 1, "high when the outputs are valid"),
                *(Port(name, In, system.input_width(name, format), meanings[name]) for name in system.input_ports),
                *(Port(name, Out, format.width, meanings[name], init=format.encode(value))
                  for name, value in self.reset_outputs.items()),
                *status_ports(system, self.status_names))

    @property
    def sections(self):
        """Timing, states and microprogram, for the header of a Verilog file."""
        system, schedule = self._system, self._program.schedule
        firsts = (0, *(end + 1 for end in schedule.section_ends))
        spans = [f"cycles {first} to {end}" for first, end in zip(firsts, schedule.section_ends, strict=False)]
        last = f"cycle {firsts[-1]}: shows the outputs" + (", switches the banks of the state" if system.state else "")
        timing = (
            f"{system.start} is sampled at the rising edge of clk while the core is idle, together with all inputs, "
            f"which may change afterwards. {system.finish} falls at that edge and rises {self.latency} cycles later, "
            "in every update, with all outputs, which hold until the next finish. The next start can be taken one edge "
            "later.")
        places = ("While an update runs, engine.word holds the line of the microprogram whose number is "
                  "engine.cycle - 2, and engine.next_word the next line.")
        return (Section("TIMING", paragraphs=(timing,)),
                Section("SEQUENCER (engine.state)", paragraphs=(places,), rows=tuple(
                    zip(range(len(self.state_names)), self.state_names, ("waits for a start", *spans, last),
                        strict=True))),
                *program_sections(self._program))

    @property
    def facts(self):
        """Figures as JSON values."""
        return {"states": list(self.state_names), "operand_memory_words": self._program.used,
                **program_facts(self._program, self.status_names)}

    @property
    def reset_outputs(self):
        """Maps each output port to its value after a reset."""
        return self._program.schedule.graph.reset_outputs

    @property
    def latency(self):
        """Cycles from the edge that takes ``start`` to the edge that raises ``finish``."""
        return self._program.length + 2

    @property
    def recovery(self):
        """Cycles after a reset in which nothing is taken."""
        return 1

    @property
    def state_names(self):
        """States of the sequencer, in the order of their encoding."""
        return ("IDLE", *self._program.schedule.graph.sections, "END")

    @property
    def status_names(self):
        """Names of the status bits, lowest first."""
        if not self._system.status_port:
            return ()
        own = (*self._system.status, REFUSED, IGNORED, *([RESTARTED] if self._system.restart_after else []))
        return self._system.ordered_status(own)

    def elaborate(self, platform):
        m = Module()
        control = self._sequencer(m)
        word = self._word(m, control)
        captured = self._inputs(m, control)
        writes = self._datapath(m, control, word, captured)
        commit, special = Signal(), Signal()
        m.d.comb += commit.eq(control.ending & control.complete & ~special)
        self._outputs(m, control, writes, commit)
        if self.status_names:
            self._status(m, control, writes, commit, special)
        if self._system.restart_after:
            self._restart(m, control, word, writes, commit)
        return m

    def _sequencer(self, m):
        """The state of the update and the words of the microprogram: a Control.

        The ROM output is registered twice: ``next_word`` is the word after the current one, and ``cycle``, the program
        counter, is one ahead of that. While the engine is idle, the first word is fetched in every cycle. The engine is
        ``primed`` when the ROM has output this word, at the first edge without a reset.

        A second counter counts the remaining cycles down to -1, and then the update ends. An update whose program ends
        in another cycle is not ``complete``: a counter, the state or the ROM is wrong. Both counters are set while no
        update runs.
        """
        program = self._program
        start, finish = (getattr(self, name) for name in (self._system.start, self._system.finish))
        IDLE, END = 0, len(self.state_names) - 1
        state = Signal(range(END + 1), init=IDLE)
        cycle, left = Signal(range(program.length), name="cycle"), Signal(range(-1, program.length), name="left")
        primed, complete = Signal(name="primed"), Signal(name="complete")
        idle, ending, running = (Signal(name=name) for name in ("idle", "ending", "running"))
        m.d.comb += [idle.eq(state == IDLE), ending.eq(state == END), running.eq(~idle & (state < END))]
        m.submodules.microcode = rom = Memory(shape=program.layout, depth=program.length, init=program.words,
                                              attrs=program.schedule.pool.microcode.attributes("rom_style"))
        fetch = rom.read_port()
        next_word = Signal(program.layout, name="next_word")
        word = Signal(program.layout, name="word", init=program.resting)
        last, due, taken = Signal(name="last"), Signal(name="due"), Signal(name="taken")
        m.d.comb += [fetch.addr.eq(cycle), next_word.eq(fetch.data), last.eq(word.advance & (state == END - 1)),
                     due.eq(left < 0), taken.eq(idle & primed & start)]
        m.d.sync += [primed.eq(1), complete.eq(running & last & due), cycle.eq(Mux(running, cycle + 1, taken)),
                     left.eq(Mux(running, left - 1, program.length - 1))]
        with m.If(taken):
            m.d.sync += [state.eq(IDLE + 1), finish.eq(0)]
        with m.Elif(running):
            # Only the second counter ends an update. If the program comes to its end before, it is wrong.
            m.d.sync += state.eq(Mux(due, END, Mux(last, IDLE + 1, state + word.advance)))
        with m.Else():
            # Also from codes that stand for no state.
            m.d.sync += state.eq(IDLE)
        with m.If(ending):
            m.d.sync += finish.eq(1)
        return Control(start, idle, taken, running & ~due, ending, complete, next_word, word,
                       bank=Signal(name="bank"), fresh=Signal(name="fresh", init=1))

    def _word(self, m, control):
        """The current word: that of rest while the engine is idle.

        The bank inverts the lowest bit of addresses of the state, and the steps that restore the state are enabled only
        after a reset. Both are applied one cycle before the word is used, because neither changes during an update.
        """
        program, next_word = self._program, control.next_word
        settled = Signal(program.layout)
        m.d.comb += settled.eq(next_word)
        if program.graph.state:
            for path in program.address_fields:
                read, turned = (_field(fields, path).address for fields in (next_word, settled))
                m.d.comb += turned.eq(read ^ (control.bank & (read < program.state_words)))
            m.d.comb += settled.write.enable.eq(next_word.write.enable & (control.fresh | ~next_word.write.restore))
        m.d.sync += control.word.eq(Mux(control.active, settled, program.layout.const(program.resting)))
        return control.word

    def _inputs(self, m, control):
        """Maps each input port to its value at the edge that took the start."""
        return captured_inputs(m, self, self._program, control.taken)

    def _datapath(self, m, control, word, captured):
        """Memories, operators and buses; returns the enable and the value of each write to a memory.

        The operand memory is read before the edge and written at it, so ports need not be transparent.
        """
        program, pool, number = self._program, self._program.schedule.pool, self._program.format.layout
        m.submodules.operands = operands = memory(program, program.depth, pool.operand_memory)
        bus = Signal(number)
        if program.side_depth:
            m.submodules.side_memory = side_memory = memory(program, program.side_depth, pool.side_memory)
        components = {unit.name: unit.make() for unit in program.units}
        results = {name: Signal(number, name=f"{name}_result") for name in components}
        results["other"] = Signal(number, name="other", reset_less=True)
        if "constant" in program.operand_sources:
            results["constant"] = Signal(number, name="constant")

        def fetch(fields):
            read = operands.read_port(domain="sync" if pool.operand_memory is MemoryStyle.BLOCK else "comb")
            m.d.comb += read.addr.eq(fields.address)
            found = {"memory": read.data, "bus": bus, **results}
            if program.side_depth:
                side_read = side_memory.read_port(domain="comb")
                m.d.comb += side_read.addr.eq(fields.address)
                found["side"] = side_read.data
            return Array([Value.cast(found[name]) for name in program.operand_sources])[fields.source]

        ports = operand_registers(m, program, word, fetch)
        operators(m, program, word, components, ports, rest=control.idle, results=results)

        # One result per cycle goes over the bus, to the memory and to the operands that wait for it.
        if program.horizontal:
            self._meet(m, control, word, components, captured, bus)
        else:
            self._select(m, control, word, results, captured, bus)
        write = operands.write_port()
        m.d.comb += [write.addr.eq(word.write.address), write.data.eq(bus), write.en.eq(word.write.enable)]
        writes = [(word.write.enable, bus)]
        if program.side_depth:
            aside = Signal(number, name="side")
            choose(m, aside, word.side.source, [results[name] for name in program.sources["side"]])
            side_write = side_memory.write_port()
            m.d.comb += [side_write.addr.eq(word.side.address), side_write.data.eq(aside),
                         side_write.en.eq(word.side.enable)]
            writes.append((word.side.enable, aside))
        for unit in program.units:
            if unit.takes_condition:
                self._conditions(m, word, bus, write, components[unit.name])
        return writes

    def _select(self, m, control, word, results, captured, bus):
        """The bus takes the result that the word selects."""
        program = self._program
        results |= captured
        others = Array([Value.cast(results[name]) for name in program.other_sources])
        m.d.sync += results["other"].eq(others[word.other])
        if program.constants:
            constant = self._constants(m, word.other, control.next_word.other)
            if "constant" in results:
                m.d.comb += Value.cast(results["constant"]).eq(constant)
            else:
                results["constant"] = constant
        choose(m, bus, word.write.source, [results[name] for name in program.sources["main"]])

    def _meet(self, m, control, word, components, captured, bus):
        """The bus is the OR of all results: each is zero but in its cycle.

        A result that is not quiet is registered where it is done. Inputs and constants are registered twice, and so the
        bus is the OR of few registers.
        """
        program, width = self._program, self._program.format.width
        driving = [self._constants(m, word.constant, control.next_word.constant)]
        for port, value in captured.items():
            gated = Signal(width, name=f"{port}_gated", reset_less=True)
            m.d.sync += gated.eq(Mux(word.mute[port], 0, value))
            driving.append(gated)
        other = Signal(width, name="other", reset_less=True)
        m.d.sync += other.eq(reduce(or_, driving))
        met = [other]
        for unit in program.units:
            component, result = components[unit.name], Value.cast(components[unit.name].result)
            if not unit.direct:
                late = Signal(width, name=f"{unit.name}_late", reset_less=True)
                m.d.sync += late.eq(Mux(component.done, result, 0))
                result = late
            met.append(result)
        m.d.comb += bus.eq(reduce(or_, met))

    def _constants(self, m, number, next_number):
        """The constant with a number, a cycle later."""
        program = self._program
        return read_constants(m, program, program.schedule.pool.operand_memory, number, next_number)

    def _conditions(self, m, word, bus, write, chooser):
        """The condition of a choice: the sign of a value, stored under the value's address."""
        program = self._program
        m.submodules.signs = signs = Memory(shape=1, depth=program.depth, init=())
        sign_write, sign_read = signs.write_port(), signs.read_port(domain="comb")
        condition = Signal(reset_less=True)
        m.d.comb += [sign_write.addr.eq(write.addr), sign_write.data.eq(bus.sign), sign_write.en.eq(write.en),
                     sign_read.addr.eq(word.condition.address), chooser.condition.eq(condition)]
        m.d.sync += condition.eq(sign_read.data ^ word.condition.negate)

    def _arrives(self, m, control, node, name):
        """High if a node's value is on the bus on its way to memory; computed one cycle earlier, or in the word."""
        if self._program.horizontal:
            return control.word.arrives[name]
        arrives, next_word = Signal(name=f"{name}_arrives"), control.next_word
        address = self._program.addresses[node]
        m.d.sync += arrives.eq(control.active & next_word.write.enable & (next_word.write.address == address))
        return arrives

    def _outputs(self, m, control, writes, commit):
        """Outputs are collected in registers; END makes all of them visible in one cycle, and switches the banks."""
        (_, bus), *_ = writes
        graph = self._program.graph
        for port, node in graph.outputs.items():
            waiting = Signal(self._program.format.width, name=f"{port}_d", reset_less=True)
            with m.If(self._arrives(m, control, node, port)):
                m.d.sync += waiting.eq(bus)
            with m.If(commit):
                m.d.sync += getattr(self, port).eq(waiting)
        if graph.state:
            with m.If(commit):
                m.d.sync += [control.bank.eq(~control.bank), control.fresh.eq(0)]

    def _status(self, m, control, writes, commit, special):
        """The status port; an update is refused if a number that it wrote was not finite."""
        (_, bus), *_ = writes
        exponent = self._program.format.exponent_special
        with m.If(control.idle):
            m.d.sync += special.eq(0)
        with m.Elif(reduce(or_, (enable & (value.exponent == exponent) for enable, value in writes))):
            m.d.sync += special.eq(1)
        status = dict(zip(self.status_names, getattr(self, self._system.status_port), strict=True))
        for name, shown in self._program.graph.status.items():
            flag = Signal(name=name)
            with m.If(self._arrives(m, control, shown.node, name)):
                m.d.sync += flag.eq(bus.sign ^ shown.negated)
            with m.If(control.ending):
                m.d.sync += status[name].eq(flag & commit)
        with m.If(control.ending):
            m.d.sync += status[REFUSED].eq(~commit)
        # A start during a reset waits for its end: until then all bits are low.
        early = Signal(name="early", reset_less=True)
        m.d.sync += early.eq(ResetSignal() & (control.start | early))
        with m.If(control.start | early):
            m.d.sync += status[IGNORED].eq(~control.taken)

    def _restart(self, m, control, word, writes, commit):
        """The count of refused updates whose inputs were all finite; at its end, the state is that after a reset."""
        (_, bus), *_ = writes
        program, limit = self._program, self._system.restart_after
        of_input, foreign = Signal(name="of_input"), Signal(name="foreign")
        if program.horizontal:
            before = Signal(name="input_before")
            m.d.sync += [before.eq(~Value.cast(word.mute).all()), of_input.eq(before)]
            shows_input = of_input
        else:
            first = len(program.other_sources) - len(program.graph.inputs)
            m.d.sync += of_input.eq(word.other >= first)
            shows_input = of_input & (word.write.source == program.sources["main"].index("other"))
        with m.If(control.idle):
            m.d.sync += foreign.eq(0)
        with m.Elif(shows_input & (bus.exponent == program.format.exponent_special)):
            m.d.sync += foreign.eq(1)
        refusals, restarts = Signal(range(limit), name="refusals"), Signal(name="restarts")
        m.d.comb += restarts.eq(control.ending & ~commit & ~foreign & (refusals == limit - 1))
        with m.If(restarts):
            m.d.sync += [refusals.eq(0), control.fresh.eq(1)]
        with m.Elif(commit):
            m.d.sync += refusals.eq(0)
        with m.Elif(control.ending & ~foreign):
            m.d.sync += refusals.eq(refusals + 1)
        if RESTARTED in self.status_names:
            with m.If(control.ending):
                m.d.sync += getattr(self, self._system.status_port)[self.status_names.index(RESTARTED)].eq(restarts)


class Control(NamedTuple):
    """Signals of the sequencer: ``active`` in all cycles of an update but the last two; ``complete`` in the last one,
    END, if it came in time; ``bank`` and ``fresh`` of the state; ``next_word`` is the next word before the bank is
    applied, ``word`` the current word."""

    start: Value
    idle: Signal
    taken: Signal
    active: Value
    ending: Signal
    complete: Signal
    next_word: Value
    word: Value
    bank: Signal
    fresh: Signal


def _field(fields, path):
    for name in path:
        fields = fields[name]
    return fields
