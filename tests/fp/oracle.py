"""The operations exactly as in IEEE 754, on fractions of Python integers: slow, and short.

A number is a ``Datum``; an operation gives (encoding, flags). This module is independent of the
package's algorithms: it reads only widths and policy of the format.
"""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

INEXACT, UNDERFLOW, OVERFLOW, DIVIDE_BY_ZERO, INVALID = 1, 2, 4, 8, 16
ROUNDINGS = ("nearest_even", "nearest_away", "toward_zero", "upward", "downward")


@cache
def two_to(exponent):
    return Fraction(2) ** exponent


@dataclass(frozen=True)
class Datum:
    """Meaning of an encoding; ``value`` is None for infinities and NaNs."""

    negative: bool
    value: Fraction | None
    nan: bool = False
    signalling: bool = False

    @property
    def infinite(self):
        return self.value is None and not self.nan


def datum(fmt, encoding):
    fraction = encoding % 2**fmt.fraction_width
    exponent = encoding >> fmt.fraction_width & 2**fmt.exponent_width - 1
    negative = bool(encoding >> fmt.width - 1)
    if exponent == 2**fmt.exponent_width - 1:
        return Datum(negative, None, fraction != 0, 0 < fraction < 2 ** (fmt.fraction_width - 1))
    if exponent == 0:
        value = fraction * two_to(1 - fmt.bias - fmt.fraction_width) if fmt.gradual else Fraction(0)
    else:
        value = (1 + Fraction(fraction, 2**fmt.fraction_width)) * two_to(exponent - fmt.bias)
    return Datum(negative, -value if negative else value)


def signed(fmt, negative, magnitude):
    return magnitude | negative << fmt.width - 1


def infinity(fmt, negative=False):
    return signed(fmt, negative, (2**fmt.exponent_width - 1) << fmt.fraction_width)


def nan(fmt):
    return infinity(fmt) + 2 ** (fmt.fraction_width - 1)


def to_integer(x, rounding):
    """A fraction rounded to an integer."""
    below = math.floor(x)
    if x == below:
        return below
    match rounding:
        case "upward":
            return below + 1
        case "downward":
            return below
        case "toward_zero":
            return below if x > 0 else below + 1
    distance = x - below
    if distance != Fraction(1, 2):
        return below + (distance > Fraction(1, 2))
    if rounding == "nearest_away":
        return below + (x > 0)
    return below + below % 2


def binade(size):
    """The exponent e with 2**e <= size < 2**(e + 1)."""
    e = size.numerator.bit_length() - size.denominator.bit_length()
    return e - (two_to(e) > size)


def rounded(fmt, x, rounding):
    """Encoding and flags of a fraction that is not zero; IEEE 754-2019, 4.3, 7.4, 7.5."""
    negative, least = x < 0, two_to(1 - fmt.bias)
    largest = (2 - Fraction(1, 2**fmt.fraction_width)) * two_to(fmt.bias)
    if not fmt.gradual and abs(x) < least:
        return signed(fmt, negative, 0), UNDERFLOW | INEXACT

    def on_grid(exponent):
        unit = two_to(exponent - fmt.fraction_width)
        return to_integer(x / unit, rounding) * unit

    exponent = binade(abs(x))
    # Rounded with an unbounded exponent, to detect overflow, and tininess after rounding.
    unbounded = on_grid(exponent)
    if abs(unbounded) > largest:
        to_infinity = {"upward": not negative, "downward": negative, "toward_zero": False}.get(rounding, True)
        return infinity(fmt, negative) - (not to_infinity), OVERFLOW | INEXACT
    result = unbounded if exponent >= 1 - fmt.bias else on_grid(1 - fmt.bias)
    flags = 0 if result == x else INEXACT | (abs(unbounded) < least) * UNDERFLOW
    size = abs(result)
    if size < least:
        return signed(fmt, negative, int(size / least * 2**fmt.fraction_width)), flags
    top = binade(size)
    fraction = (size / two_to(top) - 1) * 2**fmt.fraction_width
    return signed(fmt, negative, (top + fmt.bias << fmt.fraction_width) + int(fraction)), flags


