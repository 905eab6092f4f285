"""Conversion between floating-point and fixed-point numbers."""

import operator
from types import SimpleNamespace

import numpy as np
from amaranth import *

from .pipeline import PipelinedOperator
from .stages import normalise, round_and_pack, shift_right_sticky, unpack

__all__ = ["FpToFixed", "FixedToFp"]


class _Converter(PipelinedOperator):
    """Base of the two converters: a floating-point format beside a fixed-point one."""

    # The twins hold a fixed-point number in a float64 without error.
    MAXIMUM_WIDTH = 54

    def _set_formats(self, format, width, fraction_bits):
        self._format = format
        self._width = operator.index(width)
        if not 2 <= self._width <= self.MAXIMUM_WIDTH:
            raise ValueError(f"width must be from 2 to {self.MAXIMUM_WIDTH}, not {width!r}")
        self._fraction_bits = operator.index(fraction_bits)
        if not 0 <= self._fraction_bits < self._width:
            raise ValueError(f"fraction_bits must be from 0 to {self._width - 1}, not {fraction_bits!r}")

    @property
    def format(self):
        """Floating-point format."""
        return self._format

    @property
    def width(self):
        """Bits of the fixed-point number, its sign included."""
        return self._width

    @property
    def fraction_bits(self):
        """Bits of the fixed-point number behind the point."""
        return self._fraction_bits


class FpToFixed(_Converter):
    """Fixed-point form of a floating-point number, ``result = a * 2**fraction_bits``.

    Parameters
    ----------
    format : FloatFormat
        Format of the operand.
    width, fraction_bits : int
        Bits of the result in two's complement, 2 to 54, and those behind the point, less than
        ``width``.
    latency : int
        Register ranks, 1 to 3.

    Members
    -------
    a, start : In(format), In(1)
        Operand, any unit, taken while ``start`` is high.
    result, done : Out(signed(width)), Out(1)
        Result in units of 2**-fraction_bits, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: what exceeds the range becomes the nearest end of it, infinities included;
    NaN becomes the largest number, as in the RISC-V instruction FCVT.W.S.
    Raises: ValueError if ``width``, ``fraction_bits`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *convertToIntegerTiesToEven*.
    """

    CUTS = ("distance", "align", "result")
    CUT_PRIORITY = ("result", "align", "distance")
    DEFAULT_LATENCY = 2

    def __init__(self, format, *, width, fraction_bits, latency=None):
        self._set_formats(format, width, fraction_bits)
        super().__init__({"a": format.layout}, {"result": signed(width)}, latency=latency)

    def compute(self, a):
        """Bit-exact software twin: an array of the format's dtype in, int64 out, same shape."""
        least, largest = -(1 << self._width - 1), (1 << self._width - 1) - 1
        with np.errstate(all="ignore"):
            scaled = np.ldexp(self._format.array(a).astype(np.float64), self._fraction_bits)
        rounded = np.clip(np.rint(scaled), least, largest)
        return np.where(np.isnan(scaled), largest, rounded).astype(np.int64)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # The significand starts with its top bit where the result has its sign, then moves right.
        a = unpack(m, fmt, self.a, "a")
        length = max(self._width + 2, fmt.precision)
        distance = Signal(signed(max(fmt.exponent_width, self._width.bit_length()) + 2))
        m.d.comb += distance.eq(self._width - 1 - self._fraction_bits + fmt.bias - a.exponent)
        s = rank("distance", sign=a.sign & ~a.is_nan, significand=a.significand, distance=distance,
                 saturates=(distance < 0) | a.is_infinite | a.is_nan)

        start = Cat(C(0, length - fmt.precision), s.significand)
        s = rank("align", sign=s.sign, saturates=s.saturates,
                 aligned=shift_right_sticky(m, start, s.distance.as_unsigned(), "align"))

        # Round and negate in one addition: -(x + up) = ~x + 1 - up.
        magnitude, guard = s.aligned[-self._width:], s.aligned[-self._width - 1]
        sticky = s.aligned[:-self._width - 1].any()
        up = guard & (sticky | magnitude[0])
        rounded = Signal(self._width)
        m.d.comb += rounded.eq((magnitude ^ s.sign.replicate(self._width)) + (up ^ s.sign))
        saturates = s.saturates | magnitude[-1] | (rounded[-1] & ~s.sign)
        end = Cat((~s.sign).replicate(self._width - 1), s.sign)
        s = rank("result", result=Mux(saturates, end, rounded))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m


class FixedToFp(_Converter):
    """Floating-point form of a fixed-point number, ``result = operand / 2**fraction_bits``.

    Parameters
    ----------
    format : FloatFormat
        Format of the result.
    width, fraction_bits : int
        Bits of the operand in two's complement, 2 to 54, and those behind the point, less than
        ``width``.
    latency : int
        Register ranks, 1 to 3.

    Members
    -------
    operand, start : In(signed(width)), In(1)
        Operand in units of 2**-fraction_bits, taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, any unit, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: 0 becomes +0.
    Raises: ValueError if ``width``, ``fraction_bits`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *convertFromInt*.
    """

    CUTS = ("magnitude", "normalise", "result")
    CUT_PRIORITY = ("result", "normalise", "magnitude")
    DEFAULT_LATENCY = 2

    def __init__(self, format, *, width, fraction_bits, latency=None):
        self._set_formats(format, width, fraction_bits)
        super().__init__({"operand": signed(width)}, {"result": format.layout}, latency=latency)

    def compute(self, operand):
        """Bit-exact software twin: an integer array in, the format's dtype out, same shape."""
        fmt = self._format
        exact = np.ldexp(np.asarray(operand, dtype=np.int64).astype(np.float64), -self._fraction_bits)
        result = fmt.array(exact)
        if fmt.gradual:
            return result
        # Rounding may have lifted a number to the least normal one.
        tiny = np.abs(exact) < fmt.from_bits(fmt.least_normal).astype(np.float64)
        return np.where(tiny, np.copysign(fmt.dtype.type(0), result), result)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        magnitude = Signal(self._width)
        m.d.comb += magnitude.eq(Mux(self.operand < 0, -self.operand, self.operand))
        s = rank("magnitude", sign=self.operand < 0, magnitude=magnitude)

        # Normalise. The top bit weighs 2**(width - 1 - fraction_bits).
        normalised, zeros = normalise(m, s.magnitude, "normalise")
        greatest = fmt.bias + self._width - 1 - self._fraction_bits
        least = greatest - self._width + 1
        exponent = Signal(range(least, greatest + 1) if least > 0 else range(least - 1, greatest + 1))
        m.d.comb += exponent.eq(greatest - zeros)
        padded = Cat(C(0, fmt.precision), normalised)
        s = rank(
            "normalise", sign=s.sign, is_zero=s.magnitude == 0, exponent=exponent,
            extended=Cat(padded[:-fmt.precision - 1].any(), padded[-fmt.precision - 1:]))

        number = SimpleNamespace(is_nan=C(0), is_infinite=C(0), **vars(s))
        s = rank("result", result=round_and_pack(m, fmt, number))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m
