"""Sum of two products: circuits and twin against fractions of Python integers."""

import numpy as np
import pytest

from strapdown.fp import BINARY32, BINARY64, FloatFormat, FpSumOfProducts, Rounding

from . import oracle
from .support import Bank, assert_equal, magnitude, random_numbers, with_exponent

SMALL = FloatFormat(2, 1)
FORMATS = {f"{name}_{policy}": fmt.with_subnormals(policy)
           for name, fmt in (("narrow", FloatFormat(3, 4)), ("binary32", BINARY32))
           for policy in ("gradual", "flush")} | {"binary64_gradual": BINARY64}
MOST = {"gradual": 11, "flush": 10}
"""Greatest latency for each policy."""


@pytest.fixture(scope="module")
def small_bank(models, tmp_path_factory):
    """Every rounding of a small format, with flags, in half of the depths."""
    return Bank({f"{policy}_{rounding.value}": FpSumOfProducts(
        SMALL.with_subnormals(policy), latency=most - 2 * index, rounding=rounding, flags=True)
        for policy, most in MOST.items() for index, rounding in enumerate(Rounding)}
    ).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    """Greater formats, the narrow ones without ranks inside. Wide circuits take long to compile."""
    operators = {name: FpSumOfProducts(
        fmt, latency=1 if fmt.width < 32 else None, flags=fmt.gradual,
        rounding=Rounding.DOWNWARD if fmt.gradual else Rounding.NEAREST_EVEN) for name, fmt in FORMATS.items()}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


def product(a, b):
    """The exact product as a datum; it is signalling if it raises invalid."""
    undefined = (a.infinite and b.value == 0) or (b.infinite and a.value == 0)
    negative, is_nan = a.negative != b.negative, a.nan or b.nan or undefined
    value = None if is_nan or a.infinite or b.infinite else a.value * b.value
    return oracle.Datum(negative, value, is_nan, a.signalling or b.signalling or undefined)


def expected(fmt, rounding, operands, subtract):
    """Encodings and flags of rows of operands."""
    data = [[oracle.datum(fmt, encoding) for encoding in rows.tolist()] for rows in operands]
    return np.array([
        (oracle.subtract if negative else oracle.add)(fmt, product(a, b), product(c, d), rounding.value)
        for a, b, c, d, negative in zip(*data, subtract.tolist(), strict=True)], dtype=np.uint64).T


def check(bank, fmt, operands, subtract, wanted=expected):
    """Compare circuits and twins of a format with the oracle, or with another function like ``expected``."""
    shown = dict(zip("abcd", operands, strict=True), subtract=subtract)
    results = bank.run(**shown)
    numbers = [fmt.from_bits(rows) for rows in operands]
    for name, op in bank.operators.items():
        if op.format == fmt:
            encodings, flags = wanted(fmt, op.rounding, operands, subtract)
            assert_equal(name, results[name]["result"], encodings, shown)
            assert_equal(f"{name}, twin", fmt.to_bits(op.compute(*numbers, subtract)), encodings, shown)
            assert_equal(f"{name}, flags of twin", op.compute_flags(*numbers, subtract), flags, shown)
            if "flags" in results[name]:
                assert_equal(f"{name}, flags", results[name]["flags"], flags, shown)


def random_operands(fmt, count, rng):
    """Random rows: independent; the second product near the first; products whose bits meet in the sum; products
    whose sum is near the ends of the range."""
    a, b, c, d = (random_numbers(fmt, count, rng) for _ in range(4))
    kind = rng.integers(0, 4, count)
    mask = np.uint64((1 << fmt.width) - 1 if fmt.width < 64 else ~np.uint64(0))
    near = [(rows + rng.integers(-2, 3, count).astype(np.uint64)) & mask for rows in (a, b)]
    c, d = np.where(kind == 1, near[0], c), np.where(kind == 1, near[1], d)
    exponents = [(magnitude(fmt, rows) >> np.uint64(fmt.fraction_width)).astype(np.int64) for rows in (a, b, c)]
    ends = rng.choice([2, fmt.bias + 1, 3 * fmt.bias], count) + rng.integers(-2, 3, count)
    b = np.where(kind == 3, with_exponent(fmt, b, ends - exponents[0]), b)
    exponents[1] = np.where(kind == 3, np.clip(ends - exponents[0], 0, fmt.exponent_special - 1), exponents[1])
    meets = exponents[0] + exponents[1] - exponents[2] + rng.integers(-fmt.precision - 4, fmt.precision + 5, count)
    return a, b, c, np.where(kind >= 2, with_exponent(fmt, d, meets), d)


