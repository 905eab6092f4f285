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

    CUTS = ("swap", "align", "sum", "normalise", "exponent", "result")
    CUT_PRIORITY = ("result", "align", "sum", "exponent", "swap", "normalise")
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
        aligned = shift_right_sticky(m, extended, s.distance, "align")
        s = rank(
            "align",
            sign=s.sign, opposite=s.opposite, is_nan=s.is_nan, is_infinite=s.is_infinite,
            both_negative=s.both_negative, exponent=s.exponent, larger=s.larger, smaller=aligned)

        # Add or subtract magnitudes; the larger one comes first, so the result is not negative.
        # A subtraction is the addition of the inverse and of one, put where ``larger`` has no bits.
        total = Signal(fmt.precision + 4)
        addend = Cat(s.smaller, C(0, 1)) ^ s.opposite.replicate(len(total))
        m.d.comb += total.eq(Cat(s.opposite, C(0, 2), s.larger) + addend)
        s = rank(
            "sum",
            sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, both_negative=s.both_negative,
            exponent=s.exponent, total=total)

        # Normalise. The top bit of ``total`` weighs 2**(exponent + 1), that of a subnormal 2**1:
        # no total moves by more than ``exponent``.
        significand, zeros = normalise(m, s.total, "normalise", limit=s.exponent if fmt.gradual else None)
        s = rank(
            "normalise",
            sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, both_negative=s.both_negative,
            exponent=s.exponent, zeros=zeros, significand=significand)

        # Exponent, and special results, which the rounding then leaves as they are.
        exponent = Signal(signed(fmt.exponent_width + 2))
        m.d.comb += exponent.eq(s.exponent + 1 - s.zeros)
        is_zero = ~(s.significand.any() if fmt.gradual else s.significand[-1])
        is_tiny = ~s.significand[-1] if fmt.gradual else is_zero | (exponent < 1)
        is_special = s.is_nan | s.is_infinite | (exponent == fmt.exponent_special)
        stored, significand = Signal(fmt.exponent_width), Signal(fmt.precision + 4)
        with m.If(is_special):
            m.d.comb += [stored.eq(fmt.exponent_special), significand[-2].eq(s.is_nan)]
        with m.Elif(is_tiny):
            m.d.comb += significand.eq(s.significand if fmt.gradual else 0)
        with m.Else():
            m.d.comb += [stored.eq(exponent), significand.eq(s.significand)]
        # An exact zero has the sign of equal operands' signs, else +: round to nearest.
        sign = Mux(is_zero, s.both_negative, s.sign) & ~s.is_nan
        s = rank("exponent", sign=sign, exponent=stored, significand=significand)

        # Round: significand, guard bit, and three bits that only count as sticky.
        encoded = round_nearest_even(
            fmt, s.exponent, s.significand[4:], s.significand[3], s.significand[:3].any())
        s = rank("result", result=Cat(encoded, s.sign))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m
