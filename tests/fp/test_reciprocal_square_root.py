"""Reciprocal square root: circuits and twin against integer square roots."""

import math

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat, FpReciprocalSquareRoot

from .support import FORMATS, Bank, assert_equal, decode, random_numbers, sign_bit, specials

FLUSH = BINARY32.with_subnormals("flush")
# The fraction is so wide and the range so small that the reciprocal roots of small subnormals overflow.
LONG = FloatFormat(3, 12)


@pytest.fixture(scope="module")
def fast(models, tmp_path_factory):
    """A circuit with few cycles, for many cases."""
    operators = {"gradual": FpReciprocalSquareRoot(BINARY32, bits_per_cycle=8),
                 "flush": FpReciprocalSquareRoot(FLUSH, bits_per_cycle=7)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    """All formats, with bits per cycle that divide the precision and that do not."""
    bits = {"float8_gradual": 4, "narrow_gradual": 1, "binary16_gradual": 1, "binary32_gradual": 3,
            "binary64_gradual": 5, "binary64_flush": 5}
    operators = {name: FpReciprocalSquareRoot(fmt, bits_per_cycle=bits.get(name, 2)) for name, fmt in FORMATS.items()}
    operators["long"] = FpReciprocalSquareRoot(LONG)
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


isqrt = np.frompyfunc(math.isqrt, 1, 1)


def reciprocal_roots(fmt, a):
    """Encodings, by integers of any length: 2**(p+1) / sqrt(x), cut off, then rounded."""
    numbers = decode(fmt, a)
    wanted = np.full(len(a), fmt.nan, dtype=np.uint64)
    wanted[numbers == np.inf] = 0
    zero = numbers == 0
    wanted[zero] = np.uint64(fmt.infinity) | (a[zero] & sign_bit(fmt))

    usable = (numbers > 0) & (numbers < np.inf)
    fraction, exponent = np.frexp(numbers[usable])
    odd = exponent % 2 == 0
    x = np.ldexp(fraction, fmt.precision).astype(np.int64) << odd
    # A tie never occurs: except for one, the square of a root with so few bits would have too many bits.
    rounded = (isqrt((1 << 3 * fmt.precision + 1) // x.astype(object)) + 1).astype(np.int64) >> 1
    stored = fmt.bias - 1 - (exponent - 1 - odd) // 2
    encodings = ((stored.astype(np.int64) - 1) << fmt.fraction_width) + rounded
    wanted[usable] = np.minimum(encodings, fmt.infinity).astype(np.uint64)
    return wanted


def check(bank, a):
    """Compare the results of every circuit and twin; each takes as many low bits as its format has."""
    results = bank.run(a=a)
    for name, root in bank.operators.items():
        fmt = root.format
        operand = a & np.uint64((1 << fmt.width) - 1)
        wanted = reciprocal_roots(fmt, operand)
        assert_equal(name, results[name]["result"], wanted, {"a": operand})
        assert_equal(f"{name}, twin", fmt.to_bits(root.compute(fmt.from_bits(operand))), wanted, {"a": operand})


@pytest.mark.parametrize("bits", [-1, 0, 25])
def test_bits_per_cycle_out_of_range(bits):
    with pytest.raises(ValueError, match=f"^bits_per_cycle must be from 1 to 24, not {bits}$"):
        FpReciprocalSquareRoot(BINARY32, bits_per_cycle=bits)


def test_format_without_range():
    with pytest.raises(ValueError, match=r"^exponent_width of format must be at least 3, not 2$"):
        FpReciprocalSquareRoot(FloatFormat(2, 5))


def test_properties():
    default, long = FpReciprocalSquareRoot(BINARY32), FpReciprocalSquareRoot(BINARY16, bits_per_cycle=4)
    assert (default.format, default.bits_per_cycle, default.iterative) == (BINARY32, 2, True)
    assert (default.latency, default.interval) == (14, 13)
    assert (long.latency, long.interval) == (5, 4)


@pytest.mark.verilator
def test_binary32(fast):
    check(fast, random_numbers(BINARY32, 1_000_000, np.random.default_rng(1)))


@pytest.mark.verilator
def test_all_short_operands(bank):
    high = np.random.default_rng(2).integers(0, 1 << 48, 1 << 16, dtype=np.uint64) << np.uint64(16)
    check(bank, np.arange(1 << 16, dtype=np.uint64) | high)


@pytest.mark.verilator
@pytest.mark.parametrize("fmt", [BINARY32, BINARY64], ids=lambda fmt: fmt.name)
def test_long_operands(bank, fmt):
    # Powers of two and their neighbours, where a result is exact or nearly exact.
    exponents = np.arange(fmt.exponent_special, dtype=np.uint64) << np.uint64(fmt.fraction_width)
    beside = (exponents[:, None] + np.arange(-2, 3).astype(np.uint64)).ravel()
    check(bank, np.concatenate([specials(fmt), beside, random_numbers(fmt, 10_000, np.random.default_rng(4))]))


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["fast", "bank"])
def test_handshake(name, request):
    bank, rng = request.getfixturevalue(name), np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 3000, dtype=np.uint64))
