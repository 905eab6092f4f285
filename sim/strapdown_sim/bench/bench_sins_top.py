"""Bench for SINS_top: start values, an alignment at rest, rest, and the status."""

import math

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.stimuli.flight import SOURCE_EARTH, WGS84

core, config = core_under_test()
EARTH = {"source": SOURCE_EARTH, "wgs84": WGS84}[config.earth]
LATITUDE_DEG, LONGITUDE_DEG, HEADING_DEG, HEIGHT_M = 50.0, -120.0, 30.0, 400.0
LATITUDE, HEADING = math.radians(LATITUDE_DEG), math.radians(HEADING_DEG)
DEGREE = 1e-10
"""Tolerances of angles, degrees: 1e-12 for an arctangent, and a thousand times that for the heading, because the
rounding of the specific force (2**-53) tilts an axis that only the earth's rate determines."""


def sample(omega=None, f=None, *, velocity=(0.0, 0.0, 0.0), load=0.0, align=0.0):
    """Inputs of one update; by default those of a level body at rest with the heading above."""
    east = -math.cos(LATITUDE) * math.sin(HEADING) * EARTH.rate_rad_s
    north = math.cos(LATITUDE) * math.cos(HEADING) * EARTH.rate_rad_s
    omega = omega or (east, north, math.sin(LATITUDE) * EARTH.rate_rad_s)
    f = f or (0.0, 0.0, EARTH.gravity(LATITUDE, HEIGHT_M))
    # Heading is clockwise; the quaternion's rotation about up is anticlockwise. Its length does not matter.
    q = 3 * math.cos(HEADING / 2), 0.0, 0.0, -3 * math.sin(HEADING / 2)
    altitude = {"altitude": HEIGHT_M} if config.damping_s else {}
    return core.system.bind(
        omega=omega, f=f, load=load, align=align, place=(LATITUDE_DEG, LONGITUDE_DEG), start_v=velocity,
        start_h=HEIGHT_M, start_q=q, **altitude)


def check(driver, velocity=(0.0, 0.0, 0.0)):
    """Assert that attitude, position and velocity are those of the start, within rounding."""
    told = driver.vectors()
    np.testing.assert_allclose(told["attitude"], (0.0, 0.0, HEADING_DEG), rtol=0, atol=DEGREE)
    np.testing.assert_allclose(told["position"], (LATITUDE_DEG, LONGITUDE_DEG), rtol=0, atol=DEGREE)
    assert abs(told["wander"]) <= DEGREE
    assert abs(told["height"] - HEIGHT_M) <= 1e-9
    np.testing.assert_allclose(told["velocity"], velocity, rtol=1e-12, atol=1e-12)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def waits_for_a_load(dut):
    """After a reset the core neither aligns nor navigates, and all outputs are zero for any sensor values."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    await driver.update(sample((0.1, 0.2, 0.3), (1.0, 2.0, 3.0), velocity=(5.0, 6.0, 7.0)))
    assert driver.status() == set()
    assert set(driver.outputs().values()) == {0.0}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def start_values_and_rest(dut):
    """A load gives the start values at once; a body at rest keeps them."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    velocity = 70.0, -20.0, 3.0
    await driver.update(sample(velocity=velocity, load=1.0))
    assert driver.status() == {"navigating"}
    check(driver, velocity)
    await driver.update(sample(load=1.0))
    for _ in range(2):
        check(driver)
        await driver.update(sample())
        assert driver.status() == {"navigating"}
    check(driver)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def aligns_at_rest(dut):
    """Samples of earth rate and gravity give the attitude; the start quaternion is ignored."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    for k in range(config.alignment_samples):
        assert driver.status() == ({"aligning"} if k else set())
        first = sample(load=1.0, align=1.0) | {"in_q0": 0.6, "in_q1": 0.8}
        await driver.update(sample() if k else first)
    assert driver.status() == {"navigating"}
    check(driver)
    await driver.update(sample())
    check(driver)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def out_of_range_sets_its_bit(dut):
    """A rate or a force beyond the range sets the bit, and the update is still made."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    await driver.update(sample(load=1.0))
    rate, force = math.radians(config.rate_max_deg_s), config.force_max_m_s2
    for inputs, expected in ((sample((0.0, 0.999 * rate, 0.0), (0.999 * force, 0.0, 0.0)), set()),
                             (sample((0.0, 1.001 * rate, 0.0)), {"out_of_range"}),
                             (sample(f=(1.001 * force, 0.0, 0.0)), {"out_of_range"})):
        before = driver.bits()
        await driver.update(inputs)
        assert driver.status() == {"navigating"} | expected
        assert driver.bits() != before
