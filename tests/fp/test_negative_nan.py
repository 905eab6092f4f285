"""Formats whose NaN is negative: circuits and twins of all operators give the same numbers and the other NaN."""

from dataclasses import replace

import numpy as np
import pytest
from amaranth.lib.wiring import Out

from strapdown.cordic import CordicAtan2, CordicSinCos
from strapdown.fp import (
    BINARY32,
    FloatFormat,
    FpAdd,
    FpDivide,
    FpDivideSquareRoot,
    FpMinMax,
    FpMultiply,
    FpReciprocalSquareRoot,
    FpSquareRoot,
    FpToFixed,
    FpToFp,
)

from .support import Bank, assert_equal, is_nan

POSITIVE = FloatFormat(5, 3)
NEGATIVE = replace(POSITIVE, negative_nan=True)
MAKE = {
    "add": FpAdd, "multiply": FpMultiply, "divide": FpDivide, "square_root": FpSquareRoot,
    "divide_square_root": FpDivideSquareRoot, "reciprocal": FpReciprocalSquareRoot, "extreme": FpMinMax,
    "fixed": lambda fmt: FpToFixed(fmt, width=9, fraction_bits=2, flags=True),
    "resize": lambda fmt: FpToFp(fmt, replace(fmt, fraction_width=5)),
    "atan2": lambda fmt: CordicAtan2(fmt, magnitude=True), "sincos": CordicSinCos,
}


def test_encodings():
    assert (NEGATIVE.nan, replace(BINARY32, negative_nan=True).nan) == (0x1FC, 0xFFC00000)
    # A payload that does not fit: the NaN becomes quiet and keeps its own sign.
    assert NEGATIVE.to_bits(np.uint64(0x7FF0000000000001).view(np.float64)) == 0x0FC
    with pytest.raises(TypeError, match=r"^negative_nan must be True or False, not 1$"):
        FloatFormat(8, 23, negative_nan=1)


def results(op, operands):
    """The results of a twin, as a dict from the circuit's outputs to arrays."""
    names = [member for member, port in op.signature.members.items() if port.flow is Out and member != "done"]
    computed = op.compute(**operands)
    if "flags" in names:
        computed = computed, op.compute_flags(**operands)
    return dict(zip(names, computed if isinstance(computed, tuple) else (computed,), strict=True))


@pytest.mark.verilator
def test_circuits_and_twins_differ_only_in_nan(models, tmp_path):
    rng = np.random.default_rng(20150601)
    a, b = rng.integers(0, 1 << POSITIVE.width, (2, 4000))
    for operand in a, b:
        special = rng.random(len(a)) < 0.2
        operand[special] = rng.choice([0, POSITIVE.infinity, POSITIVE.infinity + 1, POSITIVE.nan], special.sum())
        operand[special] |= rng.integers(0, 2, special.sum()) << POSITIVE.width - 1
    choice = rng.integers(0, 2, len(a))
    bits = {"a": a, "b": b, "y": a, "x": b, "angle": a, "subtract": choice, "square_root": choice, "maximum": choice}
    bank = Bank({name: make(NEGATIVE) for name, make in MAKE.items()}).build(models, tmp_path)
    answers = bank.run(**{name: bits[name] for name in bank.signature.members if name in bits})
    for name, op in bank.operators.items():
        plain = MAKE[name](POSITIVE)
        encoded = {member: bits[member] for member in op.signature.members if member in bits}
        operands = {member: rows.astype(bool) if rows is choice else POSITIVE.from_bits(rows)
                    for member, rows in encoded.items()}
        computed = results(op, operands)
        for member, wanted in results(plain, operands).items():
            if np.issubdtype(wanted.dtype, np.floating):
                fmt = getattr(plain, "to_format", POSITIVE)
                wanted = fmt.to_bits(wanted).astype(np.uint64)
                wanted |= is_nan(fmt, wanted).astype(np.uint64) << np.uint64(fmt.width - 1)
                computed[member] = fmt.to_bits(computed[member])
            elif member == "result":
                wanted = np.where(np.isnan(operands["a"]), -256, wanted)
            assert_equal(f"{name}, {member} of twin", computed[member], wanted, encoded)
            mask = (1 << len(getattr(bank, f"{name}_{member}"))) - 1
            assert_equal(f"{name}, {member}", answers[name][member], wanted.astype(np.int64) & mask, encoded)
