"""Division and square root: circuits and twins against TestFloat and against float64."""

import operator

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FpDivide, FpDivideSquareRoot, FpSquareRoot, Rounding

from .support import (
    FORMATS,
    Bank,
    canonical,
    decode,
    expected,
    numbers_for,
    pairs_for,
    random_numbers,
    random_pairs,
    sign_bit,
    vectors,
    with_exponent,
)

FLUSH = BINARY32.with_subnormals("flush")
# Bits per cycle of the pipelined circuits.
PIPELINED = {"float8_gradual": 2, "bfloat16_gradual": 4, "binary16_gradual": 4, "binary16_flush": 5,
             "binary32_gradual": 8, "binary32_flush": 2}


@pytest.fixture(scope="module")
def pipelined(models, tmp_path_factory):
    operators = {f"{make.__name__}_{name}": make(FORMATS[name], bits_per_cycle=count)
                 for name, count in PIPELINED.items() for make in (FpDivide, FpSquareRoot)}
    operators |= {f"{make.__name__}_flags": make(BINARY32, bits_per_cycle=7, flags=True)
                  for make in (FpDivide, FpSquareRoot)}
    operators |= {f"{make.__name__}_ahead": make(BINARY32, bits_per_cycle=4, looks_ahead=True)
                  for make in (FpDivide, FpSquareRoot)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def shared(models, tmp_path_factory):
    """The circuit that cores use: few variants, many cases."""
    operators = {"gradual": FpDivideSquareRoot(BINARY32), "flush": FpDivideSquareRoot(FLUSH),
                 "flags": FpDivideSquareRoot(BINARY32, bits_per_cycle=3, flags=True),
                 "flush_3": FpDivideSquareRoot(FLUSH, bits_per_cycle=3)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def iterative(models, tmp_path_factory):
    """All other iterative circuits."""
    bits = {"narrow_gradual": 1, "binary64_gradual": 5, "binary64_flush": 2}
    operators = {f"both_{name}": FpDivideSquareRoot(fmt, bits_per_cycle=bits.get(name, 3))
                 for name, fmt in FORMATS.items()}
    operators |= {
        "both_24": FpDivideSquareRoot(BINARY32, bits_per_cycle=24),
        "ahead": FpDivideSquareRoot(BINARY32, looks_ahead=True),
        "ahead_3": FpDivideSquareRoot(FLUSH, bits_per_cycle=3, looks_ahead=True),
        "divide": FpDivide(FLUSH, iterative=True),
        "root": FpSquareRoot(FLUSH, iterative=True),
    }
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.mark.parametrize("make", [FpDivide, FpSquareRoot, FpDivideSquareRoot])
@pytest.mark.parametrize("bits", [-1, 0, 26])
def test_bits_per_cycle_out_of_range(make, bits):
    with pytest.raises(ValueError, match=f"^bits_per_cycle must be from 1 to 25, not {bits}$"):
        make(BINARY32, bits_per_cycle=bits)


def test_properties():
    pipelined, iterative, both = FpDivide(BINARY32), FpSquareRoot(BINARY16, iterative=True), \
        FpDivideSquareRoot(FLUSH, bits_per_cycle=3, rounding="downward")
    assert (pipelined.format, pipelined.bits_per_cycle, pipelined.iterative) == (BINARY32, 2, False)
    assert (pipelined.latency, FpSquareRoot(BINARY32).latency, FpDivide(FLUSH).latency) == (18, 17, 15)
    assert (iterative.latency, iterative.interval, iterative.iterative) == (8, 7, True)
    assert (both.latency, both.interval, both.iterative) == (11, 10, True)
    assert (pipelined.rounding, both.rounding) == (Rounding.NEAREST_EVEN, Rounding.DOWNWARD)
    assert "flags" not in both.signature.members
    assert [make(fmt).looks_ahead for fmt in (BINARY32, BINARY64)
            for make in (FpDivide, FpSquareRoot, FpDivideSquareRoot)] == 3 * [False] + 3 * [True]


@pytest.mark.parametrize("make", [FpDivide, FpSquareRoot, FpDivideSquareRoot])
def test_no_such_rounding(make):
    with pytest.raises(ValueError, match=r"^'nearest' is not a valid Rounding$"):
        make(BINARY32, rounding="nearest")


def test_twins_broadcast():
    result = FpDivideSquareRoot(BINARY32).compute(np.float32([[4], [9]]), 2.0, [False, True])
    assert result.dtype == np.float32
    assert result.tolist() == [[2.0, 2.0], [4.5, 3.0]]
    assert FpDivide(FLUSH).compute(2.0**-126, 2.0) == 0
    assert FpSquareRoot(FLUSH).compute(2.0**-127) == 0


def quotients(fmt, a, b):
    return expected(fmt, np.divide, a, b, exact=operator.truediv)


def roots(fmt, a):
    return expected(fmt, np.sqrt, a)


def near_least_normal(fmt, count, rng):
    """Pairs whose quotients lie within a few ulp of the least normal number, on either side."""
    b = with_exponent(fmt, random_numbers(fmt, count, rng), rng.integers(1, fmt.exponent_special, count))
    with np.errstate(all="ignore"):
        a = fmt.to_bits(2.0 ** (1 - fmt.bias) * np.abs(decode(fmt, b))).astype(np.uint64)
    return (a + rng.integers(-2, 3, count).astype(np.uint64)) & ~sign_bit(fmt), b


@pytest.mark.verilator
def test_testfloat_division(pipelined):
    case = vectors("f32_div")
    pipelined.check(BINARY32, canonical(BINARY32, case["result"]), case["flags"], a=case["a"], b=case["b"])


@pytest.mark.verilator
@pytest.mark.parametrize("file", ["f32_sqrt", "f32_sqrt_level2"])
def test_testfloat_square_root(pipelined, file):
    case = vectors(file)
    pipelined.check(BINARY32, canonical(BINARY32, case["result"]), case["flags"], a=case["a"])


@pytest.mark.verilator
def test_testfloat_shared(shared):
    division, root = vectors("f32_div"), vectors("f32_sqrt_level2")
    operands = {
        "a": np.concatenate([division["a"], root["a"]]),
        "b": np.concatenate([division["b"], division["b"][:len(root["a"])]]),
        "square_root": np.repeat(np.uint64([0, 1]), [len(division["a"]), len(root["a"])]),
    }
    wanted = canonical(BINARY32, np.concatenate([division["result"], root["result"]]))
    flags = np.concatenate([division["flags"], root["flags"]])
    order = np.random.default_rng(4).permutation(len(wanted))
    shared.check(BINARY32, wanted[order], flags[order], **{name: rows[order] for name, rows in operands.items()})


@pytest.mark.verilator
@pytest.mark.parametrize("name", PIPELINED)
def test_quotients(pipelined, name):
    fmt = FORMATS[name]
    a, b = pairs_for(fmt, np.random.default_rng(1))
    pipelined.check(fmt, quotients(fmt, a, b), a=a, b=b)


@pytest.mark.verilator
@pytest.mark.parametrize("name", PIPELINED)
def test_square_roots(pipelined, name):
    fmt = FORMATS[name]
    a = numbers_for(fmt, np.random.default_rng(1))
    pipelined.check(fmt, roots(fmt, a), a=a)


@pytest.mark.verilator
@pytest.mark.parametrize("fmt", [BINARY32, FLUSH], ids=["gradual", "flush"])
def test_shared(shared, fmt):
    rng = np.random.default_rng(5)
    a, b = pairs_for(fmt, rng)
    square_root = (rng.random(len(a)) < 0.4).astype(np.uint64)
    wanted = np.where(square_root, roots(fmt, a), quotients(fmt, a, b))
    shared.check(fmt, wanted, a=a, b=b, square_root=square_root)


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_iterative(iterative, name):
    fmt, rng = FORMATS[name], np.random.default_rng(6)
    a, b = pairs_for(fmt, rng) if fmt.width <= 8 else random_pairs(fmt, 50_000, rng)
    square_root = (rng.random(len(a)) < 0.3).astype(np.uint64)
    wanted = np.where(square_root, roots(fmt, a), quotients(fmt, a, b))
    iterative.check(fmt, wanted, a=a, b=b, square_root=square_root)
    if fmt == FLUSH:
        iterative.check(fmt, quotients(fmt, a, b), a=a, b=b)
        iterative.check(fmt, roots(fmt, a), a=a)


@pytest.mark.verilator
@pytest.mark.parametrize("name", [name for name, fmt in FORMATS.items() if fmt.width >= 16])
def test_quotients_beside_the_least_normal_number(iterative, name):
    fmt = FORMATS[name]
    a, b = near_least_normal(fmt, 20_000, np.random.default_rng(2))
    wanted = quotients(fmt, a, b)
    iterative.check(fmt, wanted, a=a, b=b, square_root=np.zeros_like(a))
    if not fmt.gradual:
        # The rounded quotient alone does not determine which results must be flushed.
        with np.errstate(all="ignore"):
            rounded = fmt.to_bits(fmt.from_bits(a) / fmt.from_bits(b)) & ~sign_bit(fmt)
        assert ((rounded == fmt.least_normal) & (wanted & ~sign_bit(fmt) == 0)).any()


@pytest.mark.verilator
@pytest.mark.parametrize("bank", ["pipelined", "shared", "iterative"])
def test_handshake(bank, request):
    bank, rng = request.getfixturevalue(bank), np.random.default_rng(3)
    widths = {"a": 64, "b": 64, "square_root": 1}
    operands = {name: rng.integers(0, 1 << width, 4000, dtype=np.uint64)
                for name, width in widths.items() if name in bank.signature.members}
    bank.check_handshake(rng, **operands)
