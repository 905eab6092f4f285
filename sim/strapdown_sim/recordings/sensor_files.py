"""Recordings of one file for each sensor, in a folder or a zip: phones (phyphox, Sensor Logger), x-IMU3, NGIMU, EuRoC.

The columns say which sensor a file holds, or its name, where they are only called X, Y and Z.

=======================  ==========================================================================================
files                    streams
=======================  ==========================================================================================
phyphox                  ``Gyroscope.csv``, ``Accelerometer.csv`` or ``Raw Data.csv``, ``Magnetometer.csv``
Sensor Logger            ``Gyroscope.csv`` rad/s, ``TotalAcceleration.csv`` m/s² (``Accelerometer.csv`` has no gravity:
it
                         is used with ``Gravity.csv`` added), ``Magnetometer.csv`` µT, ``Orientation.csv``
x-IMU3                   ``Inertial.csv``, ``Magnetometer.csv``, ``Quaternion.csv``
NGIMU                    ``sensors.csv``, ``quaternion.csv``
EuRoC, TUM-VI            ``imu0/data.csv``; ``state_groundtruth_estimate0`` or ``mocap0`` for comparison
=======================  ==========================================================================================

Axes of phones are x right, y up along the screen, z out of it; accelerometers read one g upwards at rest.
"""

import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .columns import TIME, columns_of, scaled, seconds, streams_of
from .log import ACCEL, ATTITUDE, GYRO, MAG, Log, Stream, interpolated
from .plain_csv import FIXED_UNITS, gravity_side, kind_of_name, table_log
from .recording import RecordingError
from .table import decoded, parse_table

__all__ = ["is_sensor_files", "read_sensor_files"]

ENDINGS = ".csv", ".txt"

PARTS = "totalacceleration", "inertial", "sensors", "accelerometer", "acceleration", "raw data"
LEAST = "uncalibrated", "linear", "without g"
"""Words in the names of wanted files, the most wanted first, and of files that are used if there is no other."""

TRUTH = "state_groundtruth_estimate0", "mocap0"
"""Folders with the true pose in a EuRoC set."""


class File(NamedTuple):
    """A file of text: its name with folders, and its bytes."""

    name: str
    data: bytes


def is_sensor_files(path, head):
    """Whether a path is a folder, or a zip, with files of text."""
    return any(True for _ in _names(path, head))


def _names(path, head):
    if path.is_dir():
        yield from (str(file.relative_to(path)) for file in sorted(path.rglob("*"))
                    if file.suffix.lower() in ENDINGS and len(file.relative_to(path).parts) <= 4)
    elif head.startswith(b"PK"):
        try:
            with zipfile.ZipFile(path) as archive:
                yield from (name for name in sorted(archive.namelist()) if name.lower().endswith(ENDINGS))
        except zipfile.BadZipFile:
            return


def _read(path, names):
    if path.is_dir():
        return [File(name, (path / name).read_bytes()) for name in names]
    with zipfile.ZipFile(path) as archive:
        return [File(name, archive.read(name)) for name in names]


def read_sensor_files(path):
    """The Log of a folder or zip. Raises: RecordingError."""
    names = [name for name in _names(path, b"" if path.is_dir() else b"PK")
             if "meta" not in name.lower() and not Path(name).name.startswith(".")]
    imu = [name for name in names if "imu" in Path(name).parent.name.lower() and Path(name).name == "data.csv"]
    if imu and path.is_dir():
        return _euroc(path, imu)
    return _merged(path, _read(path, names))


