"""Addition and subtraction: circuits and twin against TestFloat and against float64."""

import operator

import numpy as np
import pytest

from strapdown.fp import BINARY32, FpAdd, Rounding

from . import oracle
from .support import FORMATS, Bank, assert_equal, canonical, expected, pairs_for, random_pairs, sign_bit, vectors

LATENCIES = {"binary32_gradual": (1, 3, 5, 8), "binary32_flush": (1, 2, 3, 4, 5, 6, 7, 8),
             "binary64_gradual": (5, 8), "binary64_flush": (5, 7)}
FORMS = {"dsp": "dsp_shifts", "two": "two_paths"}
"""Forms of the circuit for formats that flush subnormals: a word for their names, and their parameter."""


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"{name}_{latency}": FpAdd(fmt, latency=latency)
                 for name, fmt in FORMATS.items() for latency in LATENCIES.get(name, (5,))}
    operators["flags"] = FpAdd(BINARY32, flags=True)
    operators |= {f"{name}_{form}_{latency}": FpAdd(fmt, latency=latency, **{parameter: True})
                  for form, parameter in FORMS.items() for name, fmt in FORMATS.items() if not fmt.gradual
                  for latency in LATENCIES.get(name, (5,)) if form == "dsp" or latency < 8}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.fixture(scope="module")
def directed(models, tmp_path_factory):
    """Every rounding, with flags; all depths occur."""
    operators = {f"{name}_{rounding.value}": FpAdd(FORMATS[name], latency=1 + (3 * place + shift) % 8,
                                                   rounding=rounding, flags=True)
                 for shift, name in enumerate(("binary32_gradual", "binary32_flush"))
                 for place, rounding in enumerate(Rounding)}
    operators |= {f"binary32_flush_{form}_{rounding.value}": FpAdd(
        FORMATS["binary32_flush"], latency=1 + 3 * place % 7, rounding=rounding, flags=True, **{parameter: True})
        for form, parameter in FORMS.items() for place, rounding in enumerate(Rounding)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("directed"))


@pytest.mark.parametrize("latency", [-1, 0, 9])
def test_latency_out_of_range(latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to 8, not {latency}$"):
        FpAdd(BINARY32, latency=latency)


def test_properties():
    add = FpAdd(BINARY32)
    assert (add.format, add.latency, add.interval, add.rounding) == (BINARY32, 5, 1, Rounding.NEAREST_EVEN)
    assert "flags" not in add.signature.members
    assert FpAdd(BINARY32, rounding="upward").rounding is Rounding.UPWARD


@pytest.mark.parametrize("form", FORMS.values())
def test_forms_need_a_format_that_flushes(form):
    assert getattr(FpAdd(BINARY32.with_subnormals("flush"), **{form: True}), form) is True
    with pytest.raises(ValueError, match=rf"^format must flush subnormals with {form}, not FloatFormat\("):
        FpAdd(BINARY32, **{form: True})


def test_one_form_at_a_time():
    with pytest.raises(ValueError, match=r"^dsp_shifts and two_paths must not both be true$"):
        FpAdd(BINARY32.with_subnormals("flush"), dsp_shifts=True, two_paths=True)


def test_no_such_rounding():
    with pytest.raises(ValueError, match=r"^'nearest' is not a valid Rounding$"):
        FpAdd(BINARY32, rounding="nearest")


def test_twin_broadcasts():
    total = FpAdd(BINARY32).compute(np.float32([[1], [2]]), 3.0, [False, True])
    assert total.dtype == np.float32
    assert total.tolist() == [[4.0, -2.0], [5.0, -1.0]]
    assert FpAdd(BINARY32.with_subnormals("flush")).compute(2.0**-126, 1.5 * 2.0**-126, subtract=True) == 0


@pytest.mark.verilator
@pytest.mark.parametrize(("file", "subtract"), [("f32_add", 0), ("f32_sub", 1)])
def test_testfloat(bank, file, subtract):
    case = vectors(file)
    bank.check(BINARY32, canonical(BINARY32, case["result"]), case["flags"], a=case["a"], b=case["b"],
               subtract=np.full(len(case["a"]), subtract, dtype=np.uint64))


@pytest.mark.verilator
@pytest.mark.parametrize("name", FORMATS)
def test_sums(bank, name):
    fmt, rng = FORMATS[name], np.random.default_rng(1)
    a, b = pairs_for(fmt, rng)
    subtract = rng.integers(0, 2, len(a), dtype=np.uint64)
    b_or_negative = b ^ subtract * sign_bit(fmt)
    wanted = expected(fmt, np.add, a, b_or_negative, exact=operator.add)
    bank.check(fmt, wanted, a=a, b=b, subtract=subtract)


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["binary32_gradual", "binary32_flush",
                                  *(f"binary32_flush_{form}" for form in FORMS)])
def test_roundings(directed, name):
    fmt, rng = FORMATS["_".join(name.split("_")[:2])], np.random.default_rng(2)
    a, b = random_pairs(fmt, 6000, rng)
    subtract = rng.integers(0, 2, len(a), dtype=np.uint64)
    operands = {"a": a, "b": b, "subtract": subtract}
    results = directed.run(**operands)
    data = [[oracle.datum(fmt, encoding) for encoding in rows.tolist()] for rows in (a, b ^ subtract * sign_bit(fmt))]
    for rounding in Rounding:
        wanted = np.array([oracle.add(fmt, *pair, rounding.value) for pair in zip(*data, strict=True)]).T
        circuit, op = results[f"{name}_{rounding.value}"], directed.operators[f"{name}_{rounding.value}"]
        numbers = fmt.from_bits(a), fmt.from_bits(b), subtract.astype(bool)
        for kind, rows, twin in zip(("result", "flags"), wanted, (fmt.to_bits(op.compute(*numbers)),
                                                                  op.compute_flags(*numbers)), strict=True):
            assert_equal(f"{rounding}, {kind}", circuit[kind], rows, operands)
            assert_equal(f"{rounding}, {kind} of twin", twin, rows, operands)


@pytest.mark.verilator
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         subtract=rng.integers(0, 2, 2000, dtype=np.uint64))
