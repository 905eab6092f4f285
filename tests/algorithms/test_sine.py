"""Sine and cosine as a kernel, against float64 and, in binary64, against Python's decimals."""

import numpy as np
import pytest

from strapdown.algorithms import sine
from strapdown.fp import BINARY32, BINARY64, Subnormals
from strapdown.kernel.numeric import Float64, Twin
from strapdown.kernel.pool import Pool

DEGREES = np.concatenate([np.random.default_rng(1).uniform(-180, 180, 20_000), np.linspace(-180, 180, 1441),
                          np.ldexp(1.0, np.arange(-40, 7)), 90 + np.ldexp(1.0, np.arange(-40, 6))])


@pytest.mark.parametrize("format", [BINARY32, BINARY64], ids=lambda format: format.name)
def test_the_twin_is_within_its_bound(format):
    xp = Twin(Pool(format=format.with_subnormals(Subnormals.FLUSH)))
    degrees = xp.given(DEGREES)
    exact = degrees.array.astype(np.longdouble)
    # The reduction by the nearest multiple of 90 degrees is exact: the remainder is small where the result is small.
    turns = np.rint(exact / 90)
    rest = (exact - 90 * turns) * (np.pi.as_integer_ratio()[0] / np.longdouble(np.pi.as_integer_ratio()[1])
                                   + np.longdouble(1.2246467991473532e-16)) / 180
    s, c, quarter = np.sin(rest), np.cos(rest), turns.astype(int) % 4
    truth = np.choose(quarter, [s, c, -s, -c]), np.choose(quarter, [c, -s, -c, s])
    for found, expected in zip(sine.sine_cosine(xp, degrees), truth, strict=True):
        assert (np.abs(found.array - expected) <= 7 * 2.0**-format.precision * np.abs(expected)).all()


def test_a_whole_turn_is_brought_to_half_a_turn():
    degrees = np.array([-360.0, -240.0, -180.0, -90.0, 0.0, 180.0, 240.0, 359.5])
    assert sine.half_turn(Float64(), degrees).tolist() == [0, 120, -180, -90, 0, 180, -120, -0.5]
