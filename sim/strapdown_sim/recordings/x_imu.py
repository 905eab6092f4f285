"""Exports of the x-IMU: packet numbers in place of time, and the device's own estimate in a second file."""

import os
from pathlib import Path

import numpy as np

from .columns import COUNTER, Columns, streams_of
from .log import ATTITUDE, Log, Stream
from .recording import RecordingError
from .table import PACKET, Table, decoded, read_table, require

__all__ = ["X_IMU_RATE_HZ", "x_imu_log"]

X_IMU_RATE_HZ = 256.0
"""Sample rate assumed for an x-IMU export, whose samples have packet numbers but no time.

The device writes calibrated inertial data at 2^(n-1) Hz; the register n is in ``..._Registers.csv`` of the
export, which is read if it is there. 256 Hz (n = 9) is the highest rate, and that of the published recording
00033, as its real-time clock confirms: 12,626 samples in 49.3 s.
"""

_MAX_PACKET_STEP = 4
"""Largest step of x-IMU packet numbers between samples: one packet each of the device's quaternion,
battery and clock streams may lie between two samples."""

_QUATERNION = tuple(f"Element {k}" for k in (1, 2, 3, 4))


def x_imu_log(table: Table, found: Columns, sample_rate_hz: float | None,
              reference: str | os.PathLike | None) -> Log:
    """The Log of an x-IMU export.

    Parameters
    ----------
    table : Table
    found : Columns
    sample_rate_hz : float or None
        By default that of the file ``..._Registers.csv`` beside it, or else X_IMU_RATE_HZ.
    reference : path-like or None
        File of the device's quaternions; by default ``..._Quaternion.csv`` in the same folder, if it exists.

    Raises: RecordingError.
    """
    path = table.path
    rate = (_register_rate(path) or X_IMU_RATE_HZ) if sample_rate_hz is None else float(sample_rate_hz)
    if not 0 < rate < np.inf:
        raise RecordingError(f"{path}: the sample rate must be positive, not {sample_rate_hz!r}")
    packets = table.values[:, found.of[COUNTER][0].number]
    _check_packets(table, packets, _MAX_PACKET_STEP)
    time_s = np.arange(len(table.lines)) / rate
    streams = streams_of(table, found, time_s)
    sibling = _beside(path, "_Quaternion")
    if reference is None and sibling.is_file() and sibling != path:
        reference = sibling
    if reference is not None:
        streams.append(_device_attitude(table, packets, Path(reference), rate))
    beside = tuple(other for name in ("_Quaternion", "_Registers") if (other := _beside(path, name)) != path)
    return Log(path, "x-IMU export", tuple(streams), rate_hz=rate, stamped=False, beside=beside,
               place=lambda row: f"line {table.lines[row]}")


def _beside(path, name):
    """Path of another file of an export."""
    return path.with_name(path.name.replace("_CalInertialAndMag", name))


def _register_rate(path):
    """Rate of the inertial data in the registers of the device, or None."""
    registers = _beside(path, "_Registers")
    if registers == path or not registers.is_file():
        return None
    for line in decoded(registers.read_bytes()).splitlines():
        cells = [cell.strip() for cell in line.split(",")]
        if cells[-1] == "InertialAndMagneticDataRate" and cells[2].isdigit() and int(cells[2]) > 0:
            return 2.0 ** (int(cells[2]) - 1)
    return None


def _device_attitude(table, packets, path, rate):
    """The device's own estimate, on the time axis of the samples.

    The device numbers the packets of all its streams in one sequence and sends a quaternion right
    after the sample from which it is computed, so each quaternion belongs to the last sample with a lower
    number. Both streams have constant rates: if the number of samples between quaternions changes, packets
    are missing.
    """
    device = read_table(path, (PACKET, *_QUATERNION))
    require(device, (PACKET, *_QUATERNION))
    device_packets = device[PACKET]
    _check_packets(device, device_packets, np.inf)
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
    return Stream(ATTITUDE, path.stem, sample / rate, device[_QUATERNION][inside] * (1, -1, -1, -1), frame="NWU",
                  heading_known=False, meaning="the device's own estimate")


def _check_packets(table, packets, largest):
    step = np.diff(packets)
    for row in np.flatnonzero(~((step > 0) & (step <= largest)))[:1]:
        raise RecordingError(f"{table.path}: line {table.lines[row + 1]}: packet number goes from "
                             f"{packets[row]:.0f} to {packets[row + 1]:.0f}: rows out of order or missing; "
                             "sort them or cut the file there")
