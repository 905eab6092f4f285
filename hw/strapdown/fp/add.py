"""Addition and subtraction."""

import numpy as np
from amaranth import *

from .pipeline import PipelinedOperator
from .stages import normalise, round_nearest_even, shift_right_sticky, unpack

__all__ = ["FpAdd"]


class FpAdd(PipelinedOperator):
    """Sum of two floating-point numbers, ``result = a + b`` or ``a - b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 to 6.

    Members
    -------
    a, b, subtract, start : In(format), In(format), In(1), In(1)
        Operands, any unit, and whether ``b`` is subtracted; taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: x - x is +0; infinity - infinity and NaN operands give the format's NaN.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operations *addition* and *subtraction*.
    """

    CUTS = ("swap", "align", "sum", "normalise", "round", "result")
    CUT_PRIORITY = ("result", "align", "sum", "normalise", "swap", "round")
    DEFAULT_LATENCY = 4

    def __init__(self, format, *, latency=None):
        self._format = format
        super().__init__({"a": format.layout, "b": format.layout, "subtract": 1},
                         {"result": format.layout}, latency=latency)

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    def compute(self, a, b, subtract=False):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        fmt = self._format
        a, b = fmt.array(a), fmt.array(b)
        with np.errstate(all="ignore"):
            # A sum below the least normal number is exact: flushing needs no look at rounding.
            return fmt.canonical(fmt.flush(a + np.where(subtract, -b, b)))

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # Unpack, and swap so that |larger| >= |smaller|: the encodings compare like integers.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        b_sign = self.b.sign ^ self.subtract
        swap = Signal()
        m.d.comb += swap.eq(Cat(self.a.fraction, self.a.exponent) < Cat(self.b.fraction, self.b.exponent))
        opposite = a.sign ^ b_sign
        is_nan = a.is_nan | b.is_nan | (a.is_infinite & b.is_infinite & opposite)
        s = rank(
            "swap",
            sign=Mux(swap, b_sign, a.sign), opposite=opposite, is_nan=is_nan,
            is_infinite=a.is_infinite | b.is_infinite, both_negative=a.sign & b_sign,
            exponent=Mux(swap, b.exponent, a.exponent),
            distance=Mux(swap, b.exponent - a.exponent, a.exponent - b.exponent)[:fmt.exponent_width],
            larger=Mux(swap, b.significand, a.significand),
            smaller=Mux(swap, a.significand, b.significand))

        # Align. Guard, round and sticky bits below the smaller significand suffice: if it moves
        # by two or more, the difference loses at most one leading bit.
        extended = Signal(fmt.precision + 3)
        m.d.comb += extended.eq(Cat(C(0, 3), s.smaller))
        amount_width = (fmt.precision + 3).bit_length()
        if amount_width < fmt.exponent_width:
            far = s.distance[amount_width:].any()
            aligned = shift_right_sticky(m, extended, s.distance[:amount_width], "align")
            aligned = Mux(far, extended.any(), aligned)
        else:
            aligned = shift_right_sticky(m, extended, s.distance, "align")
        s = rank(
            "align",
            sign=s.sign, opposite=s.opposite, is_nan=s.is_nan, is_infinite=s.is_infinite,
            both_negative=s.both_negative, exponent=s.exponent, larger=s.larger, smaller=aligned)

        # Add or subtract magnitudes; the larger one comes first, so the result is not negative.
        total = Signal(fmt.precision + 4)
        minuend = Cat(C(0, 3), s.larger)
        m.d.comb += total.eq(Mux(s.opposite, minuend - s.smaller, minuend + s.smaller))
        s = rank(
            "sum",
            sign=s.sign, opposite=s.opposite, is_nan=s.is_nan, is_infinite=s.is_infinite,
            both_negative=s.both_negative, exponent=s.exponent, total=total)

        # Normalise. The top bit of ``total`` weighs 2**(exponent + 1).
        is_zero = s.total == 0
        normalised, zeros = normalise(m, s.total, "normalise")
        exponent = Signal(signed(fmt.exponent_width + 2))
        m.d.comb += exponent.eq(s.exponent + 1 - zeros)
        tiny = exponent < 1
        if fmt.gradual:
            # A subnormal keeps the weight of exponent 1: shift by no more than s.exponent.
            limited = Signal(fmt.precision + 4)
            m.d.comb += limited.eq((s.total << s.exponent[:len(zeros)])[:len(limited)])
            significand = Mux(tiny, limited, normalised)
        else:
            significand = normalised
        # An exact zero has the sign of equal operands' signs, else +: round to nearest.
        sign = Mux(is_zero, s.both_negative, s.sign)
        s = rank(
            "normalise",
            sign=sign, is_nan=s.is_nan, is_zero=is_zero | (tiny & (not fmt.gradual)),
            is_infinite=s.is_infinite | (exponent == fmt.exponent_special),
            exponent=Mux(tiny, 0, exponent[:fmt.exponent_width]), significand=significand)

        # Round: significand, guard bit, and three bits that only count as sticky.
        encoded = round_nearest_even(
            fmt, s.exponent, s.significand[4:], s.significand[3], s.significand[:3].any())
        s = rank("round", sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, is_zero=s.is_zero,
                 encoded=encoded)

        result = Signal(fmt.layout)
        with m.If(s.is_nan):
            m.d.comb += result.eq(fmt.nan)
        with m.Elif(s.is_infinite):
            m.d.comb += result.eq(Cat(C(fmt.infinity, fmt.width - 1), s.sign))
        with m.Elif(s.is_zero):
            m.d.comb += result.eq(Cat(C(0, fmt.width - 1), s.sign))
        with m.Else():
            m.d.comb += result.eq(Cat(s.encoded, s.sign))
        s = rank("result", result=result)
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m
