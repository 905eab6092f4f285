"""Arctangent and length: the circuit against its twin, and the twin against wider arithmetic."""

import re

import numpy as np
import pytest
from amaranth.sim import Simulator

from strapdown.cordic import CordicAtan2
from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat

from .support import FORMATS, ORACLE_ERROR, answers, assert_equal, exact_values, scaled_atan2, ulp_errors

# Stimuli: encodings, uint64.

def specials(fmt):
    """Zeros, ends of the ranges of subnormals and normals, one, infinities and NaNs of either sign."""
    one = fmt.bias << fmt.fraction_width
    positive = [0, 1, fmt.least_normal - 1, fmt.least_normal, one - 1, one, one + 1, fmt.infinity - 1,
                fmt.infinity, fmt.infinity + 1, fmt.nan, (1 << fmt.width - 1) - 1]
    return np.array([sign << (fmt.width - 1) | value for sign in (0, 1) for value in positive], dtype=np.uint64)


def random_pairs(fmt, count, seed):
    """Random pairs: special, independent, subnormal, on the octants' borders, of equal exponent,
    and of all exponent differences up to results that are zero."""
    rng = np.random.default_rng(seed)
    sign = np.uint64(1 << (fmt.width - 1))
    last = np.uint64(fmt.infinity - 1)
    y, x, jitter = (rng.integers(0, (1 << fmt.width) - 1, count, dtype=np.uint64, endpoint=True) for _ in range(3))
    # One operand has few significant bits, so that exact quotients and ties are among the cases.
    kept = rng.integers(0, fmt.fraction_width, count, endpoint=True, dtype=np.uint64)
    x = np.where(rng.random(count) < 0.2, x >> kept << kept, x)
    tiny = np.uint64((2 << fmt.fraction_width) - 1) | sign
    exponent = (x & ~sign) >> np.uint64(fmt.fraction_width)

    def below(least, most):
        shifted = exponent.astype(np.int64) - rng.integers(least, most, count)
        shifted = np.clip(shifted, 0, fmt.exponent_special - 1).astype(np.uint64)
        return y & (sign | np.uint64(fmt.least_normal - 1)) | shifted << np.uint64(fmt.fraction_width)

    kinds = [
        (y, x),
        (y & tiny, x),
        (y & tiny, x & tiny),
        (np.minimum(x & ~sign ^ jitter % 4, last) | y & sign, x),        # |y| = |x|, nearly
        (below(-2, 3), x),
        (below(-fmt.precision - 2, fmt.precision + 3), x),
        (below(fmt.bias - 3, fmt.bias + fmt.precision + 3), x),          # results near underflow
    ]
    kind = rng.choice(len(kinds), count)
    y, x = (np.choose(kind, [pair[operand] for pair in kinds]) for operand in (0, 1))
    swap = rng.random(count) < 0.25
    y, x = np.where(swap, x, y), np.where(swap, y, x)
    crossed = np.array(np.meshgrid(specials(fmt), specials(fmt))).reshape(2, -1)
    y[:crossed.shape[1]], x[:crossed.shape[1]] = crossed
    return y, x


# Parameters.

@pytest.mark.parametrize(("parameters", "error", "message"), [
    ({"format": "binary32"}, TypeError, "format must be a FloatFormat, not 'binary32'"),
    ({"format": FloatFormat(2, 10)}, ValueError, "format must have at least 3 exponent bits, not 2"),
    ({"steps_per_cycle": 0}, ValueError, "steps_per_cycle must be at least 1, not 0"),
    ({"width": 25}, ValueError, "width must be from 26 to 59, not 25"),
    ({"width": 60}, ValueError, "width must be from 26 to 59, not 60"),
    ({"registered_addends": True}, ValueError,
     "registered_addends must not be True for a pipeline, or with several steps per cycle"),
    ({"registered_addends": True, "iterative": False}, ValueError,
     "registered_addends must not be True for a pipeline, or with several steps per cycle"),
    ({"iterations": 25}, ValueError, "iterations must be at least 26, not 25"),
    ({"format": FloatFormat(11, 60)}, ValueError, "format must have a precision of at most 57 bits, not 61"),
    ({"steps_per_cycle": 2.0}, TypeError, "'float' object cannot be interpreted as an integer"),
])
def test_wrong_parameters(parameters, error, message):
    with pytest.raises(error, match=f"^{re.escape(message)}$"):
        CordicAtan2(**{"format": BINARY32, **parameters})


