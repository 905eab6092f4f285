# amaranth: UnusedElaboratable=no
"""Arctangent: the circuit against its twin, and the twin against the arctangent of float64."""

import re

import numpy as np
import pytest
from amaranth.back import verilog
from amaranth.sim import Simulator
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

from strapdown.cordic import CordicAtan2
from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat

FORMATS = {f"{fmt.name}_{policy}": fmt.with_subnormals(policy)
           for fmt in (BINARY16, BINARY32) for policy in ("gradual", "flush")}


# Stimuli: encodings, uint64.

def specials(fmt):
    """Zeros, ends of the ranges of subnormals and normals, one, infinities and NaNs of either sign."""
    one = fmt.bias << fmt.fraction_width
    positive = [0, 1, fmt.least_normal - 1, fmt.least_normal, one - 1, one, one + 1, fmt.infinity - 1,
                fmt.infinity, fmt.infinity + 1, fmt.nan, (1 << fmt.width - 1) - 1]
    return np.array([sign << (fmt.width - 1) | value for sign in (0, 1) for value in positive], dtype=np.uint64)


def random_pairs(fmt, count, seed):
    """Random pairs: special, independent, subnormal, on the octants' borders, of like exponent,
    and of all exponent differences up to results that vanish."""
    rng = np.random.default_rng(seed)
    sign = np.uint64(1 << (fmt.width - 1))
    last = np.uint64(fmt.infinity - 1)
    y, x, jitter = (rng.integers(0, 1 << fmt.width, count, dtype=np.uint64) for _ in range(3))
    # One of few significant bits, so that exact quotients and ties are among the cases.
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
    ({"width": 25}, ValueError, "width must be at least 26, not 25"),
    ({"iterations": 25}, ValueError, "iterations must be at least 26, not 25"),
    ({"width": 33}, ValueError, "width + iterations must be at most 62, not 63"),
    ({"iterations": 33, "steps_per_cycle": 2}, ValueError, "width + iterations must be at most 62, not 63"),
    ({"format": BINARY64}, ValueError, "width + iterations must be at most 62, not 118"),
    ({"steps_per_cycle": 2.0}, TypeError, "'float' object cannot be interpreted as an integer"),
])
def test_wrong_parameters(parameters, error, message):
    with pytest.raises(error, match=f"^{re.escape(message)}$"):
        CordicAtan2(**{"format": BINARY32, **parameters})


def test_properties():
    atan2 = CordicAtan2(BINARY32)
    assert (atan2.format, atan2.width, atan2.iterations, atan2.steps_per_cycle) == (BINARY32, 29, 30, 2)
    assert (atan2.latency, atan2.interval, atan2.error_bound) == (20, 19, 0.1875)
    atan2 = CordicAtan2(BINARY32.with_subnormals("flush"), width=28, iterations=28, steps_per_cycle=3)
    assert (atan2.width, atan2.iterations, atan2.latency, atan2.interval) == (28, 30, 13, 12)
    assert CordicAtan2(BINARY32.with_subnormals("flush"), steps_per_cycle=1).latency == 33


# The twin.

def test_twin_broadcasts():
    result = CordicAtan2(BINARY32).compute(np.float32([[1], [-2]]), [2.0, 0.0, -1.0])
    assert (result.dtype, result.shape) == (np.float32, (2, 3))
    # Correctly rounded here: the error before rounding moves none of these six over a tie.
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


ACCURACY = {
    "binary32_gradual": (FORMATS["binary32_gradual"], {}, 1_000_000),
    "binary32_flush": (FORMATS["binary32_flush"], {}, 2_000_000),
    "binary32_coarse": (FORMATS["binary32_flush"], {"width": 26, "iterations": 26}, 200_000),
    "binary32_fine": (FORMATS["binary32_gradual"], {"width": 31, "iterations": 31, "steps_per_cycle": 1}, 200_000),
    "binary16_gradual": (FORMATS["binary16_gradual"], {"steps_per_cycle": 1}, 500_000),
    "binary16_flush": (FORMATS["binary16_flush"], {"steps_per_cycle": 1}, 500_000),
    "binary16_coarse": (FORMATS["binary16_gradual"], {"width": 13, "iterations": 13, "steps_per_cycle": 1}, 200_000),
}


