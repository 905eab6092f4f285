"""Vectors, matrices and quaternions as nested tuples of scalars of any numeric namespace.

The order of operations is part of each function: sums are written out, so that every namespace
rounds in the same places. Sums are balanced, because depth is time in hardware.
"""

__all__ = ["SHORTEST_SQUARE", "root", "add", "subtract", "scale", "dot", "cross", "length_squared", "column",
           "matrix_vector", "transposed_vector", "permute", "polynomial"]

SHORTEST_SQUARE = 2.0**-100
"""Added to a squared length before a division by it: a vector shorter than 2**-50 (of any unit) has
no direction. The sum keeps every quotient finite, and gives a correction of zero for a vector of length
zero. It does not change a square of 2**-75 or more, because it is less than half an ulp of it."""


def root(xp, a):
    """Square root of a number of 0 or more by ``xp.rsqrt``: of 0 it is 0, below 2**-75 too small, of infinity NaN.

    The relative error is that of ``xp.rsqrt`` and of a product.
    """
    return a * xp.rsqrt(a + SHORTEST_SQUARE)


def add(a, b):
    """Sum of two vectors of equal length."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def subtract(a, b):
    """Difference of two vectors of equal length."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def scale(factor, a):
    """Vector times scalar."""
    return tuple(factor * x for x in a)


def dot(a, b):
    """Inner product of two vectors of 2, 3 or 4 components."""
    products = [x * y for x, y in zip(a, b, strict=True)]
    while len(products) > 1:
        products = [sum(pair[1:], pair[0]) for pair in (products[i:i + 2] for i in range(0, len(products), 2))]
    return products[0]


def cross(a, b):
    """Vector product of two vectors of three components."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def length_squared(a):
    """(Squared length of three components plus ``SHORTEST_SQUARE``, true if the squared length is below this)."""
    x, y, z = a
    square = (x * x + y * y) + (z * z + SHORTEST_SQUARE)
    return square, square < 2 * SHORTEST_SQUARE


def column(c, index):
    """Column ``index`` (from 0) of a matrix given as rows."""
    return tuple(row[index] for row in c)


def matrix_vector(c, a):
    """C·a for a matrix given as rows."""
    return tuple(dot(row, a) for row in c)


def transposed_vector(c, a):
    """Cᵀ·a for a matrix given as rows."""
    return tuple(dot(column(c, index), a) for index in range(3))


def permute(axes, a):
    """Body components of a vector measured along sensor axes.

    ``axes`` names the sensor axis that lies along body x, y and z, as in ("+y", "-x", "+z").
    """
    return tuple(a["xyz".index(axis)] if sign == "+" else -a["xyz".index(axis)] for sign, axis in axes)


def polynomial(coefficients, u):
    """Σ coefficients_i·uⁱ by Estrin's scheme: the depth grows with the logarithm of the order."""
    terms = list(coefficients)
    while len(terms) > 1:
        pairs = [terms[i:i + 2] for i in range(0, len(terms), 2)]
        terms = [pair[0] + pair[1] * u if len(pair) == 2 else pair[0] for pair in pairs]
        u = u * u if len(terms) > 1 else u
    return terms[0]