def test_properties():
    atan2 = CordicAtan2(BINARY32)
    assert (atan2.format, atan2.width, atan2.iterations, atan2.steps_per_cycle) == (BINARY32, 29, 30, 2)
    assert (atan2.latency, atan2.interval, atan2.iterative, atan2.has_magnitude) == (21, 20, True, False)
    atan2 = CordicAtan2(BINARY32.with_subnormals("flush"), width=28, iterations=28, steps_per_cycle=3)
    assert (atan2.width, atan2.iterations, atan2.latency, atan2.interval) == (28, 30, 14, 13)
    assert CordicAtan2(BINARY32.with_subnormals("flush"), steps_per_cycle=1).latency == 34
    wide = [CordicAtan2(BINARY64.with_subnormals("flush"), steps_per_cycle=count) for count in (1, 2)]
    assert [(atan2.registered_addends, atan2.latency) for atan2 in wide] == [(True, 65), (False, 34)]
    atan2 = CordicAtan2(BINARY32, magnitude=True, iterative=False)
    assert (atan2.width, atan2.latency, atan2.interval, atan2.has_magnitude) == (30, 35, 1, True)


@pytest.mark.parametrize("fmt", FORMATS.values(), ids=FORMATS)
def test_default_bounds_are_below_one_ulp(fmt):
    atan2 = CordicAtan2(fmt, magnitude=True)
    assert 0.5 < atan2.error_bound_ulp < 0.7
    assert 0.5 < atan2.magnitude_error_bound_ulp < 0.8


# The twin.

def test_twin_broadcasts():
    result = CordicAtan2(BINARY32).compute(np.float32([[1], [-2]]), [2.0, 0.0, -1.0])
    assert (result.dtype, result.shape) == (np.float32, (2, 3))
    # These six are correctly rounded: the error before rounding moves none of them over a tie.
    assert np.array_equal(result, np.float32(np.arctan2([[1.0], [-2.0]], [2.0, 0.0, -1.0])))
    assert CordicAtan2(BINARY16).compute(1.0, 0.0) == np.float16(np.pi / 2)


@pytest.mark.parametrize("fmt", FORMATS.values(), ids=FORMATS)
def test_special_values(fmt):
    """C99, F.9.1.4: zeros, infinities and NaN against anything, to the bit."""
    values = np.array([0.0, 1.0, 2.0**-14, 65504.0, np.inf, np.nan])
    y, x = np.meshgrid(np.concatenate((values, -values)), np.concatenate((values, -values)))
    special = ~(np.isfinite(y) & np.isfinite(x)) | (y == 0) | (x == 0)
    y, x = y[special], x[special]
    wanted = fmt.to_bits(fmt.canonical(fmt.array(np.arctan2(y, x))))
    np.testing.assert_array_equal(fmt.to_bits(CordicAtan2(fmt).compute(y, x)), wanted)


@pytest.mark.parametrize("fmt", FORMATS.values(), ids=FORMATS)
def test_special_lengths(fmt):
    """IEEE 754-2019, 9.2.1: hypot of zeros, infinities and NaN, to the bit."""
    values = np.array([0.0, 1.0, -1.5, float(fmt.from_bits(1)), float(fmt.from_bits(fmt.infinity - 1)), np.inf, np.nan])
    y, x = np.meshgrid(values, values)
    special = ~(np.isfinite(y) & np.isfinite(x)) | (y == 0) | (x == 0)
    y, x = fmt.array(y[special]), fmt.array(x[special])
    wanted = np.where(np.isinf(y) | np.isinf(x), np.inf, np.maximum(np.abs(y), np.abs(x)))  # a NaN stays one
    got = CordicAtan2(fmt, magnitude=True).compute(y, x).magnitude
    np.testing.assert_array_equal(fmt.to_bits(got), fmt.to_bits(fmt.canonical(fmt.array(wanted))))


def test_length_overflows():
    largest = BINARY32.from_bits(BINARY32.infinity - 1)
    lengths = CordicAtan2(BINARY32, magnitude=True).compute([largest, largest / 2], [largest, largest / 2]).magnitude
    np.testing.assert_array_equal(lengths, np.float32([np.inf, np.hypot(float(largest) / 2, float(largest) / 2)]))


ACCURACY = {
    **{name: (fmt, {}, 100_000) for name, fmt in FORMATS.items()},
    "binary32_gradual": (FORMATS["binary32_gradual"], {}, 1_000_000),
    "binary32_coarse": (FORMATS["binary32_flush"], {"width": 26, "iterations": 26}, 200_000),
    "binary32_fine": (FORMATS["binary32_gradual"], {"width": 33, "iterations": 34, "steps_per_cycle": 1}, 200_000),
    "binary16_1": (FORMATS["binary16_flush"], {"steps_per_cycle": 1}, 200_000),
    "binary16_coarse": (FORMATS["binary16_gradual"], {"width": 13, "iterations": 13, "steps_per_cycle": 1}, 200_000),
}


