"""The angle of a vector by additions and multiplications, for engines that have no arctangent."""

from .vector import polynomial

__all__ = ["atan2"]

PI = 3.141592653589793

# atan(t) = t + t·u·(c0 + c1·u + …), u = t², for 0 <= t <= 1: strapdown.design.arctangent_coefficients(7).
# The first term is exactly t, so that small angles are exact.
COEFFICIENTS = (-0.3333315274, 0.1999377284, -0.1421105535, 0.1066600481, -0.07552214647, 0.04321186513,
                -0.0163679307, 0.002920692916)

SHORTEST = 2.0**-126
"""Added to the longer side: it prevents 0/0 and does not change a side of 2**-101 or more."""


def atan2(xp, y, x):
    """Angle of the point (x, y) in radians, from -π to π, to binary32.

    A polynomial gives the arctangent of the shorter side over the longer one, which is then moved to the
    octant of the point. The polynomial's relative error is below 1.7e-8, 0.3 ulp of binary32; rounding
    adds to it. The angle of (±0, ±0) is that of the axis.
    """
    x_size, y_size = size(xp, x), size(xp, y)
    steep = x_size < y_size
    t = xp.select(steep, x_size, y_size) / (xp.select(steep, y_size, x_size) + SHORTEST)
    u = t * t
    angle = t + (t * u) * polynomial(COEFFICIENTS, u)
    angle = xp.select(steep, PI / 2 - angle, angle)
    angle = xp.select(x < 0.0, PI - angle, angle)
    return xp.select(y < 0.0, -angle, angle)


def size(xp, a):
    """Magnitude of a value."""
    return xp.select(a < 0.0, -a, a)
