"""Compiled kernels: every operation, long runs and refused updates against the twin; and unsupported systems."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from strapdown.cores import QUATERNION_J3, SINS, THESIS_COMPACT, main_module, system_of
from strapdown.cores.quaternion import quat_direct
from strapdown.fp import BINARY16, BINARY32, BINARY64
from strapdown.kernel import native
from strapdown.kernel.native import NativeError, NativeTwin
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector
from strapdown.kernel.system import System


@dataclass
class Update:
    outputs: dict
    state: dict = field(default_factory=dict)
    status: dict = field(default_factory=dict)


def everything(xp, *, a, b):
    with xp.section("ALL"):
        return Update({"r": (a + b, a - b, a * b, a / b, xp.sqrt(a), xp.select(a < b, -a, b), -a)})


DIVIDING = THESIS_COMPACT.replace(pool=replace(THESIS_COMPACT.pool, operators=(
    Adder(), Multiplier(), Divider(), Selector())))
PORTS = tuple(f"out_{index}" for index in range(7))
EVERYTHING = System("ALL", "every operation", everything, inputs={"a": "in_a", "b": "in_b"}, outputs={"r": PORTS},
                    sections=("ALL",), start="in_en", finish="out_finish")


def assert_equal(fmt, got, wanted):
    assert got.keys() == wanted.keys()
    for name, values in wanted.items():
        if values.dtype == bool:
            np.testing.assert_array_equal(got[name], values, err_msg=name)
        else:
            np.testing.assert_array_equal(fmt.to_bits(got[name]), fmt.to_bits(values), err_msg=name)


@pytest.mark.parametrize("policy", ["gradual", "flush"])
@pytest.mark.parametrize("plain", [BINARY32, BINARY64], ids=["binary32", "binary64"])
def test_every_operation_in_every_bit(plain, policy):
    """Random encodings, all pairs of special numbers, and results around the least normal number."""
    fmt, rng = plain.with_subnormals(policy), np.random.default_rng(1)
    special = [sign << fmt.width - 1 | value for sign in (0, 1) for value in (
        0, 1, fmt.least_normal - 1, fmt.least_normal, fmt.least_normal + 1, fmt.bias << fmt.fraction_width,
        fmt.infinity - 1, fmt.infinity, fmt.infinity + 1, fmt.nan)]
    pairs = np.array(np.meshgrid(special, special), dtype=np.uint64).reshape(2, -1)
    wild = rng.integers(0, 1 << fmt.width, (2, 20_000), dtype=np.uint64, endpoint=False) if fmt.width < 64 else \
        rng.integers(0, (1 << 64) - 1, (2, 20_000), dtype=np.uint64, endpoint=True)
    # Products and quotients around the least normal number: half of the products are (1 + i u)(1 - i u) times it.
    fraction = rng.integers(1, 200, (2, 20_000), dtype=np.uint64)
    fraction[1, ::2] = 2 * fraction[0, ::2]
    exponent = rng.integers(2, fmt.bias, 20_000, dtype=np.uint64)
    shift = np.uint64(fmt.fraction_width)
    larger = (exponent << shift) + fraction[0]
    product = np.stack([larger, (np.uint64(fmt.bias + 1) - exponent << shift) - fraction[1]])
    quotient = np.stack([larger, (exponent + np.uint64(fmt.bias - 1) << shift) + fraction[1]])
    bits = np.concatenate([pairs, wild, product, quotient], axis=1)
    inputs = {name: fmt.from_bits(row.astype(fmt.bits_dtype)) for name, row in zip(("in_a", "in_b"), bits, strict=True)}
    pool = replace(DIVIDING.pool, format=fmt)
    wanted = EVERYTHING.update_twin(pool, inputs)
    got, _ = NativeTwin(EVERYTHING, pool).run(inputs)
    assert_equal(fmt, got, wanted)
    products, quotients = np.split(fmt.to_bits(np.array([wanted["out_2"], wanted["out_3"]]))[:, -40_000:], 2, axis=1)
    assert (products[0] <= fmt.least_normal).sum() > 5_000
    assert (quotients[1] == fmt.least_normal).any()
    if policy == "flush":
        assert (products[0][::2] == 0).all()


@pytest.mark.parametrize("config", [QUATERNION_J3, DIVIDING], ids=lambda config: config.name)
def test_long_run_is_that_of_the_twin(config):
    """From reset, with NaN and infinity among the inputs, and a second run from the end of the first."""
    system, fmt, rng = system_of(main_module(config), config), config.pool.format, np.random.default_rng(2)
    inputs = {port: fmt.array(rng.standard_normal(300)) for port in system.input_ports}
    if "in_load_en" in inputs:
        inputs["in_load_en"] = fmt.array(-(rng.random(300) < 0.05).astype(float))
    # Row 70 has no field and is at rest, so that status bits would be set.
    for port in system.input_ports:
        inputs[port][70] = 0
    inputs[system.input_ports[0]][5], inputs[system.input_ports[-1]][70] = np.nan, np.inf
    wanted, state = system.run(config.pool, inputs)
    if system.status_port:
        assert wanted["refused"].sum() == 2
    model = NativeTwin(system, config.pool)
    got, after = model.run(inputs)
    assert_equal(fmt, got, wanted)
    assert_equal(fmt, after, state)
    first, after = model.run({port: values[:100] for port, values in inputs.items()})
    second, after = model.run({port: values[100:] for port, values in inputs.items()}, after)
    assert_equal(fmt, {name: np.concatenate((first[name], second[name])) for name in wanted}, wanted)
    assert_equal(fmt, after, state)


def test_restarts_are_those_of_the_twin():
    system, fmt = replace(quat_direct(QUATERNION_J3), restart_after=2), QUATERNION_J3.pool.format
    rng = np.random.default_rng(3)
    inputs = {port: fmt.array(rng.standard_normal(200)) for port in system.input_ports} | {"in_load_en": np.zeros(200)}
    inputs["in_p"] = np.where(rng.random(200) < 0.5, 1e38, inputs["in_p"])
    inputs["in_q"] = np.where(rng.random(200) < 0.2, np.nan, inputs["in_q"])
    wanted, state = system.run(QUATERNION_J3.pool, inputs)
    assert 10 < wanted["restarted"].sum() < wanted["refused"].sum() / 2
    model = NativeTwin(system, QUATERNION_J3.pool)
    first, after = model.run({port: values[:100] for port, values in inputs.items()})
    second, after = model.run({port: values[100:] for port, values in inputs.items()}, after)
    assert_equal(fmt, {name: np.concatenate((first[name], second[name])) for name in wanted}, wanted)
    assert_equal(fmt, after, state)


@pytest.mark.parametrize(("system", "pool", "message"), [
    (system_of(main_module(SINS), SINS), SINS.pool,
     r"^compiled kernels have no atan2: only add, copy, divide, multiply, select, sqrt$"),
    (EVERYTHING, replace(DIVIDING.pool, format=BINARY16),
     r"^compiled kernels have the format binary32 or binary64, not binary16$"),
])
def test_what_has_no_form_in_c(system, pool, message):
    with pytest.raises(NativeError, match=message):
        NativeTwin(system, pool)


def test_compiler_that_is_missing_or_fails(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(native.shutil, "which", lambda name: None)
        with pytest.raises(NativeError, match=r"^the C compiler cc is missing \(Debian: apt-get install gcc\)$"):
            NativeTwin(EVERYTHING, DIVIDING.pool)
    monkeypatch.setattr(native, "OPERATORS", "no C {real}")
    with pytest.raises(NativeError, match=r"^cc failed with status 1: .*error"):
        NativeTwin(EVERYTHING, DIVIDING.pool)