@pytest.mark.parametrize(("fmt", "parameters", "count"), ACCURACY.values(), ids=ACCURACY)
def test_accuracy(fmt, parameters, count):
    atan2 = CordicAtan2(fmt, magnitude=True, **parameters)
    y, x = (fmt.from_bits(encodings) for encodings in random_pairs(fmt, count, seed=1959))
    got = atan2.compute(y, x)
    alone = CordicAtan2(fmt, **{"width": atan2.width, **parameters}).compute(y, x)
    np.testing.assert_array_equal(got.result, alone)
    y, x = exact_values(fmt.flush(y)), exact_values(fmt.flush(x))
    with np.errstate(all="ignore"):
        wanted = np.arctan2(y, x)
        lengths = np.hypot(y, x)
    np.testing.assert_array_equal(np.isnan(got.result), np.isnan(wanted))
    np.testing.assert_array_equal(np.isnan(got.magnitude), np.isnan(lengths))
    valid = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(got.result[valid]), np.signbit(wanted[valid]))
    error = ulp_errors(fmt, got.result[valid], wanted[valid], atan2.error_bound)
    oracle_error = ORACLE_ERROR * 2.0**fmt.precision
    assert error.max() <= atan2.error_bound_ulp + oracle_error
    # The bounds are not much too large: a part of the error that they allow before rounding occurs.
    assert error.max() > 0.5 + atan2.error_bound / 10

    # With a larger exponent range this would be the number after the largest one.
    overflow = np.ldexp(np.longdouble(2) - np.ldexp(np.longdouble(1), -fmt.precision), fmt.bias)
    finite = np.isfinite(got.magnitude)
    assert np.all(lengths[~finite & valid] > overflow * (1 - 2.0**-fmt.precision))
    assert not np.isinf(lengths[finite]).any()
    error = ulp_errors(fmt, got.magnitude[finite], lengths[finite], 0)
    assert error.max() <= atan2.magnitude_error_bound_ulp + oracle_error
    assert error.max() > 0.5 + (atan2.magnitude_error_bound_ulp - 0.5) / 10


def test_ten_million():
    """Binary32 within 1 ulp of float64's arctangent, whose error is less than 2**-28 ulp of binary32."""
    atan2, worst = CordicAtan2(FORMATS["binary32_flush"]), 0.0
    for seed in range(50):
        y, x = (BINARY32.from_bits(encodings) for encodings in random_pairs(atan2.format, 200_000, seed))
        got, y, x = atan2.compute(y, x), atan2.format.flush(y), atan2.format.flush(x)
        with np.errstate(invalid="ignore"):
            wanted = np.arctan2(y, x, dtype=np.float64)
        normal = np.abs(wanted) > 2.0**-125
        ulp = np.ldexp(1.0, np.frexp(wanted[normal])[1] - 24)
        worst = max(worst, np.max(np.abs(got[normal].astype(np.float64) - wanted[normal]) / ulp))
    assert 0.52 < worst <= atan2.error_bound_ulp + 2.0**-28


