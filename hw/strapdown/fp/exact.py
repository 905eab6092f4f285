"""The operations on integers: results and flags for every format up to binary64 and every rounding.

Each function takes numbers (arrays of the format's dtype, or values that ``FloatFormat.to_bits``
accepts; shapes that broadcast) and returns a pair: results of the format's dtype, and
``Flags`` as uint8. Significands are int64 if they fit, else Python integers.
"""

import math
import operator
from types import SimpleNamespace

import numpy as np

from .rounding import Flags, Rounding, bit_length, round_encoding, round_integer

__all__ = ["add", "multiply", "sum_of_products", "divide", "square_root", "reciprocal_square_root", "resize",
           "to_fixed", "from_fixed", "unpack", "negated", "by_numpy"]

_index = np.frompyfunc(operator.index, 1, 1)
_isqrt = np.frompyfunc(math.isqrt, 1, 1)


def by_numpy(fmt, rounding, fast, operation, *operands):
    """Results of ``operation``, a function of this module; NumPy's ``fast`` computes them where both agree.

    They agree for the formats of NumPy, rounded to nearest, ties to even. Where subnormals are flushed,
    there is one exception: the least normal number may be the rounded form of a smaller value.
    """
    if not fmt.is_native or rounding is not Rounding.NEAREST_EVEN:
        return operation(fmt, *operands, rounding)[0]
    operands = tuple(fmt.array(operand) for operand in operands)
    with np.errstate(all="ignore"):
        result = fmt.canonical(fmt.flush(fast(*operands)))
    if not fmt.gradual:
        doubtful = np.abs(result) == fmt.from_bits(fmt.least_normal)
        if doubtful.any():
            chosen = (operand[doubtful] for operand in np.broadcast_arrays(*operands))
            result[doubtful] = operation(fmt, *chosen, rounding)[0]
    return result


def unpack(fmt, numbers):
    """Classes, sign, exponent and significand of a number; its magnitude is significand * 2**exponent."""
    bits = fmt.to_bits(numbers).astype(np.uint64)
    sign = bits >> np.uint64(fmt.width - 1) == 1
    magnitude = (bits & np.uint64((1 << fmt.width - 1) - 1)).astype(np.int64)
    stored, fraction = magnitude >> fmt.fraction_width, magnitude & fmt.least_normal - 1
    tiny, special = stored == 0, stored == fmt.exponent_special
    significand = np.where(tiny, fraction if fmt.gradual else 0, fraction | fmt.least_normal)
    is_nan = special & (fraction != 0)
    return SimpleNamespace(
        sign=sign, exponent=np.maximum(stored, 1) - fmt.bias - fmt.fraction_width, significand=significand,
        is_zero=significand == 0, is_infinite=special & (fraction == 0), is_nan=is_nan,
        is_signalling=is_nan & (fraction >> fmt.fraction_width - 1 == 0))


def negated(fmt, numbers, condition):
    """Numbers whose sign is changed where ``condition`` is true."""
    # The sign bit is flipped in the encoding: a format may lack a NumPy type.
    sign = np.asarray(condition, dtype=bool).astype(np.uint64) << np.uint64(fmt.width - 1)
    return fmt.from_bits(fmt.to_bits(numbers).astype(np.uint64) ^ sign)


def add(fmt, a, b, rounding):
    """a + b."""
    return _add(fmt, _unpack(fmt, a), _unpack(fmt, b), fmt.precision, rounding)


def multiply(fmt, a, b, rounding):
    """a * b."""
    product = _multiply(fmt, a, b)
    return _pack(fmt, rounding, product.sign, product.exponent, product.significand, is_nan=product.is_nan,
                 is_infinite=product.is_infinite, is_zero=product.is_zero, invalid=product.is_signalling)


def sum_of_products(fmt, a, b, c, d, rounding):
    """a * b + c * d."""
    return _add(fmt, _multiply(fmt, a, b), _multiply(fmt, c, d), 2 * fmt.precision, rounding)


