"""Steps that make a netlist readable: one wire for equal operations, names for slices, short chains as expressions."""

import re
from collections import Counter
from collections.abc import Iterator

from .fold import folded, narrow
from .netlist import (
    Choice,
    CircuitError,
    Operation,
    Register,
    joined,
    mapped,
    part_of,
    retargeted,
    slices,
    values,
    width_of,
)
from .rtlil import Assign, Bits, Slice
from .statements import condition_of, conditions_of, reset_of, tidied

__all__ = ["anonymous", "inlined", "order", "simplify"]

LARGEST_CHOICE = 4
"""Arms up to which a choice becomes a conditional expression."""

LARGEST_EXPRESSION = 7
"""Operators up to which an expression takes in the operations that only it reads."""

# Their text depends on the width or sign of the place where it stands, so they have a wire of their own.
ROOTED = {"$mul", "$sshr", "$memrd_v2"}


def simplify(circuit):
    """Carry out all steps, in place."""
    _tidy_statements(circuit)
    _expand_choices(circuit)
    _merge_equal(circuit)
    named = {wire for name, value in circuit.aliases if not anonymous(name) and (wire := circuit.wire_of(value))}
    narrow(circuit, order(circuit), named | {wire for wire in circuit.drivers if not anonymous(wire)})
    _merge_equal(circuit)
    _name_ports(circuit)
    _use_aliases(circuit)
    _remove_unread(circuit)


def anonymous(wire):
    """Whether a wire has no name but a number, or what Amaranth calls a signal without a name."""
    return re.fullmatch(r"\$(\d+\$?|signal(\$\d+)?|signature__.*)", wire) is not None


def order(circuit):
    """The wires of combinational drivers, each after those that it reads, else in the order of the circuit.

    Raises: CircuitError if a wire depends on itself.
    """
    done: dict[str, bool] = {}
    found: list[str] = []

    def inputs(wire) -> Iterator[str]:
        driver = circuit.drivers.get(wire)
        if isinstance(driver, Operation | Choice):
            for value in values(driver):
                yield from (part.wire for part in slices(value))

    for root in circuit.drivers:
        stack = [(root, inputs(root))] if root not in done else []
        while stack:
            wire, left = stack[-1]
            done.setdefault(wire, False)
            for read in left:
                if read not in done:
                    stack.append((read, inputs(read)))
                    break
                if not done[read]:
                    raise CircuitError(f"{circuit.name}: {read} depends on itself without a register between")
            else:
                done[wire] = True
                stack.pop()
                if isinstance(circuit.drivers.get(wire), Operation | Choice):
                    found.append(wire)
    return found


def _tidy_statements(circuit):
    for wire, driver in circuit.drivers.items():
        if isinstance(driver, Register):
            reset = reset_of(driver.body, circuit.whole(wire)[0])
            # The reset of a register stays the last statement.
            body = (*tidied(reset[2]), driver.body[-1]) if reset else tidied(driver.body)
            circuit.drivers[wire] = driver._replace(body=body)
        elif isinstance(driver, Choice):
            circuit.drivers[wire] = Choice(tidied(driver.body))


def _expand_choices(circuit):
    """Small choices between conditions become conditional operations."""
    for wire, driver in list(circuit.drivers.items()):
        if isinstance(driver, Choice) and _arms(driver.body) <= LARGEST_CHOICE and _simple(driver.body):
            circuit.drivers[wire] = Operation("value", (_chosen(circuit, driver.body, None),))


def _arms(body):
    return sum(1 if isinstance(statement, Assign) else sum(_arms(inner) for _, inner in statement.cases)
               for statement in body)


def _simple(body):
    """Whether each selector is compared with one number, or is a row of conditions of which the first counts."""
    return all(isinstance(statement, Assign) or
               ((conditions_of(statement) is not None or _compared(statement)) and
                all(_simple(inner) for _, inner in statement.cases)) for statement in body)


def _compared(statement):
    """Whether a switch has one case for one number, and at most one for all others."""
    (patterns, _), *others = statement.cases
    return len(patterns) == 1 and "-" not in patterns[0] and [labels for labels, _ in others] in ([], [()])


