"""Reciprocal and reciprocal square root by a table of parabolas, pipelined."""

import math
from functools import cache

import numpy as np
from amaranth import *

from .parabolas import SCALE, Parabolas, parabolas, reciprocal_value
from .pipeline import Pipeline, PipelinedOperator, pick
from .stages import pack, unpack

__all__ = ["FpTableReciprocal"]

INDEX_BITS = 8
"""Address bits of each half of the table: the intervals of one function."""
OFFSET_BITS = 16
"""Bits of the place inside an interval."""
FRACTION_BITS = 28, 25, 27
"""Fraction bits of c0, c1 and c2. A result is from 1/2 to 1."""
PRECISION = 24
"""The greatest precision of a format."""


class FpTableReciprocal(PipelinedOperator):
    """Reciprocal ``1 / a`` or reciprocal square root ``1 / sqrt(a)``, by a table and two multiplications.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and result, with a precision of 10 to 24 bits, an ``exponent_width`` of at least 3, and
        subnormals flushed.
    latency : int
        Register ranks, 1 to 7.
    quiet : bool
        True for a result that is zero while ``done`` is low.

    Members
    -------
    a, square_root, start : In(format), In(1), In(1)
        Operand, any unit; 1 takes the reciprocal of its square root. Taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: within 0.88 units in the last place of the exact value; exact for powers of two (1 / a) and of four.
    Special values: zeros give infinities of the same sign, +infinity gives +0 and, for 1 / a, -infinity gives -0;
    NaN, and for the square root other negative operands, give the format's NaN.
    Raises: ValueError if ``format`` or ``latency`` is out of range.
    Source: J.-M. Muller, Elementary Functions, 2016, table-based methods. The significand of ``a``, and for the root
    the parity of its exponent, select an interval and a place t in it; c0 + t (c1 + t c2) meets the function at three
    points of the interval. The bound is the sum, in units of 2**-24, of 0.08 from the interpolation,
    w**3 |f'''| / 192 for an interval of width w; 0.03, 0.13 and 0.02 from c0, c1 and c2, rounded; 0.13 from
    u = c1 + t c2, rounded; and 0.5 from the result, rounded.
    """

    # The table is read at an edge, so its rank is always there. The others are registers of block RAM and DSP blocks.
    PIPELINE = Pipeline(cuts=("table", "word", "bend", "slope", "product", "value", "result"),
                        priority=("table", "word", "slope", "value", "result", "product", "bend"), default_latency=5)

    def __init__(self, format, *, latency=None, quiet=False):
        if format.gradual or not 10 <= format.precision <= PRECISION or format.exponent_width < 3:
            raise ValueError("format must have a precision of 10 to 24 bits, an exponent_width of at least 3, and "
                             f"flush subnormals, not {format!r}")
        self._format = format
        super().__init__({"a": format.layout, "square_root": 1}, {"result": format.layout}, latency=latency,
                         quiet=quiet)

    @property
    def format(self):
        """Format of operand and result."""
        return self._format

    def compute(self, a, square_root):
        """Bit-exact software twin: arrays of the format's dtype and of bool, shapes that broadcast."""
        fmt = self._format
        a, square_root = np.broadcast_arrays(fmt.flush(np.asarray(a)), np.asarray(square_root, bool))
        bits = fmt.to_bits(a).astype(np.int64)
        exponent = bits >> fmt.fraction_width & fmt.exponent_special
        fraction = (bits & (1 << fmt.fraction_width) - 1) << (PRECISION - fmt.precision)

        odd = 1 - (exponent & 1)  # The bias is odd.
        by_root = 1 << INDEX_BITS | odd << INDEX_BITS - 1 | fraction >> OFFSET_BITS
        index = np.where(square_root, by_root, fraction >> OFFSET_BITS - 1)
        place = np.where(square_root, fraction, fraction << 1) & (1 << OFFSET_BITS) - 1
        value = _table(fmt.precision).compute(index, place, fmt.precision)

        stored = np.where(square_root, (3 * fmt.bias - 2 - exponent + odd) // 2, 2 * fmt.bias - 1 - exponent)
        # The highest bit of a value below one is the hidden bit of its format; one carries into the exponent.
        magnitude = (stored << fmt.fraction_width) + value - (1 << fmt.fraction_width)
        magnitude = np.where(magnitude < fmt.least_normal, 0, magnitude)
        magnitude = np.where(np.isinf(a), 0, np.where(a == 0, fmt.infinity, magnitude))
        magnitude = np.where(np.isnan(a) | square_root & (a < 0), fmt.nan, magnitude)
        sign = np.where(magnitude == fmt.nan, 0, bits >> fmt.width - 1)
        return fmt.from_bits(magnitude | sign << fmt.width - 1)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)
        table = _table(fmt.precision)

        # The address needs no logic but the choice between the two halves.
        a = unpack(m, fmt, self.a, "a")
        fraction = Cat(C(0, PRECISION - fmt.precision), self.a.fraction)
        odd = ~self.a.exponent[0]
        by_root = Cat(fraction[OFFSET_BITS:], odd)
        c0, c1, c2 = table.read(
            m, "table", Cat(Mux(self.square_root, by_root, fraction[OFFSET_BITS - 1:]), self.square_root))
        place = Mux(self.square_root, fraction[:OFFSET_BITS], Cat(C(0, 1), fraction[:OFFSET_BITS - 1]))

        # The exponent of a result below one; that of 1 is one greater. Both constants are chosen before the sum.
        exponent = Signal(signed(fmt.exponent_width + 2))
        m.d.comb += exponent.eq(Mux(self.square_root, 3 * (fmt.bias - 1) // 2 + 1 - (a.exponent + 1 >> 1),
                                    2 * fmt.bias - 1 - a.exponent))
        classes = {"sign": a.sign, "is_nan": a.is_nan | (self.square_root & a.sign & ~a.is_zero),
                   "is_infinite": a.is_zero, "is_zero": a.is_infinite}
        carried = {**classes, "exponent": exponent}
        s = rank("table", **carried, place=place)

        s = rank("word", **pick(s, carried), t=table.t(s.place), c0=c0, c1=c1, c2=c2)
        s = rank("bend", **pick(s, carried), t=s.t, c0=s.c0, c1=s.c1, bend=s.c2 * s.t)
        s = rank("slope", **pick(s, carried), t=s.t, c0=s.c0, slope=table.slope(s.c1, s.bend))
        s = rank("product", **pick(s, carried), c0=s.c0, product=s.slope * s.t)
        value = Signal(fmt.precision + 1)
        m.d.comb += value.eq(table.value(s.c0, s.product, fmt.precision))
        s = rank("value", **pick(s, carried), value=value)

        is_one = s.value[-1]
        stored = Signal(signed(fmt.exponent_width + 2))
        m.d.comb += stored.eq(s.exponent + is_one)
        s = rank("result", result=pack(
            m, fmt, s.sign, Cat(s.value[:fmt.fraction_width], stored[:fmt.exponent_width]), is_nan=s.is_nan,
            is_infinite=s.is_infinite, is_zero=s.is_zero | (stored < 1)))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m


@cache
def _table(precision):
    """Parabolas of 1/x for x in [1, 2), then of 1/sqrt(x) for x in [1, 2) and in [2, 4)."""
    count = 1 << INDEX_BITS
    return Parabolas.of(
        [*parabolas(reciprocal_value, 1, 1, count), *parabolas(_reciprocal_root, 1, 1, count // 2),
         *parabolas(_reciprocal_root, 2, 2, count // 2)], FRACTION_BITS, OFFSET_BITS, precision)


def _reciprocal_root(numerator, denominator):
    return math.isqrt((denominator << 2 * SCALE) // numerator)
