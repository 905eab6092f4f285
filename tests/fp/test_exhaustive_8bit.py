"""Every operand or pair of operands of an 8-bit format, every rounding, both policies: results and flags of
circuits and twins against fractions of Python integers."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from strapdown.fp import (
    FixedToFp,
    FloatFormat,
    FpAdd,
    FpCompare,
    FpDivide,
    FpDivideSquareRoot,
    FpMinMax,
    FpMultiply,
    FpReciprocalSquareRoot,
    FpRelation,
    FpToFixed,
    FpToFp,
)
from strapdown_lab.operators import OPERATORS

from . import oracle
from .support import FLOAT8, Bank, assert_equal

POLICIES = {policy: FLOAT8.with_subnormals(policy) for policy in ("gradual", "flush")}
SMALL = FloatFormat(3, 2)
A, B = (rows.ravel() for rows in np.meshgrid(*2 * (np.arange(256),)))
OPERANDS = np.arange(256)
FIXED = (7, 4), (3, 0)
FIXED_OPERANDS = np.arange(-(1 << 11), 1 << 11)
# Differences give the same numbers as sums.
rounded = cache(oracle.rounded)

AHEAD = "looks_ahead0", "looks_ahead1"
PLAIN = {"flags", "bits_per_cycle", "fraction_bits"}
"""Parameters that are equal in all variants of an operator."""


def word(name, value):
    """A choice in the name of a variant."""
    return value.value if name == "rounding" else f"{name}{int(value)}"


def key(make, policy, *words):
    """The name of a variant in the bank."""
    names = {"<": "less", "!=": "differ"}
    return "_".join([make.__name__, policy, *sorted(names.get(word, word) for word in words if isinstance(word, str))])


@pytest.fixture(scope="module")
def results(models, tmp_path_factory):
    """Results of every circuit for all pairs, twice: the second time with all one-bit inputs set."""
    operators = {}
    for entry in OPERATORS:
        for variants in entry.tried:
            for (fmt, *others), options in entry.rounded(variants):
                words = [*others, *(word(name, value) for name, value in options.items() if name not in PLAIN)]
                name = key(entry.component, fmt.subnormals.value, *words)
                operators[name] = entry.component(fmt, *others, **options)
    bank = Bank(operators).build(models, tmp_path_factory.mktemp("bank"))
    choice = np.repeat([0, 1], len(A))
    answers = bank.run(a=np.tile(A, 2), b=np.tile(B, 2), operand=np.arange(2 * len(A)) % 4096,
                       subtract=choice, square_root=choice, maximum=choice)
    return {name: (bank.operators[name], members) for name, members in answers.items()}


def test_every_operator_of_the_list_is_checked():
    """Every operator with variants of 8 bits in the list needs an oracle here."""
    assert {entry.component for entry in OPERATORS if entry.tried} == {
        FpAdd, FpMultiply, FpDivide, FpDivideSquareRoot, FpReciprocalSquareRoot, FpToFixed, FixedToFp, FpToFp,
        FpCompare, FpRelation, FpMinMax}


def check(name, op, members, rows, wanted, *operands):
    """Assert results and flags of a circuit, from the row ``rows`` on, and of its twin; ``wanted`` is a
    sequence of (result, flags), of pairs or single operands."""
    encodings, flags = np.array(wanted, dtype=object).T
    encodings, flags = encodings.astype(np.int64), flags.astype(np.int64)
    shown = {"a": A, "b": B} if len(flags) == len(A) else {"a": np.arange(len(flags))}
    circuit, twin = members["result"][rows:][:len(flags)], op.compute(*operands)
    if isinstance(op, FpToFixed):
        circuit = circuit.view(np.int64) << (64 - op.width) >> (64 - op.width)
    else:
        fmt = op.to_format if isinstance(op, FpToFp) else op.format
        twin = fmt.to_bits(twin)
    assert_equal(name, circuit.astype(np.int64), encodings, shown)
    assert_equal(f"{name}, flags", members["flags"][rows:][:len(flags)].astype(np.int64), flags, shown)
    assert_equal(f"{name}, twin", twin, encodings, shown)
    assert_equal(f"{name}, flags of twin", op.compute_flags(*operands), flags, shown)


def tabulate(fmt, name, roundings):
    """(result, flags) of every pair, for each rounding: each exact value is rounded once."""
    data = [oracle.datum(fmt, encoding) for encoding in OPERANDS.tolist()]
    unit = 2 ** (fmt.bias - 1 + fmt.fraction_width)
    values = np.array([0 if x.value is None else int(x.value * unit) for x in data])
    x, y = values[A], values[B]
    above, below = {"add": (x + y, unit + 0 * x), "subtract": (x - y, unit + 0 * x),
                    "multiply": (x * y, unit**2 + 0 * x), "divide": (x * np.sign(y), abs(y))}[name]
    finite = np.array([datum.value is not None for datum in data])
    ordinary = finite[A] & finite[B] & (above != 0) & (below != 0)
    divisor = np.gcd(above[ordinary], below[ordinary])
    fractions, where = np.unique(
        np.stack([above[ordinary] // divisor, below[ordinary] // divisor]), axis=1, return_inverse=True)
    fractions = [Fraction(*pair) for pair in fractions.T.tolist()]
    special = [(data[a], data[b]) for a, b in zip(A[~ordinary].tolist(), B[~ordinary].tolist(), strict=True)]
    for rounding in roundings:
        wanted = np.zeros((len(A), 2), dtype=np.int64)
        wanted[ordinary] = np.array([rounded(fmt, value, rounding) for value in fractions])[where.ravel()]
        wanted[~ordinary] = [getattr(oracle, name)(fmt, a, b, rounding) for a, b in special]
        yield rounding, wanted


@pytest.mark.verilator
@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("name", ["add", "subtract", "multiply", "divide"])
def test_pairs(results, policy, name):
    fmt = POLICIES[policy]
    numbers = fmt.from_bits(A), fmt.from_bits(B)
    for rounding, wanted in tabulate(fmt, name, oracle.ROUNDINGS):
        if name == "divide":
            for ahead in AHEAD:
                check(name, *results[key(FpDivide, policy, rounding, ahead)], 0, wanted, *numbers)
                check("both", *results[key(FpDivideSquareRoot, policy, rounding, ahead)], 0, wanted, *numbers, False)
        elif name == "multiply":
            check(name, *results[key(FpMultiply, policy, rounding)], 0, wanted, *numbers)
        else:
            choice = name == "subtract"
            check(name, *results[key(FpAdd, policy, rounding)], len(A) * choice, wanted, *numbers, choice)
            if policy == "flush":
                for form in ("dsp_shifts", "two_paths"):
                    check(f"{name}, {form}", *results[key(FpAdd, policy, rounding, f"{form}1")], len(A) * choice,
                          wanted, *numbers, choice)


@pytest.mark.verilator
@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("rounding", oracle.ROUNDINGS)
def test_single_operands(results, policy, rounding):
    fmt = POLICIES[policy]
    data, numbers = [oracle.datum(fmt, encoding) for encoding in OPERANDS.tolist()], fmt.from_bits(OPERANDS)

    def of(make, *words):
        name = key(make, policy, rounding, *words)
        return name, *results[name]

    # ``a`` changes fastest: the first 256 rows have all its encodings.
    roots = [oracle.square_root(fmt, x, rounding) for x in data]
    for ahead in AHEAD:
        check(*of(FpDivideSquareRoot, ahead), len(A), roots, numbers, numbers, True)
    check(*of(FpReciprocalSquareRoot), 0, [oracle.reciprocal_square_root(fmt, x, rounding) for x in data], numbers)
    for width, fraction_bits in FIXED:
        wanted = [oracle.to_fixed(x, width, fraction_bits, rounding) for x in data]
        check(*of(FpToFixed, f"width{width}"), 0, wanted, numbers)
    small = SMALL.with_subnormals(policy)
    check(*of(FpToFp), 0, [oracle.resize(small, x, rounding) for x in data], numbers)
    operands = np.roll(FIXED_OPERANDS, len(FIXED_OPERANDS) // 2)
    check(*of(FixedToFp, "width12"), 0, [oracle.from_fixed(fmt, int(x), 11, rounding) for x in operands], operands)


@pytest.mark.verilator
@pytest.mark.parametrize("policy", POLICIES)
def test_comparisons(results, policy):
    fmt = POLICIES[policy]
    data = [oracle.datum(fmt, encoding) for encoding in OPERANDS.tolist()]
    numbers = fmt.from_bits(A), fmt.from_bits(B)
    nan, signalling = (np.array([getattr(x, kind) for x in data]) for kind in ("nan", "signalling"))
    quiet = signalling[A] | signalling[B]
    invalid = {"signalling0": quiet, "signalling1": nan[A] | nan[B]}
    # The order of real numbers, infinities at its ends.
    places = np.array([0 if x.nan else float(x.value) if x.value is not None else (-1) ** x.negative * np.inf
                       for x in data])
    x, y, ordered = places[A], places[B], ~(nan[A] | nan[B])
    relations = {"less": ordered & (x < y), "equal": ordered & (x == y), "unordered": ~ordered}
    for name, raised in invalid.items():
        op, members = results[key(FpCompare, policy, name)]
        for member, wanted in relations.items():
            assert_equal(f"{name}: {member}", members[member][:len(A)], wanted, {"a": A, "b": B})
            assert_equal(f"{name}: {member}, twin", getattr(op.compute(*numbers), member), wanted, {"a": A, "b": B})
        for flags in members["flags"][:len(A)], op.compute_flags(*numbers):
            assert_equal(f"{name}, flags", flags, raised * oracle.INVALID, {"a": A, "b": B})
    for name, wanted, raised in (("<", relations["less"], invalid["signalling1"]), ("!=", ~relations["equal"], quiet)):
        op, members = results[key(FpRelation, policy, name)]
        for got in members["result"][:len(A)], op.compute(*numbers):
            assert_equal(name, got, wanted, {"a": A, "b": B})
        for flags in members["flags"][:len(A)], op.compute_flags(*numbers):
            assert_equal(f"{name}, flags", flags, raised * oracle.INVALID, {"a": A, "b": B})
    op, members = results[key(FpMinMax, policy)]
    for maximum in 0, 1:
        for flags in members["flags"][maximum * len(A):][:len(A)], op.compute_flags(*numbers, bool(maximum)):
            assert_equal("min_max, flags", flags, quiet * oracle.INVALID, {"a": A, "b": B})
