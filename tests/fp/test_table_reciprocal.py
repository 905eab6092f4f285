"""Reciprocal and reciprocal square root by a table: circuits against the twin, the twin against exact arithmetic."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, FloatFormat, FpTableReciprocal

from .support import Bank, assert_equal, random_numbers, specials

FLUSH = BINARY32.with_subnormals("flush")
HALF = BINARY16.with_subnormals("flush")
WIDE = FloatFormat(11, 20).with_subnormals("flush")
BOUND = 0.88
"""Greatest error in units in the last place, from the docstring."""


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    """All latencies in binary32, and other formats."""
    operators = {f"latency{latency}": FpTableReciprocal(FLUSH, latency=latency) for latency in range(1, 8)}
    operators |= {"half": FpTableReciprocal(HALF), "wide": FpTableReciprocal(WIDE),
                  "negative_nan": FpTableReciprocal(replace(FLUSH, negative_nan=True))}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


def exact(fmt, a, square_root):
    """The exact values, correct to 80 bits, and the units in the last place of the results."""
    values = a.astype(np.longdouble)
    values = 1 / (np.sqrt(values) if square_root else values)
    _, exponent = np.frexp(values)
    return values, np.ldexp(np.longdouble(1), exponent - fmt.precision)


@pytest.mark.parametrize("square_root", [False, True])
@pytest.mark.parametrize("fmt", [FLUSH, HALF], ids=lambda fmt: fmt.name)
def test_error_of_all_significands(fmt, square_root):
    """All significands of two binades: the results of the others differ only in the exponent."""
    a = fmt.from_bits(np.arange(2 << fmt.fraction_width) + (fmt.bias << fmt.fraction_width))
    values, unit = exact(fmt, a, square_root)
    error = (FpTableReciprocal(fmt).compute(a, square_root) - values) / unit
    assert np.abs(error).max() < BOUND
    assert (np.abs(error).max() > 0.5) == (fmt is FLUSH)  # The table is precise enough to round binary16 correctly.


@pytest.mark.parametrize("square_root", [False, True])
def test_other_exponents(square_root):
    rng = np.random.default_rng(1)
    a = np.abs(FLUSH.from_bits(random_numbers(FLUSH, 100_000, rng)))
    a = a[(a >= 2.0**-126) & (a < 2.0**126)]
    values, unit = exact(FLUSH, a, square_root)
    assert np.abs((FpTableReciprocal(FLUSH).compute(a, square_root) - values) / unit).max() < BOUND


@pytest.mark.parametrize("fmt", [FLUSH, HALF, WIDE], ids=lambda fmt: fmt.name)
def test_powers_are_exact(fmt):
    operator, exponents = FpTableReciprocal(fmt), np.arange(1 - fmt.bias, fmt.bias)
    powers = np.ldexp(np.float64(1), exponents).astype(fmt.dtype)
    assert (operator.compute(powers, False).astype(float) == np.ldexp(1.0, -exponents)).all()
    even = exponents[exponents % 2 == 0]
    assert (operator.compute(powers[exponents % 2 == 0], True).astype(float) == np.ldexp(1.0, -even // 2)).all()


@pytest.mark.parametrize(("a", "reciprocal", "root"), [
    (0.0, np.inf, np.inf), (-0.0, -np.inf, -np.inf), (np.inf, 0.0, 0.0), (-np.inf, -0.0, np.nan),
    (np.nan, np.nan, np.nan), (-4.0, -0.25, np.nan), (1e-40, np.inf, 1e20), (-1e-40, -np.inf, -np.inf),
    (2.0**126, 2.0**-126, 2.0**-63), (-2.0**127, -0.0, np.nan), (2.0**126 * 1.5, 0.0, None)])
def test_special_values(a, reciprocal, root):
    operator, a = FpTableReciprocal(FLUSH), np.float32(a)
    wanted = {False: reciprocal, True: np.inf if a == np.float32(1e-40) else root}
    for square_root, value in wanted.items():
        if value is not None:
            assert FLUSH.to_bits(operator.compute(a, square_root)) == FLUSH.to_bits(np.float32(value))


@pytest.mark.parametrize("fmt", [BINARY32, FloatFormat(8, 24).with_subnormals("flush"),
                                 FloatFormat(8, 8).with_subnormals("flush"),
                                 FloatFormat(2, 12).with_subnormals("flush")], ids=lambda fmt: fmt.name)
def test_formats_that_do_not_fit(fmt):
    with pytest.raises(ValueError, match=r"^format must have a precision of 10 to 24 bits, an exponent_width of at "
                                         r"least 3, and flush subnormals, not "):
        FpTableReciprocal(fmt)


def test_latencies():
    assert (FpTableReciprocal(FLUSH).latency, FpTableReciprocal(FLUSH).interval) == (5, 1)
    with pytest.raises(ValueError, match=r"^latency must be from 1 to 7, not 8$"):
        FpTableReciprocal(FLUSH, latency=8)


@pytest.mark.verilator
def test_circuit_is_the_twin(bank):
    rng = np.random.default_rng(2)
    beside = (np.arange(256, dtype=np.uint64)[:, None] << np.uint64(23)) + np.arange(-2, 3).astype(np.uint64)
    a = np.concatenate([specials(FLUSH), beside.ravel(), random_numbers(FLUSH, 200_000, rng),
                        rng.integers(0, 1 << 32, 20_000, dtype=np.uint64)])
    square_root = rng.integers(0, 2, len(a), dtype=np.uint64)
    results = bank.run(a=a, square_root=square_root)
    for name, operator in bank.operators.items():
        fmt = operator.format
        operand = a & np.uint64((1 << fmt.width) - 1)
        wanted = fmt.to_bits(operator.compute(fmt.from_bits(operand), square_root.astype(bool)))
        assert_equal(name, results[name]["result"], wanted, {"a": operand, "square_root": square_root})


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 32, 3000, dtype=np.uint64),
                         square_root=rng.integers(0, 2, 3000, dtype=np.uint64))
