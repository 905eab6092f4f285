"""A recording: samples of one inertial measurement unit in fixed units, and the checks common to all formats."""

from dataclasses import dataclass

import numpy as np

__all__ = ["STANDARD_GRAVITY", "Recording", "RecordingError", "Reference", "check_gravity", "check_time", "mean_rate",
           "unit_quaternions"]

STANDARD_GRAVITY = 9.80665
"""One g in m/s^2 (ISO 80000-3)."""

_MAX_STEP = 1.5
"""Longest accepted time step, in typical steps: more than jitter, less than a lost sample."""


class RecordingError(ValueError):
    """A recording cannot be used. The message is one line that names file, place and remedy."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference orientation, on its own time axis.

    Fields
    ------
    time_s : ndarray, shape (M,)
        Time on the recording's clock, seconds.
    quaternion : ndarray, shape (M, 4)
        Unit quaternion, scalar first, sensor to earth; (1, 0, 0, 0) where not valid.
    valid : ndarray of bool, shape (M,)
        Where the reference is valid.
    frame : str
        Earth frame, "ENU" or "NWU".
    heading_known : bool
        False if its heading has an unknown constant.
    meaning : str
        What it is, for reports: the estimate of another filter is no truth.
    """

    time_s: np.ndarray
    quaternion: np.ndarray
    valid: np.ndarray
    frame: str
    heading_known: bool
    meaning: str = "recorded reference"


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one inertial measurement unit, equidistant, in sensor axes.

    Fields
    ------
    name : str
        File name without suffix.
    sample_rate_hz : float
        Mean sample rate.
    time_s : ndarray, shape (N,)
        Time of each sample, seconds, on the clock of the file.
    gyro_deg_s : ndarray, shape (N, 3)
        Angular rate, degrees per second.
    accel : ndarray, shape (N, 3)
        Specific force, m/s^2: at rest one g upwards. Zero where there is no sample.
    mag : ndarray, shape (N, 3), or None
        Magnetic field, uT, zero where there is no sample; None without magnetometer.
    accel_unit, mag_unit : str, str or None
        Units in the file, for reports; the arrays above are converted.
    reference : Reference or None
        Reference orientation in the recording.
    """

    name: str
    sample_rate_hz: float
    time_s: np.ndarray
    gyro_deg_s: np.ndarray
    accel: np.ndarray
    mag: np.ndarray | None
    accel_unit: str
    mag_unit: str | None
    reference: Reference | None


def mean_rate(time_s):
    return float((len(time_s) - 1) / (time_s[-1] - time_s[0]))


def check_time(path, time_s, place):
    step = np.diff(time_s)
    for row in np.flatnonzero(~(step > 0))[:1]:
        raise RecordingError(f"{path}: {place(row + 1)}: time goes from {time_s[row]:g} s to "
                             f"{time_s[row + 1]:g} s; it must increase")
    typical = np.median(step)
    for row in np.flatnonzero(step > _MAX_STEP * typical)[:1]:
        raise RecordingError(f"{path}: {place(row + 1)}: gap of {step[row]:g} s after {time_s[row]:g} s, "
                             f"where steps are {typical:g} s; fill it in or cut the recording there")


def check_gravity(path, recording):
    """Refuse a specific force whose ratio to 9.8 g or 1/9.8 g is closer to one than its ratio to one g."""
    force = np.linalg.norm(recording.accel, axis=1) / STANDARD_GRAVITY
    force = force[force > 0]
    if len(force) and abs(np.log(np.median(force))) > np.log(STANDARD_GRAVITY) / 2:
        raise RecordingError(f"{path}: the median specific force is {np.median(force):.3g} g; "
                             f"is the unit of the accelerometer {recording.accel_unit}?")


def unit_quaternions(quaternion):
    """Quaternions scaled to unit length, (1, 0, 0, 0) if invalid; and an array that marks the valid ones."""
    length = np.linalg.norm(quaternion, axis=-1)
    valid = np.isfinite(length) & (length > 0.5)
    quaternion = np.where(valid[:, None], quaternion, (1.0, 0.0, 0.0, 0.0))
    return quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), valid
