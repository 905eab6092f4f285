"""The specification of results in exact integers, without bits shifted out, sticky bits or normalisation.

A finite number of a format is ``value`` units of 2**-places. A result of the circuit is correct if the exact
result lies between the midpoints to its two neighbours. Quotients and roots are compared without computing them.
"""

import operator
from types import SimpleNamespace

from amaranth import *
from amaranth.asserts import AnyConst, Initial
from amaranth.hdl import Assert, Assume, Cover
from amaranth.lib.wiring import In

__all__ = ["FixedResult", "FloatResult", "Extreme", "Relation", "EXACT"]


def places(fmt):
    """The least subnormal number is one unit of 2**-places."""
    return fmt.bias - 1 + fmt.fraction_width


def weigh(fmt, magnitude):
    """An encoding without sign, in units; infinity counts as the number after the greatest."""
    exponent, fraction = magnitude[fmt.fraction_width:], magnitude[:fmt.fraction_width]
    normal = exponent.any()
    return Cat(fraction, normal) << Mux(normal, exponent - 1, 0)[:fmt.exponent_width]


def number(fmt, encoded):
    """An operand: classes, sign, and value in units, also for infinity; subnormals follow the policy."""
    encoded = Value.cast(encoded)
    magnitude = encoded[:-1]
    tiny = magnitude < fmt.least_normal
    value = weigh(fmt, magnitude)
    return SimpleNamespace(
        sign=encoded[-1], is_nan=magnitude > fmt.infinity, is_infinite=magnitude == fmt.infinity,
        value=value if fmt.gradual else Mux(tiny, 0, value))


def signed_value(x):
    """An operand's value with its sign; infinity is beyond all numbers."""
    return Mux(x.sign, -x.value, x.value)


# The exact results: sign, and ``scaled`` * 4 / ``per(1)`` in units, where a candidate c for four times the
# magnitude, in units of the result, is less than it if ``per(c)`` is less than ``scaled``.

def _sum(op, down):
    fmt = op.format
    a, b = number(fmt, op.a), number(fmt, op.b)
    b.sign = b.sign ^ op.subtract
    total = signed_value(a) + signed_value(b)
    infinite = a.is_infinite | b.is_infinite
    zero_sign = Mux(a.sign == b.sign, a.sign, down)
    return SimpleNamespace(
        is_nan=a.is_nan | b.is_nan | (a.is_infinite & b.is_infinite & (a.sign ^ b.sign)),
        is_infinite=infinite, by_zero=C(0),
        sign=Mux(infinite, Mux(a.is_infinite, a.sign, b.sign), Mux(total == 0, zero_sign, total < 0)),
        scaled=4 * abs(total), per=lambda c: c)


def _product(op, down):
    fmt = op.format
    a, b = number(fmt, op.a), number(fmt, op.b)
    infinite = a.is_infinite | b.is_infinite
    return SimpleNamespace(
        is_nan=a.is_nan | b.is_nan | (infinite & ((a.value == 0) | (b.value == 0))), is_infinite=infinite,
        by_zero=C(0), sign=a.sign ^ b.sign, scaled=4 * (a.value * b.value), per=lambda c: c << places(fmt))


def _sum_of_products(op, down):
    fmt = op.format
    a, b, c, d = (number(fmt, operand) for operand in (op.a, op.b, op.c, op.d))
    sign, other = a.sign ^ b.sign, c.sign ^ d.sign ^ op.subtract
    total = Mux(sign, -(a.value * b.value), a.value * b.value) + Mux(other, -(c.value * d.value), c.value * d.value)
    infinite, too = a.is_infinite | b.is_infinite, c.is_infinite | d.is_infinite
    # A product that is undefined also counts where an operand of the other one is NaN.
    undefined = (infinite & ((a.value == 0) | (b.value == 0))) | (too & ((c.value == 0) | (d.value == 0)))
    is_nan = a.is_nan | b.is_nan | c.is_nan | d.is_nan
    cancels = infinite & too & (sign ^ other)
    return SimpleNamespace(
        is_nan=is_nan | undefined | cancels, invalid=undefined | (cancels & ~is_nan),
        is_infinite=infinite | too, by_zero=C(0),
        sign=Mux(infinite, sign, Mux(too, other, Mux(total == 0, Mux(sign == other, sign, down), total < 0))),
        scaled=4 * abs(total), per=lambda candidate: candidate << places(fmt))


