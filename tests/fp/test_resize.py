"""Conversion between formats: circuits and twin against float64, rounded once."""

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat, FpToFp

from .support import (
    BFLOAT16,
    FLOAT8,
    NARROW,
    Bank,
    assert_equal,
    canonical,
    decode,
    encode,
    numbers_for,
    with_exponent,
)

# A wider fraction than the widest standard type, and a very small range: conversions are always or almost never exact.
LONG = FloatFormat(3, 40)


def flush(fmt):
    return fmt.with_subnormals("flush")


SHAPES = [
    # from, to, latency
    (BINARY64, BINARY32, 1), (BINARY64, BINARY32, 4), (BINARY64, flush(BINARY32), 1), (BINARY64, LONG, 1),
    (flush(BINARY64), BINARY16, 2), (BINARY32, BINARY64, 1), (BINARY32, flush(BINARY64), 1), (BINARY32, BINARY16, 4),
    (BINARY32, flush(BINARY16), 1), (BINARY32, BFLOAT16, 1), (BINARY32, flush(BINARY32), 1),
    (flush(BINARY32), BINARY32, 1), (flush(BINARY32), BINARY64, 2), (flush(BINARY32), flush(BINARY16), 4),
    (BINARY16, BINARY32, 1), (BINARY16, BINARY64, 3), (BINARY16, FLOAT8, 1), (BINARY16, flush(FLOAT8), 1),
    (flush(BINARY16), BINARY32, 1), (BFLOAT16, BINARY16, 3), (BFLOAT16, LONG, 1), (FLOAT8, NARROW, 1),
    (FLOAT8, flush(NARROW), 1), (flush(NARROW), FLOAT8, 1), (NARROW, LONG, 4),
    (LONG, BINARY16, 4), (LONG, FLOAT8, 2), (LONG, BINARY32, 3),
]
SOURCES = list(dict.fromkeys(shape[0] for shape in SHAPES))


def name_of(source, fmt, latency):
    return "_".join((source.name, source.subnormals.value, fmt.name, fmt.subnormals.value, str(latency)))


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {name_of(*shape): FpToFp(shape[0], shape[1], latency=shape[2]) for shape in SHAPES}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.mark.parametrize("latency", [-1, 0, 5])
def test_latency_out_of_range(latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to 4, not {latency}$"):
        FpToFp(BINARY32, BINARY16, latency=latency)


def test_properties():
    resize = FpToFp(BINARY32, BINARY16)
    assert (resize.from_format, resize.to_format, resize.latency, resize.interval) == (BINARY32, BINARY16, 4, 1)


@pytest.mark.verilator
@pytest.mark.parametrize("source", SOURCES, ids=lambda source: f"{source.name}_{source.subnormals.value}")
def test_numbers(bank, source):
    rng = np.random.default_rng(1)
    a = numbers_for(source, rng)[:100_000]
    if source.width > 16:
        # Both ends of a smaller format's range, far inside this range; the range of LONG is even smaller.
        reach = rng.choice([4, 30, 155], len(a))
        near = with_exponent(source, a, source.bias + rng.integers(-reach, reach))
        a = np.where(rng.random(len(a)) < 0.7, near, a)
    results, numbers = bank.run(a=a), decode(source, a)
    for shape in SHAPES:
        if shape[0] != source:
            continue
        name, fmt = name_of(*shape), shape[1]
        wanted = canonical(fmt, numbers.view(np.uint64)) if fmt.width == 64 else encode(fmt, numbers)
        assert_equal(name, results[name]["result"], wanted, {"a": a})
        twin = bank.operators[name].compute(source.from_bits(a))
        assert_equal(f"{name}, twin", fmt.to_bits(twin), wanted, {"a": a})


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64))
