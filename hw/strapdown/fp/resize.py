"""Conversion between two floating-point formats."""

from types import SimpleNamespace

import numpy as np
from amaranth import *

from .pipeline import PipelinedOperator
from .stages import normalise, round_and_pack, unpack

__all__ = ["FpToFp"]


class FpToFp(PipelinedOperator):
    """The same number in another floating-point format.

    Parameters
    ----------
    from_format, to_format : FloatFormat
        Format of the operand and of the result, any two.
    latency : int
        Register ranks, 1 or 2.

    Members
    -------
    a, start : In(from_format), In(1)
        Operand, any unit, taken while ``start`` is high.
    result, done : Out(to_format), Out(1)
        Result, in the unit of ``a``, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even; exact if ``to_format`` has every number
    of ``from_format``. Each format's own policy holds for subnormals, of operand and of result.
    Special values: what exceeds the range becomes infinity; NaN becomes the format's NaN.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.2, operation *convertFormat*.
    """

    CUTS = ("normalise", "result")
    CUT_PRIORITY = ("result", "normalise")
    DEFAULT_LATENCY = 1

    def __init__(self, from_format, to_format, *, latency=None):
        self._from_format = from_format
        self._to_format = to_format
        super().__init__({"a": from_format.layout}, {"result": to_format.layout}, latency=latency)

    @property
    def from_format(self):
        """Format of the operand."""
        return self._from_format

    @property
    def to_format(self):
        """Format of the result."""
        return self._to_format

    def compute(self, a):
        """Bit-exact software twin: an array of the one dtype in, of the other out, same shape.

        Raises: ValueError if NumPy has no type for one of the formats.
        """
        fmt = self._to_format
        a = self._from_format.array(a)
        result = fmt.array(a)
        if not fmt.gradual:
            # Rounding may have lifted a number to the least normal one.
            tiny = np.abs(a) < np.ldexp(1.0, 1 - fmt.bias)
            result = np.where(tiny, np.copysign(fmt.dtype.type(0), result), result)
        return fmt.canonical(result)

    def elaborate(self, platform):
        m = Module()
        source, fmt = self._from_format, self._to_format
        rank = self.ranks(m)

        # Unpack. The exponent's range tells the rounding stage whether there can be subnormals.
        a = unpack(m, source, self.a, "a")
        offset = fmt.bias - source.bias
        least, greatest = 1 + offset, source.exponent_special + offset
        significand, zeros = a.significand, C(0)
        if source.gradual:
            significand, zeros = normalise(m, significand, "normalise")
            least -= source.fraction_width
        exponent = Signal(range(least, greatest + 1) if least > 0 else range(min(least, -1), greatest + 1))
        m.d.comb += exponent.eq(a.exponent + offset - zeros)
        s = rank("normalise", sign=a.sign, is_nan=a.is_nan, is_infinite=a.is_infinite, is_zero=a.is_zero,
                 exponent=exponent, significand=significand)

        padded = Cat(C(0, fmt.precision), s.significand)
        number = SimpleNamespace(
            **vars(s), extended=Cat(padded[:-fmt.precision - 1].any(), padded[-fmt.precision - 1:]))
        s = rank("result", result=round_and_pack(m, fmt, number))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m
