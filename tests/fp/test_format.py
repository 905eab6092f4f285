"""The floating-point formats: parameters, encodings, and the policy for subnormals and NaN."""

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat, Subnormals

from .support import FLOAT8, FORMATS, decode, flushed, numbers_for, random_numbers

FLUSH = BINARY32.with_subnormals("flush")


@pytest.mark.parametrize(("widths", "message"), [
    ((1, 3), "exponent_width must be at least 2, not 1"),
    ((4, 0), "fraction_width must be at least 1, not 0"),
])
def test_widths_out_of_range(widths, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        FloatFormat(*widths)


def test_parameters_of_wrong_kind():
    with pytest.raises(TypeError):
        FloatFormat(8.0, 23)
    with pytest.raises(TypeError, match=r"^subnormals must be a Subnormals policy, not 'flush'$"):
        FloatFormat(8, 23, "flush")
    with pytest.raises(ValueError, match="'abrupt' is not a valid Subnormals"):
        BINARY32.with_subnormals("abrupt")


def test_numpy_has_no_such_type():
    with pytest.raises(ValueError, match=r"^NumPy has no floating-point type for float4_3$"):
        _ = FLOAT8.dtype


def test_widths_and_encodings():
    assert (FLUSH.name, FLUSH.width, FLUSH.precision, FLUSH.bias) == ("binary32", 32, 24, 127)
    assert (FLUSH.exponent_special, FLUSH.infinity, FLUSH.nan) == (255, 0x7F800000, 0x7FC00000)
    assert (FLUSH.least_normal, FLUSH.gradual, BINARY32.gradual) == (0x00800000, False, True)
    assert (FLOAT8.name, FLOAT8.width, FLOAT8.bias, FLOAT8.nan) == ("float4_3", 8, 7, 0x7C)
    assert [fmt.decimal_digits for fmt in (BINARY16, BINARY32, BINARY64)] == [5, 9, 17]
    assert FLUSH.layout.size == 32
    assert FLUSH == FloatFormat(8, 23, Subnormals.FLUSH) != BINARY32


@pytest.mark.parametrize("name", [name for name, fmt in FORMATS.items() if fmt.width >= 16])
def test_numpy_side(name):
    fmt = FORMATS[name]
    encodings = numbers_for(fmt, np.random.default_rng(1)) if fmt.width == 16 else \
        random_numbers(fmt, 10_000, np.random.default_rng(1))
    numbers = fmt.from_bits(encodings)
    assert numbers.dtype == fmt.dtype
    np.testing.assert_array_equal(fmt.to_bits(numbers), encodings)
    ordinary = ~np.isnan(numbers)
    np.testing.assert_array_equal(fmt.flush(numbers[ordinary]).astype(float), decode(fmt, encodings[ordinary]))
    np.testing.assert_array_equal(fmt.to_bits(fmt.array(numbers)), flushed(fmt, encodings))
    assert set(fmt.to_bits(fmt.canonical(numbers[~ordinary]))) == {fmt.nan}


def test_encode():
    assert (BINARY32.encode(1.0), BINARY32.encode(-0.1)) == (0x3F800000, 0xBDCCCCCD)
    assert (BINARY32.encode(2.0**-149), FLUSH.encode(-(2.0**-149))) == (1, 0x80000000)
    assert BINARY32.encode(1e39) == BINARY32.infinity
