"""Comparison."""

from typing import NamedTuple

import numpy as np
from amaranth import *

from . import exact
from .pipeline import Pipeline, PipelinedOperator
from .rounding import Flags, flags_member
from .stages import unpack

__all__ = ["FpCompare", "FpRelation", "Relations", "RELATIONS"]


class Relations(NamedTuple):
    """Result of ``FpCompare.compute``: arrays of bool, at most one of the three true."""

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
"""The six relations, each as a function of the three outputs of ``FpCompare``: one-bit Values or arrays of bool.
If the operands are unordered, only ``!=`` is true."""


def _relations(fmt, a, b):
    a, b = fmt.array(a), fmt.array(b)
    return Relations(a < b, a == b, np.isnan(a) | np.isnan(b))


def _flags(fmt, signalling, a, b):
    a, b = exact.unpack(fmt, a), exact.unpack(fmt, b)
    invalid = a.is_nan | b.is_nan if signalling else a.is_signalling | b.is_signalling
    return invalid * np.uint8(Flags.INVALID)


class FpCompare(PipelinedOperator):
    """Relations between two floating-point numbers; ``RELATIONS`` derives any of the six.

    Parameters
    ----------
    format : FloatFormat
        Format of the operands.
    latency : int
        Register ranks, 1 or 2.
    signalling : bool
        True if a quiet NaN is an invalid operand, too.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    less, equal, unordered, done : Out(1), Out(1), Out(1), Out(1)
        ``a < b``, ``a = b``, and high if an operand is NaN; valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this comparison, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact.
    Special values: +0 = -0; a NaN is unordered with everything, itself included.
    Flags: invalid for signalling NaNs, and for quiet ones if ``signalling``.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 5.11.
    """

    PIPELINE = Pipeline(cuts=("magnitude", "result"), priority=("result", "magnitude"), default_latency=1)

    def __init__(self, format, *, latency=None, signalling=False, flags=False):
        self._format = format
        self._signalling = bool(signalling)
        self._flags = bool(flags)
        super().__init__({"a": format.layout, "b": format.layout},
                         {"less": 1, "equal": 1, "unordered": 1, **flags_member(flags)}, latency=latency)

    @property
    def format(self):
        """Format of the operands."""
        return self._format

    @property
    def signalling(self):
        """True if a quiet NaN is an invalid operand, too."""
        return self._signalling

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return _relations(self._format, a, b)

    def compute_flags(self, a, b):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return _flags(self._format, self._signalling, a, b)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # Magnitudes compare like integers. A flushed subnormal does not have to be cleared for this: it is
        # less than any normal number, and the magnitudes of two zeros are ignored.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        a_magnitude = Cat(self.a.fraction, self.a.exponent)
        b_magnitude = Cat(self.b.fraction, self.b.exponent)
        invalid = a.is_nan | b.is_nan if self._signalling else a.is_signalling | b.is_signalling
        s = rank(
            "magnitude", **({"invalid": invalid} if self._flags else {}),
            a_sign=a.sign, b_sign=b.sign, less=a_magnitude < b_magnitude, equal=a_magnitude == b_magnitude,
            both_zero=a.is_zero & b.is_zero, unordered=a.is_nan | b.is_nan)

        magnitude_is_less = Mux(s.a_sign, ~(s.less | s.equal), s.less)
        less = Mux(s.a_sign == s.b_sign, magnitude_is_less, s.a_sign)
        ordered = ~s.unordered
        s = rank(
            "result", **({"flags": Cat(C(0, 4), s.invalid)} if self._flags else {}),
            less=less & ~s.both_zero & ordered,
            equal=(s.both_zero | (s.equal & (s.a_sign == s.b_sign))) & ordered,
            unordered=s.unordered)
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m


class FpRelation(PipelinedOperator):
    """One relation between two floating-point numbers, ``result = a relation b``.

    Parameters
    ----------
    format : FloatFormat
        Format of the operands.
    relation : str
        A key of ``RELATIONS``: ``==``, ``!=``, ``<``, ``<=``, ``>`` or ``>=``.
    latency : int
        Register ranks, 1 or 2.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    result, done : Out(1), Out(1)
        High if the relation is true, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this comparison, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact.
    Special values: +0 = -0; between a NaN and any number, itself included, only ``!=`` is true.
    Flags: invalid for signalling NaNs; for the four relations of order also for quiet NaNs.
    Raises: ValueError if ``relation`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.11, tables 5.1 and 5.2: the predicates with these signs, quiet for
    equality and signalling for order.
    """

    PIPELINE = FpCompare.PIPELINE

    def __init__(self, format, relation, *, latency=None, flags=False):
        self._format = format
        self._relation = relation
        if relation not in RELATIONS:
            raise ValueError(f"relation must be one of {', '.join(RELATIONS)}, not {relation!r}")
        self._flags = bool(flags)
        super().__init__({"a": format.layout, "b": format.layout}, {"result": 1, **flags_member(flags)},
                         latency=latency)

    @property
    def format(self):
        """Format of the operands."""
        return self._format

    @property
    def relation(self):
        """The relation as a key of ``RELATIONS``."""
        return self._relation

    @property
    def _signalling(self):
        return self._relation not in ("==", "!=")

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, shapes that broadcast; bool out."""
        return RELATIONS[self._relation](*_relations(self._format, a, b))

    def compute_flags(self, a, b):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return _flags(self._format, self._signalling, a, b)

    def elaborate(self, platform):
        m = Module()
        m.submodules.compare = compare = FpCompare(
            self._format, latency=self.latency, signalling=self._signalling, flags=self._flags)
        m.d.comb += [
            compare.a.eq(self.a), compare.b.eq(self.b), compare.start.eq(self.start),
            self.result.eq(RELATIONS[self._relation](compare.less, compare.equal, compare.unordered)),
            self.done.eq(compare.done),
        ]
        if self._flags:
            m.d.comb += self.flags.eq(compare.flags)
        return m
