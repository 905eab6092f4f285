"""The floating-point formats: parameters, encodings, and the policy for subnormals and NaN."""

import numpy as np
import pytest

from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat, Subnormals

from .support import BFLOAT16, FLOAT8, FORMATS, NARROW, decode, encode, flushed, numbers_for, random_numbers

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


def test_too_wide_for_a_twin():
    for fmt in FloatFormat(15, 112), FloatFormat(12, 10), FloatFormat(5, 53):
        with pytest.raises(ValueError, match=rf"^{fmt.name} has no software twin: formats up to binary64 have "
                                             r"\(exponent_width 11, fraction_width 52\)$"):
            fmt.to_bits(1.0)


def test_widths_and_encodings():
    assert (FLUSH.name, FLUSH.width, FLUSH.precision, FLUSH.bias) == ("binary32", 32, 24, 127)
    assert (FLUSH.exponent_special, FLUSH.infinity, FLUSH.nan) == (255, 0x7F800000, 0x7FC00000)
    assert (FLUSH.least_normal, FLUSH.gradual, BINARY32.gradual) == (0x00800000, False, True)
    assert (FLOAT8.name, FLOAT8.width, FLOAT8.bias, FLOAT8.nan) == ("float4_3", 8, 7, 0x7C)
    assert [fmt.decimal_digits for fmt in (BINARY16, BINARY32, BINARY64)] == [5, 9, 17]
    assert FLUSH.layout.size == 32
    assert FLUSH == FloatFormat(8, 23, Subnormals.FLUSH) != BINARY32


@pytest.mark.parametrize(("widths", "dtype", "bits_dtype"), [
    ((2, 1), "f2", "u1"), ((4, 3), "f2", "u1"), ((5, 10), "f2", "u2"), ((5, 11), "f4", "u4"), ((6, 2), "f4", "u2"),
    ((8, 7), "f4", "u2"), ((8, 23), "f4", "u4"), ((8, 24), "f8", "u8"), ((3, 40), "f8", "u8"), ((11, 52), "f8", "u8")])
def test_numpy_types(widths, dtype, bits_dtype):
    fmt = FloatFormat(*widths)
    assert (fmt.dtype, fmt.bits_dtype) == (dtype, bits_dtype)
    assert fmt.is_native == (widths in ((5, 10), (8, 23), (11, 52)))
    greatest, least = fmt.from_bits([fmt.infinity - 1, 1]).tolist()
    assert greatest == (2 - 2.0 ** -fmt.fraction_width) * 2.0**fmt.bias
    assert least == 2.0 ** (1 - fmt.bias - fmt.fraction_width)


@pytest.mark.parametrize("name", FORMATS)
def test_numpy_side(name):
    fmt = FORMATS[name]
    encodings = numbers_for(fmt, np.random.default_rng(1)) if fmt.width <= 16 else \
        random_numbers(fmt, 10_000, np.random.default_rng(1))
    numbers = fmt.from_bits(encodings)
    assert numbers.dtype == fmt.dtype
    np.testing.assert_array_equal(fmt.to_bits(numbers), encodings)
    ordinary = ~np.isnan(numbers)
    np.testing.assert_array_equal(fmt.flush(numbers[ordinary]).astype(float), decode(fmt, encodings[ordinary]))
    np.testing.assert_array_equal(fmt.to_bits(fmt.array(numbers)), flushed(fmt, encodings))
    assert set(fmt.to_bits(fmt.canonical(numbers[~ordinary]))) == {fmt.nan}


@pytest.mark.parametrize("fmt", [BFLOAT16, FLOAT8, NARROW], ids=lambda fmt: fmt.name)
def test_to_bits_rounds(fmt):
    """Numbers of another format, near ties and near both ends of the range."""
    rng = np.random.default_rng(7)
    numbers = decode(fmt, rng.integers(0, 1 << fmt.width, 20_000, dtype=np.uint64))
    numbers = numbers * rng.choice([1, 1 + 2.0**-fmt.precision, 1 + 2.0**-30, 1 - 2.0**-30], len(numbers))
    numbers = numbers[~np.isnan(numbers)]
    np.testing.assert_array_equal(fmt.to_bits(numbers), encode(fmt, numbers))
    assert fmt.to_bits(np.float32(-np.inf)) == fmt.infinity | 1 << (fmt.width - 1)
    assert fmt.to_bits([1, 2]).tolist() == [fmt.encode(1.0), fmt.encode(2.0)]


def test_nan_payloads_that_do_not_fit():
    payload_of_one = np.uint64(BINARY64.infinity + 1).view(np.float64)
    assert BFLOAT16.to_bits(payload_of_one) == BFLOAT16.nan


def test_encode():
    assert (BINARY32.encode(1.0), BINARY32.encode(-0.1)) == (0x3F800000, 0xBDCCCCCD)
    assert (BINARY32.encode(2.0**-149), FLUSH.encode(-(2.0**-149))) == (1, 0x80000000)
    assert BINARY32.encode(1e39) == BINARY32.infinity
