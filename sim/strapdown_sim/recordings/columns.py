"""Columns of a table as streams: quantity, axis and unit of each column from its name."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .log import ACCEL, ATTITUDE, GYRO, MAG, PRESSURE, Stream
from .recording import RecordingError
from .table import Table
from .units import factor, listed

__all__ = ["COUNTER", "NAMES", "TIME", "Column", "Columns", "columns_of", "scaled", "seconds", "streams_of"]

TIME, COUNTER = "time", "counter"

NAMES = {TIME: "Time", COUNTER: "Packet number", GYRO: "Gyroscope", ACCEL: "Accelerometer", MAG: "Magnetometer",
         ATTITUDE: "Quaternion", PRESSURE: "Barometer"}
"""Usual name of each quantity, for messages."""

AXES = {GYRO: "xyz", ACCEL: "xyz", MAG: "xyz", ATTITUDE: "wxyz"}

_TIMES = {"time", "timestamp", "t", "times", "timestamps", "secondselapsed", "elapsed", "unixtime", "epoch",
          "epochtime",
          "timestampsample", "timesample", "loggingtime", "timesincestart", "datetime", "sensortimestamp", "systime",
          "elapsedtime", "headerstamp", "rosbagtimestamp"}
_COUNTERS = {"packetnumber", "packetcounter", "counter", "packetid", "packet", "sampleindex", "sample", "index",
             "loopiteration", "sampletimefine"}
_RANKS = (("uncal", 2), ("raw", 1), ("linear", 1), ("filtered", 1), ("user", 3), ("without", 3), ("unfilt", 2),
          ("free", 3))
"""Words that make a source less wanted where there are several."""


_TAILS = {"axis", "cal"}
"""Words after the axis that say nothing about it."""

_DIGITS = {"element": "1234"}
"""Numbers of axes that do not begin with 0."""


class Column(NamedTuple):
    """A column: quantity, axis (empty for time), name of the source, unit as written, number in the table."""

    kind: str
    axis: str
    source: str
    unit: str | None
    number: int


class Columns(NamedTuple):
    """Columns of a table by quantity: of each the wanted source's, and names of all columns that are not used."""

    of: dict[str, list[Column]]
    ignored: list[str]


def _tokens(label):
    """Lower-case words of a name: parted at other signs, before capitals, and between letters and digits."""
    label = re.sub(r"([a-z])([A-Z])", r"\1 \2", label)
    return re.findall(r"[a-z]+|\d+", label.replace("'", "").lower())


def _parted(cell):
    """Label and unit of a header cell: "Gyroscope X (deg/s)", "w_RS_S_x [rad s^-1]"."""
    match = re.fullmatch(r"\s*#?\s*(.*?)\s*[(\[]([^()\[\]]*)[)\]]\s*", cell)
    if match and not re.fullmatch(r"[0-3]", match[2].strip()):
        return match[1], match[2].strip()
    return cell.strip().lstrip("#").strip(), None


def _kind(words):
    """Quantity of the words of a name without axis and unit, or None."""
    text = "".join(words)
    if text in _TIMES or "timestamp" in text:
        return TIME
    if text in _COUNTERS:
        return COUNTER
    if any(word in ("bias", "offset", "cov", "covariance", "variance", "std", "temp", "temperature", "integral", "dt",
                    "debug", "setpoint", "norm", "magnitude", "abs", "absolute") for word in words):
        return None
    if "gyr" in text or "angularvel" in text or "angularrate" in text or "rotationrate" in text or \
            text in ("g", "w", "omega", "wrss", "as"):
        return GYRO
    if "acc" in text or "specificforce" in text or text in ("a", "f", "arss"):
        return ACCEL
    if "mag" in words or "magn" in text or text in ("m", "h", "mags", "compass") or text.startswith("mag"):
        return MAG
    if "quat" in text or text in ("q", "qrs", "element") or (words and words[-1] == "orientation"):
        return ATTITUDE
    if "baro" in text or text == "pressure":
        return PRESSURE
    return None


def _lettered(words):
    """Places of words that may be an axis, the last one first, with the axis and the words before."""
    for place in range(len(words) - 1, -1, -1):
        if re.fullmatch(r"[wxyz]", words[place]):
            yield place, words[place], words[:place]
        elif re.fullmatch(r"[gamhw][xyz]|q[wxyz]", words[place]):
            yield place, words[place][1], [*words[:place], words[place][0]]