def test_binary64_against_integers():
    """Angles in the first quadrant, with an arctangent in integer arithmetic."""
    rng = np.random.default_rng(754)
    y, x = (rng.integers(1 << 52, 1 << 53, 300) for _ in range(2))
    places = rng.integers(0, 60, (2, 300))
    atan2 = CordicAtan2(BINARY64)
    got = atan2.compute(np.ldexp(y.astype(float), -places[0]), np.ldexp(x.astype(float), -places[1]))
    for row, angle in enumerate(got):
        wanted = scaled_atan2(int(y[row]) << int(places[1][row]), int(x[row]) << int(places[0][row]), 200)
        numerator, denominator = float(angle).as_integer_ratio()
        ulps = abs((numerator << 200) // denominator - wanted) / 2.0**200 / np.spacing(angle)
        assert ulps <= atan2.error_bound_ulp + 1e-9


def test_accuracy_of_defaults():
    """A bound for these cases alone, well below the proven one, to detect a loss of accuracy."""
    fmt = FORMATS["binary32_flush"]
    rng = np.random.default_rng(1971)
    x, y = rng.uniform(1, 2, (2, 1_000_000)).astype(np.float32)
    y *= np.exp2(rng.integers(-12, 3, y.shape)).astype(np.float32)
    got = CordicAtan2(fmt).compute(y, -x).astype(np.float64), CordicAtan2(fmt).compute(y, x).astype(np.float64)
    for result, wanted in zip(got, (np.arctan2(y, -x, dtype=float), np.arctan2(y, x, dtype=float)), strict=True):
        assert np.max(np.abs(result - wanted) / np.spacing(wanted.astype(np.float32))) < 0.6


# The circuit.

CIRCUITS = {
    "binary32_gradual_2": (FORMATS["binary32_gradual"], {}, 300_000),
    "binary32_flush_1": (FORMATS["binary32_flush"], {"steps_per_cycle": 1}, 200_000),
    "binary32_flush_2": (FORMATS["binary32_flush"], {}, 1_000_000),
    "binary32_length": (FORMATS["binary32_gradual"], {"magnitude": True, "steps_per_cycle": 3}, 200_000),
    "binary32_pipelined": (FORMATS["binary32_gradual"], {"magnitude": True, "iterative": False}, 300_000),
    "binary64_length": (FORMATS["binary64_flush"], {"magnitude": True}, 10_000),
    "binary64_1": (FORMATS["binary64_flush"], {"steps_per_cycle": 1}, 10_000),
    "binary64_length_1": (FORMATS["binary64_gradual"], {"magnitude": True, "steps_per_cycle": 1}, 10_000),
    "binary16_registered": (FORMATS["binary16_gradual"], {"magnitude": True, "steps_per_cycle": 1, "width": 40,
                                                          "iterations": 13, "registered_addends": True}, 200_000),
    "binary16_flush_1": (FORMATS["binary16_flush"], {"steps_per_cycle": 1, "width": 13, "iterations": 13}, 200_000),
    "bfloat16_length": (FORMATS["bfloat16_gradual"], {"magnitude": True}, 200_000),
    "custom_pipelined": (FORMATS["float6_16_flush"], {"magnitude": True, "iterative": False}, 100_000),
}


@pytest.mark.verilator
@pytest.mark.parametrize(("fmt", "parameters", "count"), CIRCUITS.values(), ids=CIRCUITS)
def test_circuit_equals_twin(fmt, parameters, count, models, tmp_path):
    atan2 = CordicAtan2(fmt, **parameters)
    stimulus = dict(zip(("y", "x"), random_pairs(fmt, count, seed=1999), strict=True))
    results = ("result", "magnitude") if atan2.has_magnitude else ("result",)
    answer = answers(atan2, "atan2", ("y", "x"), results, stimulus, models, tmp_path)
    wanted = atan2.compute(*(fmt.from_bits(encodings) for encodings in stimulus.values()))
    for name, numbers in wanted._asdict().items() if atan2.has_magnitude else [("result", wanted)]:
        assert_equal(fmt, answer[name], numbers, stimulus, name)


@pytest.mark.parametrize("policy", ["gradual", "flush"])
@pytest.mark.parametrize("rate", [0.1, 0.9, 1.0])
def test_handshake(policy, rate):
    """Random starts, with operands that change in every cycle: checks the accepted starts, the time of
    the results, and that results hold."""
    fmt = BINARY16.with_subnormals(policy)
    atan2 = CordicAtan2(fmt, steps_per_cycle=2)
    rng = np.random.default_rng(754)
    y, x = random_pairs(fmt, 600, seed=754)
    order = rng.permutation(len(y))
    y, x, start = y[order], x[order], rng.random(len(y)) < rate
    results = fmt.to_bits(atan2.compute(fmt.from_bits(y), fmt.from_bits(x)))

    done, result = np.zeros(len(y), dtype=int), np.zeros(len(y), dtype=int)
    free = 0
    for cycle in np.flatnonzero(start):
        if cycle >= free:
            free = cycle + atan2.interval
            done[cycle + atan2.latency:][:1] = 1
            result[cycle + atan2.latency:] = results[cycle]
    assert done.sum() > 5

    async def drive(ctx):
        for cycle in range(len(y)):
            ctx.set(atan2.y, fmt.layout.from_bits(int(y[cycle])))
            ctx.set(atan2.x, fmt.layout.from_bits(int(x[cycle])))
            ctx.set(atan2.start, int(start[cycle]))
            assert (cycle, ctx.get(atan2.done)) == (cycle, done[cycle])
            assert (cycle, ctx.get(atan2.result.as_value())) == (cycle, result[cycle])
            await ctx.tick()

    simulator = Simulator(atan2)
    simulator.add_clock(1e-6)
    simulator.add_testbench(drive)
    simulator.run()
