"""Choice between two numbers."""

import numpy as np
from amaranth import *

from .pipeline import Pipeline, PipelinedOperator

__all__ = ["FpSelect"]


class FpSelect(PipelinedOperator):
    """One of two floating-point numbers, ``result = a if condition else b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    quiet : bool
        True for a result that is zero while ``done`` is low.

    Members
    -------
    a, b, condition, start : In(format), In(format), In(1), In(1)
        Operands, any unit, and the condition; taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.

    Latency: 1 cycle, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact; every encoding passes unchanged, subnormals and NaN payloads included;
    like a copy, it raises no exceptions.
    """

    PIPELINE = Pipeline(cuts=("result",), priority=("result",), default_latency=1)

    def __init__(self, format, *, quiet=False):
        self._format = format
        super().__init__({"a": format.layout, "b": format.layout, "condition": 1}, {"result": format.layout},
                         quiet=quiet)

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    @staticmethod
    def compute(a, b, condition):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return np.where(condition, a, b)

    def elaborate(self, platform):
        m = Module()
        rank = self.ranks(m)
        if self._quiet:
            # Two registers with a synchronous reset each, and an OR, which may be that of a bus.
            s = rank("result", a=Mux(self.condition, self.a, 0), b=Mux(self.condition, 0, self.b))
            result = s.a | s.b
        else:
            chosen = Signal(self._format.layout)
            m.d.comb += chosen.eq(Mux(self.condition, self.a, self.b))
            result = rank("result", result=chosen).result
        m.d.comb += [self.result.eq(result), self.done.eq(rank.valid)]
        return m
