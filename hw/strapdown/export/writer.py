"""Verilog-2001 text of a netlist."""

import re
from collections import defaultdict
from itertools import groupby
from textwrap import wrap

from .expression import Expressions, constant, pattern
from .keywords import KEYWORDS
from .netlist import Choice, Operation, Read, Register, part_of, width_of
from .rtlil import Assign, Bits, SignedBits, Switch
from .simplify import anonymous, inlined, order
from .statements import conditions_of, merged, reset_of, switch_key

__all__ = ["module_text", "plain", "unused"]

LINE_LENGTH = 120
"""Longest line of code; only a single word can be longer."""

COMMENT_LENGTH = 150
"""Longest line of code with a comment beside it."""

MOST_LISTED = 6
"""Names in the comment of a block."""

ROM_STYLES = ("rom_block", "rom_style")
"""Attributes of the table of a ROM that are written, at its output and at its ``case``."""

STYLES = ("ram_style", *ROM_STYLES, "ASYNC_REG", "fsm_encoding")
"""Attributes that are written; the others mean nothing to synthesis."""


def plain(name):
    """A name of letters, digits and underscores."""
    return re.sub(r"\W+", "_", re.sub(r"\$\d+$", "", name)).strip("_")


def unused(name, taken):
    """The name, with a number if it is taken."""
    candidate, number = name, 1
    while candidate in taken:
        number += 1
        candidate = f"{name}_{number}"
    return candidate


def module_text(circuit, kinds, *, vectors=(), comments=None):
    """The text of a module.

    Parameters
    ----------
    circuit : Circuit
    kinds : dict
        Name of each module to its name in Verilog, and names of its ports.
    vectors : collection of str
        Ports of one bit that are declared as vectors, ``[0:0]``.
    comments : dict
        Memory to the comments of its rows, by address.
    """
    return _Writer(circuit, kinds, vectors, comments or {}).text()


