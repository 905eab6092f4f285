"""Bench for INS_flight: alignment to a known attitude, and the cause of each status bit."""

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.flight import ALIGNMENTS
from strapdown_sim.truth import flight_filter

core, config = core_under_test()
G, FIELD = 9.81, (20.0, 0.0, -45.0)
SAMPLE = {"a": (0.1, -0.2, 9.7), "m": (20.0, 3.0, -40.0), "g": (1.0, -2.0, 3.0)}
"""Default vectors: m/s², µT, deg/s."""
TOLERANCE_DEG = 1e-4
"""About thirty roundings of 2**-24 rad per update, and twelve updates."""


def sample(**vectors):
    """Inputs of one update; the default is SAMPLE."""
    vectors = SAMPLE | vectors
    return core.system.bind(**{name: vectors[name] for name in core.system.inputs})


def difference(angles, expected):
    """The largest difference of angles, degrees, modulo 360."""
    return np.abs((np.subtract(angles, expected) + 180) % 360 - 180).max()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def aligns_at_once(dut):
    """At rest in a known attitude: the attitude after the samples with full weight."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    q = np.array([0.8, 0.4, -0.2, 0.4])
    c = matrix_from_quaternion(q / np.linalg.norm(q))
    # A correction acts one update later.
    for _ in range(2 * ALIGNMENTS + 1):
        await driver.update(sample(a=c @ (0, 0, G), m=c @ FIELD, g=(0, 0, 0)))
    # Without a magnetometer only the vertical is known.
    columns = slice(None) if config.magnetometer else 2
    assert np.abs(driver.vectors()["c"] - c)[:, columns].max() <= np.radians(TOLERANCE_DEG)
    assert driver.status() == {"starting"}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def status_by_cause(dut):
    """Sensors fail one after the other: each sets its bit, and the attitude agrees with the float64 reference."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth, nothing = flight_filter(config), (0.0, -0.0, 0.0)
    for vectors, expected in (
            *[({}, set())] * (2 * ALIGNMENTS),
            ({"a": nothing}, {"accelerometer_missing"}),
            ({"m": nothing}, {"magnetometer_missing"}),
            ({"a": nothing, "m": nothing}, {"accelerometer_missing", "magnetometer_missing"}),
            ({"a": (0.0, 0.0, 1.01 * config.accelerometer_range)}, {"range_exceeded"}),
            ({"g": (0.0, 1.01 * config.gyro_range, 0.0)}, {"range_exceeded"}),
            # The tilt recovers for three seconds.
            ({"m": (-20.0, 3.0, 90.0)}, {"range_exceeded"}),
            ({}, {"range_exceeded"})):
        await driver.update(sample(**vectors))
        assert driver.status() == {"starting"} | (expected & set(core.engine.status_names)), vectors
        exact = truth.run(*(np.array([vector]) for vector in (SAMPLE | vectors).values()))
        expected_angles = exact.pitch[0], exact.roll[0], exact.yaw[0]
        assert difference(driver.vectors()["angles"], expected_angles) <= TOLERANCE_DEG, vectors
