"""Conversion to and from fixed point: circuits and twins against TestFloat and against integers."""

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FixedToFp, FpToFixed

from .support import (
    FLOAT8,
    Bank,
    assert_equal,
    canonical,
    decode,
    encode,
    numbers_for,
    vectors,
    with_exponent,
)

FLUSH = BINARY32.with_subnormals("flush")
SHAPES = [
    # format, width, fraction bits, latency
    (BINARY32, 32, 0, 1), (BINARY32, 32, 0, 2), (BINARY32, 12, 5, 3), (FLUSH, 32, 29, 2), (FLUSH, 54, 53, 1),
    (BINARY16, 32, 31, 2), (BINARY16.with_subnormals("flush"), 20, 19, 3), (BINARY64, 54, 20, 2),
    (FLOAT8, 4, 3, 2), (FLOAT8.with_subnormals("flush"), 24, 18, 2),
]


def name_of(fmt, *shape):
    return "_".join(map(str, (fmt.name, fmt.subnormals.value, *shape)))


def bank_of(make, models, directory):
    operators = {name_of(fmt, width, fraction_bits, latency):
                 make(fmt, width=width, fraction_bits=fraction_bits, latency=latency)
                 for fmt, width, fraction_bits, latency in SHAPES}
    operators["flags"] = make(BINARY32, width=32, fraction_bits=0, flags=True)
    return Bank(operators).build(models, directory)


@pytest.fixture(scope="module")
def to_fixed(models, tmp_path_factory):
    return bank_of(FpToFixed, models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def to_float(models, tmp_path_factory):
    return bank_of(FixedToFp, models, tmp_path_factory.mktemp("bank"))


def as_signed(values, width):
    """Two's complement in the low bits of uint64 to int64."""
    return (values << np.uint64(64 - width)).view(np.int64) >> (64 - width)


@pytest.mark.parametrize("make", [FpToFixed, FixedToFp])
@pytest.mark.parametrize(("options", "message"), [
    ({"width": 1, "fraction_bits": 0}, "width must be at least 2, not 1"),
    ({"width": 32, "fraction_bits": -1}, "fraction_bits must be from 0 to 31, not -1"),
    ({"width": 32, "fraction_bits": 32}, "fraction_bits must be from 0 to 31, not 32"),
    ({"width": 32, "fraction_bits": 0, "latency": 0}, "latency must be from 1 to 4, not 0"),
    ({"width": 32, "fraction_bits": 0, "latency": 5}, "latency must be from 1 to 4, not 5"),
])
def test_parameters_out_of_range(make, options, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        make(BINARY32, **options)


@pytest.mark.parametrize("make", [FpToFixed, FixedToFp])
def test_properties(make):
    convert = make(BINARY32, width=32, fraction_bits=30)
    assert (convert.format, convert.width, convert.fraction_bits) == (BINARY32, 32, 30)
    assert (convert.latency, convert.interval) == (4, 1)


@pytest.mark.verilator
@pytest.mark.parametrize("level", ["", "_level2"])
def test_testfloat_to_fixed(to_fixed, level):
    case = vectors(f"f32_to_i32{level}")
    wanted = case["result_riscv"].view(np.int64)
    results = to_fixed.run(a=case["a"])
    for latency in (1, 2):
        name = name_of(BINARY32, 32, 0, latency)
        assert_equal(name, as_signed(results[name]["result"], 32), wanted, case)
        assert_equal(f"{name}, twin", to_fixed.operators[name].compute(BINARY32.from_bits(case["a"])), wanted, case)
    convert = to_fixed.operators["flags"]
    assert_equal("flags", results["flags"]["flags"], case["flags"], case)
    assert_equal("flags of twin", convert.compute_flags(BINARY32.from_bits(case["a"])), case["flags"], case)


@pytest.mark.verilator
@pytest.mark.parametrize("level", ["", "_level2"])
def test_testfloat_to_float(to_float, level):
    case = vectors(f"i32_to_f32{level}")
    results = to_float.run(operand=case["a"])
    for latency in (1, 2):
        name = name_of(BINARY32, 32, 0, latency)
        twin = to_float.operators[name].compute(case["a"].view(np.int64))
        assert_equal(name, results[name]["result"], canonical(BINARY32, case["result"]), case)
        assert_equal(f"{name}, twin", BINARY32.to_bits(twin), case["result"], case)
    convert = to_float.operators["flags"]
    assert_equal("flags", results["flags"]["flags"], case["flags"], case)
    assert_equal("flags of twin", convert.compute_flags(case["a"].view(np.int64)), case["flags"], case)


@pytest.mark.verilator
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: name_of(*shape))
def test_to_fixed(to_fixed, shape):
    fmt, width, fraction_bits, _ = shape
    convert, rng = to_fixed.operators[name_of(*shape)], np.random.default_rng(1)
    a = numbers_for(fmt, rng)
    if fmt.width > 16:
        # Most of the range of a float is far outside the range of a fixed-point number.
        exponent = fmt.bias - fraction_bits + rng.integers(-3, width + 3, len(a))
        a = np.where(rng.random(len(a)) < 0.8, with_exponent(fmt, a, exponent), a)
    result = as_signed(to_fixed.run(a=a)[name_of(*shape)]["result"], width)

    # Ties to even by integers: twice the number, cut off, decides on which side of a half it is.
    least, largest = -(1 << width - 1), (1 << width - 1) - 1
    numbers = decode(fmt, a)
    with np.errstate(all="ignore"):
        doubled = np.clip(np.nan_to_num(np.ldexp(numbers, fraction_bits + 1), nan=np.inf), 4.0 * least, 4.0 * -least)
    half_steps = np.floor(doubled)
    below, odd, rest = (half_steps // 2).astype(np.int64), half_steps % 2 == 1, doubled != half_steps
    wanted = np.clip(below + (odd & (rest | (below % 2 == 1))), least, largest)
    assert_equal(name_of(*shape), result, wanted, {"a": a})
    assert_equal(f"{name_of(*shape)}, twin", convert.compute(fmt.from_bits(a)), wanted, {"a": a})


@pytest.mark.verilator
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: name_of(*shape))
def test_to_float(to_float, shape):
    fmt, width, fraction_bits, _ = shape
    convert, rng = to_float.operators[name_of(*shape)], np.random.default_rng(1)
    # All magnitudes with equal frequency, and the ends of the range.
    count = 1_000_000
    operand = rng.integers(-(1 << width - 1), 1 << width - 1, count) >> rng.integers(0, width, count)
    operand[:6] = 0, 1, -1, (1 << width - 1) - 1, -(1 << width - 1), -(1 << width - 1) + 1
    bits = operand.view(np.uint64) & np.uint64((1 << width) - 1)
    result = to_float.run(operand=bits)[name_of(*shape)]["result"]
    wanted = encode(fmt, np.ldexp(operand.astype(float), -fraction_bits))
    assert_equal(name_of(*shape), result, wanted, {"operand": operand})
    assert_equal(f"{name_of(*shape)}, twin", fmt.to_bits(convert.compute(operand)), wanted, {"operand": operand})


@pytest.mark.verilator
@pytest.mark.parametrize("bank", ["to_fixed", "to_float"])
def test_handshake(bank, request):
    bank, rng = request.getfixturevalue(bank), np.random.default_rng(3)
    member = next(name for name in ("a", "operand") if name in bank.signature.members)
    bank.check_handshake(rng, **{member: rng.integers(0, 1 << 64, 2000, dtype=np.uint64) >> 10})