def _quotient(op, down):
    fmt = op.format
    a, b = number(fmt, op.a), number(fmt, op.b)
    by_zero = (b.value == 0) & (a.value != 0) & ~a.is_infinite
    # A number divided by infinity is zero: four times it is neither above nor below 0.
    return SimpleNamespace(
        is_nan=a.is_nan | b.is_nan | (a.is_infinite & b.is_infinite) | ((a.value == 0) & (b.value == 0)),
        is_infinite=a.is_infinite | by_zero, by_zero=by_zero, sign=a.sign ^ b.sign,
        scaled=Mux(b.is_infinite, 0, 4 * (a.value << places(fmt))), per=lambda c: c * b.value)


def _square_root(op, down):
    fmt = op.format
    a = number(fmt, op.a)
    return SimpleNamespace(
        is_nan=a.is_nan | (a.sign & (a.value != 0)), is_infinite=a.is_infinite, by_zero=C(0), sign=a.sign,
        scaled=16 * (a.value << places(fmt)), per=lambda c: c * c)


def _reciprocal_square_root(op, down):
    fmt = op.format
    a = number(fmt, op.a)
    return SimpleNamespace(
        is_nan=a.is_nan | (a.sign & (a.value != 0)), is_infinite=a.value == 0, by_zero=a.value == 0, sign=a.sign,
        scaled=Mux(a.is_infinite, 0, C(16 << 3 * places(fmt))), per=lambda c: c * c * a.value)


def _resized(op, down):
    a = number(op.from_format, op.a)
    return SimpleNamespace(
        is_nan=a.is_nan, is_infinite=a.is_infinite, by_zero=C(0), sign=a.sign,
        scaled=4 * a.value << places(op.to_format), per=lambda c: c << places(op.from_format))


def _from_fixed(op, down):
    return SimpleNamespace(
        is_nan=C(0), is_infinite=C(0), by_zero=C(0), sign=op.operand < 0,
        scaled=4 * abs(op.operand) << places(op.format), per=lambda c: c << op.fraction_bits)


EXACT = {"FpAdd": _sum, "FpMultiply": _product, "FpSumOfProducts": _sum_of_products, "FpDivide": _quotient,
         "FpSquareRoot": _square_root,
         "FpReciprocalSquareRoot": _reciprocal_square_root, "FpToFp": _resized, "FixedToFp": _from_fixed}
"""Maps the class of an operator to its exact result."""


class _Result(Elaboratable):
    """Base: an arbitrary operation, started in the first state and examined ``latency`` edges later."""

    def __init__(self, op):
        self.op = op

    def claim(self, m, op):
        """Assert the values of the outputs in the cycle of ``done``."""
        raise NotImplementedError

    def elaborate(self, platform):
        m = Module()
        # No reset, because it would end the operation.
        m.d.comb += Assume(~ResetSignal())
        m.submodules.op = op = self.op
        for name, member in op.signature.members.items():
            if member.flow is In:
                port = Value.cast(getattr(op, name))
                m.d.comb += port.eq(Initial() if name == "start" else AnyConst(len(port)))
        age = Signal(op.latency)
        m.d.sync += age.eq(Cat(Initial(), age))
        with m.If(age[-1]):
            m.d.comb += [Assert(op.done), Cover(op.done)]
            self.claim(m, op)
        return m


