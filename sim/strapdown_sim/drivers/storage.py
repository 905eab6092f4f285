"""What a generated Verilog file stores: its registers, its memories and its ROM, as Verilator names them."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from strapdown.export import without_comments

__all__ = ["CONSTANTS", "MEMORY", "REGISTER", "ROM", "Storage", "exposed", "storage", "unfilled"]

REGISTER, MEMORY, ROM = "register", "memory", "ROM"

MODULE = re.compile(r"^(module (\w+).*?;\n)(.*?)(^endmodule)", re.MULTILINE | re.DOTALL)
DECLARED = re.compile(r"^  (output )?reg (?:\[(\d+):0\] )?(\w+)(?: \[(?:(\d+):0|0:(\d+))\])?( = [^;,\n]*)?([;,]?)$",
                      re.MULTILINE)
"""A register or a memory: whether it is a port, highest bit, name, last row, initial value."""

ASSIGNED = re.compile(r"^ +(?:always @\(.*?\) )?(?:(?:else )?if \(.*\) |else |[\w'?, ]+: )?(\w+)(?:\[.*?\])* <= ",
                      re.MULTILINE)
INSTANCE = re.compile(r"^  (\w+) (\w+) \($", re.MULTILINE)

COMMENTS = r"(?: *//.*\n)*"
ROW = rf" *(?:\d+'[bh][0-9a-f]+|default): (?P=target) (?P=operator) \d+'[bh][0-9a-f]+;.*\n{COMMENTS}"
TABLE = re.compile(rf"^( *)case \((.*)\)\n(?={COMMENTS} *\d+'[bh]0+: (?P<target>\w+) (?P<operator><?=) \d+')"
                   rf"((?:{COMMENTS}{ROW})+) *endcase\n", re.MULTILINE)
"""A ROM as a ``case``: indentation, address, target, operator, rows."""

VALUE = re.compile(r"^ *\d+'[bh][0-9a-f]+: \w+ <?= (\d+)('[bh][0-9a-f]+);", re.MULTILINE)

BASES = {"h": 16, "b": 2}

OWN = "__register"
"""What follows the name of a port in the name of its register in an exposed text."""

TABLE_OWN = "_rom"
"""What follows the name of a signal in the name of the ROM that it is read from."""

CONSTANTS = "constants" + TABLE_OWN
"""The ROM of constants in an unfilled text."""


class Storage(NamedTuple):
    """A register or a memory.

    Fields
    ------
    kind : str
        REGISTER, MEMORY or ROM.
    module, variable : str
        Verilog module, and name there.
    path : str
        C++ expression under the root of the Verilated model.
    rows, width : int
        Number of words, 1 for a register, and bits of each.
    """

    kind: str
    module: str
    variable: str
    path: str
    rows: int
    width: int

    @property
    def bits(self):
        """Number of bits."""
        return self.rows * self.width

    @property
    def name(self):
        """Instances below the top module and the variable, separated by dots."""
        name = self.path.partition("__DOT__")[2].replace("__DOT__", ".").replace("___05F", "__")
        return name.removesuffix(OWN)


def storage(text: str, top: str) -> tuple[Storage, ...]:
    """All registers and memories of a module and those inside it, in the order of the text.

    A ROM that is written as a ``case`` is a memory only in an ``exposed`` text.

    Parameters
    ----------
    text : str
        Verilog, as the generator writes it.
    top : str
        The module.
    """
    modules = {name: head + body for head, name, body, _ in MODULE.findall(text)}

    def inside(module, path):
        body = modules[module]
        clocked = {*ASSIGNED.findall(body)} - {"initial_trigger"}
        for _, high, name, *last, _, _ in DECLARED.findall(body):
            rows = int(last[0] or last[1] or 0) + 1
            if not (any(last) or name in clocked):
                continue
            kind = REGISTER if not any(last) else MEMORY if name in clocked else ROM
            # Verilator's spelling of two underscores.
            yield Storage(kind, module, name, path + name.replace("__", "___05F"), rows, int(high or 0) + 1)
        for inner, name in INSTANCE.findall(body):
            if inner in modules:
                yield from inside(inner, f"{path}{name}__DOT__")

    return tuple(inside(top, f"{top}__DOT__"))


def exposed(text: str) -> str:
    """The same circuit, with a variable for each register and each ROM of an engine.

    Verilator may keep the contents of a register that is a port in the port of an outer module only. A write to the
    register would be lost. A ``case`` has no contents that could be changed; it becomes a memory.
    """
    def module(found):
        head, name, body, end = found.groups()
        clocked = {*ASSIGNED.findall(body)}
        for port, high, register, *_, initial, _ in DECLARED.findall(head + body):
            declared = f"reg {f'[{high}:0] ' if high else ''}{register}"
            if not (register in clocked and (port or re.search(rf"^  output .*\b{register};$", body, re.MULTILINE))):
                continue
            inner = register + OWN
            if port:
                head = head.replace(f"output {declared}{initial}", "output " + declared.replace("reg", "wire", 1))
                body = f"  {declared}{initial};\n{body}"
            body = re.sub(rf"(?<![.\w']){register}\b", inner, body)
            body = re.sub(rf"^(  output .*\b){inner};$", rf"\1{register};", body, flags=re.MULTILINE)
            body += f"  assign {register} = {inner};\n"
        return head + (_with_memories(body) if name.endswith("_engine") else body) + end

    return MODULE.sub(module, text)


def _with_memories(body):
    """A body with memories in place of its tables of constants."""
    memories = []

    def memory(found):
        indent, address, target, operator, rows = found.groups()
        values = VALUE.findall(rows)
        (width, _), *_ = values
        name = target.removesuffix(OWN) + TABLE_OWN
        memories.append(f"  reg [{int(width) - 1}:0] {name} [0:{len(values) - 1}];\n  initial begin\n" + "".join(
            f"    {name}[{row}] = {width}{value};\n" for row, (width, value) in enumerate(values)) + "  end\n")
        return f"{indent}{target} {operator} {name}[{address}];\n"

    body = TABLE.sub(memory, body)
    return "".join(memories) + body


def unfilled(text: str, words: Sequence[int]) -> str:
    """The same circuit without comments, with an empty memory CONSTANTS in place of the engine's ROM of constants.

    Cores that differ only in their constants have one unfilled text.

    Parameters
    ----------
    text : str
        Verilog, as the generator writes it.
    words : sequence of int
        Contents of the ROM, by which it is found.

    Raises: ValueError if the text has no such ROM, or several.
    """
    widths = []

    def memory(found):
        indent, address, target, operator, rows = found.groups()
        values = VALUE.findall(rows)
        if [int(value[2:], BASES[value[1]]) for _, value in values] != list(words):
            return found[0]
        widths.append(int(values[0][0]))
        return f"{indent}{target} {operator} {CONSTANTS}[{address}];\n"

    def module(found):
        head, _, body, end = found.groups()
        known = len(widths)
        body = TABLE.sub(memory, body)
        declared = "".join(f"  reg [{width - 1}:0] {CONSTANTS} [0:{len(words) - 1}];\n" for width in widths[known:])
        return head + declared + body + end

    text = MODULE.sub(module, without_comments(text))
    if len(widths) != 1:
        raise ValueError(f"{len(widths)} tables have the constants of the engine, not one")
    return text