def _chosen(circuit, body, value):
    """The value that statements leave, from the value before them."""
    for statement in body:
        if isinstance(statement, Assign):
            value = statement.value
            continue
        result = value
        for patterns, inner in reversed(statement.cases):
            then = _chosen(circuit, inner, value)
            if not patterns or result is None:
                result = then
                continue
            if then != result:
                condition, level = condition_of(statement.selector, patterns) or \
                    (_add(circuit, "$eq", statement.selector, (Bits(patterns[0]),), width=1), "1")
                arms = (result, then) if level == "1" else (then, result)
                result = _add(circuit, "$mux", condition, *arms, width=width_of(then))
        value = result
    return value


def _add(circuit, kind, *operands, width):
    """The value of a new operation."""
    name = circuit.wire(width)
    circuit.drivers[name] = Operation(kind, operands)
    return circuit.whole(name)


def _replaced(value, replacement):
    """A value with wires replaced by other values."""
    return joined(*[part_of(_replaced(replacement[part.wire], replacement), part.low, part.width)
                    if isinstance(part, Slice) and part.wire in replacement else (part,) for part in value])


def _map_all(circuit, change):
    """Change all values that the circuit reads."""
    circuit.drivers = {wire: mapped(driver, change) for wire, driver in circuit.drivers.items()}
    circuit.writes = [mapped(write, change) for write in circuit.writes]
    circuit.aliases = [(name, change(value)) for name, value in circuit.aliases]
    for instance in circuit.instances:
        instance.inputs = {port: change(value) for port, value in instance.inputs.items()}


def _merge_equal(circuit):
    """Keep one of several wires with the same operation; wires that only rename bits become aliases."""
    replacement = {wire: driver.operands[0] for wire, driver in circuit.drivers.items()
                   if isinstance(driver, Operation) and driver.kind == "value"}
    for wire in replacement:
        del circuit.drivers[wire]
    circuit.aliases += replacement.items()
    _map_all(circuit, lambda value: _replaced(value, replacement))
    known: dict = {}
    replacement = {}
    for wire in order(circuit):
        before = None
        driver = mapped(circuit.drivers[wire], lambda value: _replaced(value, replacement))
        while isinstance(driver, Operation | Choice) and driver != before:
            before, driver = driver, folded(driver, circuit.widths[wire])
        if not isinstance(driver, Operation | Choice):
            replacement[wire] = driver
        elif driver in known:
            replacement[wire] = circuit.whole(known[driver])
        else:
            known[driver] = wire
            circuit.drivers[wire] = driver
    for wire in replacement:
        del circuit.drivers[wire]
    circuit.aliases += [(wire, circuit.whole(wire)) for wire in replacement]
    _map_all(circuit, lambda value: _replaced(value, replacement))


def _name_ports(circuit):
    """A wire that is shown on an output takes the name of this port."""
    names: dict[str, str] = {}
    outputs = [port for port, direction in circuit.ports.items() if direction == "output"]
    shown = {name: value for name, value in circuit.aliases if name in outputs}
    for port, value in shown.items():
        source = circuit.wire_of(value)
        if source is None or source in circuit.ports or source in names:
            circuit.drivers[port] = Operation("value", (value,))
            continue
        names[source] = port
        circuit.attributes[port] = circuit.attributes[source]
    for instance in circuit.instances:
        instance.outputs = {port: names.get(wire, wire) for port, wire in instance.outputs.items()}
    circuit.drivers = {
        names.get(wire, wire):
        driver._replace(body=retargeted(driver.body, names)) if isinstance(driver, Register | Choice) else driver
        for wire, driver in circuit.drivers.items()}
    replacement = {source: circuit.whole(port) for source, port in names.items()}
    circuit.aliases = [(name, value) for name, value in circuit.aliases if name not in shown]
    circuit.aliases += replacement.items()
    _map_all(circuit, lambda value: _replaced(value, replacement))