def expected_of_all(fmt, rounding, operands, subtract):
    """Encodings and flags of all operands, in the order of their encodings: each sum is computed once."""
    numbers = [oracle.datum(fmt, encoding) for encoding in range(1 << fmt.width)]
    pairs = [product(a, b) for a in numbers for b in numbers]
    kinds = list(dict.fromkeys(pairs))
    sums = np.array([[[operation(fmt, first, second, rounding.value) for second in kinds] for first in kinds]
                     for operation in (oracle.add, oracle.subtract)], dtype=np.uint64)
    places = [kinds.index(pair) for pair in pairs]
    return sums[:, places][:, :, places].reshape(-1, 2).T


@pytest.mark.verilator
@pytest.mark.parametrize("policy", ["gradual", "flush"])
def test_all_operands_of_a_small_format(small_bank, policy):
    fmt = SMALL.with_subnormals(policy)
    subtract, *operands = np.indices((2, *4 * (1 << fmt.width,)), dtype=np.uint64).reshape(5, -1)
    check(small_bank, fmt, operands, subtract, expected_of_all)


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_sums(bank, name):
    rng = np.random.default_rng(2)
    check(bank, FORMATS[name], random_operands(FORMATS[name], 3000, rng), rng.integers(0, 2, 3000, dtype=np.uint64))


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["binary32_gradual", "binary32_flush", "binary64_gradual"])
def test_named_sums(bank, name):
    fmt = FORMATS[name]
    one, least = fmt.encode(1), fmt.least_normal
    great, top = fmt.infinity - 1, (fmt.exponent_special - 2) << fmt.fraction_width
    rows = np.array([
        [great, great, great, great],           # a zero sum of products beyond the range
        [great, great - 1, great, great],
        [fmt.infinity, one, great, great],      # the infinite product has the smaller exponent
        [fmt.infinity, least, great, great],
        [0, great, one, one],                   # a product of zero with a great exponent
        [one, one, 0, great],
        [one + 1, one + 1, one, one + 2],       # one unit of the last place of a product is left
        [least, one, 1, one],
        [least + 1, one - 1, one, 0],           # just below the least normal number
        # The product of a subnormal number has the greater exponent, and is nearly that of two normal numbers.
        [1, top, least + 5, top + 3 - (fmt.fraction_width << fmt.fraction_width)],
    ], dtype=np.uint64)
    rows = np.concatenate([rows, rows[:, [2, 3, 0, 1]]]).repeat(2, axis=0)
    check(bank, fmt, [*rows.T], np.tile(np.arange(2, dtype=np.uint64), len(rows) // 2))


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    operands = {name: rng.integers(0, 1 << 64, 500, dtype=np.uint64) for name in "abcd"}
    bank.check_handshake(rng, **operands, subtract=rng.integers(0, 2, 500, dtype=np.uint64))


@pytest.mark.parametrize(("policy", "most"), MOST.items())
@pytest.mark.parametrize("latency", [-1, 0, 12])
def test_latency_out_of_range(policy, most, latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to {most}, not {latency}$"):
        FpSumOfProducts(BINARY32.with_subnormals(policy), latency=latency)


def test_properties():
    op = FpSumOfProducts(BINARY32)
    assert (op.format, op.latency, op.interval, op.rounding) == (BINARY32, 9, 1, Rounding.NEAREST_EVEN)
    assert "flags" not in op.signature.members
    assert FpSumOfProducts(BINARY32, rounding="upward").rounding is Rounding.UPWARD


def test_no_such_rounding():
    with pytest.raises(ValueError, match=r"^'nearest' is not a valid Rounding$"):
        FpSumOfProducts(BINARY32, rounding="nearest")


def test_twin_broadcasts():
    total = FpSumOfProducts(BINARY32).compute(np.float32([[1], [2]]), 3.0, 4.0, 5.0, [False, True])
    assert total.dtype == np.float32
    assert total.tolist() == [[23.0, -17.0], [26.0, -14.0]]


def test_one_rounding():
    """Products that are rounded first lose what is left of their difference."""
    a = np.float32(1 + 2.0**-23)
    assert FpSumOfProducts(BINARY32).compute(a, a, a, a, True) == 0
    assert FpSumOfProducts(BINARY32).compute(a, a, 1.0, np.float32(1 + 2.0**-22), True) == 2.0**-46
