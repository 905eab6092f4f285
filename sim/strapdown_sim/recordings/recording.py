"""A recording: samples of one inertial measurement unit in fixed units, and the checks common to all formats."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["STANDARD_GRAVITY", "NotARecordingError", "PartError", "Recording", "RecordingError", "Reference", "Timing",
           "Track", "check_gravity", "listing", "mean_rate", "unit_quaternions"]

STANDARD_GRAVITY = 9.80665
"""One g in m/s^2 (ISO 80000-3)."""

class RecordingError(ValueError):
    """A recording cannot be used. The message is one line that names file, place and remedy."""


class NotARecordingError(RecordingError):
    """A file is no recording at all: its format is not known, or it is text without a table of numbers."""


class PartError(RecordingError):
    """A file has one sensor of a recording, whose folder ``whole`` is to be read in its place."""

    def __init__(self, message: str, whole: Path) -> None:
        super().__init__(message)
        self.whole = whole


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
class Track:
    """Position (latitude, longitude in degrees, height in m) or velocity (east, north, up, m/s) of a recording.

    Fields
    ------
    time_s : ndarray, shape (M,)
        Time on the recording's clock, increasing.
    values : ndarray, shape (M, 3)
    """

    time_s: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Timing:
    """What was found in the time stamps of a recording, and done about it.

    Fields
    ------
    faults : dict
        Name of each kind of fault, with what was done, to its number.
    bridged : tuple of (float, float)
        Ends of the gaps that were filled, seconds.
    longest_gap_s : float
        The longest of them.
    bridge_error_deg : float
        Largest angle by which the samples filled into one gap can be wrong: half of the change of the rate across the
        gap, times its length.
    one_rate_error_deg : float
        Largest angle by which a core errs that has one constant sample period in place of each sample's own.
    """

    faults: dict[str, int]
    bridged: tuple[tuple[float, float], ...]
    longest_gap_s: float
    bridge_error_deg: float
    one_rate_error_deg: float


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one inertial measurement unit, in sensor axes.

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
    accel_unit : str
        Unit in the file, for messages; the array above is converted.
    reference : Reference or None
        Reference orientation in the recording.
    period_s : ndarray, shape (N,), or None
        Time from each sample to the next, seconds, during which its rate holds; that of the last is the step before
        it. None if the file has no time stamps.
    mag_new : ndarray of bool, shape (N,), or None
        Where ``mag`` has a sample that was not there before; None stands for wherever it is not zero.
    timing : Timing or None
        Faults of the time stamps; None if the file has none.
    notes : tuple of str
        What the user should know about the file, each in one line.
    position, velocity : Track or None
    external : ndarray, shape (N, 3), or None
        Acceleration that is known from elsewhere, m/s², in the navigation axes of the core that takes it.
    """

    name: str
    sample_rate_hz: float
    time_s: np.ndarray
    gyro_deg_s: np.ndarray
    accel: np.ndarray
    mag: np.ndarray | None
    accel_unit: str
    reference: Reference | None
    period_s: np.ndarray | None = None
    mag_new: np.ndarray | None = None
    timing: Timing | None = None
    notes: tuple[str, ...] = ()
    position: Track | None = None
    velocity: Track | None = None
    external: np.ndarray | None = None


def listing(names: list[str]) -> str:
    """The first of some names, and how many more there are, for a message."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def mean_rate(time_s):
    return float((len(time_s) - 1) / (time_s[-1] - time_s[0]))


def check_gravity(path, recording):
    """Refuse a specific force without gravity, and one whose unit must be wrong.

    The unit is wrong if the ratio of the median to 9.8 g or 1/9.8 g is closer to one than its ratio to one g.
    """
    force = np.linalg.norm(recording.accel, axis=1) / STANDARD_GRAVITY
    force = force[force > 0]
    if not len(force):
        raise RecordingError(f"{path}: the accelerometer has no samples")
    median = float(np.median(force))
    if abs(np.log(median)) <= np.log(STANDARD_GRAVITY) / 2:
        return
    if median < 1 and not 0.9 < median * STANDARD_GRAVITY < 1.1 and not 0.9 < median * 1000 < 1.1:
        raise RecordingError(f"{path}: the median specific force is {median:.3g} g: gravity was removed from it "
                             "(linear acceleration); use the accelerometer with gravity (TotalAcceleration.csv of "
                             "Sensor Logger, Accelerometer.csv of phyphox)")
    raise RecordingError(f"{path}: the median specific force is {median:.3g} g; "
                         f"is the unit of the accelerometer {recording.accel_unit}?")


def unit_quaternions(quaternion):
    """Quaternions scaled to unit length, (1, 0, 0, 0) if invalid; and an array that marks the valid ones."""
    length = np.linalg.norm(quaternion, axis=-1)
    valid = np.isfinite(length) & (length > 0.5)
    quaternion = np.where(valid[:, None], quaternion, (1.0, 0.0, 0.0, 0.0))
    return quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), valid
