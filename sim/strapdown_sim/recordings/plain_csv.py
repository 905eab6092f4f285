"""Text files with a table: a column of time, columns of sensors, and units in the header or known from the format."""

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from .blackbox import one_g
from .columns import COUNTER, NAMES, TIME, columns_of, scaled, seconds, streams_of, unit_of_steps
from .dialects import dialect_of, units_of_values
from .log import ACCEL, ATTITUDE, GYRO, MAG, PRESSURE, Log, Stream, interpolated, own_estimate
from .recording import STANDARD_GRAVITY, NotARecordingError, PartError, RecordingError
from .table import Table, decoded, holds_numbers, parse_table
from .x_imu import x_imu_log

__all__ = ["attitude_streams", "kind_of_name", "read_csv", "table_log"]

XSENS_UNITS = {GYRO: "rad/s", ACCEL: "m/s^2", MAG: "a.u."}
"""Units of text files of Xsens MT Manager."""

XSENS_DOT_UNITS = XSENS_UNITS | {GYRO: "deg/s"}
"""Units of files of Xsens DOT."""

BESIDE = "Magnetometer", "Quaternion"
"""Files of an x-IMU3 beside ``Inertial.csv``, with clocks of their own."""


def read_csv(path: Path, *, columns: Mapping[str, str] | None = None, sample_rate_hz: float | None = None,
             reference: str | os.PathLike | None = None) -> Log:
    """The Log of a text file. Raises: RecordingError."""
    text = decoded(path.read_bytes())
    try:
        return table_log(parse_table(path, text), given=columns, sample_rate_hz=sample_rate_hz, reference=reference)
    except RecordingError as error:
        if holds_numbers(text):
            raise
        raise NotARecordingError(str(error)) from None


