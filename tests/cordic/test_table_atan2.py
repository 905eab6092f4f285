"""Arctangent by tables: circuits against the twin, the twin against extended precision and the CORDIC operator."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.cordic import CordicAtan2, TableAtan2
from strapdown.fp import BINARY16, BINARY32, FloatFormat

from ..fp.support import Bank, assert_equal, random_numbers, specials

FLUSH = BINARY32.with_subnormals("flush")
HALF = BINARY16.with_subnormals("flush")
BOUND = 1.8
"""Greatest error in units in the last place, from the docstring."""
DEGREES = 180 / np.longdouble("3.14159265358979323846264338327950288")


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"latency{latency}": TableAtan2(FLUSH, latency=latency) for latency in (2, 5, 11, 17)}
    operators |= {"degrees": TableAtan2(FLUSH, degrees=True), "half": TableAtan2(HALF, degrees=True),
                  "negative_nan": TableAtan2(replace(FLUSH, negative_nan=True), latency=8)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


def vectors(kind, count, rng):
    """y and x of one kind, binary32."""
    y, x = rng.standard_normal((2, count)).astype(np.float32)
    scale = np.exp2(rng.integers(-30, 30, count)).astype(np.float32)
    ulps = (np.float32(2.0**-23) * rng.integers(-9, 10, (2, count))).astype(np.float32)
    match kind:
        case "any":
            return y, x
        case "any ratio":
            return y * scale, x
        case "near 45 degrees":
            return x * (1 + ulps[0] * np.float32(8)), x
        case "small angles":
            return y * np.float32(2.0**-20), np.abs(x)
        case "near powers of two":
            return scale * (1 + ulps[0]), np.float32(8) * (1 + ulps[1])
        case "near the axes":
            return y * np.float32(2.0**-25) * np.float32(3), x
    raise ValueError(kind)


@pytest.mark.parametrize("degrees", [False, True])
@pytest.mark.parametrize("kind", ["any", "any ratio", "near 45 degrees", "small angles", "near powers of two",
                                  "near the axes"])
def test_error(kind, degrees):
    y, x = vectors(kind, 200_000, np.random.default_rng(7))
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble)) * (DEGREES if degrees else 1)
    _, exponent = np.frexp(exact)
    error = (TableAtan2(FLUSH, degrees=degrees).compute(y, x) - exact) / np.ldexp(np.longdouble(1), exponent - 24)
    assert np.abs(error).max() < BOUND


@pytest.mark.parametrize("fmt", [FLUSH, HALF], ids=lambda fmt: fmt.name)
def test_special_values_are_those_of_the_other_operator(fmt):
    numbers = np.array([0, -0.0, np.inf, -np.inf, np.nan, 1, -1, 3, -5, 1e-40, fmt.from_bits(fmt.least_normal),
                        fmt.from_bits(fmt.infinity - 1)]).astype(fmt.dtype)
    y, x = np.meshgrid(numbers, numbers)
    special = ~np.isfinite(y) | ~np.isfinite(x) | (fmt.flush(y) == 0) | (fmt.flush(x) == 0) | (np.abs(y) == np.abs(x))
    found, other = (fmt.to_bits(make(fmt).compute(y, x)) for make in (TableAtan2, CordicAtan2))
    assert (found[special] == other[special]).all()
    assert np.abs(found.astype(np.int64) - other).max() <= 2


def test_multiples_of_45_degrees_are_exact():
    operator = TableAtan2(FLUSH, degrees=True)
    y, x = np.meshgrid(np.float32([3, 0, -3]), np.float32([3, 0, -3]))
    assert (operator.compute(y, x) == np.degrees(np.arctan2(y, x.astype(float)))).all()


def test_an_angle_below_the_range_is_a_zero_of_the_same_sign():
    y, x = np.float32([2.0**-100, -(2.0**-100)]), np.float32(2.0**100)
    assert (FLUSH.to_bits(TableAtan2(FLUSH).compute(y, x)) == [0, 1 << 31]).all()
    assert (TableAtan2(FLUSH).compute(y, -x) == np.float32([np.pi, -np.pi])).all()


@pytest.mark.parametrize("fmt", [BINARY32, FloatFormat(8, 24).with_subnormals("flush"),
                                 FloatFormat(4, 12).with_subnormals("flush")], ids=lambda fmt: fmt.name)
def test_formats_that_do_not_fit(fmt):
    with pytest.raises(ValueError, match=r"^format must have a precision of 10 to 24 bits, an exponent_width of at "
                                         r"least 5, and flush subnormals, not "):
        TableAtan2(fmt)


@pytest.mark.parametrize("latency", [1, 18])
def test_latency_out_of_range(latency):
    with pytest.raises(ValueError, match=rf"^latency must be from [12] to 17, not {latency}$"):
        TableAtan2(FLUSH, latency=latency)


@pytest.mark.verilator
def test_circuit_is_the_twin(bank):
    rng = np.random.default_rng(2)
    pairs = [np.meshgrid(specials(FLUSH), specials(FLUSH))]
    pairs += [[FLUSH.to_bits(values) for values in vectors(kind, 20_000, rng)]
              for kind in ("any", "any ratio", "near 45 degrees", "small angles", "near powers of two")]
    pairs += [[random_numbers(FLUSH, 100_000, rng), random_numbers(FLUSH, 100_000, rng)]]
    y, x = (np.concatenate([np.ravel(pair[side]).astype(np.uint64) for pair in pairs]) for side in (0, 1))
    results = bank.run(y=y, x=x)
    for name, operator in bank.operators.items():
        fmt = operator.format
        operands = {member: bits & np.uint64((1 << fmt.width) - 1) for member, bits in (("y", y), ("x", x))}
        wanted = fmt.to_bits(operator.compute(*map(fmt.from_bits, operands.values())))
        assert_equal(name, results[name]["result"], wanted, operands)


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, y=rng.integers(0, 1 << 32, 3000, dtype=np.uint64),
                         x=rng.integers(0, 1 << 32, 3000, dtype=np.uint64))