def finish(fmt, x, rounding, negative_zero):
    return rounded(fmt, x, rounding) if x else (signed(fmt, negative_zero, 0), 0)


def of_nans(fmt, *operands):
    """The result for NaN operands, or None if no operand is NaN."""
    if any(operand.nan for operand in operands):
        return nan(fmt), INVALID * any(operand.signalling for operand in operands)
    return None


def add(fmt, a, b, rounding):
    if answer := of_nans(fmt, a, b):
        return answer
    if a.infinite and b.infinite and a.negative != b.negative:
        return nan(fmt), INVALID
    if a.infinite or b.infinite:
        return infinity(fmt, a.negative if a.infinite else b.negative), 0
    # 6.3: an exact zero sum of opposite signs is +0, but -0 downward; x + x keeps its sign.
    negative_zero = a.negative if a.negative == b.negative else rounding == "downward"
    return finish(fmt, a.value + b.value, rounding, negative_zero)


def subtract(fmt, a, b, rounding):
    negated = Datum(not b.negative, None if b.value is None else -b.value, b.nan, b.signalling)
    return add(fmt, a, negated, rounding)


def multiply(fmt, a, b, rounding):
    negative = a.negative != b.negative
    if answer := of_nans(fmt, a, b):
        return answer
    if a.infinite or b.infinite:
        if a.value == 0 or b.value == 0:
            return nan(fmt), INVALID
        return infinity(fmt, negative), 0
    return finish(fmt, a.value * b.value, rounding, negative)


def divide(fmt, a, b, rounding):
    negative = a.negative != b.negative
    if answer := of_nans(fmt, a, b):
        return answer
    if (a.infinite and b.infinite) or (a.value == 0 and b.value == 0):
        return nan(fmt), INVALID
    if a.infinite:
        return infinity(fmt, negative), 0
    if b.infinite:
        return signed(fmt, negative, 0), 0
    if b.value == 0:
        return infinity(fmt, negative), DIVIDE_BY_ZERO
    return finish(fmt, a.value / b.value, rounding, negative)


def bracketed_root(x, bits):
    """The square root of a fraction if it is a fraction. Else the root, cut off to more than ``bits``
    bits, plus half a unit, so that it is not equal to a number of ``bits`` bits."""
    exponent = binade(x) // 2 - bits
    scaled = x / Fraction(4) ** exponent
    root = math.isqrt(math.floor(scaled))
    return (root + (Fraction(0) if root * root == scaled else Fraction(1, 2))) * two_to(exponent)


def square_root(fmt, a, rounding):
    if answer := of_nans(fmt, a):
        return answer
    if a.value == 0:
        return signed(fmt, a.negative, 0), 0
    if a.negative:
        return nan(fmt), INVALID
    if a.infinite:
        return infinity(fmt), 0
    return rounded(fmt, bracketed_root(a.value, fmt.fraction_width + 4), rounding)


def reciprocal_square_root(fmt, a, rounding):
    if answer := of_nans(fmt, a):
        return answer
    if a.value == 0:
        return infinity(fmt, a.negative), DIVIDE_BY_ZERO
    if a.negative:
        return nan(fmt), INVALID
    if a.infinite:
        return 0, 0
    return rounded(fmt, bracketed_root(1 / a.value, fmt.fraction_width + 4), rounding)


def resize(fmt, a, rounding):
    if answer := of_nans(fmt, a):
        return answer
    if a.infinite:
        return infinity(fmt, a.negative), 0
    return finish(fmt, a.value, rounding, a.negative)


def to_fixed(a, width, fraction_bits, rounding):
    """An integer in place of the encoding; NaN gives the largest."""
    lowest, largest = -(2 ** (width - 1)), 2 ** (width - 1) - 1
    if a.value is None:
        return lowest if a.infinite and a.negative else largest, INVALID
    x = a.value * 2**fraction_bits
    result = to_integer(x, rounding)
    if not lowest <= result <= largest:
        return min(max(result, lowest), largest), INVALID
    return result, INEXACT * (result != x)


def from_fixed(fmt, operand, fraction_bits, rounding):
    return finish(fmt, Fraction(operand, 2**fraction_bits), rounding, False)
