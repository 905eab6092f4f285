"""NumPy archives: arrays ``t``, ``fs``, ``gyro`` (rad/s), ``accel`` (m/s^2), ``mag`` (uT), ``quat_ref``."""

import zipfile
import zlib

import numpy as np

from .recording import Recording, RecordingError, Reference, check_time, mean_rate, unit_quaternions

__all__ = ["read_npz"]


def read_npz(path):
    """The Recording in a NumPy archive. Raises: RecordingError."""
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

    def finite(name, *shape):
        values = array(name, *shape)
        for place in np.argwhere(~np.isfinite(values))[:1]:
            raise RecordingError(f"{path}: array {name!r}, index {list(map(int, place))}: "
                                 f"{values[tuple(place)]} is not finite; correct or cut it")
        return values

    count = len(np.atleast_1d(arrays.get("gyro", ())))
    gyro = finite("gyro", count, 3)
    if count < 2:
        raise RecordingError(f"{path}: {count} samples; at least 2 are needed")
    time_s, rate = finite("t", count), float(finite("fs"))
    check_time(path, time_s, lambda row: f"array 't', index {row}")
    if not 0.99 < rate / mean_rate(time_s) < 1.01:
        raise RecordingError(f"{path}: array 'fs' says {rate:g} Hz, array 't' {mean_rate(time_s):g} Hz; "
                             "correct one")

    reference = None
    if "quat_ref" in arrays:
        clock = array("t_att", arrays["t_att"].size) if "t_att" in arrays else time_s
        quaternion, valid = unit_quaternions(array("quat_ref", len(clock), 4))
        if "valid" in arrays:
            valid = valid & (array("valid", len(clock)) != 0)
        reference = Reference(time_s=clock, quaternion=quaternion, valid=valid & np.isfinite(clock),
                              frame="ENU", heading_known=True)
    mag = finite("mag", count, 3) if "mag" in arrays else None
    return Recording(name=path.stem, sample_rate_hz=rate, time_s=time_s, gyro_deg_s=np.degrees(gyro),
                     accel=finite("accel", count, 3), mag=mag,
                     accel_unit="m/s^2", mag_unit=None if mag is None else "uT", reference=reference)
