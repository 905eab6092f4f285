"""Bench for INS_top alone: table 5-7, and everything that can be wrong with a sample."""

import math

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.reference.attitude import ComplementaryFilter
from strapdown_sim.stimuli.thesis import TABLE_5_7, TABLE_5_7_INPUT

core, config = core_under_test()
ANGLES = "out_pitch", "out_roll", "out_yaw"


def sample(a=(0.1, -0.2, 9.7), m=(20.0, 3.0, -40.0), g=(1.0, -2.0, 3.0)):
    """Inputs of one update: m/s², µT, deg/s."""
    return {f"in_{sensor}{axis}": value for sensor, vector in (("acc", a), ("mag", m), ("gyro", g))
            for axis, value in zip("xyz", vector, strict=True)}


def reference():
    """The float64 filter with this core's parameters."""
    return ComplementaryFilter(kp=config.kp, ki=config.ki, period_s=config.period_s,
                               mag_axes=config.magnetometer_axes)


def near(driver, truth):
    """Whether all nine elements of the matrix are the reference's, within 1e-6."""
    outputs = driver.outputs()
    matrix = [[outputs[f"out_c{row}{column}"] for column in "123"] for row in "123"]
    # Some ten roundings of 2**-24 an update, and a handful of updates.
    return np.abs(matrix - truth.c_n2b).max() < 1e-6


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def table_5_7(dut):
    """Five updates from reset, within 5e-5 degrees of the float64 reference and of the printed digits."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth = reference()
    for printed in TABLE_5_7:
        await driver.update(TABLE_5_7_INPUT)
        exact = truth.update((1, 1, 1), (1, 1, 1), (1, 1, 1))
        outputs = driver.outputs()
        for port, value, published in zip(ANGLES, (exact.pitch, exact.roll, exact.yaw), printed, strict=True):
            assert abs(outputs[port] - value) <= 5e-5
            if config.name == "thesis":
                # The digits are printed with four decimals.
                assert abs(outputs[port] - published) <= 5e-5 + 5e-5


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def state_after_reset(dut):
    """After a reset the outputs show q = (1, 0, 0, 0): C is the unit matrix, the angles are zero."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    expected = {port: float(port in ("out_c11", "out_c22", "out_c33")) for port in core.system.output_ports}
    assert driver.outputs() == expected
    await driver.update(sample())
    assert driver.outputs() != expected
    await driver.begin(sample())
    await driver.cycles(core.latency // 3)
    await driver.assert_reset()
    assert driver.outputs() == expected
    assert driver.status() == set()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def sensor_without_length(dut):
    """A zero accelerometer or magnetometer does not correct, and says so; the other goes on."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth, nothing = reference(), (0.0, -0.0, 0.0)
    for kwargs, expected in (({"a": nothing}, {"accelerometer_missing"}),
                             ({"m": nothing}, {"magnetometer_missing"}),
                             ({"a": nothing, "m": nothing}, {"accelerometer_missing", "magnetometer_missing"}),
                             ({"a": (1e-30, 0.0, 0.0)}, {"accelerometer_missing"}),
                             ({}, set())):
        inputs = sample(**kwargs)
        await driver.update(inputs)
        assert driver.status() == expected, kwargs
        vectors = [tuple(inputs[f"in_{sensor}{axis}"] for axis in "xyz") for sensor in ("acc", "mag", "gyro")]
        if kwargs.get("a") == (1e-30, 0.0, 0.0):
            vectors[0] = nothing  # too short to have a direction
        assert near(driver, truth.update(*vectors)), kwargs


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def overflow_is_refused(dut):
    """Finite numbers too large for the arithmetic are refused like infinite ones, in the first update too."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    at_reset = driver.bits()
    for inputs in (sample(a=(3e38, 0, 0)), sample(m=(0, -3e38, 0)), sample(g=(0, 0, 3e38)), sample(a=(1e25, 1e25, 0))):
        assert await driver.update(inputs) == core.latency
        assert driver.status() == {"refused"}
        assert driver.bits() == at_reset
    await driver.update(sample())
    assert driver.status() == set()
    assert near(driver, reference().update((0.1, -0.2, 9.7), (20, 3, -40), (1, -2, 3)))


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def gimbal_lock(dut):
    """Turned about west through straight down and on: angles stay numbers, pitch comes near 90 and not above."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    highest = 0.0
    rate = 1.5 / config.period_s  # 1.5 degrees an update
    for _ in range(90):
        await driver.update(sample(a=(0, 0, 0), m=(0, 0, 0), g=(0, rate, 0)))
        outputs = driver.outputs()
        assert all(math.isfinite(value) for value in outputs.values())
        assert 0 <= outputs["out_yaw"] < 360
        highest = max(highest, outputs["out_pitch"])
    # The nearest of the updates is at most half a step away.
    assert 89.2 < highest <= 90
