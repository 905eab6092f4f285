"""Ten million pairs of binary16 numbers: circuits against float64 arithmetic, rounded once.

A sum, product or quotient of binary16 numbers, rounded to float64, is rounded correctly to
binary16: 53 >= 2 * 11 + 2 (S. A. Figueroa, When is double rounding innocuous?, 1995).
"""

import numpy as np
import pytest

from strapdown.fp import BINARY16, FpAdd, FpDivide, FpMultiply

from .support import Bank, assert_equal

COUNT, PART = 10_000_000, 1 << 18
OPERATIONS = {"add": np.add, "multiply": np.multiply, "divide": np.divide}


@pytest.fixture(scope="module")
def bank(models, tmp_path_factory):
    operators = {"add": FpAdd(BINARY16), "multiply": FpMultiply(BINARY16),
                 "divide": FpDivide(BINARY16, bits_per_cycle=4)}
    return Bank(operators).build(models, tmp_path_factory.mktemp("bank"))


@pytest.mark.verilator
def test_random_pairs(bank):
    rng = np.random.default_rng(20)
    for _ in range(0, COUNT, PART):
        pairs = rng.integers(0, 1 << 32, PART, dtype=np.uint32).view(np.uint16).reshape(2, PART)
        answers = bank.run(a=pairs[0], b=pairs[1])
        x, y = pairs.view(np.float16).astype(np.float64)
        for name, operation in OPERATIONS.items():
            with np.errstate(all="ignore"):
                result = operation(x, y).astype(np.float16)
            wanted = np.where(np.isnan(result), np.uint16(BINARY16.nan), result.view(np.uint16))
            assert_equal(name, answers[name]["result"], wanted, {"a": pairs[0], "b": pairs[1]})
