"""Simpler forms of operations: of those with constants, and of those whose highest bits nothing reads."""

from collections import defaultdict

from .netlist import Choice, Operation, joined, mapped, part_of, resized, slices, values, width_of
from .rtlil import Bits

__all__ = ["folded", "narrow"]

# The low bits of their result depend only on the low bits of their operands.
LOW_FIRST = {"$add", "$sub", "$mul", "$neg", "$and", "$or", "$xor", "$not"}


def folded(driver, width):
    """A simpler Operation with the same result, or the value itself as a tuple.

    Parameters
    ----------
    driver : Operation or Choice
    width : int
        Width of its result.
    """
    if not isinstance(driver, Operation) or driver.memory:
        return driver
    kind, operands = driver.kind, driver.operands
    match kind:
        case "$and" | "$or" | "$xor" | "$add":
            for value, other in (operands, reversed(operands)):
                bits = _constant(value)
                if bits is not None and (result := _with_constant(kind, bits, other)) is not None:
                    return result
        case "$not" if (bits := _constant(operands[0])) is not None:
            return (Bits(bits.translate(str.maketrans("01", "10"))),)
        case "$mux":
            return _chosen(driver)
        case "$lt" | "$ge" if driver.signed and "1" not in (_constant(operands[1]) or "1"):
            sign = part_of(operands[0], width_of(operands[0]) - 1, 1)
            return sign if kind == "$lt" else Operation("$not", (sign,))
        case "$reduce_or" | "$reduce_and" | "$reduce_xor" | "$reduce_bool":
            return _reduced(driver)
        case "$shl" | "$shr" | "$sshr" if (bits := _constant(operands[1])) is not None:
            distance = min(int(bits, 2), width)
            if kind == "$shl":
                return joined((Bits("0"),) * distance, part_of(operands[0], 0, width - distance))
            kept = part_of(operands[0], min(distance, width - 1) if driver.signed else distance, width)
            return resized(kept, width, signed=driver.signed)
    return driver


def _constant(value):
    """The digits of a constant value, else None."""
    return value[0].digits if len(value) == 1 and isinstance(value[0], Bits) else None


def _with_constant(kind, bits, other):
    if "1" not in bits:
        return (Bits(bits),) if kind == "$and" else other
    if "0" not in bits and kind != "$add":
        return {"$and": other, "$or": (Bits(bits),), "$xor": Operation("$not", (other,))}[kind]
    return None


def _chosen(driver):
    condition, other, then = driver.operands
    if then == other or condition == (Bits("0"),):
        return other
    if condition == (Bits("1"),):
        return then
    if (then, other) == ((Bits("1"),), (Bits("0"),)):
        return condition
    if (then, other) == ((Bits("0"),), (Bits("1"),)):
        return Operation("$not", (condition,))
    return driver


def _reduced(driver):
    """A reduction without the bits that do not matter to it."""
    (value,) = driver.operands
    neutral, decisive = ("1", "0") if driver.kind == "$reduce_and" else ("0", "1")
    if driver.kind != "$reduce_xor":
        if any(isinstance(part, Bits) and decisive in part.digits for part in value):
            return (Bits(decisive),)
        value = joined(part for part in value if not isinstance(part, Bits)) or (Bits(neutral),)
    return value if width_of(value) == 1 else driver._replace(operands=(value,))


def narrow(circuit, order, fixed):
    """Reduce operations to the bits that are read, in place.

    Parameters
    ----------
    circuit : Circuit
    order : list of str
        Its combinational wires, each after those that it reads.
    fixed : set of str
        Wires that keep their width.
    """
    needed: defaultdict[str, int] = defaultdict(int)

    def read(value):
        for part in slices(value):
            needed[part.wire] = max(needed[part.wire], part.low + part.width)

    for driver in (*(driver for driver in circuit.drivers.values() if not isinstance(driver, Operation | Choice)),
                   *circuit.writes):
        for value in values(driver):
            read(value)
    for value in (*(value for _, value in circuit.aliases),
                  *(value for instance in circuit.instances for value in instance.inputs.values())):
        read(value)
    for wire in reversed(order):
        driver, width = circuit.drivers[wire], needed[wire]
        if isinstance(driver, Operation) and wire not in fixed and 0 < width < circuit.widths[wire]:
            if driver.kind in LOW_FIRST:
                driver = mapped(driver, lambda value, width=width: part_of(value, 0, width))
            elif driver.kind == "$shl":
                driver = driver._replace(operands=(part_of(driver.operands[0], 0, width), driver.operands[1]))
            elif driver.kind == "$mux":
                condition, *arms = driver.operands
                driver = driver._replace(operands=(condition, *(part_of(value, 0, width) for value in arms)))
            else:
                width = circuit.widths[wire]
            circuit.widths[wire], circuit.drivers[wire] = width, driver
        for value in values(driver):
            read(value)