def _misplaced(exact, rounding, magnitude, value):
    """Compares a magnitude with the rounded exact result: (too small, too large); the second is for magnitudes above 0.

    ``value`` gives the units of a magnitude.
    """
    def below(candidate):
        return exact.per(candidate) < exact.scaled

    def up_to(candidate):
        return exact.per(candidate) <= exact.scaled

    less, same, more = (value((magnitude + step)[:len(magnitude)]) for step in (-1, 0, 1))
    low, high = (less + same) << 1, (same + more) << 1
    match rounding:
        case "nearest_even":
            # A tie is rounded to the even neighbour.
            odd = magnitude[0]
            return Mux(odd, up_to(high), below(high)), Mux(odd, ~below(low), ~up_to(low))
        case "nearest_away":
            return up_to(high), ~up_to(low)
        case "toward_zero":
            outward = C(0)
        case "upward":
            outward = ~exact.sign
        case "downward":
            outward = exact.sign
    return (Mux(outward, below(same << 2), up_to(more << 2)), Mux(outward, ~below(less << 2), ~up_to(same << 2)))


def _goes_outward(exact, rounding):
    """True if a result beyond the greatest finite number is rounded away from it."""
    return {"toward_zero": C(0), "upward": ~exact.sign, "downward": exact.sign}.get(rounding, C(1))


class FloatResult(_Result):
    """The result of an operator of ``EXACT`` is the exact one, rounded once; also its flags, if it has any."""

    def claim(self, m, op):
        fmt = getattr(op, "to_format", None) or op.format
        rounding = rounding_of(op)
        exact = EXACT[type(op).__name__](op, C(int(rounding == "downward"), 1))
        result = Value.cast(op.result)
        magnitude, sign = result[:-1], result[-1]
        least = exact.per(C(1 << fmt.fraction_width + 2))
        tiny = exact.scaled < least
        with m.If(exact.is_nan):
            m.d.comb += Assert(result == fmt.nan)
        with m.Elif(exact.is_infinite):
            m.d.comb += [Assert(magnitude == fmt.infinity), Assert(sign == exact.sign)]
        with m.Elif(tiny & (not fmt.gradual)):
            m.d.comb += [Assert(magnitude == 0), Assert(sign == exact.sign)]
        with m.Else():
            m.d.comb += Assert(sign == exact.sign)
            limit = Mux(_goes_outward(exact, rounding), fmt.infinity, fmt.infinity - 1)
            too_small, too_large = _misplaced(exact, rounding, magnitude, lambda encoding: weigh(fmt, encoding))
            m.d.comb += [Assert(magnitude <= limit), Assert(~too_small | (magnitude == limit)),
                         Assert(~too_large | (magnitude == 0))]
        if "flags" in op.signature.members:
            self.claim_flags(m, op, fmt, exact, tiny, magnitude, rounding)

    def claim_flags(self, m, op, fmt, exact, tiny, magnitude, rounding):
        """IEEE 754-2019, 7, with tininess after rounding; flushed results raise underflow and inexact."""
        flags = op.flags
        finite = ~exact.is_nan & ~exact.is_infinite
        operands = [Value.cast(getattr(op, name)) for name in "abcd" if name in op.signature.members]
        source = getattr(op, "from_format", fmt)
        nans = [number(source, operand).is_nan for operand in operands]
        signalling = Cat(nan & ~operand[source.fraction_width - 1]
                         for nan, operand in zip(nans, operands, strict=True)).any()
        infinity = exact.per(C(1 << fmt.precision + fmt.exponent_special))
        flushed = finite & tiny & (exact.scaled != 0) if not fmt.gradual else C(0)
        overflow = (magnitude == fmt.infinity) | (infinity <= exact.scaled)
        # Infinity is never exact, not even for the number by which it is represented here.
        inexact = overflow | (exact.per(weigh(fmt, magnitude) << 2) != exact.scaled)
        # With unbounded exponents, the distance of numbers just below the least normal one is half as large.
        half, quarter = (exact.per(C((1 << fmt.fraction_width + 2) - part)) for part in (2, 1))
        stays_tiny = exact.scaled < quarter if rounding in ("nearest_even", "nearest_away") else \
            Mux(_goes_outward(exact, rounding), exact.scaled <= half, tiny)
        m.d.comb += [
            Assert(flags.invalid == (signalling | getattr(exact, "invalid", exact.is_nan & ~Cat(nans).any()))),
            Assert(flags.divide_by_zero == (exact.by_zero & ~exact.is_nan)),
            Assert(flags.overflow == (finite & overflow)),
            Assert(flags.inexact == (finite & (flushed | inexact))),
            Assert(flags.underflow == (flushed if not fmt.gradual else finite & inexact & stays_tiny)),
        ]


