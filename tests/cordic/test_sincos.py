"""Sine and cosine: the circuit against its twin, and the twin against wider arithmetic."""

import re

import numpy as np
import pytest
from amaranth.sim import Simulator

from strapdown.cordic import CordicSinCos
from strapdown.cordic.tables import SCALE, least_remainder, scaled_reciprocal_gain
from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat

from .support import FORMATS, ORACLE_ERROR, answers, assert_equal, exact_values, ulp_errors

# Stimuli: encodings, uint64.

def specials(fmt):
    """Zeros, ends of the ranges of subnormals, normals, tiny angles and operands, infinities and NaNs."""
    tiny = fmt.bias - (fmt.precision + 1) // 2 << fmt.fraction_width
    borders = [fmt.least_normal, tiny, fmt.bias - 1 << fmt.fraction_width, fmt.bias << fmt.fraction_width,
               fmt.bias + 8 << fmt.fraction_width, fmt.infinity]
    positive = [0, 1, *(border + offset for border in borders for offset in (-1, 0, 1)), fmt.nan,
                (1 << fmt.width - 1) - 1]
    return np.array([sign << (fmt.width - 1) | value for sign in (0, 1) for value in positive], dtype=np.uint64)


def random_angles(fmt, count, seed):
    """Random angles: any encodings, all magnitudes that are computed, few significant bits,
    uniform within two turns, and close to all multiples of pi/4."""
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, (1 << fmt.width) - 1, count, dtype=np.uint64, endpoint=True)
    kept = rng.integers(0, fmt.fraction_width, count, endpoint=True, dtype=np.uint64)
    exponent = rng.integers(fmt.bias - fmt.precision // 2 - 2, fmt.bias + 9, count).astype(np.uint64)
    fraction_bits = np.uint64(fmt.fraction_width)
    sign = bits & np.uint64(1 << (fmt.width - 1))
    magnitude = bits & np.uint64(fmt.least_normal - 1) | exponent << fraction_bits
    multiples = fmt.to_bits(rng.integers(1, 326, count) * (np.pi / 4)).astype(np.uint64)
    kinds = [
        bits,
        magnitude | sign,
        magnitude >> kept << kept | sign,
        fmt.to_bits(rng.uniform(-4 * np.pi, 4 * np.pi, count)).astype(np.uint64),
        multiples + rng.integers(0, 5, count).astype(np.uint64) - np.uint64(2) | sign,
    ]
    angles = np.choose(rng.choice(len(kinds), count, p=[0.1, 0.3, 0.2, 0.2, 0.2]), kinds)
    crossed = specials(fmt)
    angles[:len(crossed)] = crossed
    return angles


# Parameters.

@pytest.mark.parametrize(("parameters", "error", "message"), [
    ({"format": "binary32"}, TypeError, "format must be a FloatFormat, not 'binary32'"),
    ({"format": FloatFormat(4, 10)}, ValueError, "format must have at least 5 exponent bits, not 4"),
    ({"steps_per_cycle": 0}, ValueError, "steps_per_cycle must be from 1 to 8, not 0"),
    ({"steps_per_cycle": 9}, ValueError, "steps_per_cycle must be from 1 to 8, not 9"),
    ({"steps_per_cycle": 2.0}, TypeError, "'float' object cannot be interpreted as an integer"),
    ({"width": 26}, ValueError, "width must be from 27 to 60, not 26"),
    ({"width": 61}, ValueError, "width must be from 27 to 60, not 61"),
    ({"format": FloatFormat(11, 60)}, ValueError, "format must have a precision of at most 57 bits, not 61"),
    ({"iterations": 25}, ValueError, "iterations must be at least 26, not 25"),
])
def test_wrong_parameters(parameters, error, message):
    with pytest.raises(error, match=f"^{re.escape(message)}$"):
        CordicSinCos(**{"format": BINARY32, **parameters})


def test_properties():
    sincos = CordicSinCos(BINARY32)
    assert (sincos.format, sincos.width, sincos.iterations, sincos.steps_per_cycle) == (BINARY32, 31, 30, 2)
    assert (sincos.latency, sincos.interval, sincos.limit) == (22, 21, 256)
    assert 0.237 < sincos.error_bound < 0.238
    sincos = CordicSinCos(BINARY32, width=29, iterations=28, steps_per_cycle=3)
    assert (sincos.width, sincos.iterations, sincos.latency, sincos.interval) == (29, 30, 16, 15)
    assert 0.737 < CordicSinCos(BINARY32).error_bound_ulp < 0.738
    assert CordicSinCos(BINARY64).error_bound_ulp < 0.8
    sincos = CordicSinCos(BINARY32, iterative=False, steps_per_cycle=3)
    assert (sincos.latency, sincos.interval, sincos.iterative) == (16, 1, False)
    assert CordicSinCos(BINARY32, steps_per_cycle=1).latency == 41


# The constants.

def test_gain():
    assert scaled_reciprocal_gain(0) / 2.0**SCALE == pytest.approx(0.6072529350088813, rel=1e-15)
    assert scaled_reciprocal_gain(1) / 2.0**SCALE == pytest.approx(0.6072529350088813 * 2**0.5, rel=1e-15)


def test_least_remainder():
    """For binary16, against all numbers of an exponent."""
    for exponent in range(8):
        angles = np.arange(1 << 10, 1 << 11) * 2.0 ** (exponent - 10)
        found = np.min(np.abs(angles - np.rint(angles / (np.pi / 2)) * (np.pi / 2)))
        # The function includes numbers of smaller exponents, which are not multiples of 2**(exponent - 10).
        assert least_remainder(11, exponent) / 2.0**SCALE <= found * (1 + 1e-9)
    assert least_remainder(11, 7) / 2.0**SCALE == pytest.approx(abs(177.5 - 56.5 * np.pi), rel=1e-9)


# The twin.

def test_twin_shapes():
    angle = np.float32([[0.25, 1.0, -2.0], [10.0, -200.0, 3.0]])
    result = CordicSinCos(BINARY32).compute(angle)
    assert (result.sin.dtype, result.sin.shape, result.cos.dtype, result.cos.shape) == (np.float32, (2, 3)) * 2
    np.testing.assert_allclose(result.sin, np.sin(angle.astype(float)), rtol=1e-7)
    np.testing.assert_allclose(result.cos, np.cos(angle.astype(float)), rtol=1e-7)
    sin, cos = CordicSinCos(BINARY16).compute(1.0)
    assert (sin, cos) == (np.float16(np.sin(1)), np.float16(np.cos(1)))


@pytest.mark.parametrize("fmt", FORMATS.values(), ids=FORMATS)
def test_special_values(fmt):
    """Zeros keep their sign, tiny angles equal their sines, and operands that cannot be reduced give NaN."""
    subnormal = float(fmt.from_bits(3))
    tiny = float(np.nextafter(fmt.dtype.type(2.0 ** -((fmt.precision + 1) // 2)), fmt.dtype.type(0)))
    kept = np.array([0.0, subnormal, 2.0 ** (1 - fmt.bias), tiny])
    kept = np.concatenate((kept, -kept))
    sin, cos = CordicSinCos(fmt).compute(kept)
    np.testing.assert_array_equal(fmt.to_bits(sin), fmt.to_bits(fmt.array(kept)))
    assert sin[1] == (subnormal if fmt.gradual else 0)
    assert np.all(cos == 1)
    for lost in (256.0, float(fmt.from_bits(fmt.infinity - 1)), np.inf, np.nan):
        for value in (lost, -lost):
            for result in CordicSinCos(fmt).compute(value):
                assert fmt.to_bits(result) == fmt.nan


def test_subnormal_result():
    """177.5 = 56.5 pi, nearly: the cosine is subnormal in binary16."""
    assert np.float16(np.cos(177.5)) == np.float16(-1.508e-05)
    assert CordicSinCos(BINARY16).compute(177.5).cos == np.float16(np.cos(177.5))
    flushed = CordicSinCos(BINARY16.with_subnormals("flush")).compute(177.5).cos
    assert flushed == 0
    assert np.signbit(flushed)


ACCURACY = {
    "binary64_gradual": (FORMATS["binary64_gradual"], {}, 20_000),
    "binary64_flush": (FORMATS["binary64_flush"], {"width": 56, "iterations": 57}, 20_000),
    "binary32_gradual": (FORMATS["binary32_gradual"], {}, 1_000_000),
    "binary32_flush": (FORMATS["binary32_flush"], {}, 200_000),
    "binary32_coarse": (FORMATS["binary32_flush"], {"width": 27, "iterations": 26}, 200_000),
    "binary32_8": (FORMATS["binary32_flush"], {"steps_per_cycle": 8}, 50_000),
    "float6_16_gradual": (FORMATS["float6_16_gradual"], {}, 200_000),
    "binary16_gradual": (FORMATS["binary16_gradual"], {}, None),
    "binary16_flush": (FORMATS["binary16_flush"], {}, None),
    "binary16_coarse": (FORMATS["binary16_gradual"], {"width": 14, "iterations": 13, "steps_per_cycle": 1}, None),
    "bfloat16_gradual": (FORMATS["bfloat16_gradual"], {}, None),
    "bfloat16_flush": (FORMATS["bfloat16_flush"], {}, None),
}


@pytest.mark.parametrize(("fmt", "parameters", "count"), ACCURACY.values(), ids=ACCURACY)
def test_accuracy(fmt, parameters, count):
    sincos = CordicSinCos(fmt, **parameters)
    angle = fmt.from_bits(np.arange(1 << fmt.width) if count is None else random_angles(fmt, count, seed=1959))
    exact = exact_values(fmt.flush(angle))
    valid = np.abs(exact) < sincos.limit
    worst = 0.0
    for got, function in zip(sincos.compute(angle), (np.sin, np.cos), strict=True):
        assert np.isnan(got[~valid]).all()
        got, wanted = got[valid], function(exact[valid])
        np.testing.assert_array_equal(np.signbit(got), np.signbit(wanted))
        error = ulp_errors(fmt, got, wanted, sincos.error_bound)
        assert error.max() <= sincos.error_bound_ulp + ORACLE_ERROR * 2.0**fmt.precision
        worst = max(worst, error.max())
    # The bound is not much too large: a part of the error that it allows before rounding occurs.
    assert worst > 0.5 + sincos.error_bound / 20


def test_accuracy_of_defaults():
    """A bound for these cases alone, well below the proven one, to detect a loss of accuracy."""
    angle = np.random.default_rng(1971).uniform(-2 * np.pi, 2 * np.pi, 500_000).astype(np.float32)
    for got, function in zip(CordicSinCos(BINARY32).compute(angle), (np.sin, np.cos), strict=True):
        wanted = function(angle.astype(np.float64))
        error = np.abs(got.astype(np.float64) - wanted) / np.spacing(np.abs(wanted).astype(np.float32))
        assert error.max() < 0.62


# The circuit.

CIRCUITS = {
    "binary32_gradual_2": (FORMATS["binary32_gradual"], {}, 300_000),
    "binary32_flush_3": (FORMATS["binary32_flush"], {"steps_per_cycle": 3, "width": 29}, 200_000),
    "binary32_pipelined": (FORMATS["binary32_flush"], {"iterative": False}, 300_000),
    "binary64_3": (FORMATS["binary64_gradual"], {"steps_per_cycle": 3}, 2_000),
    "binary16_gradual_2": (FORMATS["binary16_gradual"], {}, 200_000),
    "binary16_flush_1": (FORMATS["binary16_flush"], {"steps_per_cycle": 1, "width": 14, "iterations": 13}, 200_000),
    "bfloat16_2": (FORMATS["bfloat16_gradual"], {}, 200_000),
}


@pytest.mark.verilator
@pytest.mark.parametrize(("fmt", "parameters", "count"), CIRCUITS.values(), ids=CIRCUITS)
def test_circuit_equals_twin(fmt, parameters, count, models, tmp_path):
    sincos = CordicSinCos(fmt, **parameters)
    stimulus = {"angle": random_angles(fmt, count, seed=1999)}
    answer = answers(sincos, "sincos", ("angle",), ("sin", "cos"), stimulus, models, tmp_path)
    for name, wanted in sincos.compute(fmt.from_bits(stimulus["angle"]))._asdict().items():
        assert_equal(fmt, answer[name], wanted, stimulus, name)


@pytest.mark.parametrize("policy", ["gradual", "flush"])
@pytest.mark.parametrize("rate", [0.1, 1.0])
def test_handshake(policy, rate):
    """Random starts, with operands that change in every cycle: checks the accepted starts, the time of
    the results, and that results hold."""
    fmt = BINARY16.with_subnormals(policy)
    sincos = CordicSinCos(fmt)
    rng = np.random.default_rng(754)
    angle = rng.permutation(random_angles(fmt, 500, seed=754))
    start = rng.random(len(angle)) < rate
    results = [fmt.to_bits(values) for values in sincos.compute(fmt.from_bits(angle))]

    done, sin, cos = (np.zeros(len(angle), dtype=int) for _ in range(3))
    free = 0
    for cycle in np.flatnonzero(start):
        if cycle >= free:
            free = cycle + sincos.interval
            finish = cycle + sincos.latency
            done[finish:][:1], sin[finish:], cos[finish:] = 1, results[0][cycle], results[1][cycle]
    assert done.sum() > 5

    async def drive(ctx):
        for cycle in range(len(angle)):
            ctx.set(sincos.angle, fmt.layout.from_bits(int(angle[cycle])))
            ctx.set(sincos.start, int(start[cycle]))
            assert (cycle, ctx.get(sincos.done)) == (cycle, done[cycle])
            assert (cycle, ctx.get(sincos.sin.as_value())) == (cycle, sin[cycle])
            assert (cycle, ctx.get(sincos.cos.as_value())) == (cycle, cos[cycle])
            await ctx.tick()

    simulator = Simulator(sincos)
    simulator.add_clock(1e-6)
    simulator.add_testbench(drive)
    simulator.run()
