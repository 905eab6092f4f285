# mypy: disable-error-code="attr-defined"
"""Comparison."""

from dataclasses import dataclass

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described
from strapdown.fp import FpCompare

from .base import Operation, Operator

__all__ = ["Comparator"]


class Less(Described):
    """``FpCompare`` with a number as result: -0 for ``a < b``, else +0.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any common unit; taken while ``start`` is high.
    result, done : Out(format), Out(1)
        The result, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Raises: ValueError if ``latency`` is out of range.
    """

    def __init__(self, format, *, latency):
        self._compare = FpCompare(format, latency=latency)
        super().__init__({"a": In(format.layout), "b": In(format.layout), "start": In(1),
                          "result": Out(format.layout), "done": Out(1)})

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``."""
        return self._compare.latency

    @property
    def interval(self):
        """Cycles between two operations: 1."""
        return self._compare.interval

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        fmt = self._compare.format
        return fmt.from_bits(self._compare.compute(a, b).less.astype(np.uint64) << np.uint64(fmt.width - 1))

    def elaborate(self, platform):
        m = Module()
        m.submodules.compare = compare = self._compare
        m.d.comb += [compare.a.eq(self.a), compare.b.eq(self.b), compare.start.eq(self.start),
                     self.result.sign.eq(compare.less), self.done.eq(compare.done)]
        return m


@dataclass(frozen=True, kw_only=True)
class Comparator(Operator):
    """Pipelined ``a < b``, and ``a > b`` with the operands exchanged; without it, they are the sign of a difference.

    If an operand is NaN, both relations are false. A system with a status port refuses the update in that case.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FpCompare``.
    count : int
        How many there are.
    """

    name = "comparator"
    component = Less
    beside = "adder"
    operations = (Operation("less", twin=lambda component, a, b: component.compute(a, b), float64=np.less,
                            fallback=lambda xp, a, b: xp.is_negative(a - b), gives_condition=True),)

    latency: int = 1
    count: int = 1
