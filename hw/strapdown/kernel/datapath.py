"""The common parts of the engines: memories, constants, operand registers, operators and result buses."""

from amaranth import *
from amaranth.lib.memory import Memory

from strapdown.fp.stages import NARROW

from .operators import integer_bits
from .pool import MemoryStyle

__all__ = ["captured_inputs", "choose", "constants", "memory", "operand_registers", "operators", "read_constants"]


def memory(program, depth, style):
    """A memory of numbers. An update reads only words that were written since the last reset."""
    return Memory(shape=program.format.width, depth=depth, init=(), attrs=style.attributes("ram_style"))


def constants(m, program, style):
    """The ROM with the constants of a program, as the submodule ``constants``.

    It consists of LUTs, one per bit for up to 32 constants. More constants are in block RAM if the operands are.
    """
    in_block = _constants_in_block(program, style)
    m.submodules.constants = rom = Memory(
        shape=program.format.width, depth=len(program.constants),
        attrs=style.attributes("rom_style") if in_block else {},
        init=program.constant_words)
    return rom


def _constants_in_block(program, style):
    return style is MemoryStyle.BLOCK and len(program.constants) > 32


def read_constants(m, program, style, address, next_address):
    """The constant that ``address`` selects, one cycle after it.

    The contents of block RAM come out late in a cycle. For wide numbers it is read with ``next_address``, which is one
    cycle ahead of ``address``, and a register follows.
    """
    read = constants(m, program, style).read_port()
    if not _constants_in_block(program, style) or program.format.precision <= NARROW:
        m.d.comb += read.addr.eq(address)
        return read.data
    constant = Signal(program.format.width, name="constant", reset_less=True)
    m.d.comb += read.addr.eq(next_address)
    m.d.sync += constant.eq(read.data)
    return constant


def captured_inputs(m, component, program, taken):
    """Maps each input port to a register of its value at the last edge with ``taken`` high, as a memory word."""
    captured = {port: Signal(program.format.width, name=f"{port}_q", reset_less=True)
                for port in program.graph.inputs}
    with m.If(taken):
        for port, register in captured.items():
            value = getattr(component, port)
            if port in component.system.integers:
                # The sign is extended up to the bits that are always zero.
                value = Cat(value, value[-1].replicate(integer_bits(program.format) - len(value)))
            m.d.sync += register.eq(value)
    return captured


def operand_registers(m, program, word, fetch):
    """Both operands of each pair of read ports, in registers: maps (port, "a" or "b") to a Signal.

    ``fetch(fields)`` gives the operand selected by the fields of the word, before a change of its sign.
    """
    ports = {}
    for port in program.read_ports:
        for side in "ab":
            fields = word[f"port{port}"][side]
            operand = Signal(program.format.layout, name=f"port{port}_{side}", reset_less=True)
            m.d.sync += operand.eq(fetch(fields) ^ (fields.negate << (program.format.width - 1)))
            ports[port, side] = operand
    return ports


def operators(m, program, word, components, ports, *, rest=None, results=None):
    """The operators as submodules, each with its operands, its modes and a start a cycle after the word.

    ``rest``, if given, is high while no update is in flight: it resets the operators, whatever an upset left in them.
    ``results`` are signals for their results, by name of the unit, if the buses do not take them from the units.
    """
    for unit in program.units:
        component = components[unit.name]
        m.submodules[unit.name] = component if rest is None else ResetInserter(rest)(component)
        if results:
            m.d.comb += results[unit.name].eq(component.result)
        begin = Signal(name=f"{unit.name}_start")
        m.d.sync += begin.eq(word.start[unit.name])
        m.d.comb += component.start.eq(begin)
        for member, side in zip(unit.operands, "ab", strict=False):
            m.d.comb += getattr(component, member).eq(ports[program.schedule.machine.port(unit), side])
        for mode in unit.modes.values():
            chosen = Signal(name=f"{unit.name}_{mode}", reset_less=True)
            m.d.sync += chosen.eq(word.mode[f"{unit.name}_{mode}"])
            m.d.comb += getattr(component, mode).eq(chosen)


def choose(m, bus, source, results):
    """Put the result with the number ``source`` on a bus."""
    with m.Switch(source):
        for index, result in enumerate(results):
            with m.Case(index):
                m.d.comb += bus.eq(result)
