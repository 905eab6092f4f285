"""Minimum and maximum: circuits and twin against the order of the encodings and against NumPy."""

import numpy as np
import pytest

from strapdown.fp import BINARY32, FpMinMax

from .support import FORMATS, Bank, decode, flushed, is_nan, magnitude, pairs_for, sign_bit


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"{name}_{latency}": FpMinMax(fmt, latency=latency)
                 for name, fmt in FORMATS.items() for latency in ((1, 2) if fmt.width == 32 else (1,))}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


def rank_of(fmt, encodings):
    """Rank of a number in the order of all numbers, with -0 below +0, as an integer."""
    encodings = flushed(fmt, encodings)
    size = magnitude(fmt, encodings).astype(np.int64)
    return np.where(encodings & sign_bit(fmt), ~size, size)


def extremes(fmt, a, b, maximum):
    place = np.where(maximum, np.maximum(rank_of(fmt, a), rank_of(fmt, b)),
                     np.minimum(rank_of(fmt, a), rank_of(fmt, b)))
    encodings = np.where(place < 0, sign_bit(fmt) | (~place).astype(np.uint64), place.astype(np.uint64))
    return np.where(is_nan(fmt, a) | is_nan(fmt, b), np.uint64(fmt.nan), encodings)


@pytest.mark.parametrize("latency", [-1, 0, 3])
def test_latency_out_of_range(latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to 2, not {latency}$"):
        FpMinMax(BINARY32, latency=latency)


def test_properties():
    min_max = FpMinMax(BINARY32)
    assert (min_max.format, min_max.latency, min_max.interval) == (BINARY32, 1, 1)


def test_zeros_and_nan():
    zeros = np.float32([-0.0, 0.0])
    min_max = FpMinMax(BINARY32)
    assert np.signbit(min_max.compute(zeros, zeros[::-1], False)).all()
    assert not np.signbit(min_max.compute(zeros, zeros[::-1], True)).any()
    assert np.isnan(min_max.compute(np.nan, 1, [False, True])).all()
    assert np.isnan(min_max.compute(-np.inf, np.nan, [False, True])).all()


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_extremes(bank, name):
    fmt, rng = FORMATS[name], np.random.default_rng(1)
    a, b = (rows[:100_000] for rows in pairs_for(fmt, rng))
    if fmt.width <= 8:
        a, b, maximum = np.tile(a, 2), np.tile(b, 2), np.repeat(np.uint64([0, 1]), len(a))
    else:
        maximum = rng.integers(0, 2, len(a), dtype=np.uint64)
    wanted = extremes(fmt, a, b, maximum)
    x, y = decode(fmt, a), decode(fmt, b)
    np.testing.assert_array_equal(decode(fmt, wanted), np.where(maximum, np.maximum(x, y), np.minimum(x, y)))
    bank.check(fmt, wanted, a=a, b=b, maximum=maximum)


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         maximum=rng.integers(0, 2, 2000, dtype=np.uint64))
