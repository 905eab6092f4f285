"""NumPy archives: arrays ``t``, ``fs``, ``gyro`` (rad/s), ``accel`` (m/s^2), ``mag`` (uT), ``quat_ref``, ``vel_ref``.

``quat_ref`` has the times ``t``, or ``t_att``; ``vel_ref`` (m/s, east, north, up; NaN where it is not known) those of
``t``, ``t_pos`` or ``t_ref``.
"""

import zipfile
import zlib

import numpy as np

from .log import ACCEL, ATTITUDE, GYRO, MAG, VELOCITY, Log, Stream
from .recording import RecordingError

__all__ = ["read_npz"]


def read_npz(path):
    """The Log of a NumPy archive. Raises: RecordingError."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = dict(archive)
    except (EOFError, TypeError, ValueError, zipfile.BadZipFile, zlib.error):
        raise RecordingError(f"{path}: not a NumPy archive of plain arrays; "
                             "write it with numpy.savez") from None

    def array(name, *shape):
        if name not in arrays:
            raise RecordingError(f"{path}: no array {name!r}; add it")
        if arrays[name].shape != shape or arrays[name].dtype.kind not in "fiub":
            raise RecordingError(f"{path}: array {name!r} must hold numbers in shape {shape}, "
                                 f"not {arrays[name].dtype} in {arrays[name].shape}")
        return arrays[name].astype(float)

    count = len(np.atleast_1d(arrays.get("gyro", ())))
    gyro = array("gyro", count, 3)
    if count < 2:
        raise RecordingError(f"{path}: {count} samples; at least 2 are needed")
    time_s, rate = array("t", count), float(array("fs"))
    step = np.diff(time_s)
    if (step > 0).any() and not 0.99 < rate * np.median(step[step > 0]) < 1.01:
        raise RecordingError(f"{path}: array 'fs' says {rate:g} Hz, array 't' {1 / np.median(step[step > 0]):g} Hz; "
                             "correct one")
    streams = [Stream(GYRO, "gyro", time_s, np.degrees(gyro), "rad/s"),
               Stream(ACCEL, "gyro", time_s, array("accel", count, 3), "m/s^2")]
    if "mag" in arrays:
        streams.append(Stream(MAG, "mag", time_s, array("mag", count, 3), "uT"))
    if "quat_ref" in arrays:
        clock = array("t_att", arrays["t_att"].size) if "t_att" in arrays else time_s
        quaternion = array("quat_ref", len(clock), 4)
        if "valid" in arrays:
            quaternion[array("valid", len(clock)) == 0] = np.nan
        streams.append(Stream(ATTITUDE, "quat_ref", clock, quaternion, frame="ENU", heading_known=True,
                              meaning="recorded reference"))
    if "vel_ref" in arrays:
        clock = next((array(name, arrays[name].size) for name in ("t_pos", "t_ref") if name in arrays), time_s)
        streams.append(Stream(VELOCITY, "vel_ref", clock, array("vel_ref", len(clock), 3), "m/s"))
    return Log(path, "NumPy archive", tuple(streams), rate_hz=rate, place=lambda row: f"array 't', index {row}")
