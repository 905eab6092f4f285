"""Recordings of one file for each sensor, in a folder: phones (phyphox, Sensor Logger), x-IMU3, NGIMU, EuRoC.

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

import csv
from dataclasses import replace

import numpy as np

from .columns import TIME, columns_of, scaled, seconds, streams_of
from .dialects import SI_UNITS
from .log import ACCEL, ATTITUDE, GYRO, MAG, Log, Stream, interpolated
from .plain_csv import attitude_streams, kind_of_name, table_log
from .recording import RecordingError, listing
from .table import decoded, parse_table

__all__ = ["is_euroc", "is_sensor_files", "read_sensor_files"]

ENDINGS = ".csv", ".txt"

PARTS = "totalacceleration", "inertial", "sensors", "accelerometer", "acceleration", "raw data"
LEAST = "uncalibrated", "linear", "without g", "wrist", "watch", "headphone"
"""Words in the names of wanted files, the most wanted first, and of files that are used if there is no other."""

TRUTH = "state_groundtruth_estimate0", "mocap0"
"""Folders with the true pose in a EuRoC set."""


def is_sensor_files(path, head):
    """Whether a path is a folder with files of text."""
    return path.is_dir() and bool(_files(path))


def is_euroc(folder):
    """Whether a folder is one set of EuRoC: ``imu0`` is in it, or in its folder ``mav0``."""
    return any(True for place in (folder, folder / "mav0") for _ in place.glob("imu*/data.csv"))


def _files(folder):
    """The files of text in a folder, and in folders in it."""
    return [file for file in sorted(folder.rglob("*")) if file.suffix.lower() in ENDINGS
            and len(file.relative_to(folder).parts) <= 4 and not file.name.startswith(".")
            and "meta" not in (file.parent.name.lower(), file.stem.lower().removesuffix("data"))]


def read_sensor_files(path):
    """The Log of a folder. Raises: RecordingError."""
    files = _files(path)
    imus = [file for file in files if "imu" in file.parent.name.lower() and file.name == "data.csv"]
    return _euroc(path, imus) if imus else _merged(path, files)


def _euroc(path, imus):
    """Log of the first IMU of a EuRoC folder, with the true pose beside it."""
    first = parse_table(imus[0], decoded(imus[0].read_bytes()))
    log = table_log(first)
    truth = next((file for name in TRUTH if (file := imus[0].parents[1] / name / "data.csv").is_file()), None)
    others = ", ".join(str(file.relative_to(path)) for file in imus[1:])
    notes = (f"IMUs not used: {others}; replay their data.csv",) if others else ()
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
    found, gravity, whole = [], None, []
    for file in sorted(files, key=lambda file: (_rank(file), file)):
        try:
            table = parse_table(file, decoded(file.read_bytes()))
            columns = columns_of(table, default=kind_of_name(file))
        except RecordingError:
            continue
        if GYRO in columns.of and ACCEL in columns.of:
            whole.append(table)
        if "gravity" in file.name.lower():
            gravity = table
        elif TIME in columns.of and any(each in columns.of for each in (GYRO, ACCEL, MAG, ATTITUDE)):
            found.append((file.stem, table, columns))
    alone = next((table for _, table, columns in found if GYRO in columns.of and ACCEL not in columns.of), None)
    if alone is None and len(whole) > 1:
        raise RecordingError(f"{path}: {len(whole)} recordings are in it "
                             f"({listing([table.path.name for table in whole])}); name one of them")
    if alone is None and not whole:
        have = listing([file.name for file in files]) or "no file of text"
        raise RecordingError(f"{path}: no file with a gyroscope is in it ({have}); record the gyroscope too")
    log = table_log(whole[0]) if alone is None else None
    first = alone or whole[0]
    times = columns_of(first, default=kind_of_name(first.path)).of.get(TIME)
    origin = first.values[0, times[0].number] if times else None
    damaged: list[str] = []
    streams, attitudes, used = [] if log is None else list(log.streams), [], [first.path] * (log is not None)
    for name, table, columns in found:
        if table.path in used or any(stream.name == name for stream in streams) or (log and ACCEL in columns.of):
            continue
        used.append(table.path)
        damaged += [f"{table.path.name}: {note}" for note in table.notes]
        time_s = seconds(table, columns.of[TIME][0], origin)
        # A file of a phone without units is one of Sensor Logger.
        streams += streams_of(table, columns, time_s, units=SI_UNITS, name=name)
        if ATTITUDE in columns.of:
            attitudes.append((name, time_s, scaled(table, columns.of[ATTITUDE])[0]))
    forces = [stream for stream in streams if stream.kind == ACCEL]
    notes = [*damaged, *(() if log is None else log.notes)]
    if forces and gravity is not None and not _has_gravity(forces[0]):
        forces[0] = _with_gravity(forces[0], gravity, origin)
        notes.append(f"gravity of {gravity.path.name} is added to {forces[0].name}")
    if forces and log is None and _is_ios(path):
        forces = [replace(stream, values=-stream.values) for stream in forces]
        notes.append("accelerometer: signs of iOS, turned")
    for name, time_s, q in attitudes if forces else ():
        force = interpolated(time_s, forces[0].time_s, forces[0].values)
        streams += attitude_streams(name, time_s, q, force, "device", notes)
    order = [stream for stream in streams if stream.kind != ACCEL] + forces
    sources = {stream.name for stream in streams}
    unused = sorted(file.name for file in files if file not in used and file.stem not in sources
                    and (gravity is None or file != gravity.path))
    if unused:
        notes.append(f"files not used: {', '.join(unused)}")
    if log is not None:
        return replace(log, path=path, streams=tuple(order), notes=tuple(notes))
    return Log(path, "one file for each sensor", tuple(order), notes=tuple(notes))


def _is_ios(path):
    """Whether the metadata of Sensor Logger say that the signs of accelerations are those of iOS.

    There gravity less acceleration is recorded, unless units and frames are standardised.
    """
    for file in path.rglob("Metadata.csv"):
        row = next(csv.DictReader(decoded(file.read_bytes()).splitlines()), {})
        return row.get("platform", "").lower() == "ios" and row.get("standardisation", "").lower() != "true"
    return False


def _rank(file):
    lower = file.stem.lower()
    rank = next((rank for rank, word in enumerate(PARTS) if word in lower), 0)
    return rank + len(PARTS) * any(word in lower for word in LEAST)


def _has_gravity(stream):
    return float(np.nanmedian(np.linalg.norm(stream.values, axis=1))) > 5


def _with_gravity(stream, table, origin):
    columns = columns_of(table, default=ACCEL)
    values, _ = scaled(table, columns.of[ACCEL], SI_UNITS)
    time_s = seconds(table, columns.of[TIME][0], origin)
    added = interpolated(stream.time_s, time_s, values)
    return Stream(ACCEL, stream.name, stream.time_s, stream.values + added, stream.unit)
