"""Formats, a circuit run against its twin, and exact oracles for the tests of the CORDIC operators."""

import math

import numpy as np
import pytest

from strapdown.export.backend import to_verilog
from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

BFLOAT16, CUSTOM = FloatFormat(8, 7), FloatFormat(6, 16)
FORMATS = {f"{fmt.name}_{policy}": fmt.with_subnormals(policy)
           for fmt in (BINARY16, BINARY32, BINARY64, BFLOAT16, CUSTOM) for policy in ("gradual", "flush")}

ORACLE_ERROR = 2.0**-62
"""Upper bound of the relative error of NumPy's longdouble functions: 2 ulp of a 64-bit significand.
A longdouble that is not wider than float64 would not be sufficient."""


def exact_values(values):
    """Numbers as longdouble, for use as an oracle's operands."""
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("NumPy's longdouble is not wider than float64 here, so it is no oracle.")
    with np.errstate(invalid="ignore"):  # signalling NaNs
        return values.astype(np.longdouble)


def ulp_errors(fmt, got, wanted, slack):
    """Errors in ulp of the expected results. Flushed results must be flushed correctly, within ``slack`` ulp."""
    exponent = np.maximum(np.frexp(wanted)[1] - 1, 1 - fmt.bias)
    error = np.abs(exact_values(got) - wanted) * np.ldexp(np.longdouble(1), fmt.fraction_width - exponent)
    if not fmt.gradual:
        size, least = np.abs(wanted), np.ldexp(np.longdouble(1), 1 - fmt.bias)
        margin = slack * np.ldexp(least, -fmt.fraction_width)
        assert not got[size < least - margin].any()
        error = np.where((size < least + margin) & (got == 0), 0, error)
    return error.astype(np.float64)


def scaled_atan2(y, x, places):
    """atan2(y, x) * 2**places for positive integers, within 64: four halvings of the angle, then Taylor's series."""
    guard = places + 32
    t = (y << guard) // x
    for _ in range(4):
        # tan(a / 2) = t / (1 + sqrt(1 + t**2)), for any t.
        t = (t << guard) // ((1 << guard) + math.isqrt((1 << 2 * guard) + t * t))
    total, power, n = 0, t, 0
    while power:
        total += (-1) ** n * power // (2 * n + 1)
        power, n = power * t * t >> 2 * guard, n + 1
    return (total << 4) >> guard - places


def answers(component, name, operands, results, stimulus, models, tmp_path):
    """Results of the circuit for rows of operands, with a check of its latency: maps result names to encodings.

    A pipeline starts in three of four cycles and must finish in exactly these cycles, ``latency`` later.
    """
    source = tmp_path / f"{name}.v"
    source.write_text(to_verilog(component, name), encoding="utf-8")
    if component.iterative:
        interface = Interface(name, operands, results, start="start", finish="done", reset="rst", reset_active=1)
    else:
        interface = Interface(name, (*operands, "start"), (*results, "done"), reset="rst", reset_active=1)
    try:
        model = VerilatedModel(source, interface, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))
    if component.iterative:
        answer = model.transact(stimulus)
        # The edge that takes the operands counts in the latency.
        assert set(answer["cycles"].tolist()) == {component.latency - 1}
        return answer
    count, latency = len(next(iter(stimulus.values()))), component.latency
    start = np.random.default_rng(1959).random(2 * count) < 0.75
    start &= np.cumsum(start) <= count
    assert start.sum() == count
    rows = {operand: np.random.default_rng(1971).integers(0, 1 << 16, 2 * count + latency, dtype=np.uint64)
            for operand in operands}
    for operand in operands:
        rows[operand][:2 * count][start] = stimulus[operand]
    answer = model.stream({**rows, "start": np.concatenate((start, np.zeros(latency))).astype(np.uint64)})
    np.testing.assert_array_equal(answer["done"][latency:], start)
    assert not answer["done"][:latency].any()
    return {result: answer[result][latency:][start] for result in results}


def assert_equal(fmt, got, wanted, stimulus, name):
    """Fails with the first operands whose encodings and numbers differ."""
    wanted = fmt.to_bits(wanted)
    wrong = np.flatnonzero(got != wanted)
    rows = "\n".join(f"{name}({', '.join(hex(values[row]) for values in stimulus.values())}) is "
                     f"{got[row]:#x}, not {wanted[row]:#x}" for row in wrong[:5])
    assert not wrong.size, f"{wrong.size} of {len(got)} wrong\n{rows}"
