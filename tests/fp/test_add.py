# amaranth: UnusedElaboratable=no
"""Addition and subtraction: circuits and twin against TestFloat and against float64."""

import operator

import numpy as np
import pytest

from strapdown.fp import BINARY32, FpAdd

from .support import FORMATS, Bank, canonical, expected, pairs_for, sign_bit, vectors

LATENCIES = {"binary32_gradual": (1, 3, 6), "binary32_flush": (1, 2, 4, 5, 6)}


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {f"{name}_{latency}": FpAdd(fmt, latency=latency)
                 for name, fmt in FORMATS.items() for latency in LATENCIES.get(name, (4,))}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.mark.parametrize("latency", [-1, 0, 7])
def test_latency_out_of_range(latency):
    with pytest.raises(ValueError, match=f"^latency must be from 1 to 6, not {latency}$"):
        FpAdd(BINARY32, latency=latency)


def test_properties():
    add = FpAdd(BINARY32)
    assert (add.format, add.latency, add.interval) == (BINARY32, 4, 1)


def test_twin_broadcasts():
    total = FpAdd(BINARY32).compute(np.float32([[1], [2]]), 3.0, [False, True])
    assert total.dtype == np.float32
    assert total.tolist() == [[4.0, -2.0], [5.0, -1.0]]
    assert FpAdd(BINARY32.with_subnormals("flush")).compute(2.0**-126, 1.5 * 2.0**-126, subtract=True) == 0


@pytest.mark.verilator
@pytest.mark.parametrize(("file", "subtract"), [("f32_add", 0), ("f32_sub", 1)])
def test_testfloat(bank, file, subtract):
    case = vectors(file)
    bank.check(BINARY32, canonical(BINARY32, case["result"]), a=case["a"], b=case["b"],
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
def test_handshake(bank):
    rng = np.random.default_rng(3)
    bank.check_handshake(rng, a=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         b=rng.integers(0, 1 << 64, 2000, dtype=np.uint64),
                         subtract=rng.integers(0, 2, 2000, dtype=np.uint64))