def _euroc(path, imu):
    """Log of the first IMU of a EuRoC folder, with the true pose beside it."""
    first = parse_table(path / imu[0], decoded((path / imu[0]).read_bytes()))
    log = table_log(first)
    truth = next((file for name in TRUTH if (file := (path / imu[0]).parents[1] / name / "data.csv").is_file()), None)
    notes = () if len(imu) == 1 else (f"IMUs not used: {', '.join(imu[1:])}; replay their data.csv",)
    log = Log(path, "EuRoC", log.streams, notes=(*log.notes, *notes), place=log.place)
    if truth is None:
        return log
    table = parse_table(truth, decoded(truth.read_bytes()))
    found, origin = columns_of(table), first.values[0, columns_of(first).of[TIME][0].number]
    if ATTITUDE not in found.of or TIME not in found.of:
        return log
    q, _ = scaled(table, found.of[ATTITUDE])
    truth_stream = Stream(ATTITUDE, truth.parent.name, seconds(table, found.of[TIME][0], origin), q, frame="NWU",
                          meaning="the data set's ground truth")
    return Log(path, "EuRoC", (*log.streams, truth_stream), notes=log.notes, place=log.place)


def _merged(path, files):
    """Log of the streams of all files."""
    found, notes, tables = [], [], {}
    for file in files:
        try:
            tables[file.name] = parse_table(Path(file.name), decoded(file.data))
        except RecordingError:
            continue
    gravity = None
    for name, table in sorted(tables.items(), key=lambda item: (_rank(item[0]), item[0])):
        kind = kind_of_name(Path(name))
        if "gravity" in name.lower():
            gravity = table
            continue
        columns = columns_of(table, default=kind)
        if TIME in columns.of and any(each in columns.of for each in (GYRO, ACCEL, MAG, ATTITUDE)):
            found.append((name, table, columns))
    if not any(GYRO in columns.of for _, _, columns in found):
        have = ", ".join(Path(file.name).name for file in files) or "no file of text"
        raise RecordingError(f"{path}: no file with a gyroscope is in it ({have}); record the gyroscope too")
    origin = next(table.values[0, columns.of[TIME][0].number] for _, table, columns in found if GYRO in columns.of)
    streams, attitudes = [], []
    for name, table, columns in found:
        time_s = seconds(table, columns.of[TIME][0], origin)
        # A file of a phone without units is one of Sensor Logger.
        streams += streams_of(table, columns, time_s, units=FIXED_UNITS, name=Path(name).stem)
        if ATTITUDE in columns.of:
            attitudes.append((Path(name).stem, time_s, scaled(table, columns.of[ATTITUDE])[0]))
    forces = [stream for stream in streams if stream.kind == ACCEL]
    if forces and gravity is not None and not _has_gravity(forces[0]):
        forces[0] = _with_gravity(forces[0], gravity, origin)
        notes.append(f"gravity of Gravity.csv is added to {forces[0].name}")
    for name, time_s, q in attitudes:
        force = interpolated(time_s, forces[0].time_s, forces[0].values)
        turned = gravity_side(q, force)
        if turned is not None:
            streams.append(Stream(ATTITUDE, name, time_s, turned, frame="NWU",
                                  meaning="the device's own estimate, not truth"))
    order = [stream for stream in streams if stream.kind != ACCEL] + forces
    used = {Path(name).name for name, _, _ in found}
    if unused := [Path(file.name).name for file in files if Path(file.name).name not in used
                  and "gravity" not in file.name.lower()]:
        notes.append(f"files not used: {', '.join(sorted(unused))}")
    return Log(path, "one file for each sensor", tuple(order), notes=tuple(notes))


def _rank(name):
    lower = Path(name).stem.lower()
    rank = next((rank for rank, word in enumerate(PARTS) if word in lower), 0)
    return rank + len(PARTS) * any(word in lower for word in LEAST)


def _has_gravity(stream):
    return float(np.nanmedian(np.linalg.norm(stream.values, axis=1))) > 5


def _with_gravity(stream, table, origin):
    columns = columns_of(table, default=ACCEL)
    values, _ = scaled(table, columns.of[ACCEL], FIXED_UNITS)
    time_s = seconds(table, columns.of[TIME][0], origin)
    added = interpolated(stream.time_s, time_s, values)
    return Stream(ACCEL, stream.name, stream.time_s, stream.values + added, stream.unit)
