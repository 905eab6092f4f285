"""Minimax polynomials, in decimal arithmetic of 60 digits.

The errors fall below the resolution of float64, so everything here is a Decimal.
"""

from collections.abc import Callable
from decimal import Decimal, localcontext

import numpy as np

__all__ = ["DIGITS", "arctangent_coefficients", "evaluate", "interpolate", "remez", "sine_coefficients"]

DIGITS = 60
"""Precision of the arithmetic; callers of the other functions set it."""

ROUNDS = 30


def arctangent_coefficients(order):
    """Coefficients c_0 … c_order of atan(t) = t + t·u·Σ c_i·uⁱ, u = t², for 0 <= t <= 1.

    Their largest error relative to atan(t) is minimal.

    Parameters
    ----------
    order : int
        Degree of the sum, at least 1.

    Returns
    -------
    coefficients : tuple of Decimal
    error : Decimal
        The largest relative error.
    """
    return _odd_function(_arctangent_ratio, order, Decimal(1))


def sine_coefficients(order):
    """Coefficients c_0 … c_order of sin(t) = t + t·u·Σ c_i·uⁱ, u = t², for 0 <= t <= π/2.

    Their largest error relative to sin(t) is minimal. Parameters and result are as in ``arctangent_coefficients``.
    """
    with localcontext(prec=DIGITS):
        return _odd_function(_sine_ratio, order, (2 * _arctangent(Decimal(1))) ** 2)


def _odd_function(ratio, order, last):
    """Coefficients and largest relative error of t + t·u·Σ c_i·uⁱ against t·ratio(u), with u from 0 to ``last``."""
    with localcontext(prec=DIGITS):
        coefficients = remez(lambda u: (ratio(u) - 1) / u if u else Decimal(0), lambda u: u / ratio(u), order, last,
                             grid=4000)
        points = [last * k / 1000 for k in range(1, 1001)]
        error = max(abs((1 + u * evaluate(coefficients, u)) / ratio(u) - 1) for u in points)
    return tuple(coefficients), error


def _sine_ratio(u):
    """sin(t)/t as a function of u = t²."""
    return _series(lambda n, term: -term * u / ((2 * n) * (2 * n + 1)))


def _arctangent_ratio(u):
    """atan(t)/t as a function of u = t²."""
    return _arctangent(u.sqrt()) / u.sqrt() if u else Decimal(1)


def _arctangent(t):
    """atan(t): half of the angle has the tangent t/(1 + sqrt(1 + t²))."""
    halvings = 4
    for _ in range(halvings):
        t = t / (1 + (1 + t * t).sqrt())
    power = Decimal(1)

    def term(n, _):
        nonlocal power
        power *= -t * t
        return power / (2 * n + 1)
    return 2**halvings * t * _series(term)


def _series(following):
    """1 + following(1, 1) + …: each term is a function of its number and the previous term."""
    total = term = Decimal(1)
    n = 0
    while abs(term) > Decimal(10) ** -DIGITS:
        n += 1
        term = following(n, term)
        total += term
    return total


def evaluate(coefficients, u):
    """Value of a polynomial, lowest power first."""
    total = Decimal(0)
    for coefficient in reversed(coefficients):
        total = total * u + Decimal(coefficient)
    return total


def interpolate(nodes, values):
    """Coefficients of the polynomial through (node, value), lowest power first: Newton's divided differences."""
    values = list(values)
    for level in range(1, len(nodes)):
        for i in range(len(nodes) - 1, level - 1, -1):
            values[i] = (values[i] - values[i - 1]) / (nodes[i] - nodes[i - level])
    result = [Decimal(0)] * len(nodes)
    for node, value in zip(reversed(nodes), reversed(values), strict=True):
        shifted = [Decimal(0), *result[:-1]]
        result = [up - node * same for up, same in zip(shifted, result, strict=True)]
        result[0] += value
    return result


def remez(function: Callable, weight: Callable, order: int, last: Decimal, *, grid: int = 400):
    """Minimax polynomial of ``function`` on [0, last] for an error times ``weight``.

    On order + 2 nodes the error alternates in sign with equal magnitude; the nodes then move to the
    extremes of the error. The largest error is found on a grid of ``grid`` intervals. With 400 intervals this makes
    a relative difference of 1e-4 at most, because the difference is of second order in the distance from the extreme.

    Raises: ArithmeticError if the exchange does not converge.
    """
    points = [last * (1 - Decimal(float(np.cos(np.pi * k / grid)))) / 2 for k in range(grid + 1)]
    exact = [function(u) for u in points]
    weights = [weight(u) for u in points]
    # The extremes of a Chebyshev polynomial; those of a weighted error are near, and none where the weight is zero.
    nodes = [1 + round((grid - 1) * k / (order + 1)) for k in range(order + 2)]
    for _ in range(ROUNDS):
        barycentric = [1 / _product(points[k] - points[m] for m in nodes if m != k) for k in nodes]
        level = (sum(b * exact[k] for b, k in zip(barycentric, nodes, strict=True))
                 / sum(b * (-1) ** i / weights[k] for i, (b, k) in enumerate(zip(barycentric, nodes, strict=True))))
        polynomial = interpolate([points[k] for k in nodes[:-1]],
                                 [exact[k] - (-1) ** i * level / weights[k] for i, k in enumerate(nodes[:-1])])
        error = [(evaluate(polynomial, u) - f) * w for u, f, w in zip(points, exact, weights, strict=True)]
        extremes = _alternation(error, order + 2)
        if extremes == nodes:
            return polynomial
        nodes = extremes
    raise ArithmeticError("Remez' exchange did not converge")


def _alternation(error, count):
    """Indices of the largest error in each run of one sign, ``count`` runs."""
    runs: list[int] = []
    for k, value in enumerate(error):
        if value and (not runs or (value > 0) != (error[runs[-1]] > 0)):
            runs.append(k)
        elif value and abs(value) > abs(error[runs[-1]]):
            runs[-1] = k
    while len(runs) > count:
        runs.pop(0 if abs(error[runs[0]]) < abs(error[runs[-1]]) else -1)
    if len(runs) < count:
        raise ArithmeticError("Remez' exchange lost an extreme")
    return runs


def _product(factors):
    result = Decimal(1)
    for factor in factors:
        result *= factor
    return result