def divide(fmt, a, b, rounding):
    """a / b."""
    a, b = _normalise(fmt, _unpack(fmt, a)), _normalise(fmt, _unpack(fmt, b))
    places = fmt.precision + 2
    dividend = _integers(a.significand, fmt.precision + places) << places
    divisor = np.where(b.is_zero, 1, b.significand)
    quotient = dividend // divisor
    undefined = (a.is_zero & b.is_zero) | (a.is_infinite & b.is_infinite)
    return _pack(fmt, rounding, a.sign ^ b.sign, a.exponent - b.exponent - places, quotient,
                 sticky=quotient * divisor != dividend,
                 is_nan=a.is_nan | b.is_nan | undefined, is_infinite=a.is_infinite | b.is_zero,
                 is_zero=a.is_zero | b.is_infinite, invalid=a.is_signalling | b.is_signalling | undefined,
                 divide_by_zero=b.is_zero & ~(a.is_zero | a.is_infinite | a.is_nan))


def square_root(fmt, a, rounding):
    """Square root of a."""
    a = _normalise(fmt, _unpack(fmt, a))
    places = fmt.precision + 4 + (a.exponent - fmt.precision & 1)
    radicand = _integers(a.significand, 2 * fmt.precision + 5) << places
    root = _isqrt(radicand).astype(radicand.dtype)
    negative = a.sign & ~a.is_zero & ~a.is_nan
    return _pack(fmt, rounding, a.sign, (a.exponent - places) // 2, root, sticky=root * root != radicand,
                 is_nan=a.is_nan | negative, is_infinite=a.is_infinite, is_zero=a.is_zero,
                 invalid=a.is_signalling | negative)


