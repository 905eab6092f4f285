"""The machine that runs a microprogram: sequencer, operand memory, operators, result bus."""

from functools import reduce
from operator import or_

from amaranth import *
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from .description import Port, Section, SystemComponent, program_facts, program_sections, status_ports
from .microprogram import Microprogram
from .pool import MemoryStyle
from .schedule import schedule

__all__ = ["Engine"]

REFUSED, IGNORED = "refused", "ignored"


class Engine(SystemComponent):
    """A system's equations on a pool of operators, one update a start.

    Parameters
    ----------
    system : System
        Equations and interface.
    pool : Pool
        Operators; those the equations do not use are left out.

    Members
    -------
    *start*, *finish* : In(1), Out(1)
        The start is sampled at the clock edge while the engine is idle, and with it all inputs.
        The finish falls at that edge and rises with the outputs.
    *input ports* : In(format.width)
    *output ports* : Out(format.width)
        Hold from one finish to the next; all change in one cycle. After a reset they show the
        reset state where they are state, else zero.
    *status* : Out(len(status_names))
        Bits in the order of ``status_names``, if the system has a status port. They change with
        the finish; ``ignored`` is set by a start while an update runs and cleared by the next
        start that is taken.

    All members have the names that the system gives them.

    Latency: ``latency`` cycles from the edge that takes the start to the one that raises the
    finish, in every update. A new start can be taken at the edge after.
    State: kept in two banks; an update reads the one and writes the other, and its last cycle
    makes the other the current one. An update that is refused, because a number it wrote was
    NaN or infinite, leaves state and outputs as they were.
    """

    def __init__(self, system, pool):
        self._system = system
        self._program = Microprogram(schedule(system.trace(pool), pool))
        super().__init__({port.name: port.member for port in self.ports})

    @property
    def program(self):
        """The microprogram."""
        return self._program

    @property
    def ports(self):
        """The ports, in the order of the module."""
        system, format, meanings = self._system, self._program.format, self._system.port_meanings
        return (Port(system.start, In, 1, "starts an update"),
                Port(system.finish, Out, 1, "high when the outputs are valid"),
                *(Port(name, In, format.width, meanings[name]) for name in system.input_ports),
                *(Port(name, Out, format.width, meanings[name], init=format.encode(value))
                  for name, value in self.reset_outputs.items()),
                *status_ports(system, self.status_names))

    @property
    def sections(self):
        """Timing, states and microprogram, for the header of a Verilog file."""
        system, schedule = self._system, self._program.schedule
        firsts = (0, *(end + 1 for end in schedule.section_ends))
        spans = [f"cycles {first} to {end}" for first, end in zip(firsts, schedule.section_ends, strict=False)]
        last = f"cycle {firsts[-1]}: shows the outputs" + (", turns the state's banks" if system.state else "")
        timing = (
            f"{system.start} is sampled at the rising edge of clk while the core is idle, together with all inputs, "
            f"which may change afterwards. {system.finish} falls at that edge and rises {self.latency} cycles later, "
            "in every update, with all outputs, which then hold. A new start can be taken at the next edge.")
        return (Section("TIMING", paragraphs=(timing,)),
                Section("SEQUENCER (engine.state)", rows=tuple(
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
        """Output port to the value that it shows after a reset."""
        return self._program.schedule.graph.reset_outputs

    @property
    def latency(self):
        """Cycles from the edge that takes ``start`` to the one that raises ``finish``."""
        return self._program.length + 2

    @property
    def state_names(self):
        """States of the sequencer, in the order of their encoding."""
        return ("IDLE", *self._program.schedule.graph.sections, "END")

    @property
    def status_names(self):
        """Names of the status bits, lowest first."""
        return (*self._system.status, REFUSED, IGNORED) if self._system.status_port else ()

    def elaborate(self, platform):
        m = Module()
        program, graph = self._program, self._program.schedule.graph
        number = program.format.layout
        start, finish = getattr(self, self._system.start), getattr(self, self._system.finish)

        # Sequencer. Words take two steps from the ROM: ``fetched`` is the word after ``word``, and
        # the program counter is one ahead of that. While the engine is idle the first word waits
        # in ``fetched``, and nothing but zeros in ``word``.
        IDLE, END = 0, len(self.state_names) - 1
        state = Signal(range(END + 1), init=IDLE)
        counter, primed = Signal(range(program.length)), Signal(name="primed")
        idle, ending, running = (Signal(name=name) for name in ("idle", "ending", "running"))
        m.d.comb += [idle.eq(state == IDLE), ending.eq(state == END), running.eq(~(idle | ending))]
        pool = program.schedule.pool
        m.submodules.microcode = rom = Memory(shape=program.layout, depth=program.length, init=program.words,
                                              attrs={"rom_style": pool.microcode.value})
        fetch = rom.read_port()
        fetched, word = Signal(program.layout), Signal(program.layout)
        last, taken = Signal(name="last"), Signal(name="taken")
        m.d.comb += [fetch.addr.eq(counter), fetched.eq(fetch.data), last.eq(word.advance & (state == END - 1)),
                     fetch.en.eq((running & ~last) | ~primed), taken.eq(idle & start)]
        m.d.sync += primed.eq(1)
        with m.If(fetch.en):
            m.d.sync += counter.eq(Mux(counter == program.length - 1, 0, counter + 1))
        with m.If(taken):
            m.d.sync += [state.eq(state + 1), finish.eq(0)]
        with m.Elif(ending):
            m.d.sync += [state.eq(IDLE), finish.eq(1)]
        with m.Elif(running):
            m.d.sync += state.eq(state + word.advance)

        # Addresses of the state turn with the bank, and what restores the state acts only after a
        # reset: settled before ``word``, since neither changes during an update.
        bank, fresh = Signal(name="bank"), Signal(name="fresh", init=1)
        settled = Signal(program.layout)
        m.d.comb += settled.eq(fetched)
        if graph.state:
            for path in program.address_fields:
                read, turned = (_field(fields, path).address for fields in (fetched, settled))
                m.d.comb += turned.eq(read ^ (bank & (read < program.state_words)))
            m.d.comb += settled.write.enable.eq(fetched.write.enable & (fresh | ~fetched.write.restore))
        m.d.sync += word.eq(Mux(running & ~last, settled, 0))

        # Inputs, as they were at the edge that took the start.
        captured = [Signal(program.format.width, name=f"{port}_q", reset_less=True) for port in graph.inputs]
        with m.If(taken):
            m.d.sync += [register.eq(getattr(self, port))
                         for register, port in zip(captured, graph.inputs, strict=True)]

        # Operand memory: read before the edge, written at it, so ports need not be transparent.
        # Operands are registered, from memory or straight from where a result comes out.
        m.submodules.operands = operands = Memory(shape=program.format.width, depth=program.depth, init=program.initial,
                                                  attrs={"ram_style": pool.operand_memory.value})
        bus = Signal(number)
        if program.side_depth:
            m.submodules.side = side_memory = Memory(shape=program.format.width, depth=program.side_depth, init=[],
                                                     attrs={"ram_style": MemoryStyle.DISTRIBUTED.value})
        components = {unit.name: unit.make() for unit in program.units}
        results = {name: Signal(number, name=f"{name}_result") for name in components}
        forwarded = {"bus": bus, **results}
        ports = {}
        for port in program.read_ports:
            for side in "ab":
                fields = word[f"port{port}"][side]
                read = operands.read_port(domain="sync" if pool.operand_memory is MemoryStyle.BLOCK else "comb")
                operand = Signal(number, name=f"port{port}_{side}", reset_less=True)
                m.d.comb += read.addr.eq(fields.address)
                found = {"memory": read.data, **forwarded}
                if program.side_depth:
                    side_read = side_memory.read_port(domain="comb")
                    m.d.comb += side_read.addr.eq(fields.address)
                    found["side"] = side_read.data
                choice = Array([Value.cast(found[name]) for name in program.operand_sources])
                m.d.sync += operand.eq(choice[fields.source] ^ (fields.negate << (program.format.width - 1)))
                ports[port, side] = operand

        # Operators.
        for unit in program.units:
            m.submodules[unit.name] = component = components[unit.name]
            m.d.comb += results[unit.name].eq(component.result)
            begin = Signal(name=f"{unit.name}_start")
            m.d.sync += begin.eq(word.start[unit.name])
            m.d.comb += component.start.eq(begin)
            for member, side in zip(unit.operands, "ab", strict=True):
                m.d.comb += getattr(component, member).eq(ports[unit.read_port, side])
            for mode in unit.modes.values():
                chosen = Signal(name=f"{unit.name}_{mode}", reset_less=True)
                m.d.sync += chosen.eq(word.mode[f"{unit.name}_{mode}"])
                m.d.comb += getattr(component, mode).eq(chosen)

        # Result bus: one result a cycle, to the memory and to whoever waits for it.
        results |= dict(zip(graph.inputs, captured, strict=True))
        results["other"] = other = Signal(number, name="other", reset_less=True)
        m.d.sync += other.eq(Array([Value.cast(results[name]) for name in program.other_sources])[word.other])
        _choose(m, bus, word.write.source, [results[name] for name in program.sources])
        writes = word.write.enable
        write = operands.write_port()
        m.d.comb += [write.addr.eq(word.write.address), write.data.eq(bus), write.en.eq(writes)]

        written_values = [(writes, bus)]
        if program.side_depth:
            aside = Signal(number, name="side")
            _choose(m, aside, word.side.source, [results[name] for name in program.side_sources])
            side_write = side_memory.write_port()
            m.d.comb += [side_write.addr.eq(word.side.address), side_write.data.eq(aside),
                         side_write.en.eq(word.side.enable)]
            written_values.append((word.side.enable, aside))

        # Conditions: the sign of a value, by its address.
        if "selector" in components:
            m.submodules.signs = signs = Memory(shape=1, depth=program.depth,
                                                init=[word >> (program.format.width - 1) for word in program.initial])
            sign_write, sign_read = signs.write_port(), signs.read_port(domain="comb")
            condition = Signal(reset_less=True)
            m.d.comb += [sign_write.addr.eq(write.addr), sign_write.data.eq(bus.sign), sign_write.en.eq(write.en),
                         sign_read.addr.eq(word.condition.address), components["selector"].condition.eq(condition)]
            m.d.sync += condition.eq(sign_read.data ^ word.condition.negate)

        def written(node, name):
            """Whether a node's value is on the bus, on its way to memory: found out a cycle before."""
            arrives = Signal(name=f"{name}_arrives")
            address = program.addresses[node]
            m.d.sync += arrives.eq(running & ~last & fetched.write.enable & (fetched.write.address == address))
            return arrives

        # Outputs wait beside the stage; END shows them all at once, and turns the banks.
        commit = Signal()
        refused = Signal()
        m.d.comb += commit.eq(ending & ~refused)
        for port, node in graph.outputs.items():
            waiting = Signal(program.format.width, name=f"{port}_d", reset_less=True)
            with m.If(written(node, port)):
                m.d.sync += waiting.eq(bus)
            with m.If(commit):
                m.d.sync += getattr(self, port).eq(waiting)
        if graph.state:
            with m.If(commit):
                m.d.sync += [bank.eq(~bank), fresh.eq(0)]

        # Status.
        if self.status_names:
            with m.If(idle):
                m.d.sync += refused.eq(0)
            with m.Elif(reduce(or_, (enable & (value.exponent == program.format.exponent_special)
                                     for enable, value in written_values))):
                m.d.sync += refused.eq(1)
            status = dict(zip(self.status_names, getattr(self, self._system.status_port), strict=True))
            for name, shown in graph.status.items():
                flag = Signal(name=name)
                with m.If(written(shown.node, name)):
                    m.d.sync += flag.eq(bus.sign ^ shown.negated)
                with m.If(ending):
                    m.d.sync += status[name].eq(flag & ~refused)
            with m.If(ending):
                m.d.sync += status[REFUSED].eq(refused)
            with m.If(start):
                m.d.sync += status[IGNORED].eq(~idle)
        return m


def _choose(m, bus, source, results):
    """Put the result of the number ``source`` on a bus."""
    with m.Switch(source):
        for index, result in enumerate(results):
            with m.Case(index):
                m.d.comb += bus.eq(result)


def _field(fields, path):
    for name in path:
        fields = fields[name]
    return fields
