"""Sine and cosine as a kernel, against float64 and, in binary64, against Python's decimals."""

import numpy as np
import pytest

from strapdown.algorithms import sine
from strapdown.fp import BINARY16, BINARY32, BINARY64, Subnormals
from strapdown.kernel.numeric import Float64, Twin
from strapdown.kernel.operators import SineCosine
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


@pytest.mark.parametrize("format", [BINARY16, BINARY32, BINARY64], ids=lambda format: format.name)
def test_without_their_operator_sine_and_cosine_are_within_their_bound(format):
    xp = Twin(Pool(format=format.with_subnormals(Subnormals.FLUSH)))
    ends = np.concatenate([np.pi / 4 * np.arange(-8, 9), np.ldexp(1.0, np.arange(-12, 3)), [0.0, -0.0]])
    angle = xp.given(np.concatenate([np.random.default_rng(2).uniform(-6.28, 6.28, 20_000),
                                     ends.clip(-6.28, 6.28)]))
    # Longer than binary64; π/2 to 40 digits is beside it.
    exact = angle.array.astype(np.longdouble)
    unit = 2.0**-format.precision
    for found, expected in (xp.sin(angle), np.sin(exact)), (xp.cos(angle), np.cos(exact)):
        assert (np.abs(found.array - expected) <= unit * (7 * np.abs(expected) + 2**-8)).all()
    assert not (np.signbit(xp.sin(angle).array) ^ np.signbit(angle.array))[np.abs(angle.array) < 3].any()


def test_without_their_operator_sine_and_cosine_are_close_to_the_operator():
    """The same kernel on both pools, as a kernel asks for it."""
    angle = np.random.default_rng(3).uniform(-2 * np.pi, 2 * np.pi, 2000)
    plain, own = (Twin(Pool().with_operators(*more)) for more in ((), (SineCosine(),)))
    for one, other in zip(plain.sincos(plain.given(angle)), own.sincos(own.given(angle)), strict=True):
        assert np.abs(one.array - other.array).max() < 8 * 2.0**-24


def test_a_whole_turn_is_brought_to_half_a_turn():
    degrees = np.array([-360.0, -240.0, -180.0, -90.0, 0.0, 180.0, 240.0, 359.5])
    assert sine.half_turn(Float64(), degrees).tolist() == [0, 120, -180, -90, 0, 180, -120, -0.5]
