"""Coefficients of the quaternion's transition against cosine, sine and the exact rotation."""

from fractions import Fraction
from math import factorial

import numpy as np
import pytest

from strapdown.design import METHODS, least_squares, minimax, smallest_order
from strapdown_sim.reference import quaternion as exact

RANGES = [0.07, 0.5, 3.0]
ORDERS = [2, 3, 5]


def polynomial(coefficients, u):
    return np.polynomial.polynomial.polyval(u, coefficients)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("largest", RANGES)
def test_least_squares_takes_the_patents_sums_to_zero(order, largest):
    c = least_squares(order, largest)
    first = largest * np.arange(order + 1) / order
    second = largest * np.arange(1, order + 2) / (order + 1)
    # Coefficients and values are float64 below 1: a few units of 2**-53 in each of order + 1 terms, times u^j.
    bound = 4 * (order + 1) * 2.0**-53 * max(1, largest ** (2 * order))
    np.testing.assert_allclose(polynomial(c.a0, first**2), np.cos(first / 2), rtol=0, atol=bound)
    np.testing.assert_allclose(polynomial(c.d0, second**2) * second, np.sin(second / 2), rtol=0, atol=bound)


@pytest.mark.parametrize("order", ORDERS)
def test_minimax_error_alternates_between_order_plus_two_equal_extremes(order):
    # By the theorem of de la Vallee-Poussin such a polynomial has the smallest maximum error.
    largest = 3.0
    x = np.linspace(0, largest, 20001)
    c = minimax(order, largest)
    for error in (polynomial(c.a0, x**2) - np.cos(x / 2), polynomial(c.d0, x**2) * x - np.sin(x / 2)):
        runs = np.split(error, np.flatnonzero(np.diff(np.sign(error[1:]))) + 2)
        extremes = [abs(run).max() for run in runs if run.size > 1]
        assert len(extremes) == order + 2
        # The relative error of the grid, 1e-4, and float64 against an error of 1e-9 at order 5.
        np.testing.assert_allclose(extremes, extremes[0], rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", ORDERS)
def test_errors_are_those_of_the_rotation(method, order):
    c = METHODS[method](order, 3.0)
    x = np.linspace(0, 3.0, 50)
    axis = np.array([0.48, -0.6, 0.64])
    q = np.concatenate([polynomial(c.a0, x**2)[:, None],
                        (polynomial(c.d0, x**2) * x)[:, None] * axis], axis=1)
    truth = exact.increment(x[:, None] * axis, 1.0)
    angle, norm = c.errors(x)
    np.testing.assert_allclose(np.abs(angle), exact.angle_between(q, truth), rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(norm, np.linalg.norm(q, axis=1) - 1, rtol=0, atol=1e-15)


def test_minimax_is_never_worse_in_its_own_measure():
    x = np.linspace(0, 3.0, 5000)
    for order in ORDERS:
        small, patent = minimax(order, 3.0), least_squares(order, 3.0)
        for name, f in ("a0", np.cos(x / 2)), ("d0", np.sin(x / 2)):
            factor = 1 if name == "a0" else x
            error, other = (np.abs(polynomial(getattr(c, name), x**2) * factor - f).max() for c in (small, patent))
            assert error < other


def test_errors_far_below_float64_are_told():
    # Order 4 at 0.07 rad: the first omitted term, (x/2)^10/10!, is 7e-22; float64 resolves only 1e-16.
    c = least_squares(4, 0.07)
    half = Fraction(0.07) / 2
    left_out = half**10 / factorial(10)
    cosine = sum((-1) ** n * half ** (2 * n) / factorial(2 * n) for n in range(12))
    a = sum(Fraction(value) * (4 * half * half) ** n for n, value in enumerate(c.a0))
    assert abs(a - cosine) < Fraction(1, 10**15)
    assert 0 < c.worst()[0] < 1e-17
    assert left_out < Fraction(1, 10**21)


def test_smallest_order():
    for wanted in (1e-4, 1e-8, 1e-14):
        c = smallest_order("minimax", 0.5, wanted=wanted)
        assert c.worst()[0] <= wanted
        assert c.order == 2 or minimax(c.order - 1, 0.5).worst()[0] > wanted


def test_rounded_coefficients_are_of_the_type():
    c = minimax(3, 0.5).rounded(np.float32)
    assert all(np.float32(value) == value for value in (*c.a0, *c.d0))
    assert minimax(3, 0.5).worst()[0] < c.worst()[0] < 2.0**-24


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_is_refused(method):
    with pytest.raises(ValueError, match="order must be from 2 to 8, not 1"):
        METHODS[method](1, 0.5)
    with pytest.raises(ValueError, match="at most 3 rad, not 4 rad: sample faster"):
        METHODS[method](2, 4.0)
    with pytest.raises(ValueError, match="no order up to 8"):
        smallest_order(method, 3.0, wanted=1e-25)
