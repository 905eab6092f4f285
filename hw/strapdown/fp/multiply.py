"""Multiplication."""

import numpy as np
from amaranth import *

from . import exact
from .pipeline import Pipeline, RoundedOperator, pick
from .rounding import Rounding
from .stages import (
    FINE_LEVELS,
    align_subnormal,
    normalise,
    pack,
    partial_products,
    sum_of_partial_products,
    unpack,
)

__all__ = ["FpMultiply"]


class FpMultiply(RoundedOperator):
    """Product of two floating-point numbers, ``result = a * b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 to 6, or with gradual subnormals 1 to 8.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.
    quiet : bool
        True for outputs that are zero while ``done`` is low.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded.
    Special values: 0 * infinity and NaN operands give the format's NaN.
    Flags: invalid for 0 * infinity and signalling NaNs; overflow, underflow, inexact as in ``Flags``.
    Raises: ValueError if ``latency`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *multiplication*.
    """

    # Ranks at "unpack", "partial" and "product" use the registers inside DSP blocks. A rank between the
    # products of the slices and their sum is best for an ECP5, which has smaller blocks.
    PIPELINE = Pipeline(cuts=("unpack", "partial", "product", "normalise", "round", "result"),
                        priority=("result", "partial", "product", "normalise", "unpack", "round"), default_latency=3)
    # Subnormal operands are normalised before the product, subnormal results aligned after it.
    GRADUAL_PIPELINE = Pipeline(
        cuts=("coarse", "unpack", "partial", "product", "normalise", "align", "round", "result"),
        priority=("result", "partial", "normalise", "unpack", "align", "coarse", "product", "round"), default_latency=6)

    def __init__(self, format, *, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False, quiet=False):
        super().__init__(format, {"a": format.layout, "b": format.layout}, latency=latency, rounding=rounding,
                         flags=flags, quiet=quiet)

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return exact.by_numpy(self._format, self._rounding, np.multiply, exact.multiply, a, b)

    def compute_flags(self, a, b):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.multiply(self._format, a, b, self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)
        width = fmt.exponent_width

        # Unpack. The class flags mark a zero, so flushing does not need the significands.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        undefined = (a.is_infinite & b.is_zero) | (a.is_zero & b.is_infinite)
        classes = {"sign": a.sign ^ b.sign, "is_nan": a.is_nan | b.is_nan | undefined,
                   "is_infinite": a.is_infinite | b.is_infinite, "is_zero": a.is_zero | b.is_zero}
        if self._flags:
            classes["invalid"] = a.is_signalling | b.is_signalling | undefined
        exponent = Signal(signed(max(width, fmt.fraction_width.bit_length()) + 2))
        if fmt.gradual:
            # One normaliser is enough: the product of two subnormals is shifted right anyway.
            swap, levels = ~b.significand[-1], range((fmt.precision - 1).bit_length())
            # The selection of the operand takes as long as one level.
            fine_levels, coarse_levels = levels[:FINE_LEVELS + 1], levels[FINE_LEVELS + 1:]
            multiplicand, coarse = normalise(m, Mux(swap, b.significand, a.significand), "coarse",
                                             levels=coarse_levels)
            s = rank("coarse", **classes, multiplicand=multiplicand, multiplier=Mux(swap, a.significand, b.significand),
                     coarse=coarse, exponent=a.exponent + b.exponent)
            classes, multiplier = pick(s, classes), s.multiplier
            multiplicand, fine = normalise(m, s.multiplicand, "normalise", levels=fine_levels)
            m.d.comb += exponent.eq(s.exponent - fmt.bias - Cat(fine, s.coarse))
        else:
            multiplicand, multiplier = Cat(self.a.fraction, C(1, 1)), Cat(self.b.fraction, C(1, 1))
            # a + b - bias = (a + b + 1) - 2**(width - 1): one adder, and logic on its two top bits.
            total = Signal(width + 1)
            m.d.comb += [total.eq(a.exponent - ~b.exponent),
                         exponent.eq(Cat(total[:-2], ~total[-2], total[-2:] == 1, (total[-2:] == 2).replicate(2)))]
        s = rank("unpack", **classes, exponent=exponent, multiplicand=multiplicand, multiplier=multiplier)

        # Multiply by slices, and add the partial products.
        s = rank("partial", **pick(s, classes), exponent=s.exponent,
                 **partial_products(s.multiplicand, s.multiplier))
        product = Signal(2 * fmt.precision)
        m.d.comb += product.eq(sum_of_partial_products(s))
        s = rank("product", **pick(s, classes), exponent=s.exponent, product=product)

        # Normalise: the product of two numbers in [1, 2) is in [1, 4). With ``carry`` the exponent is one
        # greater. The check of its range does not need this addition; the rounding adder makes it.
        exponent, carry = s.exponent, s.product[-1]
        sticky = s.product[:-fmt.precision - 2].any() | (carry & s.product[-fmt.precision - 2])
        extended = Cat(sticky, Mux(carry, s.product[-fmt.precision - 1:], s.product[-fmt.precision - 2:-1]))
        tiny = exponent[-1] | ~(exponent.any() | carry)
        overflow = ~exponent[-1] & (exponent[width:-1].any() | (exponent[1:width].all() & (exponent[0] | carry)))
        outcome, aside = {**pick(s, classes), "tiny": tiny, "overflow": overflow}, {}
        if fmt.gradual:
            if self._flags:
                # Tininess after rounding: just below the least normal number the significand may
                # carry, although its subnormal form is rounded at a higher bit.
                up = self._rounding.increments(s.sign, extended[2], extended[1], extended[0])
                outcome["tiny"] = tiny & ~(((exponent + carry) == 0) & extended[2:].all() & up)
            below = Signal(len(exponent))
            m.d.comb += below.eq(1 - exponent - carry)
            aside = {"subnormal": tiny, "below": below}
        s = rank("normalise", **outcome, **aside, exponent=exponent[:width], carry=carry, extended=extended)

        if fmt.gradual:
            # A subnormal keeps the weight of exponent 1.
            aligned = align_subnormal(m, s.extended, s.below)
            s = rank("align", **pick(s, outcome), exponent=Mux(s.subnormal, 0, s.exponent),
                     carry=s.carry & ~s.subnormal, extended=Mux(s.subnormal, aligned, s.extended))

        # Round.
        inexact = s.extended[:2].any()
        up = self._rounding.increments(s.sign, s.extended[2], s.extended[1], s.extended[0])
        rounded = Signal(fmt.width - 1)
        m.d.comb += rounded.eq(Cat(s.extended[2:-1], s.exponent) + Cat(up, C(0, fmt.fraction_width - 1), s.carry))
        s = rank("round", **pick(s, outcome), rounded=rounded, **({"inexact": inexact} if self._flags else {}))

        # Pack.
        tiny = s.tiny & (not fmt.gradual)
        away = self._rounding.increments(s.sign, C(1), C(1), C(1))
        outputs = {"result": pack(
            m, fmt, s.sign, Mux(s.overflow & ~away, fmt.infinity - 1, s.rounded), is_nan=s.is_nan,
            is_infinite=s.is_infinite | (s.overflow & away), is_zero=s.is_zero | tiny)}
        if self._flags:
            is_finite = ~(s.is_nan | s.is_infinite | s.is_zero)
            outputs["flags"] = Cat(
                is_finite & (s.inexact | s.overflow | tiny), is_finite & s.tiny & (s.inexact | tiny),
                is_finite & (s.overflow | (s.rounded[fmt.fraction_width:].all() & ~tiny)), C(0, 1), s.invalid)
        s = rank("result", **outputs)
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m