@pytest.mark.parametrize(("fmt", "parameters", "count"), ACCURACY.values(), ids=ACCURACY)
def test_accuracy(fmt, parameters, count):
    atan2 = CordicAtan2(fmt, **parameters)
    y, x = (fmt.from_bits(encodings) for encodings in random_pairs(fmt, count, seed=1959))
    got = atan2.compute(y, x).astype(np.float64)
    with np.errstate(invalid="ignore"):
        wanted = np.arctan2(fmt.flush(y).astype(np.float64), fmt.flush(x).astype(np.float64))
    np.testing.assert_array_equal(np.isnan(got), np.isnan(wanted))
    valid = ~np.isnan(wanted)
    got, wanted = got[valid], wanted[valid]
    np.testing.assert_array_equal(np.signbit(got), np.signbit(wanted))

    exponent = np.maximum(np.frexp(wanted)[1] - 1, 1 - fmt.bias)
    error = np.abs(got - wanted) * np.ldexp(1.0, fmt.fraction_width - exponent)
    if not fmt.gradual:
        # Results so much below the least normal number vanish; nearer to it, they may.
        size, least = np.abs(wanted), 2.0 ** (1 - fmt.bias)
        slack = atan2.error_bound * least * 2.0**-fmt.fraction_width
        assert not got[size < least - slack].any()
        error = np.where((size < least + slack) & (got == 0), 0, error)
    # np.arctan2 of float64 is off by less than 2**-52 relative: 2**-28 ulp of binary32.
    assert error.max() <= 0.5 + atan2.error_bound + 2.0**-28


def test_accuracy_of_defaults():
    """A bound that holds for these cases alone, well below the proven one, so as to notice a loss."""
    fmt = FORMATS["binary32_flush"]
    rng = np.random.default_rng(1971)
    x, y = rng.uniform(1, 2, (2, 1_000_000)).astype(np.float32)
    y *= np.exp2(rng.integers(-12, 3, y.shape)).astype(np.float32)
    got = CordicAtan2(fmt).compute(y, -x).astype(np.float64), CordicAtan2(fmt).compute(y, x).astype(np.float64)
    for result, wanted in zip(got, (np.arctan2(y, -x, dtype=float), np.arctan2(y, x, dtype=float)), strict=True):
        assert np.max(np.abs(result - wanted) / np.spacing(wanted.astype(np.float32))) < 0.6


# The circuit.

CIRCUITS = {
    "binary32_gradual_2": (FORMATS["binary32_gradual"], {}, 1_000_000),
    "binary32_flush_1": (FORMATS["binary32_flush"], {"steps_per_cycle": 1}, 500_000),
    "binary32_flush_2": (FORMATS["binary32_flush"], {}, 1_000_000),
    "binary16_gradual_3": (FORMATS["binary16_gradual"], {"steps_per_cycle": 3}, 500_000),
    "binary16_flush_1": (FORMATS["binary16_flush"], {"steps_per_cycle": 1, "width": 13, "iterations": 13}, 500_000),
}


@pytest.mark.verilator
@pytest.mark.parametrize(("fmt", "parameters", "count"), CIRCUITS.values(), ids=CIRCUITS)
def test_circuit_equals_twin(fmt, parameters, count, models, tmp_path):
    atan2 = CordicAtan2(fmt, **parameters)
    source = tmp_path / "atan2.v"
    source.write_text(verilog.convert(atan2, name="atan2", emit_src=False))
    interface = Interface("atan2", ("y", "x"), ("result",), start="start", finish="done", reset="rst",
                          reset_active=1)
    try:
        model = VerilatedModel(source, interface, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))
    y, x = random_pairs(fmt, count, seed=1999)
    answer = model.transact({"y": y, "x": x})
    # The taking edge is one of the latency's.
    assert set(answer["cycles"].tolist()) == {atan2.latency - 1}
    wanted = fmt.to_bits(atan2.compute(fmt.from_bits(y), fmt.from_bits(x)))
    wrong = np.flatnonzero(answer["result"] != wanted)
    rows = "\n".join(f"atan2({y[row]:#x}, {x[row]:#x}) is {answer['result'][row]:#x}, not {wanted[row]:#x}"
                     for row in wrong[:5])
    assert not wrong.size, f"{wrong.size} of {count} wrong\n{rows}"


@pytest.mark.parametrize("policy", ["gradual", "flush"])
@pytest.mark.parametrize("rate", [0.1, 0.9, 1.0])
def test_handshake(policy, rate):
    """Random starts, operands changing in every cycle: which are taken, when results come, and
    that they hold."""
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
