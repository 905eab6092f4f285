"""The registers of a table as a memory map of IP-XACT."""

from strapdown.ascii import ascii_text
from strapdown.bus import REGISTER_BITS, TABLE_SIZE, Access

from .spirit import element

__all__ = ["memory_map"]

ACCESS = {
    Access.CONSTANT: "read-only",
    Access.READ: "read-only",
    Access.WRITE: "read-write",
    Access.PULSE: "write-only",
    Access.CLEAR: "read-write",
}
"""What IP-XACT calls the accesses."""

BLOCK = "reg0"
"""Name of the address block; that of the address segment in a Vivado block design."""


def memory_map(name, table):
    """The element ``spirit:memoryMap`` called ``name`` of a RegisterTable."""
    return element(
        "memoryMap", element("name", name),
        element("addressBlock",
                element("name", BLOCK), element("baseAddress", 0, format="long"),
                element("range", TABLE_SIZE, format="long"), element("width", REGISTER_BITS, format="long"),
                element("usage", "register"), element("access", "read-write"),
                *(_register(register) for register in table)))


def _register(register):
    accesses = {ACCESS[field.access] for field in register.fields}
    return element(
        "register", element("name", register.name), element("displayName", register.name),
        element("description", ascii_text(register.meaning)),
        element("addressOffset", f"{register.address:#x}"), element("size", REGISTER_BITS, format="long"),
        element("volatile", _volatile(register.fields)),
        element("access", accesses.pop() if len(accesses) == 1 else "read-write"),
        element("reset", element("value", f"{register.reset:#x}"),
                element("mask", f"{sum(field.mask for field in register.fields):#x}")),
        *(_field(field) for field in register.fields))


def _field(field):
    return element(
        "field", element("name", field.name), element("displayName", field.name),
        element("description", ascii_text(field.meaning)), element("bitOffset", field.low),
        element("bitWidth", field.width, format="long"), element("volatile", _volatile([field])),
        element("access", ACCESS[field.access]),
        *([element("modifiedWriteValue", "oneToClear")] if field.access is Access.CLEAR else []))


def _volatile(fields):
    """Whether the circuit can change what is read."""
    return str(any(field.access in (Access.READ, Access.PULSE, Access.CLEAR) for field in fields)).lower()