def reciprocal_square_root(fmt, a, rounding):
    """1 / square root of a."""
    a = _normalise(fmt, _unpack(fmt, a))
    odd = a.exponent & 1
    radicand = _integers(np.where(a.is_zero, 1, a.significand << odd), 4 * fmt.precision)
    places = 2 * fmt.precision
    unit = np.ones_like(radicand) << 2 * places
    root = _isqrt(unit // radicand).astype(radicand.dtype)
    negative = a.sign & ~a.is_zero & ~a.is_nan
    return _pack(fmt, rounding, a.sign, (odd - a.exponent) // 2 - places, root, sticky=root * root * radicand != unit,
                 is_nan=a.is_nan | negative, is_infinite=a.is_zero, is_zero=a.is_infinite,
                 invalid=a.is_signalling | negative, divide_by_zero=a.is_zero)


def resize(from_format, to_format, a, rounding):
    """The same number in another format."""
    a = _unpack(from_format, a)
    return _pack(to_format, rounding, a.sign, a.exponent, a.significand, is_nan=a.is_nan, is_infinite=a.is_infinite,
                 is_zero=a.is_zero, invalid=a.is_signalling)


def from_fixed(fmt, operand, fraction_bits, rounding):
    """operand / 2**fraction_bits, of any integers."""
    operand = _index(np.asarray(operand, dtype=object)[..., np.newaxis])
    if (np.abs(operand) < 1 << 62).all():
        operand = operand.astype(np.int64)
    return _pack(fmt, rounding, operand < 0, np.int64(-fraction_bits), np.abs(operand), is_zero=operand == 0)


def to_fixed(fmt, a, width, fraction_bits, rounding):
    """a * 2**fraction_bits as an integer of ``width`` bits in two's complement: int64 or object."""
    a = _unpack(fmt, a)
    lowest, largest = -(1 << width - 1), (1 << width - 1) - 1
    # With this exponent a number is out of range for every significand.
    exponent = a.exponent + fraction_bits
    outside = a.is_infinite | (exponent + bit_length(a.significand) > width)
    significand = _integers(np.where(outside | a.is_nan, 0, a.significand), width)
    magnitude, inexact = round_integer(a.sign, significand, -np.minimum(exponent, width), rounding)
    outside |= np.where(a.sign, magnitude > -lowest, magnitude > largest)
    invalid = outside | a.is_nan
    result = np.where(np.where(a.is_nan, fmt.negative_nan, a.sign), np.where(invalid, lowest, -magnitude),
                      np.where(invalid, largest, magnitude))
    flags = invalid * Flags.INVALID | (inexact & ~invalid) * Flags.INEXACT
    return result.astype(np.int64 if width <= 64 else object)[..., 0], flags.astype(np.uint8)[..., 0]


def _unpack(fmt, numbers):
    # One additional axis, removed at the end: NumPy turns arrays of objects without axes into scalars.
    return unpack(fmt, np.asarray(numbers)[..., np.newaxis])


def _add(fmt, a, b, bits, rounding):
    """The sum of two numbers with significands of ``bits`` bits, rounded, and its flags.

    A significand that has leading zeros, but is not zero, belongs to the least exponent, or is a product and has
    fmt.precision bits at least.
    """
    # If the smaller operand is far below the last place of the larger one, it only sets the sticky bit.
    reach = bits + 3
    least = np.minimum(a.exponent, b.exponent)
    exponent = np.where(a.is_zero, b.exponent, np.where(b.is_zero, a.exponent, np.maximum(a.exponent, b.exponent)))
    exponent = np.maximum(least, exponent - reach)
    total = 0
    for number in a, b:
        above = np.where(number.is_zero, 0, number.exponent - exponent)
        term = _integers(number.significand, bits + reach + 1) << np.maximum(above, 0)
        term = np.where(above < 0, number.significand != 0, term)
        total = total + np.where(number.sign, -term, term)
    cancels = a.is_infinite & b.is_infinite & (a.sign != b.sign)
    is_infinite = a.is_infinite | b.is_infinite
    # An exact zero has the sign of both operands if their signs are equal; else the rounding decides.
    is_zero = total == 0
    sign = np.where(is_zero, np.where(a.sign == b.sign, a.sign, rounding is Rounding.DOWNWARD), total < 0)
    sign = np.where(is_infinite, np.where(a.is_infinite, a.sign, b.sign), sign)
    return _pack(fmt, rounding, sign, exponent, np.abs(total),
                 is_nan=a.is_nan | b.is_nan | cancels, is_infinite=is_infinite, is_zero=is_zero,
                 invalid=a.is_signalling | b.is_signalling | cancels)


def _multiply(fmt, a, b):
    """The exact product, classified like an operand; signalling means that it is invalid."""
    a, b = _unpack(fmt, a), _unpack(fmt, b)
    undefined = (a.is_zero & b.is_infinite) | (a.is_infinite & b.is_zero)
    is_nan = a.is_nan | b.is_nan | undefined
    return SimpleNamespace(
        sign=a.sign ^ b.sign, exponent=a.exponent + b.exponent,
        significand=_integers(a.significand, 2 * fmt.precision) * b.significand,
        is_zero=a.is_zero | b.is_zero, is_infinite=(a.is_infinite | b.is_infinite) & ~is_nan, is_nan=is_nan,
        is_signalling=a.is_signalling | b.is_signalling | undefined)


def _integers(values, bits):
    """``values`` as int64 if ``bits`` of a magnitude fit into it, else as Python integers."""
    return values if bits <= 62 else values.astype(object)


def _normalise(fmt, number):
    """The same number with a significand of fmt.precision bits; zero does not change."""
    zeros = fmt.precision - bit_length(number.significand)
    number.significand, number.exponent = number.significand << zeros, number.exponent - zeros
    return number


def _pack(fmt, rounding, sign, exponent, significand, *, is_zero, invalid=False, sticky=False, is_nan=False,
          is_infinite=False, divide_by_zero=False):
    """Rounded numbers and flags: NaN, infinity or zero if flagged, in this order, else the computed number."""
    encoded, flags = round_encoding(fmt, sign, exponent, significand, rounding, sticky)
    signed = np.asarray(sign).astype(np.uint64) << np.uint64(fmt.width - 1)
    special = is_nan | is_infinite | is_zero
    encoded = np.select([is_nan & special, is_infinite & special, special],
                        [np.uint64(fmt.nan), signed | np.uint64(fmt.infinity), signed], encoded)
    flags = np.where(special, 0, flags) | invalid * Flags.INVALID | divide_by_zero * Flags.DIVIDE_BY_ZERO
    return fmt.from_bits(encoded[..., 0]), flags.astype(np.uint8)[..., 0]
