"""Multiplication: circuits and twin against TestFloat and against float64."""

import operator

import numpy as np
import pytest

from strapdown.fp import BINARY32, FpMultiply, Rounding

from . import oracle
from .support import (
    FORMATS,
    Bank,
    assert_equal,
    canonical,
    decode,
    expected,
    pairs_for,
    random_numbers,
    random_pairs,
    sign_bit,
    vectors,
    with_exponent,
)

LATENCIES = {"binary32_gradual": (1, 3, 5, 6, 8), "binary32_flush": (1, 2, 3, 4, 5, 6),
             "binary64_flush": (3, 4)}


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"{name}_{latency}": FpMultiply(fmt, latency=latency)
                 for name, fmt in FORMATS.items() for latency in LATENCIES.get(name, (2,))}
    operators["flags"] = FpMultiply(BINARY32, flags=True)
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def directed(models, tmp_path_factory):
    """Every rounding, with flags, at several depths."""
    operators = {f"{name}_{rounding.value}": FpMultiply(FORMATS[name], latency=(1, 3, 4, 6, 7 - shift)[place],
                                                        rounding=rounding, flags=True)
                 for shift, name in enumerate(("binary32_gradual", "binary32_flush"))
                 for place, rounding in enumerate(Rounding)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("directed"))


@pytest.mark.parametrize(("name", "most"), [("binary32_gradual", 8), ("binary32_flush", 6)])
@pytest.mark.parametrize("latency", [-1, 0, 9])
def test_latency_out_of_range(name, most, latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to {most}, not {latency}$"):
        FpMultiply(FORMATS[name], latency=latency)


def test_properties():
    multiply = FpMultiply(BINARY32)
    assert (multiply.format, multiply.latency, multiply.interval) == (BINARY32, 6, 1)
    assert multiply.rounding is Rounding.NEAREST_EVEN
    assert "flags" not in multiply.signature.members
    assert FpMultiply(BINARY32, rounding="upward").rounding is Rounding.UPWARD


def test_no_such_rounding():
    with pytest.raises(ValueError, match=r"^'nearest' is not a valid Rounding$"):
        FpMultiply(BINARY32, rounding="nearest")


def test_twin_broadcasts():
    product = FpMultiply(BINARY32).compute(np.float32([[1], [2]]), 3.0)
    assert product.dtype == np.float32
    assert product.tolist() == [[3.0], [6.0]]
    assert FpMultiply(BINARY32.with_subnormals("flush")).compute(2.0**-126, 0.5) == 0


@pytest.mark.verilator
def test_testfloat(bank):
    case = vectors("f32_mul")
    bank.check(BINARY32, canonical(BINARY32, case["result"]), case["flags"], a=case["a"], b=case["b"])


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_products(bank, name):
    fmt = FORMATS[name]
    a, b = pairs_for(fmt, np.random.default_rng(1))
    bank.check(fmt, expected(fmt, np.multiply, a, b, exact=operator.mul), a=a, b=b)


@pytest.mark.verilator
@pytest.mark.parametrize("name", [name for name, fmt in FORMATS.items() if fmt.width >= 16])
def test_products_beside_the_least_normal_number(bank, name):
    fmt, rng, count = FORMATS[name], np.random.default_rng(2), 20_000
    a = with_exponent(fmt, random_numbers(fmt, count, rng), rng.integers(1, fmt.exponent_special, count))
    with np.errstate(all="ignore"):
        b = fmt.to_bits(2.0 ** (1 - fmt.bias) / np.abs(decode(fmt, a))).astype(np.uint64)
    b = (b + rng.integers(-2, 3, count).astype(np.uint64)) & ~sign_bit(fmt)
    wanted = expected(fmt, np.multiply, a, b, exact=operator.mul)
    bank.check(fmt, wanted, a=a, b=b)
    if not fmt.gradual:
        # The rounded product alone does not determine which results must be flushed.
        rounded = fmt.to_bits(fmt.from_bits(a) * fmt.from_bits(b)) & ~sign_bit(fmt)
        assert ((rounded == fmt.least_normal) & (wanted & ~sign_bit(fmt) == 0)).any()


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["binary32_gradual", "binary32_flush"])
def test_roundings(directed, name):
    fmt, rng = FORMATS[name], np.random.default_rng(4)
    a, b = random_pairs(fmt, 6000, rng)
    results = directed.run(a=a, b=b)
    data = [[oracle.datum(fmt, encoding) for encoding in rows.tolist()] for rows in (a, b)]
    for rounding in Rounding:
        wanted = np.array([oracle.multiply(fmt, *pair, rounding.value) for pair in zip(*data, strict=True)]).T
        circuit, op = results[f"{name}_{rounding.value}"], directed.operators[f"{name}_{rounding.value}"]
        numbers = fmt.from_bits(a), fmt.from_bits(b)
        for kind, rows, twin in zip(("result", "flags"), wanted, (fmt.to_bits(op.compute(*numbers)),
                                                                  op.compute_flags(*numbers)), strict=True):
            assert_equal(f"{rounding}, {kind}", circuit[kind], rows, {"a": a, "b": b})
            assert_equal(f"{rounding}, {kind} of twin", twin, rows, {"a": a, "b": b})


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64))
