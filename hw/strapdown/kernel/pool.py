# amaranth: UnusedElaboratable=no
# Units are also made for their latency and their twin alone.
"""The pool of operators that an engine computes with."""

import enum
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

from strapdown.cordic import CordicAtan2
from strapdown.fp import BINARY32, FloatFormat, FpAdd, FpDivideSquareRoot, FpMultiply, FpSelect, Subnormals

__all__ = ["MemoryStyle", "Pool", "Unit"]

FLUSHED32 = BINARY32.with_subnormals(Subnormals.FLUSH)


@dataclass(frozen=True)
class Unit:
    """An operator of a pool.

    Attributes
    ----------
    name : str
        Name of its instance in the Verilog.
    make : callable
        Makes a fresh component, with members ``start`` and ``result``.
    operations : dict
        Kernel operation to its bit-exact twin on arrays.
    read_port : int
        The pair of memory read ports that feeds it.
    operands : tuple of str
        Members that take the first and second operand.
    modes : dict
        Kernel operation to the member that is high for it.
    direct : bool
        Whether its results go straight to the result bus, and can be operands as they come out. Those of
        the others, which are seldom used, are registered once more on the way.
    latency, interval : int
        Cycles from start to result, and between two starts.
    """

    name: str
    make: Callable[[], Any]
    operations: dict[str, Callable]
    read_port: int
    operands: tuple[str, str] = ("a", "b")
    modes: dict[str, str] = field(default_factory=dict)
    direct: bool = False
    latency: int = field(init=False)
    interval: int = field(init=False)

    def __post_init__(self):
        model = self.make()
        object.__setattr__(self, "latency", model.latency)
        object.__setattr__(self, "interval", model.interval)


class MemoryStyle(enum.Enum):
    """What a memory of the engine is made of."""

    DISTRIBUTED = "distributed"
    """LUTs: read without a clock edge."""
    BLOCK = "block"
    """Block RAM: an operand's address goes out a cycle earlier."""


@dataclass(frozen=True)
class Pool:
    """Which operators an engine has, how deep they are, and how they are fed.

    Parameters
    ----------
    format : FloatFormat
        Format of all numbers.
    adders, multipliers, dividers, arctangents : int
        How many of each. Without an arctangent, atan2 is computed by the others.
    adder_latency, multiplier_latency : int
        Register ranks of the pipelined operators.
    divider_bits_per_cycle : int
        Result bits that the iterative division and square root find in a cycle.
    arctangent_steps_per_cycle : int
        CORDIC steps in a cycle.
    forwarding : bool
        Whether a result can be an operand as it comes out, without a way through the memory.
    private_ports : bool
        Whether every adder and every multiplier has a pair of read ports to itself.
    operand_memory, microcode : MemoryStyle
        What the two memories are made of.
    side_memory : bool
        Whether there is a second result bus, with a memory of its own for results of adders and multipliers.

    Raises: TypeError and ValueError for parameters that an operator refuses, for counts below one, and
    for a side memory beside operands in block RAM.
    """

    format: FloatFormat = FLUSHED32
    adders: int = 1
    adder_latency: int = 5
    multipliers: int = 1
    multiplier_latency: int = 2
    dividers: int = 2
    divider_bits_per_cycle: int = 1
    arctangents: int = 1
    arctangent_steps_per_cycle: int = 1
    forwarding: bool = True
    private_ports: bool = True
    operand_memory: MemoryStyle = MemoryStyle.DISTRIBUTED
    microcode: MemoryStyle = MemoryStyle.BLOCK
    side_memory: bool = False

    def __post_init__(self):
        for name, least in ("adders", 1), ("multipliers", 1), ("dividers", 1), ("arctangents", 0):
            if (count := operator.index(getattr(self, name))) < least:
                raise ValueError(f"{name} must be at least {least}, not {count!r}")
        if self.side_memory and self.operand_memory is not MemoryStyle.DISTRIBUTED:
            raise ValueError("operand_memory must be distributed if there is a side memory")
        _ = self.units  # each operator checks its parameters

    @property
    def memory_delay(self):
        """Least number of cycles between a result and an operand that comes from memory."""
        return 2 if self.operand_memory is MemoryStyle.BLOCK else 1

    @cached_property
    def units(self):
        """All units of the pool, a tuple of Unit.

        Additions are on nearly every path, so an adder shares its pair of read ports with none but the
        selector, which is seldom used; whatever is iterative shares that of a multiplier.
        """
        divider = partial(FpDivideSquareRoot, self.format, bits_per_cycle=self.divider_bits_per_cycle)
        arctangent = partial(CordicAtan2, self.format, steps_per_cycle=self.arctangent_steps_per_cycle)
        divide_square_root = divider().compute
        units = [
            *self._pipelined("adder", "add", self.adders, 0, partial(FpAdd, self.format, latency=self.adder_latency)),
            *self._pipelined("multiplier", "multiply", self.multipliers, self.adders,
                             partial(FpMultiply, self.format, latency=self.multiplier_latency))]
        iterative = 0
        for name in _numbered("divider", self.dividers):
            units.append(Unit(name, divider, {"divide": lambda a, b: divide_square_root(a, b, False),
                                              "sqrt": lambda a: divide_square_root(a, a, True)},
                              read_port=self._port(self.adders + iterative % self.multipliers),
                              modes={"sqrt": "square_root"}))
            iterative += 1
        for name in _numbered("arctangent", self.arctangents):
            units.append(Unit(name, arctangent, {"atan2": arctangent().compute}, operands=("y", "x"),
                              read_port=self._port(self.adders + iterative % self.multipliers)))
            iterative += 1
        units.append(Unit("selector", partial(FpSelect, self.format),
                          {"select": FpSelect.compute, "copy": lambda a: a}, read_port=0))
        return tuple(units)

    def _pipelined(self, name, operation, count, first_port, make):
        twin = make().compute
        return [Unit(unit, make, {operation: twin}, read_port=self._port(first_port + index), direct=True)
                for index, unit in enumerate(_numbered(name, count))]

    def _port(self, index):
        return index if self.private_ports else 0

    @cached_property
    def operations(self):
        """Kernel operation to the units that can compute it."""
        operations: dict[str, list[Unit]] = {}
        for unit in self.units:
            for operation in unit.operations:
                operations.setdefault(operation, []).append(unit)
        return operations

    def compute(self, operation, *arrays):
        """What the units of ``operation`` make of arrays of the format's dtype, bit for bit."""
        return self.operations[operation][0].operations[operation](*arrays)


def _numbered(name, count):
    return [name] if count == 1 else [f"{name}_{index}" for index in range(count)]
