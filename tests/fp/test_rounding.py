"""Rounding directions and exception flags: twins of many formats against fractions of Python
integers, circuits of binary32 against the twins."""

import numpy as np
import pytest

from strapdown.fp import (
    BINARY16,
    BINARY32,
    BINARY64,
    FLAGS,
    FixedToFp,
    Flags,
    FloatFormat,
    FpDivideSquareRoot,
    FpReciprocalSquareRoot,
    FpToFixed,
    FpToFp,
    Rounding,
    exact,
)

from . import oracle
from .support import BFLOAT16, Bank, assert_equal, random_numbers, random_pairs, with_exponent

WIDTHS = [BINARY16, BINARY32, BINARY64, BFLOAT16, FloatFormat(6, 9), FloatFormat(3, 40), FloatFormat(2, 1)]
ALL = [fmt.with_subnormals(policy) for fmt in WIDTHS for policy in ("gradual", "flush")]
# One direction per policy: the tests with eight bits try all combinations.
POLICIES = dict(zip(Rounding, ("flush", "gradual", "flush", "gradual", "flush"), strict=True))
FIXED = [(8, 3), (32, 29), (64, 20), (100, 70)]


def test_flags():
    """The order of the TestFloat vectors, and of IEEE 754's names."""
    assert [(flag.name.lower(), flag.value) for flag in Flags] == [
        ("inexact", oracle.INEXACT), ("underflow", oracle.UNDERFLOW), ("overflow", oracle.OVERFLOW),
        ("divide_by_zero", oracle.DIVIDE_BY_ZERO), ("invalid", oracle.INVALID)]
    for flag in Flags:
        assert 1 << FLAGS[flag.name.lower()].offset == flag
    assert FpToFp(BINARY32, BINARY16, flags=True).flags.shape() == FLAGS


@pytest.mark.parametrize("make", [
    lambda **options: FpToFp(BINARY32, BINARY16, **options),
    lambda **options: FpToFixed(BINARY32, width=8, fraction_bits=0, **options),
    lambda **options: FixedToFp(BINARY32, width=8, fraction_bits=0, **options),
    lambda **options: FpReciprocalSquareRoot(BINARY32, **options)])
def test_parameters(make):
    assert "flags" not in make().signature.members
    for rounding in Rounding:
        assert make(rounding=rounding).rounding == make(rounding=rounding.value).rounding == rounding
    with pytest.raises(ValueError, match=r"^'up' is not a valid Rounding$"):
        make(rounding="up")


def assert_twin(name, fmt, answer, wanted, *operands):
    """Assert numbers and flags against (encoding, flags) of the oracle."""
    encodings, flags = np.array(wanted, dtype=object).T
    shown = dict(enumerate(operands))
    assert_equal(name, (answer[0] if fmt is None else fmt.to_bits(answer[0])).astype(object), encodings, shown)
    assert_equal(f"{name}, flags", answer[1].astype(object), flags, shown)


@pytest.mark.parametrize("fmt", ALL, ids=lambda fmt: f"{fmt.name}_{fmt.subnormals.value}")
def test_twins(fmt):
    rng, count = np.random.default_rng(11), 150
    # The tests with eight bits try the pairs of special numbers, which come first.
    a, b = (rows[-count:].tolist() for rows in random_pairs(fmt, 900 + count, rng))
    single = random_numbers(fmt, count, rng).tolist()
    x, y, z = (fmt.from_bits(rows) for rows in (a, b, single))
    for rounding in Rounding:
        for operation in exact.add, exact.multiply, exact.divide:
            by_letter = getattr(oracle, operation.__name__)
            wanted = [by_letter(fmt, oracle.datum(fmt, i), oracle.datum(fmt, j), rounding.value)
                      for i, j in zip(a, b, strict=True)]
            assert_twin(operation.__name__, fmt, operation(fmt, x, y, rounding), wanted, a, b)
        data = [oracle.datum(fmt, i) for i in single]
        for operation in exact.square_root, exact.reciprocal_square_root:
            by_letter = getattr(oracle, operation.__name__)
            if operation is exact.reciprocal_square_root and fmt.exponent_width < 3:
                continue
            wanted = [by_letter(fmt, datum, rounding.value) for datum in data]
            assert_twin(operation.__name__, fmt, operation(fmt, z, rounding), wanted, single)
        for other in BINARY16, BFLOAT16.with_subnormals("flush"), FloatFormat(3, 2):
            wanted = [oracle.resize(other, datum, rounding.value) for datum in data]
            assert_twin(f"resize to {other.name}", other, exact.resize(fmt, other, z, rounding), wanted, single)
        for width, places in FIXED:
            wanted = [oracle.to_fixed(datum, width, places, rounding.value) for datum in data]
            assert_twin(f"to {width} bits", None, exact.to_fixed(fmt, z, width, places, rounding), wanted, single)
            lowest = -(1 << width - 1)
            integers = [(value << width >> 64) >> by for value, by in zip(
                rng.integers(-2**63, 2**63 - 1, count).tolist(), rng.integers(0, width, count).tolist(), strict=True)]
            integers += [lowest, ~lowest, 0, -1]
            wanted = [oracle.from_fixed(fmt, value, places, rounding.value) for value in integers]
            assert_twin(f"from {width} bits", fmt, exact.from_fixed(fmt, integers, places, rounding), wanted, integers)