class FixedResult(_Result):
    """``FpToFixed``: the operand rounded to an integer, or the nearest end of the range; also its flags, if any."""

    def claim(self, m, op):
        a = number(op.format, op.a)
        exact = SimpleNamespace(sign=a.sign, scaled=4 * (a.value << op.fraction_bits),
                                per=lambda candidate: candidate << places(op.format))
        largest = (1 << op.width - 1) - 1
        limit, magnitude = largest + a.sign, Signal(op.width)
        m.d.comb += magnitude.eq(abs(op.result))
        too_small, too_large = _misplaced(exact, rounding_of(op), magnitude, lambda integer: integer)
        with m.If(a.is_nan):
            m.d.comb += Assert(op.result == (~largest if op.format.negative_nan else largest))
        with m.Else():
            m.d.comb += [Assert((op.result == 0) | ((op.result < 0) == a.sign)), Assert(magnitude <= limit),
                         Assert(~too_small | (magnitude == limit)),
                         Assert(~too_large | (magnitude == 0))]
            with m.If(a.is_infinite):
                m.d.comb += Assert(magnitude == limit)
        if "flags" in op.signature.members:
            invalid = a.is_nan | a.is_infinite | too_small
            inexact = exact.per(magnitude << 2) != exact.scaled
            m.d.comb += [Assert(op.flags.invalid == invalid), Assert(op.flags.inexact == (inexact & ~invalid)),
                         Assert(~(op.flags.overflow | op.flags.underflow | op.flags.divide_by_zero))]


HOLDS = {"==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


class Relation(_Result):
    """``FpCompare`` and ``FpRelation``: the order of the operands' values; a NaN has none."""

    def claim(self, m, op):
        a, b = number(op.format, op.a), number(op.format, op.b)
        unordered, x, y = a.is_nan | b.is_nan, signed_value(a), signed_value(b)
        if "unordered" in op.signature.members:
            m.d.comb += [Assert(op.unordered == unordered), Assert(op.less == ((x < y) & ~unordered)),
                         Assert(op.equal == ((x == y) & ~unordered))]
        else:
            wanted = Mux(unordered, op.relation == "!=", HOLDS[op.relation](x, y))
            m.d.comb += Assert(op.result == wanted)


class Extreme(_Result):
    """``FpMinMax``: the minimum or maximum of the operands; NaN if an operand is NaN; -0 is less than +0."""

    def claim(self, m, op):
        fmt, result = op.format, Value.cast(op.result)
        a, b, r = (number(fmt, value) for value in (op.a, op.b, result))
        with m.If(a.is_nan | b.is_nan):
            m.d.comb += Assert(result == fmt.nan)
        with m.Else():
            # Twice the value, plus one for a positive sign, distinguishes the zeros.
            x, y, z = (2 * signed_value(number) + ~number.sign for number in (a, b, r))
            m.d.comb += [Assert((z == x) | (z == y)), Assert(Mux(op.maximum, (z >= x) & (z >= y), (z <= x) & (z <= y)))]
            if not fmt.gradual:
                m.d.comb += Assert((result[:-1] == 0) | (result[:-1] >= fmt.least_normal))


def rounding_of(op):
    """The name of an operator's rounding direction; to nearest even if it is exact or has no choice."""
    return op.rounding.value if hasattr(op, "rounding") else "nearest_even"
