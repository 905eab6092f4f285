"""A register table: the addresses, fields and words of a bus interface, as frozen data.

The circuit, the SystemRDL text, the IP-XACT memory map, the page, the C header and the Python map follow from it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

__all__ = ["MAP_VERSION", "REGISTER_BITS", "TABLE_SIZE", "Access", "Field", "Register", "RegisterTable", "Word"]

REGISTER_BITS = 32
"""Bits of a register and of the data bus."""

TABLE_SIZE = 4096
"""Bytes of the address range of a table."""

MAP_VERSION = 0x0001_0000
"""Version of the layout: the upper 16 bits change when a driver must change, the lower ones when fields are added."""


class Access(Enum):
    """What software may do with a field. A read has no side effect."""

    CONSTANT = "constant"
    """Reads a value that never changes."""
    READ = "read"
    """Reads a value of the circuit."""
    WRITE = "read, write"
    """Keeps what was written."""
    PULSE = "write 1"
    """A 1 acts for one cycle. Reads 0."""
    CLEAR = "read, write 1 to clear"
    """Set by the circuit; a 1 clears it. A set in the same cycle wins."""

    @property
    def writable(self):
        """Whether a write can have an effect."""
        return self in (Access.WRITE, Access.PULSE, Access.CLEAR)


@dataclass(frozen=True)
class Field:
    """Bits of a register.

    Attributes
    ----------
    name : str
        Lower case, unique in its register.
    low, width : int
        Lowest bit, and number of bits.
    access : Access
    meaning : str
        Meaning and unit.
    reset : int
        Value after a reset; for ``Access.CONSTANT`` the value.
    """

    name: str
    low: int
    width: int
    access: Access
    meaning: str
    reset: int = 0

    @property
    def high(self):
        """Highest bit."""
        return self.low + self.width - 1

    @property
    def mask(self):
        """Ones in the bits of the field."""
        return ((1 << self.width) - 1) << self.low


@dataclass(frozen=True)
class Register:
    """A register of 32 bits; bits that no field has read 0, and a write to them has no effect.

    Attributes
    ----------
    name : str
        Upper case, unique in its table.
    address : int
        Offset in bytes, a multiple of 4.
    fields : tuple of Field
        Lowest first.
    meaning : str
        Its function in one line.
    """

    name: str
    address: int
    fields: tuple[Field, ...]
    meaning: str

    def __post_init__(self):
        end = 0
        for field in self.fields:
            if field.low < end or field.high >= REGISTER_BITS:
                raise ValueError(f"field {field.name} of register {self.name} overlaps another or ends above bit 31")
            end = field.high + 1

    def __getitem__(self, name: str) -> Field:
        for field in self.fields:
            if field.name == name:
                return field
        raise KeyError(f"register {self.name} has no field {name!r}")

    @property
    def writable(self):
        """Whether a write to the register is permitted."""
        return any(field.access.writable for field in self.fields)

    @property
    def reset(self):
        """Value after a reset."""
        return sum(field.reset << field.low for field in self.fields)


@dataclass(frozen=True)
class Word:
    """An input or output of the core in the table: one register, or two with the low half first.

    Attributes
    ----------
    port : str
        Port of the core.
    width : int
        Bits of the port.
    registers : tuple of Register
    meaning : str
        Meaning, unit and frame.
    format : str
        ``binary32`` or ``binary64`` for a number, ``bits`` otherwise.
    """

    port: str
    width: int
    registers: tuple[Register, ...]
    meaning: str
    format: str


@dataclass(frozen=True)
class RegisterTable:
    """The registers of a core behind a bus.

    Attributes
    ----------
    name : str
        Verilog module of the core with its bus.
    title : str
        The function of the core in one line.
    configuration : str
        Name of the configuration.
    common : tuple of Register
        Registers that do not depend on the core's ports, or on their kind only.
    samples, parameters, outputs : tuple of Word
        Inputs of each sample, inputs that are parameters at run time, and outputs.
    """

    name: str
    title: str
    configuration: str
    common: tuple[Register, ...]
    samples: tuple[Word, ...]
    parameters: tuple[Word, ...]
    outputs: tuple[Word, ...]

    def __post_init__(self):
        seen: dict[object, Register] = {}
        for register in self:
            if register.address % 4 or not 0 <= register.address < TABLE_SIZE:
                raise ValueError(f"register {register.name} has the address {register.address:#x}: must be a multiple "
                                 f"of 4 below {TABLE_SIZE:#x}")
            for key in (register.name, register.address):
                if key in seen:
                    raise ValueError(f"registers {seen[key].name} and {register.name} share {key!r}")
                seen[key] = register

    def __iter__(self) -> Iterator[Register]:
        """All registers, in the order of their addresses."""
        return iter(self.registers)

    def __getitem__(self, name: str) -> Register:
        try:
            return self._by_name[name]
        except KeyError:
            raise KeyError(f"{self.name} has no register {name!r}") from None

    @cached_property
    def _by_name(self) -> dict[str, Register]:
        return {register.name: register for register in self}

    @cached_property
    def registers(self) -> tuple[Register, ...]:
        """All registers, in the order of their addresses."""
        words = (register for word in self.inputs + self.outputs for register in word.registers)
        return tuple(sorted((*self.common, *words), key=lambda register: register.address))

    @property
    def inputs(self) -> tuple[Word, ...]:
        """Samples and parameters."""
        return self.samples + self.parameters

    @property
    def streams(self) -> bool:
        """Whether samples can come as a stream."""
        return any(field.name == "stream" for field in self["CONTROL"].fields)

    @property
    def sample_words(self) -> int:
        """Words of 32 bits of a sample in a stream."""
        return sum(len(word.registers) for word in self.samples)

    @property
    def answer_words(self) -> int:
        """Words of 32 bits of an answer in a stream: the outputs and the status."""
        return sum(len(word.registers) for word in self.outputs) + 1
