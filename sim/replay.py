"""A recording through a generated core: attitude, comparison with the reference, picture."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strapdown.cores import attitude_core
from strapdown.export import write_core

from .drivers.core import CoreModel
from .errors import attitude_errors, match_reference, quaternion_from_matrix, rms, rotation_angle
from .picture import attitude_picture
from .reference.attitude import ComplementaryFilter, euler_angles, matrix_from_quaternion

__all__ = ["Replay", "replay"]

FRAME = "NWU"
"""Navigation frame of the attitude cores: x magnetic north, y west, z up."""


@dataclass(frozen=True)
class Replay:
    """What a replay gave.

    Attributes
    ----------
    quaternion : ndarray, shape (N, 4)
        Sensor to earth (FRAME), scalar first, of the circuit's matrix.
    angles : ndarray, shape (N, 3)
        The circuit's roll, pitch and yaw in degrees.
    summary : dict
        What ``summary.json`` says.
    """

    quaternion: np.ndarray
    angles: np.ndarray
    summary: dict


def replay(recording, config, directory, *, build, command, progress=None):
    """Run a recording through INS_top in Verilator, from reset, and write what came out.

    The core is generated for the recording's sample rate. The folder gets ``INS_top.v`` and
    ``INS_top.json``, ``attitude.csv`` (t in seconds; q from sensor to earth; pitch, roll, yaw in
    degrees), ``summary.json`` and ``attitude.png``.

    Parameters
    ----------
    recording : Recording
    config : AttitudeConfig
        Its sample rate is replaced by the recording's.
    directory : Path
        Folder to write to.
    build : Path
        Folder for compiled models.
    command : str
        Command line that makes the Verilog again, but for the sample rate.
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
    core = attitude_core("INS_top", config)
    verilog = write_core(core, config, directory, f"{command} --set sample_rate_hz={recording.sample_rate_hz!r}")
    model = CoreModel(core, verilog, build)
    progress("build", 1, 1)

    mag = np.zeros((count, 3)) if recording.mag is None else recording.mag
    inputs = {port: column for ports, samples in (("in_acc", recording.accel), ("in_mag", mag),
                                                  ("in_gyro", recording.gyro_deg_s))
              for port, column in zip((ports + axis for axis in "xyz"), samples.T, strict=True)}
    result = model.update(inputs, progress=lambda done: progress("simulate", done, count))

    progress("compare", 0, 2)
    matrix = np.stack([result[f"out_c{row}{column}"] for row in "123" for column in "123"], axis=-1)
    quaternion = quaternion_from_matrix(matrix.reshape(-1, 3, 3).astype(float))
    angles = np.stack([result[f"out_{name}"] for name in ("roll", "pitch", "yaw")], axis=-1).astype(float)
    differing = model.differing_bits(inputs, result)
    progress("compare", 1, 2)
    truth = ComplementaryFilter(kp=config.kp, ki=config.ki, period_s=config.period_s,
                                mag_axes=config.magnetometer_axes).run(recording.accel, mag, recording.gyro_deg_s)
    difference = rotation_angle(quaternion, quaternion_from_matrix(truth.c_n2b))
    summary = {
        "recording": recording.name,
        "config": config.name,
        "frame": FRAME,
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
        match = match_reference(recording, quaternion)
        errors = attitude_errors(match.q_est, match.q_ref)
        summary["against_recorded_reference_deg"] = {
            "samples": len(match.sample),
            "heading_known": bool(recording.reference.heading_known and recording.mag is not None),
            **{f"{name}_rms": rms(getattr(errors, name)) for name in errors._fields},
            "total_median": float(np.median(errors.total))}
        pitch, roll, yaw = euler_angles(matrix_from_quaternion(match.q_ref))
        device[match.sample] = np.stack([roll, pitch, yaw], axis=-1)

    _write_attitude(directory / "attitude.csv", recording.time_s, quaternion, angles)
    (directory / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    attitude_picture(
        directory / "attitude.png", time_s=recording.time_s, hardware=angles,
        title=f"{recording.name}: INS_top, configuration {config.name}, {recording.sample_rate_hz:g} Hz",
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
