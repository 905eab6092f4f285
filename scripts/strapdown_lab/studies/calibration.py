"""An example of a calibration: errors that are known, what is fitted to them, and the heading before and after.

The sensor is ``turned_by_hand``; its heading is that of the flight filter in float64. Tables and picture of
docs/calibration.md come from here.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strapdown.cores import FLIGHT
from strapdown.markdown import markdown_table
from strapdown_sim.errors import attitude_errors, match_reference, rms
from strapdown_sim.magnetometer import field_facts
from strapdown_sim.recordings import Recording
from strapdown_sim.sensor_calibration import SensorCalibration, calibrate_sensors, calibration_picture
from strapdown_sim.sensors import in_body
from strapdown_sim.stimuli.turns import EDGES, SIDES, TURNS, turned_by_hand, with_error
from strapdown_sim.truth import flight_filter

__all__ = ["GYRO_BIAS", "HARD_IRON", "SOFT_IRON", "Example", "errors_table", "example", "fields_table",
           "heading_errors_deg", "picture"]

RATE_HZ = 50.0

HARD_IRON = np.array([6.0, -4.0, 9.0])
SOFT_IRON = np.array([[1.05, 0.02, -0.01], [0.02, 0.97, 0.03], [-0.01, 0.03, 0.99]])
SOFT_IRON = SOFT_IRON / np.cbrt(np.linalg.det(SOFT_IRON))
GYRO_BIAS = np.array([0.5, -0.3, 0.2])
ACCELEROMETER_BIAS = np.array([0.1, -0.2, 0.15])
ACCELEROMETER_MATRIX = np.array([[1.01, 0.002, -0.004], [0.002, 0.985, 0.003], [-0.004, 0.003, 1.005]])

SETTLED_S = 20.0
"""Time at the start that is not counted."""


PLACES: dict[str, dict[str, tuple[int, ...]]] = {
    "bias": {"x": (0,), "y": (1,), "z": (2,)},
    "matrix": {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}}
"""Elements of the fields in the table; a matrix is symmetric."""


class Example(NamedTuple):
    """A recording without errors, the same with them, their calibration, and the fields that its command line sets."""

    clean: Recording
    wrong: Recording
    calibration: SensorCalibration
    fields: dict[str, str]


@cache
def example() -> Example:
    """The recordings of the study, and their calibration."""
    clean = turned_by_hand((*TURNS, *SIDES, *EDGES), rate_hz=RATE_HZ)
    wrong = with_error(clean, "magnetometer", HARD_IRON, SOFT_IRON)
    wrong = with_error(wrong, "accelerometer", ACCELEROMETER_BIAS, ACCELEROMETER_MATRIX)
    wrong = with_error(wrong, "gyro", GYRO_BIAS)
    calibration = calibrate_sensors(wrong)
    words = calibration.options().split()
    return Example(clean, wrong, calibration, dict(word.split("=", 1) for word in words[1::2]))


@cache
def heading_errors_deg() -> dict[str, tuple[float, float]]:
    """RMS heading error of each variant, and the part of it that the summary of a replay tells, degrees."""
    shown = example()
    found = {}
    for name, recording, fields in (
            ("no errors", shown.clean, {}), ("the errors below", shown.wrong, {}),
            ("the errors below, and the fields of the calibration", shown.wrong, shown.fields)):
        config = FLIGHT.replace(sample_rate_hz=RATE_HZ, **fields)
        answer = flight_filter(config).run(recording.accel, recording.mag, recording.gyro_deg_s)
        match = match_reference(recording, answer.q_b2n)
        settled = match.sample > SETTLED_S * RATE_HZ
        facts = field_facts(in_body(recording, config))
        assert facts is not None, "the sensor is turned"
        found[name] = rms(attitude_errors(match.q_est, match.q_ref).heading[settled]), facts.heading_error_deg
    return found


def errors_table() -> str:
    """Table of the heading errors."""
    return markdown_table(["sensor with", "heading error, RMS:", "told by the field:"], [
        [name, f"{error:.1f}°", f"{told:.1f}°"] for name, (error, told) in heading_errors_deg().items()])


def fields_table() -> str:
    """Table of the errors, and of what was fitted to them."""
    true = {"magnetometer_bias": HARD_IRON, "magnetometer_matrix": SOFT_IRON, "gyro_bias": GYRO_BIAS,
            "accelerometer_bias": ACCELEROMETER_BIAS, "accelerometer_matrix": ACCELEROMETER_MATRIX}
    rows = []
    for sensor, own in example().calibration.fields.items():
        for part, values, deviations in (("bias", own.bias, own.bias_deviation),
                                         ("matrix", own.matrix, own.matrix_deviation)):
            if values is not None and deviations is not None:
                name = f"{sensor}_{part}"
                rows += [[f"`{name}` {label}", *(f"{number[place]:.4f}" for number in (true[name], values, deviations))]
                         for label, place in PLACES[part].items()]
    return markdown_table(["field", "true:", "fitted:", "standard deviation:"], rows)


def picture(path: Path) -> None:
    """Draw the field before and after the calibration."""
    calibration_picture(path, example().calibration)
