"""Minimum and maximum of two numbers."""

import numpy as np
from amaranth import *

from . import exact
from .pipeline import Pipeline, PipelinedOperator
from .rounding import Flags, flags_member
from .stages import pack, unpack

__all__ = ["FpMinMax"]


class FpMinMax(PipelinedOperator):
    """Minimum or maximum of two floating-point numbers.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 or 2.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, maximum, start : In(format), In(format), In(1), In(1)
        Operands, any unit; 1 for the maximum, 0 for the minimum. Taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: exact.
    Special values: -0 is less than +0; a NaN operand gives the format's NaN, so that a lost
    measurement stays visible. These are *minimum* and *maximum*; *minimumNumber* and
    *maximumNumber* would give the other operand.
    Flags: invalid for signalling NaNs.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 9.6, operations *minimum* and *maximum*.
    """

    PIPELINE = Pipeline(cuts=("compare", "result"), priority=("result", "compare"), default_latency=1)

    def __init__(self, format, *, latency=None, flags=False):
        self._format = format
        self._flags = bool(flags)
        super().__init__({"a": format.layout, "b": format.layout, "maximum": 1},
                         {"result": format.layout, **flags_member(flags)}, latency=latency)

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    def compute(self, a, b, maximum):
        """Bit-exact software twin: arrays of the format's dtype and of bool, shapes that broadcast."""
        fmt = self._format
        a, b = fmt.array(a), fmt.array(b)
        # NumPy's minimum does not distinguish the zeros.
        less = (a < b) | ((a == b) & np.signbit(a))
        chosen = np.where(less ^ np.asarray(maximum, dtype=bool), a, b)
        return fmt.canonical(np.where(np.isnan(a), a, np.where(np.isnan(b), b, chosen)))

    def compute_flags(self, a, b, maximum):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        invalid = exact.unpack(self._format, a).is_signalling | exact.unpack(self._format, b).is_signalling
        return (invalid & np.full(np.shape(maximum), True)) * np.uint8(Flags.INVALID)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # Numbers of the same sign compare like their magnitudes, in reverse order if negative. If they are equal,
        # either can be the result; this includes subnormals that are flushed to the same zero.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        magnitude_is_less = Cat(self.a.fraction, self.a.exponent) < Cat(self.b.fraction, self.b.exponent)
        less = Mux(a.sign == b.sign, magnitude_is_less ^ a.sign, a.sign)
        s = rank("compare", a=Value.cast(self.a), b=Value.cast(self.b), a_is_zero=a.is_zero, b_is_zero=b.is_zero,
                 choose_a=less ^ self.maximum, is_nan=a.is_nan | b.is_nan,
                 **({"invalid": a.is_signalling | b.is_signalling} if self._flags else {}))

        chosen = Mux(s.choose_a, s.a, s.b)
        result = pack(m, fmt, chosen[-1], chosen[:-1], is_nan=s.is_nan, is_infinite=C(0),
                      is_zero=Mux(s.choose_a, s.a_is_zero, s.b_is_zero))
        s = rank("result", result=result, **({"flags": Cat(C(0, 4), s.invalid)} if self._flags else {}))
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m
