"""Comparison: circuits and twin against TestFloat and against float64."""

import operator

import numpy as np
import pytest

from strapdown.fp import BINARY32, RELATIONS, FpCompare, FpRelation

from .support import FORMATS, Bank, assert_equal, decode, pairs_for, vectors

OPERATIONS = {"==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
              ">=": operator.ge}


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"{name}_{latency}": FpCompare(fmt, latency=latency)
                 for name, fmt in FORMATS.items() for latency in ((1, 2) if fmt.width == 32 else (1,))}
    operators |= {kind: FpCompare(BINARY32, signalling=kind == "signalling", flags=True)
                  for kind in ("quiet", "signalling")}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def single(models, tmp_path_factory):
    """Every relation, in two formats."""
    latencies = {"float8_gradual": 2, "binary32_flush": 1}
    operators = {f"{name}_{operation.__name__}": FpRelation(FORMATS[name], relation, latency=latency)
                 for name, latency in latencies.items() for relation, operation in OPERATIONS.items()}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


def check(bank, fmt, relations, **operands):
    """Compare the given relations with those of circuits and twin."""
    results = bank.run(**operands)
    for name, compare in bank.operators.items():
        if compare.format != fmt:
            continue
        for relation, wanted in relations.items():
            assert_equal(f"{name}: {relation}", results[name][relation], wanted, operands)
        twin = compare.compute(*(fmt.from_bits(rows) for rows in operands.values()))
        for relation, wanted in relations.items():
            assert_equal(f"{name}: {relation}, twin", getattr(twin, relation), wanted, operands)


@pytest.mark.parametrize("latency", [-1, 0, 3])
def test_latency_out_of_range(latency):
    for make in FpCompare, lambda fmt, **options: FpRelation(fmt, "<", **options):
        with pytest.raises(ValueError, match=f"^latency must be from 1 to 2, not {latency}$"):
            make(BINARY32, latency=latency)


def test_no_such_relation():
    with pytest.raises(ValueError, match=r"^relation must be one of ==, !=, <, <=, >, >=, not '<>'$"):
        FpRelation(BINARY32, "<>")


def test_properties():
    compare, relation = FpCompare(BINARY32), FpRelation(BINARY32, "<=")
    assert (compare.format, compare.latency, compare.interval, compare.signalling) == (BINARY32, 1, 1, False)
    assert (relation.format, relation.relation, relation.latency, relation.interval) == (BINARY32, "<=", 1, 1)


@pytest.mark.verilator
def test_testfloat(bank):
    less, equal, less_or_equal = (vectors(f"f32_{name}") for name in ("lt", "eq", "le"))
    np.testing.assert_array_equal(less_or_equal["result"], less["result"] | equal["result"])
    operands = {"a": less["a"], "b": less["b"]}
    check(bank, BINARY32, {"less": less["result"], "equal": equal["result"]}, **operands)
    np.testing.assert_array_equal(less_or_equal["flags"], less["flags"])
    results, numbers = bank.run(**operands), [BINARY32.from_bits(rows) for rows in operands.values()]
    for name, case in (("quiet", equal), ("signalling", less)):
        assert_equal(f"{name}, flags", results[name]["flags"], case["flags"], operands)
        assert_equal(f"{name}, flags of twin", bank.operators[name].compute_flags(*numbers), case["flags"], operands)


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_relations(bank, name):
    fmt, rng = FORMATS[name], np.random.default_rng(1)
    a, b = pairs_for(fmt, rng)
    same = rng.random(len(a)) < 0.1
    b[same] = a[same]
    x, y = decode(fmt, a), decode(fmt, b)
    check(bank, fmt, {"less": x < y, "equal": x == y, "unordered": np.isnan(x) | np.isnan(y)}, a=a, b=b)


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["float8_gradual", "binary32_flush"])
def test_single_relations(single, name):
    fmt, rng = FORMATS[name], np.random.default_rng(2)
    a, b = (rows[:100_000] for rows in pairs_for(fmt, rng))
    same = rng.random(len(a)) < 0.1
    b[same] = a[same]
    results, numbers = single.run(a=a, b=b), (decode(fmt, a), decode(fmt, b))
    assert list(RELATIONS) == list(OPERATIONS)
    for operation in OPERATIONS.values():
        key, wanted = f"{name}_{operation.__name__}", operation(*numbers)
        assert_equal(key, results[key]["result"], wanted, {"a": a, "b": b})
        twin = single.operators[key].compute(fmt.from_bits(a), fmt.from_bits(b))
        assert_equal(f"{key}, twin", twin, wanted, {"a": a, "b": b})


@pytest.mark.verilator
@pytest.mark.parametrize("fixture", ["bank", "single"])
def test_handshake(fixture, request):
    bank, rng = request.getfixturevalue(fixture), np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64))
