"""Exports of the x-IMU: packet numbers in place of time, and the device's own estimate in a second file."""

from pathlib import Path

import numpy as np

from .recording import Recording, RecordingError, Reference, unit_quaternions
from .table import PACKET, TIME, read_table, require, sensors

__all__ = ["X_IMU_RATE_HZ", "read_x_imu"]

X_IMU_RATE_HZ = 256.0
"""Sample rate assumed for an x-IMU export, whose samples have packet numbers but no time.

The device writes calibrated inertial data at 2^(n-1) Hz; the register n is in another file of the
export. 256 Hz (n = 9) is the highest rate, and that of the published recording 00033, as its
real-time clock confirms: 12,626 samples in 49.3 s.
"""

_MAX_PACKET_STEP = 4
"""Largest step of x-IMU packet numbers between samples: one packet each of the device's quaternion,
battery and clock streams may lie between two samples."""

_QUATERNION = tuple(f"Element {k}" for k in (1, 2, 3, 4))


def read_x_imu(path, *, sample_rate_hz=None, reference=None):
    """The Recording in an x-IMU export. Parameters and errors are those of ``read_recording``."""
    table = read_table(path)
    if TIME in table.columns:
        raise RecordingError(f"{path}: columns {TIME!r} and {PACKET!r} exclude each other; delete one")
    rate = X_IMU_RATE_HZ if sample_rate_hz is None else float(sample_rate_hz)
    if not 0 < rate < np.inf:
        raise RecordingError(f"{path}: the sample rate must be positive, not {sample_rate_hz!r}")
    _check_packets(table, _MAX_PACKET_STEP)
    measured = sensors(table)
    sibling = path.with_name(path.name.replace("_CalInertialAndMag", "_Quaternion"))
    if reference is None and sibling != path and sibling.is_file():
        reference = sibling
    if reference is not None:
        reference = _x_imu_reference(table, Path(reference), rate)
    return Recording(name=path.stem, sample_rate_hz=rate, time_s=np.arange(len(table.lines)) / rate,
                     reference=reference, **measured)


def _x_imu_reference(table, path, rate):
    """The device's own estimate, on the time axis of the samples.

    The device numbers the packets of all its streams in one sequence and sends a quaternion right
    after the sample from which it is computed, so each quaternion belongs to the last sample with a lower
    number. Both streams have constant rates: if the number of samples between quaternions changes, packets
    are missing.
    """
    device = read_table(path, (PACKET, *_QUATERNION))
    require(device, (PACKET, *_QUATERNION))
    _check_packets(device, np.inf)
    packets, device_packets = table[PACKET], device[PACKET]
    inside = (device_packets > packets[0]) & (device_packets < packets[-1])
    if np.count_nonzero(inside) < 2:
        raise RecordingError(f"{path}: packet numbers do not overlap those of {table.path.name}; "
                             "take both files from one export")
    sample = np.searchsorted(packets, device_packets[inside]) - 1
    spacing = np.diff(sample)
    typical = np.median(spacing)
    for row in np.flatnonzero(spacing != typical)[:1]:
        line = np.array(device.lines)[inside][row + 1]
        raise RecordingError(f"{path}: line {line}: {spacing[row]} samples since the previous quaternion instead "
                             f"of {typical:g}: packets are missing; cut both files there")
    # The device gives earth relative to sensor, and a heading relative to its start.
    quaternion, valid = unit_quaternions(device[_QUATERNION][inside] * (1, -1, -1, -1))
    return Reference(time_s=sample / rate, quaternion=quaternion, valid=valid,
                     frame="NWU", heading_known=False, meaning="the device's own estimate")


def _check_packets(table, largest):
    packets = table[PACKET]
    step = np.diff(packets)
    for row in np.flatnonzero(~((step > 0) & (step <= largest)))[:1]:
        raise RecordingError(f"{table.path}: line {table.lines[row + 1]}: packet number goes from "
                             f"{packets[row]:.0f} to {packets[row + 1]:.0f}: rows out of order or missing; "
                             "sort them or cut the file there")
