"""The exact rotations against statements about rotations that are easy to check."""

import numpy as np
import pytest

from strapdown_sim.reference.quaternion import (
    angle_between,
    coning_attitude,
    coning_mean_rate,
    cumulative,
    first_order_increment,
    increment,
    product,
)

RNG = np.random.default_rng(3)
i, j, k = np.eye(4)[1:]


def test_product_is_hamiltons():
    np.testing.assert_array_equal(product(i, j), k)
    np.testing.assert_array_equal(product(j, i), -k)
    np.testing.assert_array_equal(product(product(i, j), k), [-1, 0, 0, 0])


def test_a_quarter_turn_about_z_takes_x_to_y():
    q = increment([0, 0, np.pi / 2], 1.0)
    conjugate = q * [1, -1, -1, -1]
    np.testing.assert_allclose(product(product(q, i), conjugate), j, atol=1e-15)


def test_cumulative_is_one_product_after_the_other():
    increments = increment(RNG.standard_normal((100, 3)), 0.3)
    q = np.array([0.5, -0.5, 0.5, 0.5])
    for given, all_at_once in zip(increments, cumulative(q, increments), strict=True):
        q = product(q, given)
        np.testing.assert_allclose(all_at_once, q, atol=1e-14)


def test_angle_between():
    q = increment([0.3, 0.4, 0], 1.0)
    for turn in (1e-12, 1e-3, 3.0):
        assert angle_between(q, -2 * product(q, increment([turn, 0, 0], 1.0))) == pytest.approx(turn, rel=1e-3)


def test_first_order_turns_by_the_arctangent():
    assert angle_between([1, 0, 0, 0], first_order_increment([0, 0.2, 0], 0.5)) == pytest.approx(2 * np.arctan(0.05))


def test_coning_rates_are_those_of_the_attitude():
    arguments = {"half_angle": 0.4, "frequency": 5.0}
    times = np.linspace(0, 2, 20001)
    q = coning_attitude(times, **arguments)
    turned = product(q[:-1] * [1, -1, -1, -1], q[1:])
    rates = coning_mean_rate(times[:-1], times[1:], **arguments)
    np.testing.assert_allclose(2 * turned[:, 1:] / 1e-4, rates, atol=1e-6)


def test_longer_floats_stay_as_long():
    count, rate = 1000, np.longdouble(0.7)
    turned = cumulative(np.eye(4)[0], increment(np.tile(rate * i[1:], (count, 1)), 0.1))
    half = count * rate * np.longdouble(0.1) / 2
    # Each of the products rounds four components once or twice.
    bound = 4 * count * np.finfo(np.longdouble).eps
    assert np.abs(turned[-1] - [np.cos(half), np.sin(half), 0, 0]).max() <= bound
