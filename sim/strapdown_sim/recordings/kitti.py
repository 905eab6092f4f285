"""OXTS records of the KITTI data set: 30 numbers for each instant, and a file with their times.

Axes are x forward, y left, z up; ``ax``, ``ay``, ``az`` (columns 12 to 14, m/s²) hold gravity, ``wx``, ``wy``, ``wz``
(18 to 20, rad/s). ``roll``, ``pitch`` and ``yaw`` (4 to 6, rad, yaw from east) give the navigation unit's own attitude
in ENU; ``lat``, ``lon``, ``alt`` and ``vn``, ``ve``, ``vu`` position and velocity.
"""

import re
from datetime import datetime

import numpy as np

from .log import ACCEL, ATTITUDE, GYRO, POSITION, VELOCITY, Log, Stream, own_estimate, quaternion_from_angles
from .recording import RecordingError

__all__ = ["is_kitti", "is_kitti_drive", "read_kitti"]

NUMBERS = 30
"""Numbers of a record."""

RATE_HZ = 10.0
"""Rate of records whose times are not given, as in the tracking benchmark."""


def is_kitti(path, head):
    """Whether a folder has records, or a file holds one."""
    if path.is_dir():
        return _records(path) is not None
    return _is_record(head)


def _is_record(head):
    line = head.split(b"\n")[0].split()
    return len(line) == NUMBERS and all(re.fullmatch(rb"[-+0-9.eE]+", cell) for cell in line)


def is_kitti_drive(folder):
    """Whether a folder is one drive: it has the folder of the records in it, or in its folder ``oxts``."""
    return _records(folder) in (folder / "oxts", folder)


def _records(path):
    """The folder with ``data`` and ``timestamps.txt`` in or above a folder, or None."""
    for place in path / "oxts", path, path.parent:
        first = min((place / "data").glob("*.txt"), default=None)
        if first is not None and _is_record(first.read_bytes()):
            return place
    return None


def read_kitti(path):
    """The Log of a folder of records, or of a file of records. Raises: RecordingError."""
    folder = _records(path if path.is_dir() else path.parent)
    try:
        if folder is not None:
            rows = np.array([np.loadtxt(file, ndmin=1)[:NUMBERS] for file in sorted((folder / "data").glob("*.txt"))])
        else:
            rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise RecordingError(f"{path}: not a table of OXTS records: {error}".splitlines()[0]) from None
    if rows.ndim != 2 or rows.shape[1] < 20:
        raise RecordingError(f"{path}: OXTS records have {NUMBERS} numbers")
    time_s, stamped = np.arange(len(rows)) / RATE_HZ, False
    if folder is not None and (folder / "timestamps.txt").is_file():
        lines = (folder / "timestamps.txt").read_text(encoding="utf-8").split("\n")
        stamps = [_seconds(line) for line in lines if line.strip()]
        if len(stamps) != len(rows):
            raise RecordingError(f"{folder / 'timestamps.txt'}: {len(stamps)} times of {len(rows)} records; complete "
                                 "them")
        time_s, stamped = np.array(stamps) - stamps[0], True
    q = quaternion_from_angles(*np.degrees(rows[:, 3:6]).T)
    return Log(folder or path, "KITTI", (
        Stream(GYRO, "oxts", time_s, np.degrees(rows[:, 17:20]), "rad/s"),
        Stream(ACCEL, "oxts", time_s, rows[:, 11:14], "m/s^2"),
        Stream(ATTITUDE, "oxts", time_s, q, frame="ENU", meaning=own_estimate("navigation unit")),
        Stream(VELOCITY, "oxts", time_s, rows[:, [7, 6, 10]], "m/s"),
        Stream(POSITION, "oxts", time_s, rows[:, :3], "deg")), stamped=stamped, rate_hz=None if stamped else RATE_HZ)


def _seconds(line):
    """Seconds of a time such as 2011-09-26 13:02:25.594360375, whose nanoseconds datetime cannot hold."""
    whole, _, fraction = line.strip().partition(".")
    try:
        begin = (datetime.fromisoformat(whole) - datetime(2000, 1, 1)).total_seconds()
        return begin + float(f"0.{fraction or 0}")
    except ValueError:
        raise RecordingError(f"timestamps.txt: {line.strip()!r} is no date and time") from None
