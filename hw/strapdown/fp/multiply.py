"""Multiplication."""

import numpy as np
from amaranth import *

from .pipeline import PipelinedOperator
from .stages import normalise, round_and_pack, unpack

__all__ = ["FpMultiply"]


class FpMultiply(PipelinedOperator):
    """Product of two floating-point numbers, ``result = a * b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 to 5. From 3 on the significands' multiplier stands between two ranks.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: 0 * infinity and NaN operands give the format's NaN.
    Raises: ValueError if ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *multiplication*.
    """

    # Nothing stands between "multiply" and "product": the two ranks after a multiplier are the
    # registers inside a DSP block (MREG and PREG of a DSP48E1).
    CUTS = ("unpack", "multiply", "product", "normalise", "result")
    CUT_PRIORITY = ("result", "product", "unpack", "normalise", "multiply")
    DEFAULT_LATENCY = 3

    def __init__(self, format, *, latency=None):
        self._format = format
        super().__init__({"a": format.layout, "b": format.layout}, {"result": format.layout}, latency=latency)

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        fmt = self._format
        a, b = fmt.array(a), fmt.array(b)
        with np.errstate(all="ignore"):
            result = a * b
            if not fmt.gradual:
                # The least normal number may be the rounded form of something below it.
                doubtful = np.abs(result) == fmt.from_bits(fmt.least_normal)
                if doubtful.any():
                    below = doubtful & _product_is_tiny(fmt, np.abs(a), np.abs(b))
                    result = np.where(below, np.copysign(fmt.dtype.type(0), result), result)
            return fmt.canonical(fmt.flush(result))

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # Unpack. A zero is a matter of flags, so flushing needs no look at the significands.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        exponent = Signal(signed(max(fmt.exponent_width, fmt.fraction_width.bit_length()) + 2))
        if fmt.gradual:
            # One normaliser is enough: the product of two subnormals is shifted right anyway.
            swap = ~b.significand[-1]
            smaller, zeros = normalise(m, Mux(swap, b.significand, a.significand), "normalise")
            larger = Mux(swap, a.significand, b.significand)
            m.d.comb += exponent.eq(a.exponent + b.exponent - fmt.bias - zeros)
        else:
            smaller, larger = Cat(self.a.fraction, C(1, 1)), Cat(self.b.fraction, C(1, 1))
            m.d.comb += exponent.eq(a.exponent + b.exponent - fmt.bias)
        s = rank(
            "unpack",
            sign=a.sign ^ b.sign, exponent=exponent, smaller=smaller, larger=larger,
            is_nan=a.is_nan | b.is_nan | (a.is_infinite & b.is_zero) | (a.is_zero & b.is_infinite),
            is_infinite=a.is_infinite | b.is_infinite, is_zero=a.is_zero | b.is_zero)

        # Multiply.
        product = Signal(2 * fmt.precision)
        m.d.comb += product.eq(s.smaller * s.larger)
        for cut in "multiply", "product":
            s = rank(cut, sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, is_zero=s.is_zero,
                     exponent=s.exponent, product=product)
            product = s.product

        # Normalise: the product of numbers from 1 to 2 lies from 1 to 4.
        top = product[-1]
        significand_and_guard = Mux(top, product[-fmt.precision - 1:], product[-fmt.precision - 2:-1])
        sticky = product[:-fmt.precision - 2].any() | (top & product[-fmt.precision - 2])
        exponent = Signal.like(s.exponent)
        m.d.comb += exponent.eq(s.exponent + top)
        s = rank("normalise", sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, is_zero=s.is_zero,
                 exponent=exponent, extended=Cat(sticky, significand_and_guard))

        s = rank("result", result=round_and_pack(m, fmt, s))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m


def _product_is_tiny(fmt, a, b):
    """Whether the exact product of finite positive numbers lies below the least normal number.

    The product of the operands scaled to [1/2, 1) is taken without error as a sum of two numbers
    (T. J. Dekker, A floating-point technique for extending the available precision, 1971).
    """
    (a, a_exponent), (b, b_exponent) = np.frexp(a), np.frexp(b)
    splitter = fmt.dtype.type((1 << (fmt.precision + 1) // 2) + 1)
    a_high, b_high = splitter * a - (splitter * a - a), splitter * b - (splitter * b - b)
    a_low, b_low = a - a_high, b - b_high
    product = a * b
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    least = np.ldexp(fmt.dtype.type(1), 1 - fmt.bias - a_exponent - b_exponent)
    return (product < least) | ((product == least) & (error < 0))
