"""SystemRDL 2.0 text of a register table."""

from textwrap import indent

from strapdown.ascii import ascii_text
from strapdown.bus import REGISTER_BITS, Access, RegisterTable

__all__ = ["text"]

PROPERTIES = {
    Access.CONSTANT: "sw = r; hw = na;",
    Access.READ: "sw = r; hw = w;",
    Access.WRITE: "sw = rw; hw = r;",
    Access.PULSE: "sw = w; hw = r; singlepulse;",
    Access.CLEAR: "sw = rw; hw = rw; onwrite = woclr; hwset; precedence = hw;",
}
"""Properties of the fields of each access."""

KEYWORDS = frozenset((
    "abstract", "accesstype", "addressingtype", "addrmap", "alias", "all", "alternate", "bit", "boolean",
    "bothedge", "byte", "compact", "component", "componentwidth", "constraint", "default", "encode", "enum",
    "external", "false", "field", "fullalign", "hw", "inside", "int", "internal", "level", "longint", "mem", "na",
    "negedge", "nonsticky", "number", "onreadtype", "onwritetype", "posedge", "precedencetype", "property", "r",
    "rclr", "real", "ref", "reg", "regalign", "regfile", "rset", "ruser", "rw", "rw1", "shortint", "shortreal",
    "signal", "signed", "string", "struct", "sw", "this", "true", "type", "unsigned", "w", "w1", "wclr", "with",
    "within", "woclr", "woset", "wot", "wr", "wset", "wuser", "wzc", "wzs", "wzt"))
"""Words of the language, which as a name need a backslash before them."""


def text(table: RegisterTable) -> str:
    """SystemRDL text of a table: one ``addrmap`` with all registers and fields, in ASCII."""
    registers = "\n".join(_register(register) for register in table)
    return (f"// Registers of {table.name}, configuration {table.configuration}.\n"
            f"addrmap {table.name} {{\n"
            f"    name = {_string(table.name)};\n"
            f"    desc = {_string(table.title)};\n"
            f"    littleendian;\n"
            f"    default regwidth = {REGISTER_BITS};\n"
            f"    default accesswidth = {REGISTER_BITS};\n\n"
            f"{indent(registers, '    ')}}};\n")


def _register(register):
    """Text of a register at its address."""
    fields = "".join(_field(field, register) for field in register.fields)
    return (f"reg {{\n    desc = {_string(register.meaning)};\n{indent(fields, '    ')}"
            f"}} {register.name} @ {register.address:#05x};\n")


def _field(field, register):
    """Text of a field of a register."""
    meaning = "" if field.meaning == register.meaning else f"    desc = {_string(field.meaning)};\n"
    return (f"field {{\n{meaning}    {PROPERTIES[field.access]}\n"
            f"}} {_name(field.name)}[{field.high}:{field.low}] = {field.width}'h{field.reset:x};\n")


def _name(name):
    """A name of a field, which must not be a word of the language."""
    return f"\\{name}" if name in KEYWORDS else name


def _string(text):
    """A string of the language."""
    escaped = ascii_text(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
