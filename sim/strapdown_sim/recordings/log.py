"""A log: streams of samples, each with its own time stamps, in fixed units and axes.

Readers of files produce a Log; ``merge.recording_of`` makes a Recording from it.

Axes are those of the sensor's body, with the specific force at rest upwards: a body of x forward, y right, z down, as
of an autopilot, is turned to x forward, y left, z up.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .recording import RecordingError

__all__ = ["ACCEL", "ATTITUDE", "GYRO", "MAG", "POSITION", "PRESSURE", "VELOCITY", "Log", "Stream", "from_frd",
           "interpolated", "own_estimate", "quaternion_from_angles", "quaternion_from_ned"]

GYRO, ACCEL, MAG, ATTITUDE = "gyro", "accel", "mag", "attitude"
VELOCITY, POSITION, PRESSURE = "velocity", "position", "pressure"


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples of one source.

    Fields
    ------
    kind : str
        "gyro" (deg/s), "accel" (m/s^2, specific force), "mag" (uT), "attitude" (unit quaternion, scalar first, body to
        ``frame``), "velocity" (m/s, east, north, up), "position" (latitude and longitude in degrees, height in m),
        "pressure" (Pa).
    name : str
        Name in the file: topic, message or columns. Gyro and accelerometer of one sensor have one name.
    time_s : ndarray, shape (N,)
        Time stamps, seconds, as they are in the file. Streams of one table share the array.
    values : ndarray, shape (N, k)
        NaN where there is no sample.
    unit : str
        Unit in the file, for reports.
    frame : str
        Of an attitude: "ENU" or "NWU".
    heading_known : bool
        Of an attitude: false if its heading has an unknown constant.
    meaning : str
        Of an attitude: what it is, for reports.
    """

    kind: str
    name: str
    time_s: np.ndarray
    values: np.ndarray
    unit: str = ""
    frame: str = ""
    heading_known: bool = False
    meaning: str = ""


@dataclass(frozen=True, eq=False)
class Log:
    """Streams of a file, or of files that belong together.

    Fields
    ------
    path : Path
        The file or folder.
    form : str
        Name of the format.
    streams : tuple of Stream
        Of each kind the preferred one first.
    notes : tuple of str
        What the reader did that the user should know, each in one line.
    rate_hz : float or None
        The sample rate, if the file has no time stamps, or says it more exactly than they do.
    stamped : bool
        Whether the file has time stamps. Without, samples are equidistant.
    beside : tuple of Path
        Files that belong to it, if they exist, beside the file of ``path``.
    place : callable
        ``place(row)`` names a row of the gyro's samples in messages.
    """

    path: Path
    form: str
    streams: tuple[Stream, ...]
    notes: tuple[str, ...] = ()
    rate_hz: float | None = None
    stamped: bool = True
    beside: tuple[Path, ...] = ()
    place: Callable[[int], str] = field(default=lambda row: f"sample {row}")

    @property
    def name(self) -> str:
        """File name without suffix, as printable text."""
        return Path(self.title).stem

    @property
    def title(self) -> str:
        """File name as printable text: a name need not be in the encoding of the system."""
        return os.fsencode(self.path.name).decode("utf-8", "replace")

    def of(self, kind: str) -> list[Stream]:
        """The streams of a kind."""
        return [stream for stream in self.streams if stream.kind == kind]

    def chosen(self, kind: str, name: str | None, option: str) -> Stream | None:
        """The stream of a kind with a name, or the first one; None if there is none. Raises: RecordingError."""
        streams = self.of(kind)
        if name is None:
            return streams[0] if streams else None
        for number, stream in enumerate(streams):
            if name in (stream.name, str(number)):
                return stream
        names = ", ".join(f"{number} ({stream.name})" for number, stream in enumerate(streams)) or "none"
        raise RecordingError(f"{self.path}: {option} {name} is not in the log; it has {names}")


def own_estimate(of: str) -> str:
    """Meaning of an attitude that ``of``, such as "autopilot", has estimated itself."""
    return f"the {of}'s own estimate, not truth"


def interpolated(time_s: np.ndarray, known_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values of shape (M, k), known at ``known_s``, on straight lines between them at ``time_s``, shape (N, k)."""
    return np.stack([np.interp(time_s, known_s, axis) for axis in values.T], axis=-1)


def from_frd(vectors: np.ndarray) -> np.ndarray:
    """Vectors in forward, right, down as forward, left, up; or in north, east, down as north, west, up."""
    return np.asarray(vectors, float) * (1.0, -1.0, -1.0)


def quaternion_from_ned(quaternion: np.ndarray) -> np.ndarray:
    """Quaternions from forward, right, down to NED as quaternions from forward, left, up to NWU."""
    return np.asarray(quaternion, float) * (1.0, 1.0, -1.0, -1.0)


def quaternion_from_angles(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Quaternion, body to navigation, of the sequence Z-Y-X of angles in degrees: shape (N, 4)."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(half), np.sin(half)) for half in (
        np.radians(np.asarray(angle, float)) / 2 for angle in (roll, pitch, yaw)))
    return np.stack([cy * cp * cr + sy * sp * sr, cy * cp * sr - sy * sp * cr,
                     cy * sp * cr + sy * cp * sr, sy * cp * cr - cy * sp * sr], axis=-1)
