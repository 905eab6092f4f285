"""Bench for INS_top: table 5-7, and bad samples of all kinds."""

import math

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.reference.attitude import axis_matrix
from strapdown_sim.stimuli.pole import angle_error
from strapdown_sim.stimuli.thesis import TABLE_5_7, TABLE_5_7_INPUT
from strapdown_sim.truth import complementary_filter

core, config = core_under_test()
SAMPLE = {"a": (0.1, -0.2, 9.7), "m": (20.0, 3.0, -40.0), "g": (1.0, -2.0, 3.0)}
"""Default vectors: m/s², µT, deg/s."""


def sample(**vectors):
    """Inputs of one update; the default is SAMPLE."""
    return core.system.bind(**SAMPLE | vectors)


def near(driver, truth):
    """True if all nine elements of the matrix agree with the reference within 1e-6."""
    # About ten roundings of 2**-24 per update, and a few updates.
    return np.abs(driver.vectors()["c"] - truth.c_n2b).max() < 1e-6


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def table_5_7(dut):
    """Five updates from reset agree with the float64 reference and the printed digits within 5e-5 degrees."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth = complementary_filter(config)
    for printed in TABLE_5_7:
        await driver.update(core.system.bind(**TABLE_5_7_INPUT))
        exact = truth.update(*TABLE_5_7_INPUT.values())
        angles = driver.vectors()["angles"]
        assert np.abs(angles - (exact.pitch, exact.roll, exact.yaw)).max() <= 5e-5
        if config.name == "thesis":
            # The digits are printed with four decimals.
            assert np.abs(np.subtract(angles, printed)).max() <= 5e-5 + 5e-5


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def state_after_reset(dut):
    """After a reset the outputs show q = (1, 0, 0, 0): C is the unit matrix, the angles are zero."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    expected = driver.outputs()
    assert (driver.vectors()["c"] == np.eye(3)).all()
    assert (driver.vectors()["angles"] == 0).all()
    await driver.update(sample())
    assert driver.outputs() != expected
    await driver.begin(sample())
    await driver.cycles(core.latency // 3)
    await driver.assert_reset()
    assert driver.outputs() == expected
    assert driver.status() == set()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def sensor_without_length(dut):
    """A zero accelerometer or magnetometer does not correct and sets its bit; the other one still corrects."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth, nothing = complementary_filter(config), (0.0, -0.0, 0.0)
    for vectors, expected in (({"a": nothing}, {"accelerometer_missing"}),
                             ({"m": nothing}, {"magnetometer_missing"}),
                             ({"a": nothing, "m": nothing}, {"accelerometer_missing", "magnetometer_missing"}),
                             ({"a": (1e-30, 0.0, 0.0)}, {"accelerometer_missing"}),
                             ({}, set())):
        await driver.update(sample(**vectors))
        assert driver.status() == expected, vectors
        if vectors.get("a") == (1e-30, 0.0, 0.0):
            vectors = {"a": nothing}  # too short to have a direction
        assert near(driver, truth.update(*(SAMPLE | vectors).values())), vectors


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reversed_attitude(dut):
    """A specific force or a field that is more than 90 degrees from the attitude sets its bit, even without an error.

    After a reset the body is level and heads north. The error vector of a body upside down is zero, and so is that of
    a body that heads south in a horizontal field: the attitude does not change.
    """
    driver = CoreDriver(dut, core)
    up, sensor = (0.0, 0.0, 9.8), axis_matrix(config.magnetometer_axes).T
    for a, field, expected in ((up, (20, 0, -40), set()), ((0, 0, -9.8), (20, 0, 0), {"tilt_reversed"}),
                               (up, (-20, 0, 0), {"heading_reversed"}),
                               ((0, 0, -9.8), (-20, 0, 0), {"tilt_reversed", "heading_reversed"}),
                               ((0, 0, 0), (0, 0, 0), {"accelerometer_missing", "magnetometer_missing"})):
        await driver.reset()
        for _ in range(3):
            await driver.update(sample(a=a, m=sensor @ field, g=(0, 0, 0)))
            assert driver.status() == expected
            assert np.abs(driver.vectors()["c"] - np.eye(3)).max() == 0


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def overflow_is_refused(dut):
    """Finite numbers that overflow are refused like infinite ones, in the first update too."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    at_reset = driver.bits()
    for inputs in (sample(a=(3e38, 0, 0)), sample(m=(0, -3e38, 0)), sample(g=(0, 0, 3e38)), sample(a=(1e25, 1e25, 0))):
        assert await driver.update(inputs) == core.latency
        assert driver.status() == {"refused"}
        assert driver.bits() == at_reset
    await driver.update(sample())
    assert driver.status() == set()
    assert near(driver, complementary_filter(config).update(*SAMPLE.values()))


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def gimbal_lock(dut):
    """Rotation about west through the vertical: the angles give the matrix, and pitch reaches 90 degrees, not more."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    highest = 0.0
    rate = 1.5 / config.period_s  # 1.5 degrees per update
    for _ in range(90):
        await driver.update(sample(a=(0, 0, 0), m=(0, 0, 0), g=(0, rate, 0)))
        assert all(math.isfinite(value) for value in driver.outputs().values())
        vectors = driver.vectors()
        pitch, _, yaw = vectors["angles"]
        assert angle_error(vectors["angles"], vectors["c"]) < 1e-4
        assert 0 <= yaw < 360
        highest = max(highest, pitch)
    # The nearest update is at most half a step away.
    assert 89.2 < highest <= 90
