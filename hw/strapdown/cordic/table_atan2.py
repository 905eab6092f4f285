"""Angle of a vector by two tables of parabolas, pipelined."""

from functools import cache

import numpy as np
from amaranth import *

from strapdown.fp.parabolas import SCALE as FUNCTION_SCALE
from strapdown.fp.parabolas import Parabolas, parabolas, reciprocal_value
from strapdown.fp.pipeline import Pipeline, PipelinedOperator, pick
from strapdown.fp.stages import partial_products, sum_of_partial_products, unpack

from .tables import SCALE, encode_scaled, round_shift, scaled_angle, scaled_atan

__all__ = ["TableAtan2"]

INDEX_BITS = 9
"""Address bits of both tables."""
PRECISION = 24
"""The greatest precision of a format."""
RATIO_BITS = 27
"""Fraction bits of the reciprocal and of the ratio."""
LACK_BITS = 25
"""Fraction bits of 1 - a."""
ANGLE_BITS = 29
"""Fraction bits of the angle."""
RECIPROCAL_OFFSET = PRECISION - 1 - INDEX_BITS
LACK_OFFSET = RATIO_BITS - INDEX_BITS
"""Bits of the place inside an interval of each table."""

NAN, COMPUTED = 5, 6
"""Sources of an angle: the numbers 0 to 4 mean that many eighths of a turn."""


