"""Sum of two products, rounded once."""

from types import SimpleNamespace

import numpy as np
from amaranth import *

from . import exact
from .pipeline import Pipeline, RoundedOperator, pick
from .rounding import Rounding
from .stages import leading_zeros, normalise, pack, partial_products, shift_right, sum_of_partial_products, unpack

__all__ = ["FpSumOfProducts"]


class FpSumOfProducts(RoundedOperator):
    """Sum of two products of floating-point numbers, ``result = a * b + c * d`` or ``a * b - c * d``, rounded once.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 to 10, or with gradual subnormals 1 to 11.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, c, d, subtract, start : In(format), In(format), In(format), In(format), In(1), In(1)
        Operands, any unit; 1 subtracts ``c * d``, 0 adds it. Taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded: the products are exact, and have any exponent.
    Special values: products and their sum follow ``FpMultiply`` and ``FpAdd``: a sum of zero is +0, or -0 if rounded
    downward, unless both products have the same sign; 0 * infinity, infinity - infinity and NaN operands give the
    format's NaN. Where subnormals are flushed, a product is not: only operands and the sum are.
    Flags: invalid for 0 * infinity, infinity - infinity and signalling NaNs; overflow, underflow, inexact as in
    ``Flags``.
    Raises: ValueError if ``latency`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *fusedMultiplyAdd*, for two products; H. H. Saleh and E. E. Swartzlander,
    A floating-point fused dot-product unit, ICCD 2008.
    """

    PIPELINE = Pipeline(cuts=("unpack", "partial", "product", "shift", "align", "sum", "coarse", "normalise", "round",
                              "result"),
                        priority=("result", "partial", "sum", "normalise", "shift", "coarse", "round", "product",
                                  "align", "unpack"), default_latency=8)
    # Subnormal results are aligned after they have been normalised.
    GRADUAL_PIPELINE = Pipeline(
        cuts=("unpack", "partial", "product", "shift", "align", "sum", "coarse", "normalise", "subnormal", "round",
              "result"),
        priority=("result", "partial", "sum", "normalise", "shift", "coarse", "round", "subnormal", "product", "align",
                  "unpack"), default_latency=9)

    def __init__(self, format, *, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__(format, {**dict.fromkeys("abcd", format.layout), "subtract": 1}, latency=latency,
                         rounding=rounding, flags=flags)

    def compute(self, a, b, c, d, subtract=False):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        operands = a, b, exact.negated(self._format, c, subtract), d
        if 2 * self._format.precision > 53:
            return exact.sum_of_products(self._format, *operands, self._rounding)[0]
        return exact.by_numpy(self._format, self._rounding, _sum_of_products, exact.sum_of_products, *operands)

    def compute_flags(self, a, b, c, d, subtract=False):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.sum_of_products(self._format, a, b, exact.negated(self._format, c, subtract), d,
                                     self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)
        width = fmt.exponent_width

        # Below the last place of the larger product come as many bits as a sum needs whose leading bits cancel, and a
        # sticky bit. Products of normal numbers are from 1 to 4. At a distance of 3 places one bit cancels at most, so
        # 2 bits are enough. The product of a normal and a subnormal number is at least 2**(p - 1) units of its last
        # place, so more than one bit cancels up to a distance of p + 2. That of two subnormals has the least exponent.
        guards = fmt.precision + 2 if fmt.gradual else 2
        length = 2 * fmt.precision + guards + 2
        levels = (length - 1).bit_length()

        # Unpack, and add the exponents. Flushing does not need the hidden bit: a product of zero is the smaller one,
        # and is shifted out. An infinite product is the larger one, for its sign.
        a, b, c, d = (unpack(m, fmt, getattr(self, name), name) for name in "abcd")
        first, second = _product_classes(a, b, 0), _product_classes(c, d, self.subtract)
        opposite, is_infinite = first.sign ^ second.sign, first.is_infinite | second.is_infinite
        cancels = first.is_infinite & second.is_infinite & opposite
        classes = {
            "opposite": opposite & ~is_infinite, "is_nan": first.is_nan | second.is_nan | cancels,
            "is_infinite": is_infinite,
            "zero_sign": first.sign | second.sign if self._rounding is Rounding.DOWNWARD else first.sign & second.sign}
        if self._flags:
            classes["invalid"] = first.is_invalid | second.is_invalid | (cancels & ~first.is_nan & ~second.is_nan)
        order = {"first_sign": first.sign, "second_sign": second.sign, "first_wins": first.is_infinite | second.is_zero,
                 "second_wins": second.is_infinite | first.is_zero, "one_is_zero": first.is_zero | second.is_zero,
                 "both_are_zero": first.is_zero & second.is_zero}
        s = rank("unpack", **classes, **order, first_exponent=a.exponent + b.exponent,
                 second_exponent=c.exponent + d.exponent, a=a.nonzero, b=b.nonzero, c=c.nonzero, d=d.nonzero)

        # Multiply by slices, and compare the exponents.
        difference = Signal(signed(width + 2))
        m.d.comb += difference.eq(s.second_exponent - s.first_exponent)
        s = rank("partial", **pick(s, classes, order, ("first_exponent", "second_exponent")), difference=difference,
                 **partial_products(s.a, s.b, "first_partial"), **partial_products(s.c, s.d, "second_partial"))

        # Add the partial products. The exponent is that of a sum whose top bit is one.
        swap = Signal()
        distance, exponent = Signal(width + 1), Signal(signed(max(width, levels) + 2))
        products = [Signal(2 * fmt.precision, name=name) for name in ("first", "second")]
        m.d.comb += [
            swap.eq(~s.first_wins & (s.second_wins | ~s.difference[-1])),
            distance.eq(Mux(s.difference[-1], -s.difference, s.difference)),
            exponent.eq(Mux(swap, s.second_exponent, s.first_exponent) - (fmt.bias - 2)),
            *(product.eq(sum_of_partial_products(s, f"{product.name}_partial")) for product in products)]
        numbers = ("sign", "exponent", "both_are_zero")
        s = rank("product", **pick(s, classes, ("one_is_zero", "both_are_zero")), exponent=exponent, swap=swap,
                 sign=Mux(swap, s.second_sign, s.first_sign), distance=distance, first=products[0], second=products[1])

        # The product of the smaller exponent moves right. A distant one leaves only the sticky bit.
        smaller = Mux(s.swap, s.first, s.second)
        if not fmt.gradual:
            smaller &= ~s.one_is_zero.replicate(len(smaller))
        distance = s.distance[:levels] | s.distance[levels:].any().replicate(levels)
        moves = [*enumerate(distance)]
        aligned, sticky = shift_right(m, Cat(C(0, guards), smaller), reversed(moves[levels // 2:]), "align")
        s = rank("shift", **pick(s, classes, numbers), larger=Mux(s.swap, s.second, s.first), aligned=aligned,
                 sticky=sticky, distance=distance[:levels // 2])
        aligned, lost = shift_right(m, s.aligned, reversed([*enumerate(s.distance)]), "align")
        s = rank("align", **pick(s, classes, numbers), larger=s.larger, smaller=Cat(s.sticky | lost, aligned))

        # Add. A difference is computed as in FpAdd: smaller + ~larger = -(larger - smaller) - 1. If its inverse is
        # negative, it is not inverted, and is one unit of the lowest bit too small.
        total = Signal(length)
        larger = Cat(C(0, guards + 1), s.larger, C(0, 1))
        m.d.comb += total.eq(s.smaller + (larger ^ s.opposite.replicate(length)))
        s = rank("sum", **pick(s, classes, numbers), total=total)
        magnitude = Signal(length)
        m.d.comb += magnitude.eq(s.total ^ (s.opposite & s.total[-1]).replicate(length))
        lacks_unit = s.opposite & ~s.total[-1]
        outcome = [name for name in classes if name != "opposite"] + ["both_are_zero"]

        # Normalise. The lowest bit is the sticky bit, or a one that is a unit too small, so it is repeated. The coarse
        # distance is counted before the first shift, in groups of bits. Only the groups that reach the guard bit after
        # the fine shift are moved. The others become sticky. Where a unit is lacking, they are those of the sum less
        # one unit: all ones stand for zeros.
        half = levels // 2
        size = 1 << half
        fill = magnitude[0].replicate(-length % size)
        padded = Cat(fill, magnitude)
        count, kept = len(padded) // size, -(-(fmt.precision + size) // size)
        occupied = Cat(padded[low:low + size].any() for low in range(0, len(padded), size))
        coarse, shifted = Signal(levels - half), padded
        m.d.comb += coarse.eq(leading_zeros(occupied)[1])
        for level in reversed(range(half, levels)):
            moved = Cat(magnitude[0].replicate(1 << level), shifted[:-(1 << level)])
            shifted = Mux(coarse[level - half], moved, shifted)
        rest = s.total ^ s.opposite.replicate(length)
        below = Cat(rest[max(index * size - len(fill), 0):(index + 1) * size - len(fill)].any()
                    & (coarse < count - kept - index) for index in range(count - kept)).any()
        s = rank("coarse", **pick(s, outcome), sign=s.sign ^ lacks_unit, exponent=s.exponent, lacks_unit=lacks_unit,
                 magnitude=shifted[-kept * size:], below=below, coarse=coarse)
        magnitude, fine = normalise(m, s.magnitude, "normalise", levels=range(half), fill=s.lacks_unit)
        exponent = Signal.like(s.exponent)
        m.d.comb += exponent.eq(s.exponent - Cat(C(0, half), s.coarse))
        outcome += ["sign", "lacks_unit"]
        s = rank("normalise", **pick(s, outcome, ("below",)), exponent=exponent, magnitude=magnitude, fine=fine)

        # The bits below the guard bit become sticky.
        exponent = Signal.like(s.exponent)
        m.d.comb += exponent.eq(s.exponent - s.fine)
        rest = s.magnitude[:-fmt.precision - 1]
        extended = Cat(s.below | (rest ^ s.lacks_unit.replicate(len(rest))).any(), s.magnitude[-fmt.precision - 1:])
        is_zero = ~s.magnitude[-1] | s.both_are_zero
        values = {**pick(s, outcome), "sign": Mux(is_zero, s.zero_sign, s.sign), "is_zero": is_zero}
        for name in "zero_sign", "both_are_zero":
            del values[name]
        outcome = list(values)
        if fmt.gradual:
            # A subnormal keeps the weight of exponent 1. It is tiny unless rounding carries from just below.
            tiny = exponent < 1
            if self._flags:
                up, _, _ = self._increment(s.sign, extended, s.lacks_unit)
                values["tiny"] = tiny & ~((exponent == 0) & extended[2:].all() & up)
                outcome.append("tiny")
            aligned = _align(m, extended, (1 - exponent)[:len(exponent)], s.lacks_unit)
            s = rank("subnormal", **values, exponent=Mux(tiny, 0, exponent), extended=Mux(tiny, aligned, extended))
            values, exponent, extended = pick(s, outcome), s.exponent, s.extended

        # Round.
        up, carries, inexact = self._increment(values["sign"], extended, values["lacks_unit"])
        rounded = Signal(fmt.fraction_width + len(exponent))
        m.d.comb += rounded.eq(Cat(extended[2:-1], exponent) + up)
        s = rank("round", **values, rounded=rounded, was_odd=exponent[0], carries=carries,
                 **({"inexact": inexact} if self._flags else {}))

        # Pack. A sum below the least normal number is flushed, also if it was rounded to this number.
        exponent = s.rounded[fmt.fraction_width:]
        overflow = ~s.is_zero & ~exponent[-1] & (exponent[width:-1].any() | exponent[:width].all())
        was_less = (s.was_odd ^ exponent[0]) & ~s.carries
        tiny = (exponent[-1] | ~exponent[1:].any() & (~exponent[0] | was_less)) & (not fmt.gradual)
        away = self._rounding.increments(s.sign, C(1), C(1), C(1))
        outputs = {"result": pack(
            m, fmt, s.sign, Mux(overflow & ~away, fmt.infinity - 1, s.rounded[:fmt.width - 1]), is_nan=s.is_nan,
            is_infinite=s.is_infinite | (overflow & away), is_zero=s.is_zero | tiny)}
        if self._flags:
            is_finite = ~(s.is_nan | s.is_infinite | s.is_zero)
            underflow = s.tiny & s.inexact if fmt.gradual else tiny
            outputs["flags"] = Cat(is_finite & (s.inexact | overflow | underflow), is_finite & underflow,
                                   is_finite & overflow, C(0, 1), s.invalid)
        s = rank("result", **outputs)
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m

    def _increment(self, sign, extended, lacks_unit):
        """Whether a significand is increased, whether this only adds the unit that it lacks, and whether it is inexact.

        ``extended`` has, from the low end, sticky bit, guard bit and significand.
        """
        sticky, guard = extended[0], extended[1]
        completes = lacks_unit & ~sticky
        increments = self._rounding.increments(sign, extended[2], guard ^ completes, sticky)
        return increments | (completes & guard), completes & guard, sticky | (guard ^ completes)


def _product_classes(a, b, subtract):
    undefined = (a.is_infinite & b.is_zero) | (a.is_zero & b.is_infinite)
    return SimpleNamespace(
        sign=a.sign ^ b.sign ^ subtract, is_nan=a.is_nan | b.is_nan | undefined,
        is_infinite=a.is_infinite | b.is_infinite, is_zero=a.is_zero | b.is_zero,
        is_invalid=a.is_signalling | b.is_signalling | undefined)


def _align(m, extended, below, lacks_unit):
    """``extended``, as in ``_increment``, shifted right by ``below``, the distance of its exponent below 1."""
    levels = len(extended).bit_length()
    # A bit that is shifted out leaves the sticky bit clear if it equals the bits of zero.
    tails = Cat(extended[1:] ^ lacks_unit.replicate(len(extended) - 1), lacks_unit.replicate(1 << levels))
    tails, lost = shift_right(m, tails, enumerate(below[:levels]), "subnormal")
    aligned = Cat(extended[0] | lost, tails[:len(extended) - 1] ^ lacks_unit.replicate(len(extended) - 1))
    return Mux(below[levels:].any(), 1, aligned)


def _sum_of_products(a, b, c, d):
    """The twin for formats of NumPy up to binary32, to nearest, ties to even.

    Products of two such numbers are exact in float64: they have 48 bits and exponents from -298 to 256. Knuth's TwoSum
    gives their sum, rounded, and its exact error, for sums in this range of exponents always. Where there is an error,
    and the last bit of the sum is even, the neighbour towards the exact sum has an odd one: the sum is then rounded to
    odd. Rounded again, to a precision less by two bits at least, it equals the exact sum, rounded once (S. Boldo and
    G. Melquiond, Emulation of FMA and correctly rounded sums, 2008).
    """
    first, second = (np.multiply(x, y, dtype=np.float64) for x, y in ((a, b), (c, d)))
    total = first + second
    part = total - first
    error = (first - (total - part)) + (second - part)
    even = total.view(np.int64) & 1 == 0
    inexact = np.isfinite(total) & (error != 0)
    neighbour = np.nextafter(total, np.copysign(np.inf, error))
    return np.where(inexact & even, neighbour, total).astype(a.dtype)