def table_log(table: Table, *, given: Mapping[str, str] | None = None, sample_rate_hz: float | None = None,
              reference: str | os.PathLike | None = None) -> Log:
    """The Log of a table. Raises: RecordingError."""
    found = columns_of(table, given=given, default=kind_of_name(table.path))
    if TIME in found.of and COUNTER in found.of and "packet number" in found.of[COUNTER][0].source:
        raise RecordingError(f"{table.path}: columns 'Time' and 'Packet number' exclude each other; delete one")
    if GYRO not in found.of and MAG in found.of and ACCEL not in found.of:
        raise RecordingError(f"{table.path}: only a magnetometer is in this file; replay the file of the inertial "
                             "sensor "
                             f"beside it{_inertial_hint(table.path)}: it finds this one")
    missing = [kind for kind in (GYRO, ACCEL) if kind not in found.of]
    alone = next((NAMES[kind].lower() for kind in (GYRO, ACCEL, ATTITUDE) if kind in found.of), None)
    if missing and alone and kind_of_name(table.path):
        raise PartError(f"{table.path}: only the {alone} is in this file; replay the folder with the files of all "
                        f"sensors: {table.path.parent}", table.path.parent)
    if missing and table.header[0] == "1":
        raise RecordingError(f"{table.path}: line {table.lines[0]} holds numbers, and no line before it names "
                             f"{len(table.header)} columns: name them by their numbers, as in --columns time=1:ms "
                             "--columns gyro_x=2:deg/s")
    if missing:
        name = {GYRO: "Gyroscope X", ACCEL: "Accelerometer X"}[missing[0]]
        raise RecordingError(f"{table.path}: no column {name!r}; the columns are {', '.join(table.header)}: name it "
                             "with "
                             f"--columns {missing[0]}_x=NAME:UNIT")
    xsens = _xsens(table, found, sample_rate_hz)
    if xsens is None and TIME not in found.of and COUNTER in found.of and \
            "packet number" in found.of[COUNTER][0].source:
        return x_imu_log(table, found, sample_rate_hz, reference)
    if reference is not None:
        raise RecordingError(f"{table.path}: only x-IMU exports have a separate reference; leave it out")
    dialect, notes = dialect_of(table), [*table.notes, *ignored_note(table, found)]
    stamped, rate, units = True, None, dict(dialect.units) if dialect else {}
    if xsens is not None:
        time_s, stamped, units = xsens
    elif _is_blackbox(table) and TIME in found.of and not found.of[TIME][0].unit:
        time_s = 1e-6 * table.values[:, found.of[TIME][0].number]
    elif TIME in found.of:
        if sample_rate_hz is not None:
            raise RecordingError(f"{table.path}: the file contains its time; leave out the sample rate")
        time_s = seconds(table, found.of[TIME][0])
        if unit := unit_of_steps(table, found.of[TIME][0]):
            notes.append(f"time: no unit in the header; its steps go with {unit}")
    elif sample_rate_hz is not None:
        stamped, rate, time_s = False, float(sample_rate_hz), np.arange(len(table.lines)) / sample_rate_hz
    else:
        raise RecordingError(f"{table.path}: no column 'Time'; add it, name it with --columns time=NAME:UNIT, or give "
                             "the "
                             "rate of the rows with --rate HZ")
    if _is_blackbox(table):
        table, units, guessed = _blackbox(table, found)
    else:
        more, guessed = units_of_values(table, found, time_s, units)
        units |= more
    notes += guessed
    streams = streams_of(table, found, time_s, units=units)
    if dialect and dialect.signs:
        streams = [replace(stream, values=stream.values * dialect.signs[stream.kind])
                   if stream.kind in dialect.signs else stream for stream in streams]
    streams += _beside(table, found, notes)
    if ATTITUDE in found.of:
        force = next(stream for stream in streams if stream.kind == ACCEL)
        streams += attitude_streams(found.of[ATTITUDE][0].source, time_s, scaled(table, found.of[ATTITUDE])[0],
                                    interpolated(time_s, force.time_s, force.values), "file", notes)
    lines = np.array(table.lines)
    if len(streams[0].time_s) < len(lines):
        lines = lines[np.isfinite(table.values[:, [column.number for column in found.of[GYRO]]]).all(axis=1)]
    form = f"table of text, {dialect.name}" if dialect else "table of text"
    return Log(table.path, form, tuple(streams), notes=tuple(notes), rate_hz=rate, stamped=stamped,
               beside=_others(table.path), place=lambda row: f"line {lines[row]}")


def _xsens(table, found, sample_rate_hz):
    """Time of the rows of a text file of Xsens, whether the file gives it, and the units; None for another file."""
    plain = [cell.lower() for cell in table.header]
    if "acc_x" not in plain or "gyr_x" not in plain or COUNTER not in found.of:
        return None
    manager = any(comment.startswith("//") for comment in table.comments)
    units = XSENS_UNITS if manager else XSENS_DOT_UNITS
    rows = np.arange(len(table.lines), dtype=float)
    ticks = table.values[:, plain.index("sampletimefine")] if "sampletimefine" in plain else np.full(1, np.nan)
    if np.isfinite(ticks).all():
        # Ticks of 100 us, in an app of DOT of 1 us.
        return (ticks - ticks[0]) * (1e-4 if manager else 1e-6), True, units
    rates = [re.search(r"(?:sample|update) rate:\s*([\d.]+)", comment.lower()) for comment in table.comments]
    rate = sample_rate_hz or next((float(match[1]) for match in rates if match), None)
    if rate is None:
        return None
    counter = table.values[:, next(column.number for column in found.of[COUNTER])]
    if not np.isfinite(counter).all():
        counter = rows
    # 16 bits.
    steps = np.mod(np.diff(counter), 65536)
    return np.concatenate([[0.0], np.cumsum(steps)]) / rate, True, units


def _is_blackbox(table):
    """Whether a table is a blackbox log that a program has decoded."""
    return {"gyroadc[0]", "accsmooth[0]"} <= {cell.partition("(")[0].strip().lower() for cell in table.header}


