"""A module as a netlist: each wire with the operation or register that drives it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from .rtlil import Assign, Bits, Slice, Switch

__all__ = ["Choice", "Circuit", "CircuitError", "Instance", "Operation", "Read", "Register", "Write", "joined",
           "mapped", "part_of", "resized", "retargeted", "slices", "targets", "values", "width_of"]


class CircuitError(ValueError):
    """A component has a part that plain Verilog, as it is written here, cannot express."""


class Operation(NamedTuple):
    """A combinational operation; its ``kind`` is that of RTLIL, or "value" for a wire that only renames bits."""

    kind: str
    operands: tuple
    signed: bool = False
    memory: str = ""


class Choice(NamedTuple):
    """Combinational statements; the wire has the value of the last one that is carried out."""

    body: tuple


class Register(NamedTuple):
    """Statements carried out at a clock edge; ``clear`` is an asynchronous reset and its value, or None."""

    body: tuple
    clock: tuple
    edge: str = "posedge"
    clear: tuple | None = None
    clear_value: tuple = ()


class Read(NamedTuple):
    """The output register of a memory."""

    memory: str
    address: tuple
    enable: tuple
    clock: tuple
    edge: str


class Write(NamedTuple):
    """A write port of a memory; ``enable`` has a bit for each bit of data."""

    memory: str
    address: tuple
    data: tuple
    enable: tuple
    clock: tuple
    edge: str


@dataclass
class Instance:
    """A submodule: values of its inputs, and wires on its outputs."""

    kind: str
    name: str
    parameters: dict
    inputs: dict
    outputs: dict


@dataclass
class Circuit:
    """A module.

    Parameters
    ----------
    ports : dict
        Port to "input" or "output".
    widths, attributes : dict
        Of all wires.
    drivers : dict
        Wire to Operation, Choice, Register or Read; inputs and outputs of submodules have none.
    aliases : list
        Tuples of a name and the value that has it.
    names : dict
        Wire to the most informative of its names.
    """

    name: str
    ports: dict
    widths: dict
    attributes: dict
    memories: dict
    drivers: dict = field(default_factory=dict)
    aliases: list = field(default_factory=list)
    writes: list = field(default_factory=list)
    instances: list = field(default_factory=list)
    names: dict = field(default_factory=dict)

    def whole(self, wire):
        """All bits of a wire, as a value."""
        return (Slice(wire, 0, self.widths[wire]),)

    def wire_of(self, value):
        """The wire whose ``whole`` a value is, or None."""
        if len(value) == 1 and isinstance(value[0], Slice) and value == self.whole(value[0].wire):
            return value[0].wire
        return None

    def wire(self, width):
        """A new wire without a name."""
        name = f"${len(self.widths)}$"
        self.widths[name], self.attributes[name] = width, {}
        return name


def width_of(value):
    """Bits of a value, which is a tuple of Slice and Bits."""
    return sum(part.width for part in value)


def joined(*values):
    """Values one above the other, the lowest first; neighbouring parts are united."""
    parts: list = []
    for value in values:
        for part in value:
            last = parts[-1] if parts else None
            if isinstance(last, Bits) and isinstance(part, Bits):
                parts[-1] = Bits(part.digits + last.digits)
            elif isinstance(last, Slice) and isinstance(part, Slice) and \
                    part.wire == last.wire and part.low == last.low + last.width:
                parts[-1] = Slice(last.wire, last.low, last.width + part.width)
            elif part.width:
                parts.append(part)
    return tuple(parts)


def part_of(value, low, width):
    """Bits of a value."""
    parts: list = []
    for part in value:
        first, last = max(low, 0), min(low + width, part.width)
        if first < last:
            parts.append(Slice(part.wire, part.low + first, last - first) if isinstance(part, Slice)
                         else Bits(part.digits[part.width - last:part.width - first]))
        low -= part.width
    return joined(parts)


def resized(value, width, *, signed=False):
    """A value with more bits, zeros or copies of its highest one, or with fewer."""
    missing = width - width_of(value)
    if missing <= 0:
        return part_of(value, 0, width)
    fill = part_of(value, width_of(value) - 1, 1) if signed and value else (Bits("0"),)
    return joined(value, *[fill] * missing)


def slices(value):
    return [part for part in value if isinstance(part, Slice)]


def values(driver):
    """All values that a driver reads."""
    found: list = []

    def note(value):
        found.append(value)
        return value

    mapped(driver, note)
    return found


def mapped(driver, change: Callable):
    """A driver, or a port of a memory, or statements, with every value that it reads changed."""
    match driver:
        case Operation(operands=operands):
            return driver._replace(operands=tuple(change(value) for value in operands))
        case Choice(body=body):
            return Choice(mapped(body, change))
        case Register(body=body, clock=clock, clear=clear):
            return driver._replace(body=mapped(body, change), clock=change(clock), clear=clear and change(clear))
        case Read(address=address, enable=enable, clock=clock):
            return driver._replace(address=change(address), enable=change(enable), clock=change(clock))
        case Write(address=address, data=data, enable=enable, clock=clock):
            return driver._replace(address=change(address), data=change(data), enable=change(enable),
                                   clock=change(clock))
        case Assign(target=target, value=value):
            return Assign(target, change(value))
        case Switch(selector=selector, cases=cases):
            return Switch(change(selector), tuple((patterns, mapped(body, change)) for patterns, body in cases))
        case _:
            return tuple(mapped(statement, change) for statement in driver)


def targets(body):
    """Slices that statements assign."""
    for statement in body:
        if isinstance(statement, Assign):
            yield statement.target
        else:
            for _, inner in statement.cases:
                yield from targets(inner)


def retargeted(body, names):
    """Statements that assign wires under other names; ``names`` maps a wire to its new name."""
    return tuple(
        Assign(statement.target._replace(wire=names.get(statement.target.wire, statement.target.wire)), statement.value)
        if isinstance(statement, Assign) else
        Switch(statement.selector, tuple((patterns, retargeted(inner, names)) for patterns, inner in statement.cases))
        for statement in body)
