"""Bench for INS_flight alone: alignment to a known attitude, and each status bit by its cause."""

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.flight import ALIGNMENTS, FlightFilter

core, config = core_under_test()
G, FIELD = 9.81, (20.0, 0.0, -45.0)
ANGLES = "out_pitch", "out_roll", "out_yaw"
TOLERANCE_DEG = 1e-4
"""Some thirty roundings of 2**-24 rad in an update, and a dozen updates."""


def sample(a=(0.1, -0.2, 9.7), m=(20.0, 3.0, -40.0), g=(1.0, -2.0, 3.0)):
    """Inputs of one update: m/s², µT, deg/s."""
    inputs = {f"in_{sensor}{axis}": value for sensor, vector in (("acc", a), ("mag", m), ("gyro", g))
              for axis, value in zip("xyz", vector, strict=True)}
    return {port: float(inputs[port]) for port in core.system.input_ports}


def angles(driver):
    """Pitch, roll and yaw at the outputs."""
    outputs = driver.outputs()
    return np.array([outputs[port] for port in ANGLES])


def difference(angles, expected):
    """The largest difference of angles, degrees, across 360 too."""
    return np.abs((np.subtract(angles, expected) + 180) % 360 - 180).max()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def aligns_at_once(dut):
    """At rest, turned about all axes: the attitude after the samples that are believed at once."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    q = np.array([0.8, 0.4, -0.2, 0.4])
    c = matrix_from_quaternion(q / np.linalg.norm(q))
    # A correction acts in the update after.
    for _ in range(2 * ALIGNMENTS + 1):
        await driver.update(sample(c @ (0, 0, G), c @ FIELD, (0, 0, 0)))
    outputs = driver.outputs()
    found = np.array([[outputs[f"out_c{row}{column}"] for column in "123"] for row in "123"])
    # Without magnetometer only the vertical is known.
    columns = slice(None) if config.magnetometer else 2
    assert np.abs(found - c)[:, columns].max() <= np.radians(TOLERANCE_DEG)
    assert driver.status() == {"starting"}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def status_by_cause(dut):
    """Sensors that fail, one after the other: each is told, and the attitude is the float64 reference's."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    truth = FlightFilter(period_s=config.period_s, frame=config.frame, axes=config.axes,
                         magnetometer=config.magnetometer, **config.parameters._asdict())
    nothing = (0.0, -0.0, 0.0)
    for kwargs, expected in (
            *[({}, set())] * (2 * ALIGNMENTS),
            ({"a": nothing}, {"accelerometer_missing"}),
            ({"m": nothing}, {"magnetometer_missing"}),
            ({"a": nothing, "m": nothing}, {"accelerometer_missing", "magnetometer_missing"}),
            ({"a": (0.0, 0.0, 1.01 * config.accelerometer_range)}, {"range_exceeded"}),
            ({"g": (0.0, 1.01 * config.gyro_range, 0.0)}, {"range_exceeded"}),
            ({"m": (-20.0, 3.0, 90.0)}, set()),
            ({}, set())):
        inputs = sample(**kwargs)
        await driver.update(inputs)
        assert driver.status() == {"starting"} | (expected & set(core.engine.status_names)), kwargs
        vectors = {"a": (0.1, -0.2, 9.7), "m": (20.0, 3.0, -40.0), "g": (1.0, -2.0, 3.0)} | kwargs
        exact = truth.run(*(np.array([vectors[name]]) for name in "amg"))
        assert difference(angles(driver), [exact.pitch[0], exact.roll[0], exact.yaw[0]]) <= TOLERANCE_DEG, kwargs