def _numbered(words):
    """The same for axes that are numbers, in the last word."""
    if len(words) > 1 and re.fullmatch(r"[0-4]", words[-1]):
        yield len(words) - 1, words[-1], words[:-1]


def _of_number(before, kind, number):
    numbers = _DIGITS.get("".join(before), "0123")
    return dict(zip(numbers, AXES[kind], strict=False)).get(number, "")


def _column(cell, index, default):
    """Column of a header cell, or None. ``default`` is the quantity of columns that are only called X, Y and Z."""
    label, unit = _parted(cell)
    words = _tokens(label)
    if not words:
        return None
    for place, axis, before in (*_lettered(words), *_numbered(words)):
        tail = "".join(word for word in words[place + 1:] if word not in _TAILS)
        kind = _kind(before) if before else default
        if kind not in AXES or (tail and (unit is not None or factor(kind, tail) is None)):
            continue
        axis = axis if axis.isalpha() else _of_number(before, kind, axis)
        if axis in list(AXES[kind]):
            return Column(kind, axis, " ".join(before) or kind, unit if unit is not None else tail or None, index)
    for count in range(len(words), 0, -1):
        kind, tail = _kind(words[:count]), "".join(words[count:])
        if kind in (TIME, COUNTER, PRESSURE) and (not tail or (unit is None and factor(kind, tail))):
            return Column(kind, "", " ".join(words[:count]), unit if unit is not None else tail or None, index)
    return None


def _rank(column):
    return sum(rank for word, rank in _RANKS if word in column.source.replace(" ", ""))


def columns_of(table: Table, *, given: Mapping[str, str] | None = None, default: str | None = None) -> Columns:
    """The columns of a table.

    Parameters
    ----------
    table : Table
    given : mapping
        Names such as "time" and "gyro_x" to header cells, or to COLUMN:UNIT; they go before what names say.
    default : str, optional
        Quantity of columns that are only called X, Y and Z, from the name of the file.

    Raises: RecordingError for a column of ``given`` that is not there, a column that appears twice, and a sensor that
    lacks an axis.
    """
    found = [column for index, cell in enumerate(table.header) if (column := _column(cell, index, default))]
    chosen: dict[str, list[Column]] = {}
    for name, cell in (given or {}).items():
        column = _given(table, name, cell)
        chosen.setdefault(column.kind, []).append(column)
    for kind in dict.fromkeys(column.kind for column in found):
        if kind in chosen and kind in (TIME, COUNTER):
            continue
        sources: dict[str, list[Column]] = {}
        for column in found:
            if column.kind == kind:
                sources.setdefault(column.source, []).append(column)
        own = {column.axis for column in chosen.get(kind, ())}
        best = min(sources.values(), key=lambda columns: (-len({c.axis for c in columns}), _rank(columns[0]),
                                                          columns[0].number))
        if kind == TIME:
            # A date is no number.
            numbers = [columns for columns in sources.values() if np.isfinite(table.values[:, columns[0].number]).any()]
            best = min(numbers or [best], key=lambda columns: (factor(TIME, columns[0].unit or "") is None,
                                                               columns[0].number))
        for column in best:
            if column.axis in own or (kind in chosen and column.axis == ""):
                continue
            twice = [other for other in best if other.axis == column.axis]
            if len(twice) > 1:
                raise RecordingError(f"{table.path}: column {_name(column)!r} appears twice; delete one")
            chosen.setdefault(kind, []).append(column)
    for kind, columns in list(chosen.items()):
        if kind not in AXES:
            continue
        missing = [axis for axis in AXES[kind] if axis not in {column.axis for column in columns}]
        if missing and (kind in (ATTITUDE,) or len(columns) == 1):
            del chosen[kind]
        elif missing:
            raise RecordingError(f"{table.path}: no column '{NAMES[kind]} {missing[0].upper()}'; add it, or name it "
                                 "with "
                                 f"--columns {kind}_{missing[0]}=NAME")
        else:
            chosen[kind] = sorted(columns, key=lambda column: AXES[column.kind].index(column.axis))
    used = {column.number for columns in chosen.values() for column in columns}
    return Columns(chosen, [cell for index, cell in enumerate(table.header) if index not in used and cell])


