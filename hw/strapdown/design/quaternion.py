"""Coefficients of the quaternion's state transition: polynomials in place of cosine and sine.

A rotation by x = |omega|·T multiplies the quaternion by a = cos(x/2) and d·omega with
d = T·sin(x/2)/x. Both are even in x, so polynomials in u = x² can replace them:
a = Σ a0_i·uⁱ and d = T·Σ d0_i·uⁱ, i = 0 … j (source 001). The errors fall below the resolution of
float64, so everything here is computed with 60 decimal digits.
"""

import operator
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from functools import wraps
from math import factorial

import numpy as np

from .polynomial import DIGITS, evaluate, interpolate, remez

__all__ = ["METHODS", "TransitionCoefficients", "least_squares", "minimax", "smallest_order"]

LARGEST_ANGLE = 3.0
"""Largest rotation in one update, rad: at pi the direction of the rotation would be ambiguous."""
HIGHEST_ORDER = 8


@dataclass(frozen=True)
class TransitionCoefficients:
    """The two coefficient vectors, and their errors against the exact rotation.

    Attributes
    ----------
    a0, d0 : tuple of float
        Coefficients of u⁰ … uʲ: a = Σ a0_i·uⁱ, d = T·Σ d0_i·uⁱ, u = (|omega|·T)².
    largest_angle : float
        End of the design range: |omega|·T from 0 to this, rad.
    method : str
        "least-squares" or "minimax".
    """

    a0: tuple[float, ...]
    d0: tuple[float, ...]
    largest_angle: float
    method: str

    @property
    def order(self):
        """The order j."""
        return len(self.a0) - 1

    def rounded(self, dtype):
        """These coefficients rounded to a NumPy type, as in a circuit of that format."""
        return replace(self, a0=tuple(map(float, np.array(self.a0, dtype))),
                       d0=tuple(map(float, np.array(self.d0, dtype))))

    def errors(self, angles):
        """Errors of one update that rotates by ``angles`` (rad, any shape).

        Returns
        -------
        angle, norm : ndarray of float64
            Excess of the rotation angle, rad; relative growth of the quaternion's norm. They are
            those of the float64 coefficients, in exact arithmetic.
        """
        pairs = [self._errors(Decimal(float(x))) for x in np.ravel(angles)]
        angle, norm = (np.array(column, dtype=float).reshape(np.shape(angles)) for column in zip(*pairs, strict=True))
        return angle, norm

    def worst(self, points=257):
        """Largest magnitudes of ``errors`` over the range: (angle in rad, norm)."""
        angle, norm = self.errors(np.linspace(0, self.largest_angle, points))
        return float(np.abs(angle).max()), float(np.abs(norm).max())

    def _errors(self, x):
        with localcontext(prec=DIGITS):
            u = x * x
            cosine, sine = _cosine(u), x * _sine_over_angle(u)
            a, s = evaluate(self.a0, u), x * evaluate(self.d0, u)
            # (a, s) rotated back by the exact half angle: the small rest is the error.
            along, across = a * cosine + s * sine, s * cosine - a * sine
            ratio = across / along
            # Half the angle is the arctangent of this ratio: two terms of its series.
            return 2 * (ratio - ratio**3 / 3), (along * along + across * across).sqrt() - 1


def _checked(design):
    """Check order and range before a design function runs."""
    @wraps(design)
    def checked(order, largest_angle):
        order = operator.index(order)
        if not 2 <= order <= HIGHEST_ORDER:
            raise ValueError(f"order must be from 2 to {HIGHEST_ORDER}, not {order!r}")
        if not 0 < largest_angle <= LARGEST_ANGLE:
            raise ValueError(f"largest angle of one update must be above 0 and at most {LARGEST_ANGLE:g} rad, "
                             f"not {largest_angle:g} rad: sample faster")
        with localcontext(prec=DIGITS):
            a0, d0 = design(order, Decimal(float(largest_angle)))
        return TransitionCoefficients(tuple(map(float, a0)), tuple(map(float, d0)), float(largest_angle),
                                      design.__name__.replace("_", "-"))
    return checked


@_checked
def least_squares(order, largest_angle):
    """The patent's coefficients for an order j >= 2 and the range 0 … ``largest_angle`` (rad) of x.

    They minimise J1 = Σ_{i=0…j} [cos(iH/2) − a0·h_i]² and J2 = Σ_{i=1…j+1} [sin(iH/2) − d0·h_i·iH]²,
    h_i = (1, (iH)², (iH)⁴, …). There are as many nodes as coefficients, so both minima are
    zero: the polynomials pass through all nodes. Each sum has a separate H, so that its last node is the
    end of the range. With the same H for both, a third of J1's range would have no node at j = 2.

    Raises: ValueError if the order or the angle is out of range.
    """
    first = [(largest_angle * i / order) ** 2 for i in range(order + 1)]
    second = [(largest_angle * i / (order + 1)) ** 2 for i in range(1, order + 2)]
    return (interpolate(first, [_cosine(u) for u in first]),
            interpolate(second, [_sine_over_angle(u) for u in second]))


@_checked
def minimax(order, largest_angle):
    """Coefficients with the smallest max |a − cos(x/2)| and max |d·x/T − sin(x/2)|, by Remez' exchange in u.

    Parameters, result and errors are those of ``least_squares``.
    """
    last = largest_angle * largest_angle
    return (remez(_cosine, lambda u: Decimal(1), order, last),
            remez(_sine_over_angle, lambda u: u.sqrt(), order, last))


METHODS = {"least-squares": least_squares, "minimax": minimax}
"""Design functions by name."""


def smallest_order(method, largest_angle, *, wanted):
    """The coefficients of lowest order whose worst angle error in one update is at most ``wanted`` rad.

    ``method`` is a key of ``METHODS``. Raises: ValueError if the highest order does not reach it.
    """
    for order in range(2, HIGHEST_ORDER + 1):
        coefficients = METHODS[method](order, largest_angle)
        if coefficients.worst()[0] <= wanted:
            return coefficients
    raise ValueError(f"no order up to {HIGHEST_ORDER} has an error of {wanted:.3g} rad per update or less: "
                     f"sample faster, or accept {coefficients.worst()[0]:.3g} rad")


# Decimal arithmetic, in the caller's context.

def _series(u, odd):
    """Σ (−u/4)ⁿ/(2n + odd)!."""
    total, term, n = Decimal(0), Decimal(1), 0
    while abs(term) > Decimal(10) ** -DIGITS:
        total += term
        n += 1
        term = (-u / 4) ** n / factorial(2 * n + odd)
    return total


def _cosine(u):
    """cos(x/2) as a function of u = x²."""
    return _series(u, 0)


def _sine_over_angle(u):
    """sin(x/2)/x as a function of u = x²."""
    return _series(u, 1) / 2
