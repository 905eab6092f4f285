"""A netlist from RTLIL: cells become operations, registers and ports of memories, whose operands have equal widths."""

from collections import Counter
from itertools import pairwise

from .netlist import (
    Choice,
    Circuit,
    CircuitError,
    Instance,
    Operation,
    Read,
    Register,
    Write,
    joined,
    part_of,
    resized,
    retargeted,
    slices,
    targets,
    values,
    width_of,
)
from .rtlil import Assign, Bits, Slice, Switch, parse

__all__ = ["circuits"]

# Kinds of operation by the rule for their operands. Operands of COMMON and COMPARED have equal widths afterwards.
COMMON = {"$add", "$sub", "$and", "$or", "$xor", "$not", "$neg"}
SHIFTED = {"$shl", "$shr", "$sshr"}
COMPARED = {"$eq", "$ne", "$lt", "$le", "$gt", "$ge"}
REDUCED = {"$reduce_or", "$reduce_and", "$reduce_xor", "$reduce_bool"}
ZERO = (Bits("0"),)
DIVIDED = {"$divfloor", "$modfloor"}
KINDS = COMMON | SHIFTED | COMPARED | REDUCED | DIVIDED | {"$mux", "$mul", "$shift"}


def circuits(text):
    """The modules of an RTLIL text, as a list of Circuit.

    Raises: CircuitError for a cell that has no counterpart in plain Verilog.
    """
    modules = parse(text)
    ports = {module.name: {wire.name: wire.port for wire in module.wires.values() if wire.port} for module in modules}
    return [_circuit(module, ports) for module in modules]


def _circuit(module, ports):
    circuit = Circuit(module.name, ports[module.name], {wire.name: wire.width for wire in module.wires.values()},
                      {wire.name: wire.attributes for wire in module.wires.values()}, module.memories)
    circuit.aliases = list(module.connections)
    bodies = {next(targets(body)).wire: body for body in module.processes}
    reads = Counter(part.wire for value in _read(module) for part in slices(value))
    updates = {wire: bodies.pop(wire) for wire in list(bodies)
               if reads[wire] == 1 and wire not in circuit.ports}
    for cell in module.cells:
        if cell.kind.startswith("$"):
            _add_cell(circuit, cell, updates)
        else:
            known = ports.get(cell.kind)
            outputs = {port for port, kind in known.items() if kind == "output"} if known else cell.outputs
            circuit.instances.append(Instance(
                cell.kind, cell.name, cell.parameters,
                {port: value for port, value in cell.ports.items() if port not in outputs},
                {port: value[0].wire for port, value in cell.ports.items() if port in outputs}))
    # The updates that are left are not those of a register.
    for wire, body in (bodies | updates).items():
        _add_choice(circuit, wire, body)
    return circuit


def _read(module):
    """All values that a module reads."""
    for cell in module.cells:
        yield from (value for port, value in cell.ports.items() if port not in cell.outputs)
    for body in module.processes:
        yield from values(body)
    yield from (value for _, value in module.connections)


def _add_choice(circuit, wire, body):
    """Statements of a combinational process; wires of which they assign parts become several."""
    cuts = sorted({place for target in targets(body) for place in (target.low, target.low + target.width)})
    parts = []
    for low, high in pairwise(cuts):
        name = wire if len(cuts) == 2 else circuit.wire(high - low)
        inner = _only(body, name, low, high - low)
        parts.append(circuit.whole(name))
        if len(inner) == 1 and isinstance(inner[0], Assign):
            circuit.drivers[name] = Operation("value", (inner[0].value,))
        else:
            circuit.drivers[name] = Choice(inner)
    if len(parts) > 1:
        circuit.drivers[wire] = Operation("value", (joined(*parts),))


def _only(body, name, low, width):
    """The statements that assign some bits of a wire; these bits become a wire of their own."""
    kept: list = []
    for statement in body:
        if isinstance(statement, Switch):
            cases = tuple((patterns, _only(inner, name, low, width)) for patterns, inner in statement.cases)
            if any(inner for _, inner in cases):
                kept.append(Switch(statement.selector, cases))
        elif statement.target.low <= low < statement.target.low + statement.target.width:
            assigned = Assign(Slice(name, 0, width), part_of(statement.value, low - statement.target.low, width))
            # What is always carried out makes the statements before it void.
            kept = [assigned]
    return tuple(kept)


