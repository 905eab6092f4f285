"""Samples of a recording as a core's equations have them: calibrated, in the axes of the body."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from strapdown.config import Config

from .recordings import Recording
from .reference.attitude import axis_matrix

__all__ = ["SENSORS", "corrected", "in_body"]

SENSORS = {"accelerometer": "accel", "gyro": "gyro_deg_s", "magnetometer": "mag"}
"""Names of the sensors in the fields of configurations, and the fields of a Recording that have their samples."""


def corrected(recording: Recording, sensor: str, bias: npt.ArrayLike, matrix: npt.ArrayLike) -> Recording:
    """A recording in which the samples of ``sensor``, a key of SENSORS, are matrix (sample − bias).

    A specific force or a field of zero is no sample, and stays zero; a rate of zero is one.
    """
    samples = getattr(recording, SENSORS[sensor])
    moved = (samples - np.asarray(bias)) @ np.asarray(matrix).T
    if sensor != "gyro":
        moved = np.where(samples.any(axis=1)[:, None], moved, 0.0)
    return _with_samples(recording, sensor, moved)


def in_body(recording: Recording, config: Config) -> Recording:
    """A recording as the equations of a configuration have it.

    The fields ``…_bias`` and ``…_matrix`` of a sensor correct its samples, and ``…_axes`` turns them. A configuration
    without such a field takes them as they are.
    """
    for sensor, name in SENSORS.items():
        if getattr(recording, name) is None:
            continue
        bias, matrix, axes = (getattr(config, f"{sensor}_{part}", None) for part in ("bias", "matrix", "axes"))
        if bias is not None and matrix is not None:
            recording = corrected(recording, sensor, bias, matrix)
        if axes is not None:
            recording = _with_samples(recording, sensor, getattr(recording, name) @ axis_matrix(axes).T)
    return recording


def _with_samples(recording, sensor, samples):
    changes: dict[str, Any] = {SENSORS[sensor]: samples}
    return replace(recording, **changes)
