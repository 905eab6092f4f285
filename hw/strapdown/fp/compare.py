"""Comparison."""

from typing import NamedTuple

import numpy as np
from amaranth import *

from .pipeline import PipelinedOperator
from .stages import unpack

__all__ = ["FpCompare", "FpRelation", "Relations", "RELATIONS"]


class Relations(NamedTuple):
    """What ``FpCompare.compute`` gives back: arrays of bool, at most one of the three true."""

    less: np.ndarray
    equal: np.ndarray
    unordered: np.ndarray


RELATIONS = {
    "==": lambda less, equal, unordered: equal,
    "!=": lambda less, equal, unordered: ~equal,
    "<": lambda less, equal, unordered: less,
    "<=": lambda less, equal, unordered: less | equal,
    ">": lambda less, equal, unordered: ~(less | equal | unordered),
    ">=": lambda less, equal, unordered: ~(less | unordered),
}
"""The six relations, each from the three outputs of ``FpCompare``: one-bit Values or arrays of bool.
Of unordered operands only ``!=`` holds."""


def _relations(fmt, a, b):
    a, b = fmt.array(a), fmt.array(b)
    return Relations(a < b, a == b, np.isnan(a) | np.isnan(b))


class FpCompare(PipelinedOperator):
    """Relations between two floating-point numbers; ``RELATIONS`` makes any of the six.

    Parameters
    ----------
    format : FloatFormat
        Format of the operands.
    latency : int
        Register ranks, 1 or 2.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    less, equal, unordered, done : Out(1), Out(1), Out(1), Out(1)
        ``a < b``, ``a = b``, and whether an operand is NaN; valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact.
    Special values: +0 = -0; a NaN is unordered with everything, itself included.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 5.11.
    """

    CUTS = ("magnitude", "result")
    CUT_PRIORITY = ("result", "magnitude")
    DEFAULT_LATENCY = 1

    def __init__(self, format, *, latency=None):
        self._format = format
        super().__init__({"a": format.layout, "b": format.layout},
                         {"less": 1, "equal": 1, "unordered": 1}, latency=latency)

    @property
    def format(self):
        """Format of the operands."""
        return self._format

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return _relations(self._format, a, b)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # Magnitudes compare like integers. A flushed subnormal need not be cleared for this: it
        # is less than any normal number, and among zeros the magnitudes do not count.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        a_magnitude = Cat(self.a.fraction, self.a.exponent)
        b_magnitude = Cat(self.b.fraction, self.b.exponent)
        s = rank(
            "magnitude",
            a_sign=a.sign, b_sign=b.sign, less=a_magnitude < b_magnitude, equal=a_magnitude == b_magnitude,
            both_zero=a.is_zero & b.is_zero, unordered=a.is_nan | b.is_nan)

        magnitude_is_less = Mux(s.a_sign, ~(s.less | s.equal), s.less)
        less = Mux(s.a_sign == s.b_sign, magnitude_is_less, s.a_sign)
        ordered = ~s.unordered
        s = rank(
            "result",
            less=less & ~s.both_zero & ordered,
            equal=(s.both_zero | (s.equal & (s.a_sign == s.b_sign))) & ordered,
            unordered=s.unordered)
        m.d.comb += [self.less.eq(s.less), self.equal.eq(s.equal), self.unordered.eq(s.unordered),
                     self.done.eq(rank.valid)]
        return m


class FpRelation(PipelinedOperator):
    """Whether one relation holds between two floating-point numbers, ``result = a relation b``.

    Parameters
    ----------
    format : FloatFormat
        Format of the operands.
    relation : str
        A key of ``RELATIONS``: ``==``, ``!=``, ``<``, ``<=``, ``>`` or ``>=``.
    latency : int
        Register ranks, 1 or 2.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    result, done : Out(1), Out(1)
        Whether the relation holds, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact.
    Special values: +0 = -0; of a NaN and any number, itself included, only ``!=`` holds.
    Raises: ValueError if ``relation`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.11, the quiet predicates of table 5.3.
    """

    CUTS = FpCompare.CUTS
    CUT_PRIORITY = FpCompare.CUT_PRIORITY
    DEFAULT_LATENCY = FpCompare.DEFAULT_LATENCY

    def __init__(self, format, relation, *, latency=None):
        self._format = format
        self._relation = relation
        if relation not in RELATIONS:
            raise ValueError(f"relation must be one of {', '.join(RELATIONS)}, not {relation!r}")
        super().__init__({"a": format.layout, "b": format.layout}, {"result": 1}, latency=latency)

    @property
    def format(self):
        """Format of the operands."""
        return self._format

    @property
    def relation(self):
        """The relation, as it is written."""
        return self._relation

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, shapes that broadcast; bool out."""
        return RELATIONS[self._relation](*_relations(self._format, a, b))

    def elaborate(self, platform):
        m = Module()
        m.submodules.compare = compare = FpCompare(self._format, latency=self.latency)
        m.d.comb += [
            compare.a.eq(self.a), compare.b.eq(self.b), compare.start.eq(self.start),
            self.result.eq(RELATIONS[self._relation](compare.less, compare.equal, compare.unordered)),
            self.done.eq(compare.done),
        ]
        return m