class _Writer:
    def __init__(self, circuit, kinds, vectors, comments):
        self.circuit, self.kinds, self.vectors, self.comments = circuit, kinds, vectors, comments
        self.inlined = inlined(circuit)
        self.order = order(circuit)
        self.names = self._names()
        self.expressions = Expressions(circuit, self.inlined, self.names)
        self.lines: list[str] = []

    # Names

    def _names(self):
        """Names of wires, memories and instances, in the order in which the text shows them."""
        circuit = self.circuit
        _, ports = self.kinds[circuit.name]
        names, taken = dict(ports), {*ports.values(), *KEYWORDS, *(name for name, _ in self.kinds.values())}
        numbered = 0
        shown = [*circuit.memories, *(wire for wire, driver in circuit.drivers.items()
                                      if isinstance(driver, Register | Read)),
                 *(wire for instance in circuit.instances for wire in instance.outputs.values()),
                 *(wire for wire in self.order if wire not in self.inlined),
                 *(id(instance) for instance in circuit.instances)]
        instances = {id(instance): instance.name for instance in circuit.instances}
        for wire in shown:
            if wire in names:
                continue
            wanted = instances.get(wire) or circuit.names.get(wire, wire)
            if anonymous(wanted):
                numbered += 1
                wanted = f"n{numbered}"
            names[wire] = unused(re.sub("_+", "_", plain(wanted)), taken)
            taken.add(names[wire])
        return names

    # Layout

    def add(self, text, depth=1):
        """A line of code, broken at blanks if it is long."""
        indent = "  " * depth
        self.lines += wrap(text, LINE_LENGTH, initial_indent=indent, subsequent_indent=indent + "    ",
                           break_long_words=False, break_on_hyphens=False)

    def _beside(self, comment):
        """A comment to the right of the last line, and below it there if it is long."""
        indent = len(self.lines[-1]) + 2
        first, *more = wrap(comment, max(COMMENT_LENGTH - indent - 3, 40))
        self.lines[-1] += f"  // {first}"
        self.lines += [f"{' ' * indent}//   {line}" for line in more]

    def block(self, comment):
        self.lines += ["", *wrap(comment, COMMENT_LENGTH, initial_indent="  // ", subsequent_indent="  //   ")]

    def text(self):
        circuit = self.circuit
        self.lines.append(f"module {self.kinds[circuit.name][0]} (")
        last = list(circuit.ports)[-1]
        for port, direction in circuit.ports.items():
            self._style(port)
            self.add(f"{direction} {self._type(port)} {self._range(port)}{self.names[port]}{self._initial(port)}"
                     f"{',' * (port != last)}")
        self.lines.append(");")
        self._memories()
        self._registers()
        if outputs := [wire for instance in circuit.instances for wire in instance.outputs.values()
                       if wire not in circuit.ports]:
            self.block("Outputs of the modules inside.")
            for wire in outputs:
                self.add(f"wire {self._range(wire)}{self.names[wire]};")
        self._combinational()
        self._clocked()
        self._memory_ports()
        self._instances()
        return "\n".join([*self.lines, "endmodule", ""])

    def _type(self, wire):
        driver = self.circuit.drivers.get(wire)
        return "reg" if isinstance(driver, Register | Read | Choice) or self._table(wire) else "wire"

    def _table(self, wire):
        """Whether a wire is read from a memory that never changes, which is written as a ``case``."""
        driver = self.circuit.drivers.get(wire)
        return getattr(driver, "memory", "") and not self._written(driver.memory)

    def _written(self, memory):
        return any(write.memory == memory for write in self.circuit.writes)

    def _range(self, wire):
        width = self.circuit.widths[wire]
        vector = width > 1 or (wire in self.circuit.ports and self.names[wire] in self.vectors)
        return f"[{width - 1}:0] " if vector else ""

    def _initial(self, wire):
        init = self.circuit.attributes[wire].get("init") if \
            isinstance(self.circuit.drivers.get(wire), Register) else None
        return f" = {constant(init.digits)}" if init else ""

    def _attributes(self, attributes, depth=1, styles=STYLES):
        for style in styles:
            if style in attributes:
                self.add(f'(* {style} = "{attributes[style]}" *)', depth)

    def _style(self, wire):
        """The attributes of a register; that of a table has those of the table."""
        self._attributes(self.circuit.attributes[wire])
        driver = self.circuit.drivers.get(wire)
        if isinstance(driver, Read):
            self._attributes(self.circuit.memories[driver.memory].attributes, styles=ROM_STYLES)

    # Parts of a module

    def _memories(self):
        memories = [memory for memory in self.circuit.memories.values() if self._written(memory.name)]
        for memory in memories:
            self.block(f"Memory, {memory.depth} words of {memory.width} bits.")
            self._attributes(memory.attributes)
            width = f"[{memory.width - 1}:0] " if memory.width > 1 else ""
            self.add(f"reg {width}{self.names[memory.name]} [0:{memory.depth - 1}];")
            self.add("initial begin")
            for row, value in enumerate(memory.rows):
                self.add(f"{self.names[memory.name]}[{row}] = {_number(value, memory.width)};", 2)
            self.add("end")

    def _registers(self):
        registers = [wire for wire, driver in self.circuit.drivers.items()
                     if isinstance(driver, Register | Read) and wire not in self.circuit.ports]
        if registers:
            self.block("Registers.")
        for wire in registers:
            self._style(wire)
            self.add(f"reg {self._range(wire)}{self.names[wire]}{self._initial(wire)};")

    def _combinational(self):
        wires = [wire for wire in self.order if wire not in self.inlined]
        blocks = any(isinstance(self.circuit.drivers[wire], Choice) or self._table(wire) for wire in wires)
        if blocks:
            self.block("Changes once, so that the combinational blocks below run at the start of a simulation.")
            self.add("reg initial_trigger = 1'b0;")
            self.add("initial initial_trigger <= 1'b1;")
        if wires:
            self.block("Combinational logic.")
        for wire in wires:
            driver, name = self.circuit.drivers[wire], self.names[wire]
            if isinstance(driver, Operation) and not self._table(wire):
                text = self.expressions.operation(driver)
                self.add(f"assign {name} = {text};" if wire in self.circuit.ports else
                         f"wire {self._range(wire)}{name} = {text};")
                continue
            if wire not in self.circuit.ports:
                self.add(f"reg {self._range(wire)}{name};")
            self.add("always @* begin")
            self.add("if (initial_trigger) begin end", 2)
            if isinstance(driver, Choice):
                self._statements(driver.body, "=", 2)
            else:
                self._rows(wire, driver.memory, driver.operands[0], "=", 2)
            self.add("end")

    def _clocked(self):
        groups = defaultdict(list)
        for wire, driver in self.circuit.drivers.items():
            if isinstance(driver, Register):
                body, key = driver.body, None
                reset = reset_of(body, self.circuit.whole(wire)[0])
                if reset:
                    body = reset[2]
                if len(body) == 1 and isinstance(body[0], Switch):
                    key = switch_key(body[0])
                groups[driver.clock, driver.edge, driver.clear, reset and reset[0], key].append(
                    (wire, driver, reset and reset[1], body))
        # Registers whose condition no other register has stand together.
        for full, members in list(groups.items()):
            if len(members) == 1 and full[-1] is not None:
                groups[*full[:-1], None] += groups.pop(full)
        for (clock, edge, clear, reset, _), members in groups.items():
            self.block(f"Next values of {_listed([self.names[wire] for wire, *_ in members])}.")
            event = f"{edge} {self.expressions.value(clock)}"
            body = merged([body for *_, body in members])
            if reset:
                values = tuple(statement for _, _, then, _ in members for statement in then)
                body = (Switch(reset, ((("1",), values), ((), body))),)
            if clear:
                event += f" or posedge {self.expressions.value(clear)}"
                cleared = tuple(Assign(self.circuit.whole(wire)[0], driver.clear_value) for wire, driver, *_ in members)
                body = (Switch(clear, ((("1",), cleared), ((), body))),)
            several = len(body) != 1
            self.add(f"always @({event})" + " begin" * several)
            self._statements(body, "<=", 2)
            if several:
                self.add("end")

    def _memory_ports(self):
        for wire, driver in self.circuit.drivers.items():
            if isinstance(driver, Read):
                written = self._written(driver.memory)
                self.block(f"A read port of {self.names[driver.memory]}." if written else
                           f"Read-only memory {self.names[driver.memory]}.")
                enable = "" if driver.enable == (Bits("1"),) else f" if ({self.expressions.value(driver.enable)})"
                head = f"always @({driver.edge} {self.expressions.value(driver.clock)}){enable}"
                self.add(head)
                if written:
                    self.add(f"{self.names[wire]} <= {self.names[driver.memory]}"
                             f"[{self.expressions.value(driver.address)}];", 2)
                else:
                    self._rows(wire, driver.memory, driver.address, "<=", 2)
        for write in self.circuit.writes:
            for low, high, enable in _runs(write.enable):
                self.block(f"A write port of {self.names[write.memory]}.")
                self.add(f"always @({write.edge} {self.expressions.value(write.clock)})")
                self.add(f"if ({self.expressions.value((enable,))})", 2)
                all_bits = high - low == self.circuit.memories[write.memory].width
                bits = "" if all_bits else f"[{low}]" if high == low + 1 else f"[{high - 1}:{low}]"
                self.add(f"{self.names[write.memory]}[{self.expressions.value(write.address)}]{bits} <= "
                         f"{self.expressions.value(part_of(write.data, low, high - low))};", 3)

    def _rows(self, wire, memory, address, operator, depth):
        """The contents of a ROM as a ``case``."""
        memory = self.circuit.memories[memory]
        bits = width_of(address)
        if len(memory.rows) == 1:
            self.add(f"{self.names[wire]} {operator} {_number(memory.rows[0], memory.width)};", depth)
            return
        self._attributes(memory.attributes, depth, styles=ROM_STYLES)
        self.add(f"case ({self.expressions.value(address)})", depth)
        comments = self.comments.get(memory.name, {})
        for row, value in enumerate(memory.rows[:1 << bits]):
            self.add(f"{_number(row, bits)}: {self.names[wire]} {operator} {_number(value, memory.width)};", depth + 1)
            if row in comments:
                self._beside(comments[row])
        if len(memory.rows) < 1 << bits:
            self.add(f"default: {self.names[wire]} {operator} {_number(0, memory.width)};", depth + 1)
        self.add("endcase", depth)

    def _instances(self):
        for instance in self.circuit.instances:
            name, ports = self.kinds.get(instance.kind, (plain(instance.kind), {}))
            values = {port: self.expressions.value(value) for port, value in instance.inputs.items()} | \
                {port: self.names[wire] for port, wire in instance.outputs.items()}
            self.lines.append("")
            parameters = ", ".join(f".{key}({_parameter(value)})" for key, value in instance.parameters.items())
            self.add(f"{name}{f' #({parameters})' if parameters else ''} {self.names[id(instance)]} (")
            connections = [f".{ports.get(port, port)}({value})" for port, value in values.items()]
            for connection in connections[:-1]:
                self.add(f"{connection},", 2)
            self.add(connections[-1], 2)
            self.add(");")

    # Statements

    def _statements(self, body, operator, depth):
        for statement in body:
            if isinstance(statement, Assign):
                self.add(f"{self.expressions.value((statement.target,))} {operator} "
                         f"{self.expressions.value(statement.value)};", depth)
            elif conditions := conditions_of(statement):
                self._branches(statement, conditions, operator, depth)
            elif len(statement.cases) == 1 and "-" not in "".join(statement.cases[0][0]):
                ((patterns, inner),) = statement.cases
                selector = self.expressions.value(statement.selector, "$eq")
                met = " || ".join(f"{selector} == {pattern(digits)}" for digits in patterns)
                self._nested(f"if ({met})", inner, operator, depth)
            else:
                self._cases(statement, operator, depth)

    def _branches(self, statement, conditions, operator, depth, before=""):
        """A switch on conditions, as ``if`` and ``else if``."""
        arms = [(self._condition(condition), body) for condition, (_, body) in
                zip(conditions, statement.cases, strict=True)]
        while arms and not arms[-1][1]:
            arms.pop()
        for index, (condition, body) in enumerate(arms):
            head = ("else " if index else before) + (f"if ({condition})" if condition else "")
            if not condition and len(body) == 1 and isinstance(body[0], Switch) and (inner := conditions_of(body[0])):
                self._branches(body[0], inner, operator, depth, head)
            else:
                self._nested(head, body, operator, depth)

    def _condition(self, condition):
        if condition is None:
            return ""
        bit, level = condition
        text = self.expressions.value(bit, "" if level == "1" else "$not")
        return text if level == "1" else f"~{text}"

    def _nested(self, head, body, operator, depth):
        if len(body) == 1 and isinstance(body[0], Assign):
            self.add(head.rstrip(), depth)
            self._statements(body, operator, depth + 1)
            return
        self.add(f"{head.rstrip()} begin", depth)
        self._statements(body, operator, depth + 1)
        self.add("end", depth)

    def _cases(self, statement, operator, depth):
        wild = any("-" in digits for patterns, _ in statement.cases for digits in patterns)
        self.add(f"{'casez' if wild else 'case'} ({self.expressions.value(statement.selector)})", depth)
        for patterns, body in statement.cases:
            label = ", ".join(map(pattern, patterns)) or "default"
            if len(body) == 1 and isinstance(body[0], Assign):
                self.add(f"{label}: {self.expressions.value((body[0].target,))} {operator} "
                         f"{self.expressions.value(body[0].value)};", depth + 1)
            elif body:
                self._nested(f"{label}:", body, operator, depth + 1)
            else:
                self.add(f"{label}: ;", depth + 1)
        self.add("endcase", depth)


def _listed(names):
    """Names as words; of many, only the first."""
    if len(names) > MOST_LISTED:
        names = [*names[:MOST_LISTED - 1], f"{len(names) - MOST_LISTED + 1} other registers"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _number(value, width):
    return constant(f"{value:0{width}b}")


def _runs(enable):
    """Neighbouring bits with the same enable: the lowest one, the one after the highest one, and their enable."""
    bits = [part_of(enable, place, 1)[0] for place in range(width_of(enable))]
    low = 0
    for bit, group in groupby(bits):
        high = low + len(list(group))
        yield low, high, bit
        low = high


def _parameter(value):
    if isinstance(value, SignedBits):
        return constant(value.digits).replace("'", "'s")
    return constant(value.digits) if isinstance(value, Bits) else f'"{value}"' if isinstance(value, str) else value
