"""What a generated Verilog file stores: its registers, its memories and its ROM, as Verilator names them."""

import re
from typing import NamedTuple

__all__ = ["MEMORY", "REGISTER", "ROM", "Storage", "exposed", "storage"]

REGISTER, MEMORY, ROM = "register", "memory", "ROM"

MODULE = re.compile(r"^(module (\w+).*?;\n)(.*?)(^endmodule)", re.MULTILINE | re.DOTALL)
EXPOSED = "__register"
"""What follows the name of a port in the name of its register in an exposed text."""


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
        return name.removesuffix(EXPOSED)


def storage(text: str, top: str) -> tuple[Storage, ...]:
    """All registers and memories of a module and those inside it, in the order of the text.

    Parameters
    ----------
    text : str
        Verilog, as the generator writes it.
    top : str
        The module.
    """
    modules = {name: body for _, name, body, _ in MODULE.findall(text)}

    def inside(module, path):
        body = modules[module]
        clocked = _clocked(body)
        declared = re.findall(r"^  reg (?:\[(\d+):0\] )?(\w+)(?: \[(\d+):0\])?(?: = .*)?;$", body, re.MULTILINE)
        for high, name, last in declared:
            if name == "initial_trigger" or not (last or name in clocked):
                continue
            kind = REGISTER if not last else MEMORY if name in clocked else ROM
            # Verilator's spelling of two underscores.
            yield Storage(kind, module, name, path + name.replace("__", "___05F"), int(last or 0) + 1,
                          int(high or 0) + 1)
        for inner, name in re.findall(r"^  (\w+) (\w+) \($", body, re.MULTILINE):
            if inner in modules:
                yield from inside(inner, f"{path}{name}__DOT__")

    return tuple(inside(top, f"{top}__DOT__"))


def exposed(text: str) -> str:
    """The same circuit, with a variable of its own for each register that is a port.

    Verilator may keep the contents of such a register in the port of an outer module only, so that they cannot be
    changed in the register.
    """
    def module(found):
        head, _, body, end = found.groups()
        ports = set(re.findall(r"^  output (?:\[\d+:0\] )?(\w+);$", body, re.MULTILINE))
        for name in sorted(ports & _clocked(body)):
            inner = name + EXPOSED
            body = re.sub(rf"(?<![.\w']){name}\b", inner, body)
            body = re.sub(rf"^(  output .*?){inner};$", rf"\1{name};", body, flags=re.MULTILINE)
            body += f"  assign {name} = {inner};\n"
        return head + body + end

    return MODULE.sub(module, text)


def _clocked(body):
    """Names that a module assigns at clock edges."""
    return set(re.findall(r"^ .*?(\w+)(?:\[.*\])? <= ", body, re.MULTILINE))