class TableAtan2(PipelinedOperator):
    """Four-quadrant arctangent, ``result = atan2(y, x)``, by two tables and multiplications.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result, with a precision of 10 to 24 bits, an ``exponent_width`` of at least 5, and
        subnormals flushed.
    degrees : bool
        True for an angle in degrees, False for radians.
    latency : int
        Register ranks, 2 to 17.

    Members
    -------
    y, x, start : In(format), In(format), In(1)
        Ordinate and abscissa, any common unit, taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Angle from the x axis to (x, y), from -180 to 180 degrees or from -pi to pi as rounded to the format; valid
        while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: within 1.8 units in the last place of the exact angle.
    Special values: as C99 for signed zeros and infinities; every multiple of 45 degrees is correctly rounded; a NaN
    operand gives the format's NaN.
    Raises: ValueError if ``format`` or ``latency`` is out of range.
    Source: ISO/IEC 9899:1999, F.9.1.4; J.-M. Muller, Elementary Functions, 2016, table-based methods. With r, the ratio
    of the smaller to the larger operand, the angle is r a(r) in the first eighth of a turn, a(r) = atan(r) / r, and in
    the others it is subtracted from, or added to, 90 or 180 degrees. A table gives the reciprocal of the larger
    significand, another one 1 - a(r), which is less than 1/3. The bound is the sum, in relative units of 2**-24, of
    0.46 from the reciprocal, 0.25 from the ratio, 0.49 from a and 0.09 from the product, each cut off or rounded, and
    of 0.5 from the result, rounded. In the other octants r is cut off, which adds 0.13, but r a(r) is less than 0.9
    units of 64 degrees or 1 rad, and the sum of both is smaller.
    """

    # Both tables are read at an edge, so their ranks are always there.
    PIPELINE = Pipeline(
        cuts=("order", "table", "word", "slope", "value", "partial", "ratio", "shift", "angle_table", "angle_word",
              "angle_slope", "angle_value", "angle_partial", "angle", "octant", "normalise", "result"),
        priority=("table", "angle_table", "result", "order", "word", "angle_word", "slope", "value", "ratio", "shift",
                  "angle_slope", "angle_value", "angle", "octant", "normalise", "partial", "angle_partial"),
        default_latency=17)

    def __init__(self, format, *, degrees=False, latency=None):
        if format.gradual or not 10 <= format.precision <= PRECISION or format.exponent_width < 5:
            raise ValueError("format must have a precision of 10 to 24 bits, an exponent_width of at least 5, and "
                             f"flush subnormals, not {format!r}")
        self._format, self._degrees = format, bool(degrees)
        super().__init__({"y": format.layout, "x": format.layout}, {"result": format.layout}, latency=latency)
        if self.latency < 2:
            raise ValueError(f"latency must be from 2 to {len(self.PIPELINE.cuts)}, not {latency!r}")
        # The unit of an angle is 64 degrees or 1 rad.
        self._exponent = 6 if self._degrees else 0
        eighth = 45 << SCALE if self._degrees else scaled_atan(0)
        self._half, self._whole = (round_shift(n * eighth, SCALE + self._exponent - ANGLE_BITS) for n in (2, 4))
        self._constants = [*(encode_scaled(format, n * eighth) for n in range(5)), format.nan]

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    @property
    def degrees(self):
        """True if the angle is in degrees."""
        return self._degrees

    def compute(self, y, x):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        fmt = self._format
        y, x = np.broadcast_arrays(fmt.array(y), fmt.array(x))
        negative_y, negative_x, is_nan = np.signbit(y), np.signbit(x), np.isnan(y) | np.isnan(x)
        bits = [fmt.to_bits(np.abs(values)).astype(np.int64) for values in (y, x)]
        kind = np.select(
            [is_nan, (y == 0) | np.isinf(x) & ~np.isinf(y), (x == 0) | np.isinf(y) & ~np.isinf(x), bits[0] == bits[1]],
            [NAN, np.where(negative_x, 4, 0), 2, np.where(negative_x, 3, 1)], COMPUTED)

        swap = bits[0] > bits[1]
        short, long = np.minimum(*bits), np.maximum(*bits)
        hidden, spare = 1 << fmt.fraction_width, PRECISION - fmt.precision
        smaller, larger = ((number & hidden - 1 | hidden) << spare for number in (short, long))
        distance = (long >> fmt.fraction_width) - (short >> fmt.fraction_width)
        reciprocal = _reciprocals().compute(larger >> RECIPROCAL_OFFSET & (1 << INDEX_BITS) - 1,
                                            larger & (1 << RECIPROCAL_OFFSET) - 1, RATIO_BITS)
        ratio = smaller * reciprocal >> PRECISION - 1
        shifted = np.where(distance > RATIO_BITS, 0, ratio >> np.minimum(distance, RATIO_BITS))
        shifted = np.minimum(shifted, (1 << RATIO_BITS) - 1)  # Equal operands are not computed.
        lack = _lacks(self._degrees).compute(shifted >> LACK_OFFSET, shifted & (1 << LACK_OFFSET) - 1, LACK_BITS)

        small = ~swap & ~negative_x
        factor = np.where(small, ratio, shifted)
        angle = (factor << LACK_BITS) - factor * lack >> RATIO_BITS + LACK_BITS - ANGLE_BITS
        base = np.where(swap, self._half, np.where(negative_x, self._whole, 0))
        angle = base + np.where(swap ^ negative_x, -angle, angle)

        zeros = 2 + ANGLE_BITS - np.frexp(angle)[1]
        top = angle << zeros
        encoded = ((fmt.bias + self._exponent + 1 - zeros - np.where(small, distance, 0) << fmt.fraction_width)
                   + (top >> ANGLE_BITS + 2 - fmt.precision) - hidden + (top >> ANGLE_BITS + 1 - fmt.precision & 1))
        encoded = np.where(encoded < fmt.least_normal, 0, encoded)
        encoded = np.where(kind == COMPUTED, encoded, np.array([*self._constants, 0])[kind])
        return fmt.from_bits(encoded | (negative_y & ~is_nan).astype(np.int64) << fmt.width - 1)

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)
        reciprocals, lacks = _reciprocals(), _lacks(self._degrees)

        # Order the operands by their magnitudes, and find the special cases.
        y, x = unpack(m, fmt, self.y, "y"), unpack(m, fmt, self.x, "x")
        magnitudes = [Value.cast(operand)[:-1] for operand in (self.y, self.x)]
        swap = Signal()
        kind = Signal(range(COMPUTED + 1), name="case")
        m.d.comb += swap.eq(magnitudes[0] > magnitudes[1])
        with m.If(y.is_nan | x.is_nan):
            m.d.comb += kind.eq(NAN)
        with m.Elif(y.is_zero | (x.is_infinite & ~y.is_infinite)):
            m.d.comb += kind.eq(Mux(x.sign, 4, 0))
        with m.Elif(x.is_zero | (y.is_infinite & ~x.is_infinite)):
            m.d.comb += kind.eq(2)
        with m.Elif(magnitudes[0] == magnitudes[1]):
            m.d.comb += kind.eq(Mux(x.sign, 3, 1))
        with m.Else():
            m.d.comb += kind.eq(COMPUTED)
        short, long = Mux(swap, magnitudes[1], magnitudes[0]), Mux(swap, magnitudes[0], magnitudes[1])
        padding = C(0, PRECISION - fmt.precision)
        s = rank("order", kind=kind, sign=y.sign, swap=swap, back=x.sign, short=short, long=long)

        larger = Cat(padding, s.long[:fmt.fraction_width])
        c0, c1, c2 = reciprocals.read(m, "reciprocals", larger[RECIPROCAL_OFFSET:])
        distance = Signal(fmt.exponent_width)
        m.d.comb += distance.eq(s.long[fmt.fraction_width:] - s.short[fmt.fraction_width:])
        carried = ["kind", "sign", "swap", "back", "distance", "smaller"]
        s = rank("table", **pick(s, ("kind", "sign", "swap", "back")), distance=distance,
                 smaller=Cat(padding, s.short[:fmt.fraction_width], C(1, 1)), place=larger[:RECIPROCAL_OFFSET])
        s = rank("word", **pick(s, carried), t=reciprocals.t(s.place), c0=c0, c1=c1, c2=c2)
        s = rank("slope", **pick(s, carried), t=s.t, c0=s.c0, slope=reciprocals.slope(s.c1, s.c2 * s.t))
        reciprocal = Signal(RATIO_BITS + 1)
        m.d.comb += reciprocal.eq(reciprocals.value(s.c0, s.slope * s.t, RATIO_BITS))
        s = rank("value", **pick(s, carried), reciprocal=reciprocal)

        # The ratio, and the ratio in its place.
        carried = ["kind", "sign", "swap", "back", "distance"]
        s = rank("partial", **pick(s, carried), **partial_products(s.smaller, s.reciprocal))
        ratio = Signal(RATIO_BITS + 1)
        m.d.comb += ratio.eq(sum_of_partial_products(s) >> PRECISION - 1)
        s = rank("ratio", **pick(s, carried), ratio=ratio)
        shifted = Signal(RATIO_BITS)
        m.d.comb += shifted.eq(Mux(s.distance[5:].any(), 0, s.ratio >> s.distance[:5]))
        s = rank("shift", **pick(s, carried), ratio=s.ratio, shifted=shifted)

        c0, c1, c2 = lacks.read(m, "lacks", s.shifted[LACK_OFFSET:])
        small = ~s.swap & ~s.back
        carried = ["kind", "sign", "swap", "back", "distance", "factor"]
        s = rank("angle_table", **pick(s, carried[:4]), distance=Mux(small, s.distance, 0),
                 factor=Mux(small, s.ratio, s.shifted), place=s.shifted[:LACK_OFFSET])
        s = rank("angle_word", **pick(s, carried), t=lacks.t(s.place), c0=c0, c1=c1, c2=c2)
        s = rank("angle_slope", **pick(s, carried), t=s.t, c0=s.c0, slope=lacks.slope(s.c1, s.c2 * s.t))
        lack = Signal(LACK_BITS - 1)
        m.d.comb += lack.eq(lacks.value(s.c0, s.slope * s.t, LACK_BITS))
        s = rank("angle_value", **pick(s, carried), lack=lack)

        s = rank("angle_partial", **pick(s, carried), **partial_products(s.lack, s.factor))
        angle = Signal(ANGLE_BITS + 1)
        m.d.comb += angle.eq((Cat(C(0, LACK_BITS), s.factor) - sum_of_partial_products(s))
                             >> RATIO_BITS + LACK_BITS - ANGLE_BITS)
        carried = ["kind", "sign", "distance"]
        s = rank("angle", **pick(s, carried, ("swap", "back")), angle=angle)

        # The other octants.
        subtract = s.swap ^ s.back
        whole = Signal(ANGLE_BITS + 2)
        base = Mux(s.swap, self._half, Mux(s.back, self._whole, 0))
        m.d.comb += whole.eq(base + (s.angle ^ subtract.replicate(ANGLE_BITS + 2)) + subtract)
        s = rank("octant", **pick(s, carried), angle=whole)

        zeros = Mux(s.angle[-1], 0, Mux(s.angle[-2], 1, Mux(s.angle[-3], 2, 3)))
        top = Signal(fmt.precision + 1)
        exponent = Signal(signed(fmt.exponent_width + 2))
        m.d.comb += [top.eq((s.angle << zeros)[:ANGLE_BITS + 2] >> ANGLE_BITS + 1 - fmt.precision),
                     exponent.eq(fmt.bias + self._exponent + 1 - zeros - s.distance)]
        s = rank("normalise", **pick(s, ("kind", "sign")), top=top, exponent=exponent)

        rounded = Signal(fmt.width + 1)
        m.d.comb += rounded.eq(Cat(s.top[1:-1], s.exponent) + s.top[0])
        tiny = rounded[-1] | ~rounded[fmt.fraction_width:].any()
        magnitude = Signal(fmt.width - 1)
        with m.Switch(s.kind):
            for number, constant in enumerate(self._constants):
                with m.Case(number):
                    m.d.comb += magnitude.eq(constant)
            with m.Default():
                m.d.comb += magnitude.eq(Mux(tiny, 0, rounded))
        sign = s.sign | (s.kind == NAN) if fmt.negative_nan else s.sign & (s.kind != NAN)
        s = rank("result", result=Cat(magnitude, sign))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]
        return m


@cache
def _reciprocals():
    """Parabolas of 1/x for x in [1, 2)."""
    return Parabolas.of(parabolas(reciprocal_value, 1, 1, 1 << INDEX_BITS), (28, 26, 28), RECIPROCAL_OFFSET,
                        RATIO_BITS)


@cache
def _lacks(degrees):
    """Parabolas of 1 - a(r) for r in [0, 1), with a(r) = atan(r) / r in units of 64 degrees or 1 rad."""
    def lack(numerator, denominator):
        quotient = scaled_angle(numerator, denominator, SCALE) * denominator // numerator
        # 45 degrees are atan(1).
        quotient = (quotient * 45 << SCALE - 6) // scaled_atan(0) if degrees else quotient
        return (1 << FUNCTION_SCALE) - (quotient >> SCALE - FUNCTION_SCALE)

    return Parabolas.of(parabolas(lack, 0, 1, 1 << INDEX_BITS), (28, 27, 30), LACK_OFFSET, LACK_BITS)
