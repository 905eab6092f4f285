"""Constants of the CORDIC operators, computed in integers."""

import math

__all__ = ["SCALE", "encode_scaled", "least_remainder", "round_shift", "scaled_angle", "scaled_atan",
           "scaled_reciprocal_gain"]

SCALE = 256
"""Fraction bits of the integers from which constants are computed."""


def scaled_atan(i):
    """2**i * atan(2**-i) in units of 2**-SCALE; the last i + 8 bits are uncertain."""
    if i == 0:
        return 4 * _atan_reciprocal(5) - _atan_reciprocal(239)  # Machin's formula
    return _atan_reciprocal(1 << i) << i


def scaled_reciprocal_gain(first):
    """1 / K of the steps from ``first`` on, in units of 2**-SCALE; the last 8 bits are uncertain."""
    # The square of 1 / K is the product of 1 / (1 + 4**-i); factors past SCALE / 2 are 1.
    product = 1 << 2 * SCALE
    for i in range(first, SCALE):
        product = (product << 2 * i) // ((1 << 2 * i) + 1)
    return math.isqrt(product)


def least_remainder(precision, exponent):
    """Least distance from a multiple of pi/2, in units of 2**-SCALE, of all numbers with at most
    ``precision`` significant bits whose last bit weighs 2**(exponent + 1 - precision)."""
    # The best approximations of a ratio are its convergents, which Euclid's algorithm computes.
    half_pi = 2 * scaled_atan(0)
    before, factor_before = half_pi, 0
    remainder, factor = (1 << SCALE + exponent + 1 - precision) % half_pi, 1
    while True:
        quotient, after = divmod(before, remainder)
        before, factor_before, remainder, factor = remainder, factor, after, factor_before + quotient * factor
        if factor >> precision:
            return before


def round_shift(value, bits):
    """value / 2**bits, rounded."""
    return (value + (1 << bits - 1)) >> bits


def encode_scaled(fmt, value):
    """Encoding of a value of 0 or more in units of 2**-SCALE, correctly rounded."""
    if not value:
        return 0
    exponent = value.bit_length() - 1 - SCALE
    significand = round_shift(value, value.bit_length() - fmt.precision)
    return (fmt.bias + exponent - 1 << fmt.fraction_width) + significand


def scaled_angle(y, x, scale):
    """atan(y / x) of positive integers in units of 2**-scale; the last 8 bits are uncertain."""
    # Half the angle has the tangent y / (x + sqrt(x**2 + y**2)); after eight halvings the series converges fast.
    bits, halvings = scale + 32, 8
    ratio = (y << bits) // x
    for _ in range(halvings):
        ratio = (ratio << bits) // ((1 << bits) + math.isqrt((1 << 2 * bits) + ratio * ratio))
    square = ratio * ratio >> bits
    terms: list[int] = []
    while ratio:
        terms.append(ratio // (2 * len(terms) + 1))
        ratio = ratio * square >> bits
    return (sum(terms[::2]) - sum(terms[1::2])) << halvings >> bits - scale


def _atan_reciprocal(n):
    """atan(1 / n) by Gregory's series, in units of 2**-SCALE."""
    power = (1 << SCALE) // n
    terms: list[int] = []
    while power:
        terms.append(power // (2 * len(terms) + 1))
        power //= n * n
    return sum(terms[::2]) - sum(terms[1::2])
