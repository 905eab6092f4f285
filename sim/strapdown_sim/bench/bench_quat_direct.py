"""Bench for QUAT_direct: exact rotations, and the start quaternion."""

import math

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test

core, config = core_under_test()
ROUNDING = 2.5 * 2.0**-core.engine.program.format.precision
"""Rounding of a component in one update: two products, their sum, a and d."""


def inputs(rate=(0.0, 0.0, 0.0), start=(0.0, 0.0, 0.0, 0.0), load=0.0):
    """Inputs of one update: rad/s, and a quaternion if it is to be loaded."""
    return core.system.bind(omega=rate, load=load, start=start)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def half_a_turn_about_each_axis(dut):
    """Updates at the largest rate add up to 180 degrees about each axis: the quaternion is that axis."""
    driver = CoreDriver(dut, core)
    rate = math.radians(config.rate_max_deg_s)
    count = round(math.pi / (rate * config.period_s))
    for axis in range(3):
        await driver.reset()
        for _ in range(count):
            await driver.update(inputs(np.eye(3)[axis] * math.pi / (count * config.period_s)))
        expected = np.eye(4)[axis + 1]
        assert np.abs(driver.vectors()["e"] - expected).max() <= count * (ROUNDING + config.coefficients.worst()[0])


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def a_load_takes_the_start_quaternion(dut):
    """A load gives the start quaternion for any rate; the next update propagates it."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    # Exact in binary32.
    start = 0.5, -0.5, 0.5, 0.5
    await driver.update(inputs((9.0, 8.0, 7.0), start, load=1.0))
    assert driver.vectors()["e"].tolist() == list(start)
    await driver.update(inputs((10.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    c, s = math.cos(5 * config.period_s), math.sin(5 * config.period_s)
    w, x, y, z = start
    expected = w * c - x * s, x * c + w * s, y * c + z * s, z * c - y * s  # start⊗(c, s, 0, 0)
    assert np.abs(driver.vectors()["e"] - expected).max() <= ROUNDING + config.coefficients.worst()[0]


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def without_a_rate_it_stands(dut):
    """With zero rate every component keeps its reset value."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    for _ in range(3):
        await driver.update(inputs())
        assert driver.vectors()["e"].tolist() == [1, 0, 0, 0]