def _name(column):
    return f"{NAMES[column.kind]} {column.axis.upper()}".strip()


def _given(table, name, cell):
    kind, _, axis = name.partition("_")
    if name not in (TIME, COUNTER) and (kind not in AXES or axis not in list(AXES[kind])):
        raise RecordingError(f"--columns: {name!r} is no quantity; they are time, gyro_x, accel_x, mag_x, attitude_w "
                             "and "
                             "so on")
    plain = {head.strip().casefold(): index for index, head in enumerate(table.header)}
    for text, unit in (cell, None), cell.rpartition(":")[::2]:
        if (index := plain.get(text.strip().casefold())) is not None:
            return Column(kind, axis, "given", unit if unit is not None else _parted(table.header[index])[1], index)
    raise RecordingError(f"{table.path}: --columns {name}={cell}: no column is called so; they are "
                         f"{', '.join(table.header)}")


def scaled(table: Table, columns: Sequence[Column], units: Mapping[str, str] | None = None) -> tuple[np.ndarray, str]:
    """Values of the columns of one quantity in a Log's unit, shape (N, axes), and the unit of the file.

    ``units`` holds the unit of a quantity whose columns have none. Raises: RecordingError.
    """
    kind, found = columns[0].kind, []
    for column in columns:
        unit = column.unit if column.unit else (units or {}).get(kind)
        known = factor(kind, unit) if unit is not None else None
        if known is None and kind == ATTITUDE:
            known = 1.0, ""
        if known is None:
            axis = f"_{column.axis}" if column.axis else ""
            raise RecordingError(
                f"{table.path}: column {_name(column)!r}{_unknown(unit)}; units are "
                f"{listed(kind)}, in parentheses after the name, or after a colon in --columns "
                f"{kind}{axis}={table.header[column.number].strip()}:{_EXAMPLE[kind]}")
        found.append(known)
    if len({unit for _, unit in found}) > 1:
        raise RecordingError(f"{table.path}: {NAMES[kind]} axes have units {', '.join(unit for _, unit in found)}; "
                             "use one for all")
    return found[0][0] * table.values[:, [column.number for column in columns]], found[0][1]


_EXAMPLE = {TIME: "ms", GYRO: "deg/s", ACCEL: "g", MAG: "uT", PRESSURE: "hPa"}


def seconds(table: Table, column: Column, origin: float | None = None) -> np.ndarray:
    """Time of the rows in seconds. Raises: RecordingError.

    That of an epoch counts from ``origin``, a value of the column in its own unit, or else from the first row.
    """
    values = table.values[:, column.number]
    first = next(iter(values[np.isfinite(values)]), np.nan)
    written = column.unit or ("s" if column.source.startswith("seconds") else None)
    if written is None:
        # The unit of a time since 1970 shows in its size.
        sizes = {1e9: "s", 1e12: "ms", 1e15: "us", 1e18: "ns"}
        written = next((name for size, name in sizes.items() if 0.3 * size < first < 10 * size), None)
    known = factor(TIME, written) if written is not None else None
    if known is None:
        name = table.header[column.number].strip()
        raise RecordingError(f"{table.path}: column {name!r}{_unknown(written)}; units are {listed(TIME)}, in "
                             f"parentheses after the name, or after a colon in --columns time={name}:ms")
    if abs(first * known[0]) > EPOCH_S:
        values = values - (first if origin is None else origin)
    return known[0] * values


EPOCH_S = 1e8
"""Times beyond three years count from the first row: they are since 1970, and doubles lose digits there."""


def streams_of(table: Table, columns: Columns, time_s: np.ndarray, *, units: Mapping[str, str] | None = None,
               name: str = "") -> list[Stream]:
    """Streams of gyro, accelerometer, magnetometer and barometer of a table. Raises: RecordingError."""
    streams = []
    for kind in GYRO, ACCEL, MAG, PRESSURE:
        if kind in columns.of:
            if kind == PRESSURE and factor(kind, columns.of[kind][0].unit or "") is None:
                continue
            values, unit = scaled(table, columns.of[kind], units)
            streams.append(Stream(kind, name or columns.of[kind][0].source, time_s, values, unit))
    return streams


def _unknown(unit):
    """What is wrong with a unit, for a message."""
    return f": unit {unit!r} is not known" if unit else " has no unit"