def _blackbox(table, found):
    """The table with the specific force in g, the units of its columns, and notes.

    Without units in the header rates are in deg/s, and the specific force is in units of ``acc_1G``, which is in a line
    before the header, or else the power of two next to the median of the force.
    """
    units = {GYRO: "deg/s", ACCEL: "g", MAG: "a.u."}
    notes: list[str] = []
    if found.of[ACCEL][0].unit:
        return table, units, notes
    columns = [column.number for column in found.of[ACCEL]]
    given = [match for line in table.comments if (match := re.match(r'"?acc_1G"?\s*[,:]\s*"?(\d+)', line))]
    unit = float(given[0][1]) if given else 0.0
    if not unit:
        unit, note = one_g(table.values[:, columns])
        notes.append(note)
    values = table.values.copy()
    values[:, columns] /= unit
    return replace(table, values=values), units, notes


def _others(path):
    """Files that belong to an x-IMU3's ``Inertial.csv``, or an NGIMU's ``sensors.csv``."""
    if "Inertial" in path.name:
        return tuple(path.with_name(path.name.replace("Inertial", other)) for other in BESIDE)
    return (path.with_name("quaternion.csv"),) if path.name == "sensors.csv" else ()


def _beside(table, found, notes):
    """Streams of the files beside the file of an inertial sensor."""
    others = _others(table.path)
    if not others:
        return
    force = scaled(table, found.of[ACCEL])[0]
    time_s = seconds(table, found.of[TIME][0])
    for path in others:
        if not path.is_file():
            continue
        other = parse_table(path, decoded(path.read_bytes()))
        columns = columns_of(other, default=kind_of_name(path))
        if TIME not in columns.of:
            continue
        own_s = seconds(other, columns.of[TIME][0])
        yield from streams_of(other, columns, own_s, name=path.stem)
        if ATTITUDE in columns.of:
            yield from attitude_streams(path.stem, own_s, scaled(other, columns.of[ATTITUDE])[0],
                                        interpolated(own_s, time_s, force), "device", notes)


def ignored_note(table, found):
    """The note on columns that are not used."""
    # A barometer is shown, but no core takes it.
    names = [*found.ignored, *(table.header[column.number] for column in found.of.get(PRESSURE, ()))]
    if not names:
        return ()
    shown = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    return (f"columns not used: {shown}",)


def kind_of_name(path):
    """Quantity that a file's name says: "Gyroscope.csv", "xio_Magnetometer.csv"; None if it says none."""
    name = path.stem.lower()
    for kind, words in (GYRO, ("gyro",)), (ACCEL, ("accel",)), (MAG, ("magnetometer", "magnetic")), \
            (ATTITUDE, ("quaternion", "orientation")):
        if any(word in name for word in words):
            return kind
    return None


def _inertial_hint(path):
    other = path.with_name(path.name.replace("Magnetometer", "Inertial"))
    return f" ({other.name})" if other != path and other.is_file() else ""


def attitude_streams(name, time_s, quaternion, force, of, notes):
    """The stream of an attitude that ``of``, a device or a file, gives, if it turns the specific force upwards.

    The quaternions, or their conjugates, are taken, whichever do. If neither do, there is no stream, but a note.
    """
    if not np.nan_to_num(quaternion).any():
        return []
    best, upwards = quaternion, -1.0
    for sign in (1.0, 1.0, 1.0, 1.0), (1.0, -1.0, -1.0, -1.0):
        w, x, y, z = (quaternion * sign).T
        # Third row of the matrix, body to navigation.
        up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z], axis=-1)
        with np.errstate(invalid="ignore"):
            found = float(np.nanmedian((up * force).sum(axis=1))) / STANDARD_GRAVITY
        if found > upwards:
            best, upwards = quaternion * sign, found
    if upwards > 0.8:
        return [Stream(ATTITUDE, name, time_s, best, frame="NWU", meaning=own_estimate(of))]
    notes.append(f"attitude {name}: not used, because it does not turn the specific force upwards; has the "
                 "accelerometer the opposite sign, or are its axes others?")
    return []
