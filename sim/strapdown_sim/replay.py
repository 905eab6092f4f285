"""A recording through a generated core: attitude, comparison with the reference, picture."""

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strapdown.cores import main_module, make_core
from strapdown.export import write_core

from .drivers.core import CoreModel
from .errors import (
    attitude_errors,
    conjugate,
    match_reference,
    multiply,
    quaternion_from_matrix,
    rms,
    rotation_angle,
)
from .picture import attitude_picture
from .reference.attitude import ComplementaryFilter, euler_angles, matrix_from_quaternion
from .reference.flight import FRAME_QUATERNIONS, FlightFilter

__all__ = ["REFERENCES", "Replay", "complementary_filter", "flight_filter", "replay"]


@dataclass(frozen=True)
class Replay:
    """What a replay gave.

    Attributes
    ----------
    quaternion : ndarray, shape (N, 4)
        Sensor to the configuration's navigation frame, scalar first, of the circuit's matrix.
    angles : ndarray, shape (N, 3)
        The circuit's roll, pitch and yaw in degrees.
    summary : dict
        What ``summary.json`` says.
    """

    quaternion: np.ndarray
    angles: np.ndarray
    summary: dict


def complementary_filter(config):
    """The float64 reference of INS_top in an AttitudeConfig."""
    return ComplementaryFilter(kp=config.kp, ki=config.ki, period_s=config.period_s, mag_axes=config.magnetometer_axes)


def flight_filter(config):
    """The float64 reference of INS_flight in a FlightConfig."""
    return FlightFilter(period_s=config.period_s, frame=config.frame, axes=config.axes,
                        magnetometer=config.magnetometer, **config.parameters._asdict())


REFERENCES: dict[str, Callable] = {"INS_top": complementary_filter, "INS_flight": flight_filter}
"""Module to the function that makes its float64 reference for a configuration.

The reference has ``run(accel, mag, gyro_deg_s)``; the configuration has ``frame``, the navigation frame.
"""


def replay(recording, config, directory, *, build, command, progress=None):
    """Run a recording through INS_top or INS_flight in Verilator, from reset, and write what came out.

    The core is generated for the recording's sample rate. The folder gets its ``.v`` and ``.json``,
    ``attitude.csv`` (t in seconds; q from sensor to earth; pitch, roll, yaw in degrees),
    ``summary.json`` and ``attitude.png``.

    Parameters
    ----------
    recording : Recording
    config : Config
        Its main module is one of REFERENCES; its sample rate is replaced by the recording's.
    directory : Path
        Folder to write to.
    build : Path
        Folder for compiled models.
    command : str
        Command line that makes the Verilog again, but for module and sample rate.
    progress : callable or None
        ``progress(stage, done, total)``, now and then; stages are "build", "simulate", "compare".

    Returns
    -------
    Replay
    """
    progress = progress or (lambda stage, done, total: None)
    count = len(recording.time_s)
    directory = Path(directory)

    progress("build", 0, 1)
    config = config.replace(sample_rate_hz=recording.sample_rate_hz)
    module = main_module(config)
    core, reference_model = make_core(module, config), REFERENCES[module](config)
    verilog = write_core(core, config, directory,
                         f"{command} --module {module} --set sample_rate_hz={recording.sample_rate_hz!r}")
    model = CoreModel(core, verilog, build)
    progress("build", 1, 1)

    system = core.system
    mag = np.zeros((count, 3)) if recording.mag is None else recording.mag
    vectors = {"a": recording.accel, "m": mag, "g": recording.gyro_deg_s} | config.constant_inputs()
    inputs = system.bind(**{name: vectors[name] for name in system.inputs})
    result = model.update(inputs, progress=lambda done: progress("simulate", done, count))

    progress("compare", 0, 2)
    outputs = system.read(result)
    quaternion = quaternion_from_matrix(outputs["c"])
    # The core's order is pitch, roll, yaw.
    angles = outputs["angles"][:, [1, 0, 2]].astype(float)
    differing = model.differing_bits(inputs, result)
    progress("compare", 1, 2)
    truth = reference_model.run(recording.accel, mag, recording.gyro_deg_s)
    difference = rotation_angle(quaternion, quaternion_from_matrix(truth.c_n2b))
    summary = {
        "recording": recording.name,
        "config": config.name,
        "frame": config.frame,
        "quaternion": "sensor to earth, scalar first",
        "samples": count,
        "sample_rate_hz": recording.sample_rate_hz,
        "cycles_per_update": core.latency,
        "microseconds_per_update_at_100_mhz": core.latency / 100,
        "refused_updates": int(((result["out_status"] >> core.engine.status_names.index("refused")) & 1).sum()),
        "against_float64_reference_deg": {"max": float(difference.max()), "rms": rms(difference)},
        "bits_differing_from_twin": differing,
    }
    device = np.full_like(angles, np.nan)
    if recording.reference is not None:
        to_frame = FRAME_QUATERNIONS[config.frame]
        match = match_reference(recording, multiply(conjugate(to_frame), quaternion))
        errors = attitude_errors(match.q_est, match.q_ref)
        summary["against_recorded_reference_deg"] = {
            "samples": len(match.sample),
            "heading_known": bool(recording.reference.heading_known and recording.mag is not None),
            **{f"{name}_rms": rms(getattr(errors, name)) for name in errors._fields},
            "total_median": float(np.median(errors.total))}
        pitch, roll, yaw = euler_angles(matrix_from_quaternion(multiply(to_frame, match.q_ref)))
        device[match.sample] = np.stack([roll, pitch, yaw], axis=-1)

    _write_attitude(directory / "attitude.csv", recording.time_s, quaternion, angles)
    (directory / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    attitude_picture(
        directory / "attitude.png", time_s=recording.time_s, hardware=angles,
        title=f"{recording.name}: {module}, configuration {config.name}, {recording.sample_rate_hz:g} Hz",
        reference_model=np.stack([truth.roll, truth.pitch, truth.yaw], axis=-1),
        device=None if recording.reference is None else device,
        labels=("hardware", "float64 reference", "recorded reference"))
    progress("compare", 2, 2)
    return Replay(quaternion, angles, summary)


def _write_attitude(path, time_s, quaternion, angles):
    """The attitude as CSV: nine digits of a quaternion, six decimals of a degree."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("t", "q0", "q1", "q2", "q3", "pitch", "roll", "yaw"))
        for t, q, (roll, pitch, yaw) in zip(time_s.tolist(), quaternion.tolist(), angles.tolist(), strict=True):
            writer.writerow((f"{t:.6f}", *(f"{x:.9f}" for x in q), *(f"{x:.6f}" for x in (pitch, roll, yaw))))
