"""atan2 as a kernel, in float64 and in the bits of an engine without an arctangent."""

import numpy as np
import pytest

from strapdown.algorithms import arctangent
from strapdown.kernel.numeric import Float64, Twin
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector
from strapdown.kernel.pool import Pool

POOL = Pool(operators=(Adder(), Multiplier(), Divider(), Selector()))


def points(count, rng):
    """Directions all around, near the axes and the diagonals, of all lengths."""
    angle = rng.uniform(-np.pi, np.pi, count)
    near = np.round(angle / (np.pi / 4)) * (np.pi / 4) + rng.choice((-1, 1), count) * 10 ** rng.uniform(-8, -1, count)
    angle = np.where(rng.random(count) < 0.5, angle, near)
    length = 2.0 ** rng.uniform(-60, 60, count)
    return np.float32(length * np.sin(angle)), np.float32(length * np.cos(angle))


def test_polynomial_is_as_good_as_it_says():
    y, x = (np.float64(values) for values in points(100_000, np.random.default_rng(1)))
    truth = np.arctan2(y, x)
    # 1.7e-8 of the octant's angle; the rotation to other octants makes it a smaller part of the angle.
    np.testing.assert_allclose(arctangent.atan2(Float64(), y, x), truth, rtol=1.7e-8, atol=0)


def test_twin_is_within_three_units_in_the_last_place():
    y, x = points(200_000, np.random.default_rng(2))
    xp = Twin(POOL)
    result = xp.atan2(xp.lift(y), xp.lift(x)).array
    truth = np.arctan2(np.float64(y), np.float64(x))
    units = np.abs(result - truth) / np.spacing(np.abs(np.float32(truth)))
    # In ulp: the polynomial 0.3; t 0.5; its cubic part, at most a fifth of t, 5 roundings of 0.5; the sum 0.5;
    # each rotation 0.5, and the rounding of its constant 0.5: one before the result's binade, one in it.
    assert units.max() < 0.3 + 0.5 + 2.5 / 5 + 0.5 + 1.0


@pytest.mark.parametrize(("y", "x"), [
    (0.0, 1.0), (-0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0),
    (0.0, 0.0), (0.0, -0.0), (1e-30, 1e30), (1e30, 1e-30), (-3.0, -4.0)])
def test_axes_and_ends(y, x):
    xp = Twin(POOL)
    result = float(xp.atan2(xp.lift(np.float32(y)), xp.lift(np.float32(x))).array)
    assert result == pytest.approx(np.arctan2(np.float32(y), np.float32(x)), rel=3 * 2.0**-23, abs=1e-37)
    assert xp.finite
