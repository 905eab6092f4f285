"""Sine and cosine by additions and multiplications, for engines that have no operator for them."""

import math

from .vector import polynomial

__all__ = ["cosine", "half_turn", "sine", "sine_cosine"]

RADIANS = math.pi / 180

# sin(t) = t + t·u·(c0 + c1·u + …), u = t², for |t| <= π/2: strapdown.design.sine_coefficients(7).
# The first term is exactly t, so that small angles are exact.
COEFFICIENTS = (-0.16666666666666666, 0.008333333333333194, -0.00019841269841209218, 2.7557319211137288e-06,
                -2.5052106872803255e-08, 1.6058939705942778e-10, -7.642991490418e-13, 2.721174973476604e-15)


def half_turn(xp, degrees):
    """An angle between -360 and 360 degrees, wrapped to -180 to 180 degrees."""
    degrees = xp.select(degrees > 180.0, degrees - 360, degrees)
    return xp.select(degrees < -180.0, degrees + 360, degrees)


def sine_cosine(xp, degrees):
    """Sine and cosine of an angle in degrees, from -180 to 180: (sine, cosine).

    The angle is reduced to a quarter turn in degrees. The reduction is exact near the ends of each quarter,
    where sine or cosine is small. The relative error of each is below 7·2**-p, where p is the precision of the
    format, up to binary64.
    """
    size = xp.select(degrees < 0.0, -degrees, degrees)
    complement = 90 - size
    quarter_sine = sine_of_quarter(xp.select(complement < 0.0, 180 - size, size))
    return xp.select(degrees < 0.0, -quarter_sine, quarter_sine), sine_of_quarter(complement)


def sine(xp, angle):
    """Sine of an angle in radians, from -2π to 2π.

    Its error is at most 7·2**-p of itself and 2**-8 · 2**-p, p being the precision of the format, up to binary64's.
    """
    size = xp.select(angle < 0.0, -angle, angle)
    t = xp.select(size < QUARTER, size, xp.select(size < 3 * QUARTER, from_quarters(2, size), -from_quarters(4, size)))
    result = sine_of_right_angle(t)
    return xp.select(angle < 0.0, -result, result)


def cosine(xp, angle):
    """Cosine of an angle in radians, from -2π to 2π; as accurate as ``sine``."""
    size = xp.select(angle < 0.0, -angle, angle)
    t = xp.select(size < 2 * QUARTER, from_quarters(1, size), -from_quarters(3, size))
    return sine_of_right_angle(t)


QUARTER, HIGH, LOW = math.pi / 2, 1.5703125, 4.8382679489661923e-4
"""A quarter turn in radians, as such and in two parts: multiples of the high one are exact in every format."""


def from_quarters(count, size):
    """A number of quarter turns less ``size``, radians: exact to about the last place of the difference."""
    return (count * HIGH - size) + count * LOW


def sine_of_quarter(degrees):
    """Sine of an angle in degrees, from -90 to 90."""
    return sine_of_right_angle(RADIANS * degrees)


def sine_of_right_angle(t):
    """Sine of an angle in radians, from -π/2 to π/2."""
    u = t * t
    return t + (t * u) * polynomial(COEFFICIENTS, u)