def _telling(name):
    """How informative a name is."""
    return (not anonymous(name), not re.search(r"\$|__", name), len(name))


def _use_aliases(circuit):
    """Give names to wires without one, and read slices and compound values under their names."""
    best: dict[tuple, str] = {}
    for name, value in circuit.aliases:
        if not anonymous(name) and slices(value) and (value not in best or _telling(name) > _telling(best[value])):
            best[value] = name
    circuit.names = {wire: wire for wire in circuit.widths}
    for value, name in list(best.items()):
        if wire := circuit.wire_of(value):
            del best[value]
            if wire not in circuit.ports and _telling(name) > _telling(wire):
                circuit.names[wire] = name

    def parts_named(value):
        return tuple(circuit.whole(best[(part,)])[0] if (part,) in best else part for part in value)

    added = {name: Operation("value", (parts_named(value) if len(value) > 1 else value,))
             for value, name in best.items()}
    _map_all(circuit, lambda value: circuit.whole(best[value]) if value in best else parts_named(value))
    circuit.drivers |= {name: driver for name, driver in added.items() if name not in circuit.drivers}


def _remove_unread(circuit):
    """Keep what outputs, memories and submodules depend on."""
    live = {port for port, direction in circuit.ports.items() if direction == "output"}
    memories: set[str] = set()
    waiting = list(live)

    def read(value):
        for part in slices(value):
            if part.wire not in live:
                live.add(part.wire)
                waiting.append(part.wire)

    for instance in circuit.instances:
        for value in instance.inputs.values():
            read(value)
    while waiting:
        driver = circuit.drivers.get(waiting.pop())
        if driver is None:
            continue
        for value in values(driver):
            read(value)
        memory = getattr(driver, "memory", "")
        if memory and memory not in memories:
            memories.add(memory)
            for write in circuit.writes:
                if write.memory == memory:
                    for value in values(write):
                        read(value)
    circuit.drivers = {wire: driver for wire, driver in circuit.drivers.items() if wire in live}
    circuit.writes = [write for write in circuit.writes if write.memory in memories]
    circuit.memories = {name: memory for name, memory in circuit.memories.items() if name in memories}
    for instance in circuit.instances:
        instance.outputs = {port: wire for port, wire in instance.outputs.items() if wire in live}


def inlined(circuit):
    """Wires without a name whose operation stands where they are read, because that is one place.

    The inverse of a flag stands in any number of places. The inverse of a bit of a vector does not: Yosys puts the
    operands of a sum in the order of their wires, and only one order needs one LUT a bit if the other operand is
    chosen by a sign. A sign that is written twice becomes one late wire.
    """
    reads: Counter[str] = Counter()
    whole: Counter[str] = Counter()

    def count(value):
        for part in slices(value):
            reads[part.wire] += 1
            whole[part.wire] += (part,) == circuit.whole(part.wire)

    for driver in (*circuit.drivers.values(), *circuit.writes):
        for value in values(driver):
            count(value)
        for value in (getattr(driver, "clock", ()), getattr(driver, "clear", None) or ()):
            # An edge is that of a wire.
            reads.update(part.wire for part in slices(value))
    for instance in circuit.instances:
        for value in instance.inputs.values():
            count(value)
    taken: set[str] = set()
    size: dict[str, int] = {}
    for wire in order(circuit):
        driver = circuit.drivers[wire]
        if not isinstance(driver, Operation) or driver.kind in ROOTED:
            continue
        size[wire] = 1 + sum(size[part.wire] for value in driver.operands for part in slices(value)
                             if part.wire in taken)
        if not anonymous(circuit.names[wire]) or wire in circuit.ports or reads[wire] != whole[wire]:
            continue
        simple = driver.kind == "$not" and size[wire] == 1 and _is_flag(circuit, driver.operands[0])
        if (simple or reads[wire] == 1) and size[wire] <= LARGEST_EXPRESSION:
            taken.add(wire)
    return taken


def _is_flag(circuit, value):
    """True if a value is a whole wire of one bit."""
    return circuit.wire_of(value) is not None and width_of(value) == 1