@pytest.mark.parametrize("fmt", [BINARY32, BINARY64], ids=lambda fmt: fmt.name)
def test_shapes(fmt):
    """Scalars, and shapes that broadcast."""
    for rounding, third in ("downward", 1 / 3), ("upward", np.nextafter(fmt.dtype.type(1 / 3), fmt.dtype.type(1))):
        divide = FpDivideSquareRoot(fmt, rounding=rounding)
        quotient = divide.compute(1, 3, False)
        assert (quotient.dtype, quotient.shape, divide.compute_flags(1, 3, False)) == (fmt.dtype, (), Flags.INEXACT)
        if fmt == BINARY64:
            assert quotient == third
        assert divide.compute([[1], [2]], [1, 2, 4], False).tolist() == [[1, 0.5, 0.25], [2, 1, 0.5]]
    assert FixedToFp(fmt, width=80, fraction_bits=0).compute(1 << 70) == 2.0**70
    assert FpToFixed(fmt, width=80, fraction_bits=0).compute(-(2.0**70)) == -(1 << 70)
    with pytest.raises(TypeError):
        FixedToFp(fmt, width=80, fraction_bits=0).compute(0.5)


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {}
    for rounding, policy in POLICIES.items():
        fmt, options = BINARY32.with_subnormals(policy), {"rounding": rounding, "flags": True}
        operators |= {f"{name}_{rounding.value}": op for name, op in {
            "both": FpDivideSquareRoot(fmt, bits_per_cycle=8, **options),
            "reciprocal": FpReciprocalSquareRoot(fmt, bits_per_cycle=8, **options),
            "fixed": FpToFixed(fmt, width=64, fraction_bits=20, latency=3, **options),
            "float": FixedToFp(fmt, width=64, fraction_bits=50, **options),
            "resize": FpToFp(fmt, BINARY16.with_subnormals(policy), latency=2, **options)}.items()}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.mark.verilator
def test_circuits(bank):
    rng, count = np.random.default_rng(12), 50_000
    a, b = random_pairs(BINARY32, count, rng)
    near = with_exponent(BINARY32, a, BINARY32.bias + rng.integers(-30, 50, count))
    a = np.where(rng.random(count) < 0.3, near, a)
    # Roots and quotients that are exact or nearly exact.
    short = rng.integers(1, 1 << 12, count).astype(np.float32)
    squares = BINARY32.to_bits(short * short).astype(np.uint64) + rng.choice(2, count, p=(0.8, 0.2)).astype(np.uint64)
    a = np.where(rng.random(count) < 0.1, squares, a)
    operand = rng.integers(-(1 << 63), (1 << 63) - 1, count) >> rng.integers(0, 64, count)
    square_root = rng.integers(0, 2, count, dtype=np.uint64)
    answers = bank.run(a=a, b=b, square_root=square_root, operand=operand.view(np.uint64))
    x, y = BINARY32.from_bits(a), BINARY32.from_bits(b)
    operands = {"both": (x, y, square_root.astype(bool)), "reciprocal": (x,), "fixed": (x,), "float": (operand,),
                "resize": (x,)}
    for name, op in bank.operators.items():
        values = operands[name.split("_")[0]]
        shown = {"a": a, "b": b, "operand": operand}
        twin = op.compute(*values)
        if isinstance(op, FpToFixed):
            twin = twin.view(np.uint64)
        else:
            twin = (op.to_format if isinstance(op, FpToFp) else op.format).to_bits(twin)
        assert_equal(name, answers[name]["result"], twin, shown)
        assert_equal(f"{name}, flags", answers[name]["flags"], op.compute_flags(*values), shown)


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         operand=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         square_root=rng.integers(0, 2, 2000, dtype=np.uint64))
