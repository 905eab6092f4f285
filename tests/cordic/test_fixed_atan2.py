"""The results of the unrolled 16-bit arctangent; the tests of the vendor operator ``atan`` check its circuit."""

import numpy as np
import pytest

from strapdown.cordic import FixedAtan2

SEED = 20150601


def test_atan_within_its_bound():
    rng = np.random.default_rng(SEED)
    x, y = (rng.integers(-1 << 15, 1 << 15, 1_000_000) >> rng.integers(0, 16, 1_000_000) for _ in range(2))
    around = np.array([-32768, -32767, -16384, -3, -2, -1, 0, 1, 2, 3, 16384, 32766, 32767])
    x, y = np.concatenate([x, np.repeat(around, len(around))]), np.concatenate([y, np.tile(around, len(around))])
    defined = (x != 0) | (y != 0)
    error = (FixedAtan2().compute(y, x) - np.arctan2(y, x) * 8192)[defined]
    bound = FixedAtan2().error_bound
    assert bound < 0.73
    assert np.abs(error).max() <= bound
    # The bound is not much too large.
    assert np.abs(error).max() > 0.8 * bound


def test_atan_on_axes_and_diagonals():
    atan, k = FixedAtan2(), np.arange(1, 1 << 15)
    for x, y, quarters in ((k, 0, 0), (k, k, 1), (0, k, 2), (-k, k, 3),
                           (-k, 0, 4), (-k, -k, -3), (0, -k, -2), (k, -k, -1)):
        np.testing.assert_array_equal(atan.compute(y, x), np.rint(quarters * np.pi / 4 * 8192))
    assert atan.compute(0, 0) == 0


def test_latency_of_atan_is_range_checked():
    with pytest.raises(ValueError, match="latency must be from 1 to 20, not 21"):
        FixedAtan2(latency=21)
