# amaranth: UnusedElaboratable=no
# Units are also made for their latency and their twin alone.
"""The pool of operators that an engine computes with."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

from strapdown.cordic import CordicAtan2
from strapdown.fp import BINARY32, FloatFormat, FpAdd, FpDivideSquareRoot, FpMultiply, FpSelect, Subnormals

__all__ = ["Pool", "Unit"]

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
    latency, interval : int
        Cycles from start to result, and between two starts.
    """

    name: str
    make: Callable[[], Any]
    operations: dict[str, Callable]
    read_port: int
    operands: tuple[str, str] = ("a", "b")
    modes: dict[str, str] = field(default_factory=dict)
    latency: int = field(init=False)
    interval: int = field(init=False)

    def __post_init__(self):
        model = self.make()
        object.__setattr__(self, "latency", model.latency)
        object.__setattr__(self, "interval", model.interval)


@dataclass(frozen=True)
class Pool:
    """Which operators an engine has and how deep they are.

    Parameters
    ----------
    format : FloatFormat
        Format of all numbers.
    adder_latency, multiplier_latency : int
        Register ranks of the pipelined operators.
    divider_bits_per_cycle : int
        Result bits that the iterative division and square root find in a cycle.
    arctangent_steps_per_cycle : int
        CORDIC steps in a cycle.

    Raises: TypeError and ValueError for parameters that an operator refuses.
    """

    format: FloatFormat = FLUSHED32
    adder_latency: int = 4
    multiplier_latency: int = 3
    divider_bits_per_cycle: int = 2
    arctangent_steps_per_cycle: int = 2

    def __post_init__(self):
        _ = self.units  # each operator checks its parameters

    @cached_property
    def units(self):
        """All units of the pool, a tuple of Unit.

        Additions are on nearly every path, so the adder has a pair of read ports to itself but
        for the selector, which is seldom used.
        """
        adder = partial(FpAdd, self.format, latency=self.adder_latency)
        multiplier = partial(FpMultiply, self.format, latency=self.multiplier_latency)
        divider = partial(FpDivideSquareRoot, self.format, bits_per_cycle=self.divider_bits_per_cycle)
        arctangent = partial(CordicAtan2, self.format, steps_per_cycle=self.arctangent_steps_per_cycle)
        selector = partial(FpSelect, self.format)
        divide_square_root = divider().compute
        return (
            Unit("adder", adder, {"add": adder().compute}, read_port=0),
            Unit("multiplier", multiplier, {"multiply": multiplier().compute}, read_port=1),
            Unit("divider", divider, {"divide": lambda a, b: divide_square_root(a, b, False),
                                      "sqrt": lambda a: divide_square_root(a, a, True)},
                 read_port=1, modes={"sqrt": "square_root"}),
            Unit("arctangent", arctangent, {"atan2": arctangent().compute}, read_port=1, operands=("y", "x")),
            Unit("selector", selector, {"select": FpSelect.compute, "copy": lambda a: a}, read_port=0),
        )

    def unit(self, operation):
        """The unit that computes ``operation``."""
        return next(unit for unit in self.units if operation in unit.operations)

    def compute(self, operation, *arrays):
        """What the unit of ``operation`` makes of arrays of the format's dtype, bit for bit."""
        return self.unit(operation).operations[operation](*arrays)