def _add_cell(circuit, cell, updates):
    """The driver that a cell stands for."""
    ports, parameters, kind = cell.ports, cell.parameters, cell.kind
    edge = "posedge" if parameters.get("CLK_POLARITY", 1) else "negedge"
    if kind == "$meminit_v2":
        memory = circuit.memories[parameters["MEMID"].removeprefix("\\")]
        digits = ports["DATA"][0].digits
        memory.rows = [int(digits[len(digits) - (row + 1) * memory.width:][:memory.width], 2)
                       for row in range(memory.depth)]
    elif kind == "$memwr_v2":
        circuit.writes.append(Write(parameters["MEMID"].removeprefix("\\"), ports["ADDR"] or ZERO, ports["DATA"],
                                    ports["EN"], ports["CLK"], edge))
    elif kind == "$memrd_v2":
        memory = parameters["MEMID"].removeprefix("\\")
        if "1" in parameters["TRANSPARENCY_MASK"].digits:
            raise CircuitError(f"{circuit.name}: a transparent port of memory {memory} cannot be written as Verilog")
        circuit.drivers[ports["DATA"][0].wire] = (
            Read(memory, ports["ADDR"] or ZERO, ports["EN"], ports["CLK"], edge) if parameters["CLK_ENABLE"]
            else Operation(kind, (ports["ADDR"] or ZERO,), memory=memory))
    elif kind in ("$dff", "$adff"):
        (register,), data = ports["Q"], ports["D"]
        # Statements that only compute the next value of a register become those of the register.
        if (update := circuit.wire_of(data)) in updates:
            body = retargeted(updates.pop(update), {update: register.wire})
            if body[0] == Assign(register, (register,)):
                body = body[1:]
        else:
            body = (Assign(register, data),)
        clear = ports.get("ARST")
        circuit.drivers[register.wire] = Register(body, ports["CLK"], edge, clear,
                                                  (parameters["ARST_VALUE"],) if clear else ())
    else:
        _add_operation(circuit, cell)


def _add_operation(circuit, cell):
    kind, parameters = cell.kind, cell.parameters
    if kind not in KINDS:
        raise _unknown(circuit, cell)
    (output,) = cell.ports["Y"]
    if kind == "$mux":
        circuit.drivers[output.wire] = Operation(kind, tuple(cell.ports[port] for port in "SAB"))
        return
    signed = {"A": bool(parameters.get("A_SIGNED")), "B": bool(parameters.get("B_SIGNED"))}
    operands = {port: cell.ports[port] or ZERO for port in "AB" if port in cell.ports}
    if kind in ("$shift", *DIVIDED):
        # The result can be narrower than the operation.
        if kind == "$shift" and not signed["B"]:
            # The bits that the largest shift can reach.
            kind, wide = "$shr", output.width + (1 << width_of(operands["B"])) - 1
            if not signed["A"]:
                wide = min(wide, max(output.width, width_of(operands["A"])))
            operands["A"] = resized(operands["A"], wide, signed=signed["A"])
        elif kind in DIVIDED and not signed["A"]:
            wide = max(output.width, *(width_of(value) for value in operands.values()))
            operands = {port: resized(value, wide) for port, value in operands.items()}
        else:
            raise _unknown(circuit, cell)
        name = output.wire if wide == output.width else circuit.wire(wide)
        circuit.drivers[name] = Operation(kind, tuple(operands.values()))
        if name != output.wire:
            circuit.drivers[output.wire] = Operation("value", ((Slice(name, 0, output.width),),))
        return
    if kind in COMMON | SHIFTED:
        for port in operands if kind in COMMON else "A":
            operands[port] = resized(operands[port], output.width, signed=signed[port])
        signed = {"A": kind == "$sshr"}
    elif kind in COMPARED:
        wide = max(map(width_of, operands.values()))
        operands = {port: resized(value, wide, signed=signed[port]) for port, value in operands.items()}
        signed = {"A": signed["A"] and kind not in ("$eq", "$ne")}
    elif kind == "$mul":
        operands = {port: part_of(value, 0, output.width) for port, value in operands.items()}
    else:
        signed = {"A": False}
    circuit.drivers[output.wire] = Operation(kind, tuple(operands.values()), signed["A"])


def _unknown(circuit, cell):
    return CircuitError(f"{circuit.name}: a cell {cell.kind} cannot be written as Verilog")
