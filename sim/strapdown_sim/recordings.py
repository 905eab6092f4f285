"""Recordings of inertial sensors, read and checked: CSV files and NumPy archives.

Every reader returns a `Recording` in one set of units, whatever the units of the file. A file with an
error raises a `RecordingError` of one line that names file, place and remedy. ``docs/recordings.md``
describes the formats.
"""

import csv
import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Recording", "RecordingError", "Reference", "STANDARD_GRAVITY", "X_IMU_RATE_HZ", "read_recording"]

STANDARD_GRAVITY = 9.80665
"""One g in m/s^2 (ISO 80000-3)."""

X_IMU_RATE_HZ = 256.0
"""Sample rate assumed for an x-IMU export, whose samples carry packet numbers but no time.

The device writes calibrated inertial data at 2^(n-1) Hz; the register n is in another file of the
export. 256 Hz (n = 9) is the highest rate, and that of the published recording 00033, as its
real-time clock confirms: 12,626 samples in 49.3 s.
"""

_MAX_STEP = 1.5
"""Longest time step that is accepted, in typical steps: more than jitter, less than a lost sample."""

_MAX_PACKET_STEP = 4
"""Largest step of x-IMU packet numbers between samples: one packet each of the device's quaternion,
battery and clock streams may lie between two samples."""

_UNITS = {
    "Gyroscope": {"deg/s": 1.0, "rad/s": np.degrees(1.0)},
    "Accelerometer": {"g": STANDARD_GRAVITY, "m/s^2": 1.0},
    "Magnetometer": {"uT": 1.0, "G": 100.0, "mG": 0.1, "nT": 0.001},
}
"""Factor from each unit of a file to deg/s, m/s^2 and uT."""

_TIME, _PACKET = "Time", "Packet number"
_AXES = "X", "Y", "Z"
_QUATERNION = tuple(f"Element {k}" for k in (1, 2, 3, 4))


