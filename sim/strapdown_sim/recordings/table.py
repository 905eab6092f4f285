"""CSV tables: a header with units in parentheses, then numbers."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .recording import STANDARD_GRAVITY, RecordingError

__all__ = ["PACKET", "TIME", "Table", "read_table", "require", "sensors"]

_UNITS = {
    "Gyroscope": {"deg/s": 1.0, "rad/s": np.degrees(1.0)},
    "Accelerometer": {"g": STANDARD_GRAVITY, "m/s^2": 1.0},
    "Magnetometer": {"uT": 1.0, "G": 100.0, "mG": 0.1, "nT": 0.001},
}
"""Factor from each unit of a file to deg/s, m/s^2 and uT."""

TIME, PACKET = "Time", "Packet number"
_AXES = "X", "Y", "Z"


@dataclass(frozen=True, eq=False)
class Table:
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


_KNOWN_COLUMNS = (TIME, PACKET, *(name for sensor in _UNITS for name in _sensor_columns(sensor)))


def read_table(path, known=_KNOWN_COLUMNS):
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
    return Table(path, columns, units, values, lines)


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


def require(table, names):
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise RecordingError(f"{table.path}: no column {', '.join(repr(name) for name in missing)}; add it")


def _sensor(table, sensor):
    """Samples of one sensor in the Recording's unit, shape (N, 3), and the unit of the file."""
    names, accepted = _sensor_columns(sensor), _UNITS[sensor]
    require(table, names)
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


def sensors(table):
    """Keyword arguments of a Recording that come from sensor columns."""
    gyro_deg_s, _ = _sensor(table, "Gyroscope")
    accel, accel_unit = _sensor(table, "Accelerometer")
    has_mag = any(name in table.columns for name in _sensor_columns("Magnetometer"))
    mag, mag_unit = _sensor(table, "Magnetometer") if has_mag else (None, None)
    return {"gyro_deg_s": gyro_deg_s, "accel": accel, "mag": mag,
            "accel_unit": accel_unit, "mag_unit": mag_unit}