class RecordingError(ValueError):
    """A recording that cannot be used; one line that names file, place and remedy."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference orientation, on its own time axis.

    Fields
    ------
    time_s : ndarray, shape (M,)
        Time on the recording's clock, seconds.
    quaternion : ndarray, shape (M, 4)
        Unit quaternion, scalar first, sensor to earth; (1, 0, 0, 0) where not valid.
    valid : ndarray of bool, shape (M,)
        Where the reference is valid.
    frame : str
        Earth frame, "ENU" or "NWU".
    heading_known : bool
        False if its heading has an unknown constant.
    """

    time_s: np.ndarray
    quaternion: np.ndarray
    valid: np.ndarray
    frame: str
    heading_known: bool


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one inertial measurement unit, equidistant, in sensor axes.

    Fields
    ------
    name : str
        File name without suffix.
    sample_rate_hz : float
        Mean sample rate.
    time_s : ndarray, shape (N,)
        Time of each sample, seconds, on the clock of the file.
    gyro_deg_s : ndarray, shape (N, 3)
        Angular rate, degrees per second.
    accel : ndarray, shape (N, 3)
        Specific force, m/s^2: at rest one g upwards. Zero where there is no sample.
    mag : ndarray, shape (N, 3), or None
        Magnetic field, uT, zero where there is no sample; None without magnetometer.
    accel_unit, mag_unit : str, str or None
        Units in the file, for reports; the arrays above are converted.
    reference : Reference or None
        Reference orientation in the recording.
    """

    name: str
    sample_rate_hz: float
    time_s: np.ndarray
    gyro_deg_s: np.ndarray
    accel: np.ndarray
    mag: np.ndarray | None
    accel_unit: str
    mag_unit: str | None
    reference: Reference | None


def read_recording(path: str | os.PathLike, *, sample_rate_hz: float | None = None,
                   reference: str | os.PathLike | None = None) -> Recording:
    """Read a recording and check it.

    Parameters
    ----------
    path : path-like
        A ``.csv`` file with a header that names sensors and units, an x-IMU export
        (``..._CalInertialAndMag.csv``), or a ``.npz`` archive.
    sample_rate_hz : float, optional
        Sample rate of an x-IMU export, `X_IMU_RATE_HZ` by default. Other files contain their time.
    reference : path-like, optional
        Quaternion file of an x-IMU export; by default its sibling ``..._Quaternion.csv`` if there.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        If the file does not exist, is incomplete, has gaps, values that are not numbers, unknown
        columns or units, or units that its values contradict.
    """
    path = Path(path)
    try:
        match path.suffix.lower():
            case ".csv":
                table = _read_table(path)
                if _PACKET in table.columns:
                    recording = _from_x_imu(table, sample_rate_hz, reference)
                else:
                    _refuse_options(path, sample_rate_hz, reference)
                    recording = _from_csv(table)
            case ".npz":
                _refuse_options(path, sample_rate_hz, reference)
                recording = _from_npz(path)
            case suffix:
                raise RecordingError(f"{path}: suffix {suffix!r} is not known; "
                                     "recordings are .csv or .npz files")
    except OSError as error:
        raise RecordingError(f"{error.filename or path}: {error.strerror or 'cannot be read'}") from None
    _check_gravity(path, recording)
    return recording


def _refuse_options(path, sample_rate_hz, reference):
    if sample_rate_hz is not None:
        raise RecordingError(f"{path}: the file contains its time; leave out the sample rate")
    if reference is not None:
        raise RecordingError(f"{path}: only x-IMU exports have a separate reference; leave it out")


# Tables: a header with units in parentheses, then numbers.

@dataclass(frozen=True, eq=False)
class _Table:
    """Numbers of a CSV file: canonical column names and units, values (N, columns), line numbers (N)."""

    path: Path
    columns: dict[str, int]
    units: dict[str, str | None]
    values: np.ndarray
    lines: list[int]

    def __getitem__(self, names):
        """Values of one column, shape (N,), or of several, shape (N, len(names))."""
        if isinstance(names, str):
            return self.values[:, self.columns[names]]
        return self.values[:, [self.columns[name] for name in names]]


def _sensor_columns(sensor):
    return tuple(f"{sensor} {axis}" for axis in _AXES)


_KNOWN_COLUMNS = (_TIME, _PACKET, *(name for sensor in _UNITS for name in _sensor_columns(sensor)))


def _read_table(path, known=_KNOWN_COLUMNS):
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        rows = csv.reader(file)
        header = next(rows, [])
        if not any(cell.strip() for cell in header):
            raise RecordingError(f"{path}: line 1 holds no column names")
        columns, units = _read_header(path, header, known)
        cells, lines = [], []
        for row in rows:
            if not row:
                continue
            if len(row) != len(header):
                raise RecordingError(f"{path}: line {rows.line_num} has {len(row)} cells, "
                                     f"the header {len(header)}; complete or delete it")
            try:
                cells.append([float(cell) for cell in row])
            except ValueError:
                column, cell = next((n, c) for n, c in enumerate(row) if not _is_number(c))
                raise RecordingError(f"{path}: line {rows.line_num}, column {header[column].strip()!r}: "
                                     f"{cell!r} is not a number; correct or delete the line") from None
            lines.append(rows.line_num)
    if len(cells) < 2:
        raise RecordingError(f"{path}: {len(cells)} rows of numbers; at least 2 are needed")
    values = np.array(cells)
    for row, column in np.argwhere(~np.isfinite(values))[:1]:
        raise RecordingError(f"{path}: line {lines[row]}, column {header[column].strip()!r}: "
                             f"{values[row, column]} is not finite; correct or delete the line")
    return _Table(path, columns, units, values, lines)


def _read_header(path, header, known):
    """Column index and unit by canonical name."""
    canonical = {name.casefold(): name for name in known}
    columns, units = {}, {}
    for index, cell in enumerate(header):
        label, separator, unit = cell.strip().removesuffix(")").rpartition("(")
        if not separator:
            label, unit = unit, ""
        name = canonical.get(" ".join(label.split()).casefold())
        if name is None:
            raise RecordingError(f"{path}: column {cell.strip()!r} is not known; "
                                 f"columns are {', '.join(known)}, separated by commas")
        if name in columns:
            raise RecordingError(f"{path}: column {name!r} appears twice; delete one")
        columns[name], units[name] = index, unit.strip()
    return columns, units


def _is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _require(table, names):
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise RecordingError(f"{table.path}: no column {', '.join(repr(name) for name in missing)}; add it")


def _sensor(table, sensor):
    """Samples of one sensor in our unit, shape (N, 3), and the unit of the file."""
    names, accepted = _sensor_columns(sensor), _UNITS[sensor]
    _require(table, names)
    canonical = {unit.casefold(): unit for unit in accepted}
    found = []
    for name in names:
        unit = table.units[name]
        # Micro sign and Greek mu are both in use; some keyboards have a superscript two.
        plain = (unit or "").replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u") \
                            .replace("\N{SUPERSCRIPT TWO}", "^2").casefold()
        if plain not in canonical:
            raise RecordingError(f"{table.path}: column {name!r}: unit {unit or 'missing'!r} is not known; "
                                 f"units are {', '.join(accepted)}, in parentheses after the name")
        found.append(canonical[plain])
    if len(set(found)) > 1:
        raise RecordingError(f"{table.path}: {sensor} axes have units {', '.join(found)}; use one for all")
    return accepted[found[0]] * table[names], found[0]


def _sensors(table):
    """Keyword arguments of a Recording that come from sensor columns."""
    gyro_deg_s, _ = _sensor(table, "Gyroscope")
    accel, accel_unit = _sensor(table, "Accelerometer")
    has_mag = any(name in table.columns for name in _sensor_columns("Magnetometer"))
    mag, mag_unit = _sensor(table, "Magnetometer") if has_mag else (None, None)
    return {"gyro_deg_s": gyro_deg_s, "accel": accel, "mag": mag,
            "accel_unit": accel_unit, "mag_unit": mag_unit}


# The three formats.

def _from_csv(table):
    _require(table, [_TIME])
    if (unit := table.units[_TIME]) != "s":
        raise RecordingError(f"{table.path}: column {_TIME!r}: unit {unit or 'missing'!r} is not known; "
                             "time is in seconds, (s)")
    time_s = table[_TIME]
    _check_time(table.path, time_s, lambda row: f"line {table.lines[row]}")
    return Recording(name=table.path.stem, sample_rate_hz=_mean_rate(time_s), time_s=time_s,
                     reference=None, **_sensors(table))


def _from_x_imu(table, sample_rate_hz, reference):
    path = table.path
    if _TIME in table.columns:
        raise RecordingError(f"{path}: columns {_TIME!r} and {_PACKET!r} exclude each other; delete one")
    rate = X_IMU_RATE_HZ if sample_rate_hz is None else float(sample_rate_hz)
    if not 0 < rate < np.inf:
        raise RecordingError(f"{path}: the sample rate must be positive, not {sample_rate_hz!r}")
    _check_packets(table, _MAX_PACKET_STEP)
    sensors = _sensors(table)
    sibling = path.with_name(path.name.replace("_CalInertialAndMag", "_Quaternion"))
    if reference is None and sibling != path and sibling.is_file():
        reference = sibling
    if reference is not None:
        reference = _x_imu_reference(table, Path(reference), rate)
    return Recording(name=path.stem, sample_rate_hz=rate, time_s=np.arange(len(table.lines)) / rate,
                     reference=reference, **sensors)


def _x_imu_reference(table, path, rate):
    """The device's own estimate, on the time axis of the samples.

    The device numbers the packets of all its streams in one sequence and sends a quaternion right
    after the sample from which it is computed, so each quaternion belongs to the last sample with a lower
    number. Both streams have constant rates: if the number of samples between quaternions changes, packets
    are missing.
    """
    device = _read_table(path, (_PACKET, *_QUATERNION))
    _require(device, (_PACKET, *_QUATERNION))
    _check_packets(device, np.inf)
    packets, device_packets = table[_PACKET], device[_PACKET]
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
    quaternion, valid = _unit_quaternions(device[_QUATERNION][inside] * (1, -1, -1, -1))
    return Reference(time_s=sample / rate, quaternion=quaternion, valid=valid,
                     frame="NWU", heading_known=False)


def _from_npz(path):
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
    _check_time(path, time_s, lambda row: f"array 't', index {row}")
    if not 0.99 < rate / _mean_rate(time_s) < 1.01:
        raise RecordingError(f"{path}: array 'fs' says {rate:g} Hz, array 't' {_mean_rate(time_s):g} Hz; "
                             "correct one")

    reference = None
    if "quat_ref" in arrays:
        clock = array("t_att", arrays["t_att"].size) if "t_att" in arrays else time_s
        quaternion, valid = _unit_quaternions(array("quat_ref", len(clock), 4))
        if "valid" in arrays:
            valid = valid & (array("valid", len(clock)) != 0)
        reference = Reference(time_s=clock, quaternion=quaternion, valid=valid & np.isfinite(clock),
                              frame="ENU", heading_known=True)
    mag = finite("mag", count, 3) if "mag" in arrays else None
    return Recording(name=path.stem, sample_rate_hz=rate, time_s=time_s, gyro_deg_s=np.degrees(gyro),
                     accel=finite("accel", count, 3), mag=mag,
                     accel_unit="m/s^2", mag_unit=None if mag is None else "uT", reference=reference)


# Checks.

def _mean_rate(time_s):
    return float((len(time_s) - 1) / (time_s[-1] - time_s[0]))


def _check_time(path, time_s, place):
    step = np.diff(time_s)
    for row in np.flatnonzero(~(step > 0))[:1]:
        raise RecordingError(f"{path}: {place(row + 1)}: time goes from {time_s[row]:g} s to "
                             f"{time_s[row + 1]:g} s; it must increase")
    typical = np.median(step)
    for row in np.flatnonzero(step > _MAX_STEP * typical)[:1]:
        raise RecordingError(f"{path}: {place(row + 1)}: gap of {step[row]:g} s after {time_s[row]:g} s, "
                             f"where steps are {typical:g} s; fill it in or cut the recording there")


def _check_packets(table, largest):
    packets = table[_PACKET]
    step = np.diff(packets)
    for row in np.flatnonzero(~((step > 0) & (step <= largest)))[:1]:
        raise RecordingError(f"{table.path}: line {table.lines[row + 1]}: packet number goes from "
                             f"{packets[row]:.0f} to {packets[row + 1]:.0f}: rows out of order or missing; "
                             "sort them or cut the file there")


def _check_gravity(path, recording):
    """Refuse a specific force whose ratio to 9.8 g or 1/9.8 g is closer to one than its ratio to one g."""
    force = np.linalg.norm(recording.accel, axis=1) / STANDARD_GRAVITY
    force = force[force > 0]
    if len(force) and abs(np.log(np.median(force))) > np.log(STANDARD_GRAVITY) / 2:
        raise RecordingError(f"{path}: the median specific force is {np.median(force):.3g} g; "
                             f"is the unit of the accelerometer {recording.accel_unit}?")


def _unit_quaternions(quaternion):
    """Quaternions scaled to unit length, and where they are valid; (1, 0, 0, 0) elsewhere."""
    length = np.linalg.norm(quaternion, axis=-1)
    valid = np.isfinite(length) & (length > 0.5)
    quaternion = np.where(valid[:, None], quaternion, (1.0, 0.0, 0.0, 0.0))
    return quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), valid
