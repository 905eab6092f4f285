"""Columns of a table as streams: quantity, axis and unit of each column from its name."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .log import ACCEL, ATTITUDE, GYRO, MAG, PRESSURE, Stream
from .recording import RecordingError
from .table import Table
from .units import factor, listed, quantity

__all__ = ["COUNTER", "NAMES", "TIME", "Column", "Columns", "check_numbers", "columns_of", "scaled", "seconds",
           "streams_of", "unit_of_steps"]

TIME, COUNTER = "time", "counter"

NAMES = {TIME: "Time", COUNTER: "Packet number", GYRO: "Gyroscope", ACCEL: "Accelerometer", MAG: "Magnetometer",
         ATTITUDE: "Quaternion", PRESSURE: "Barometer"}
"""Usual name of each quantity, for messages."""

AXES = {GYRO: "xyz", ACCEL: "xyz", MAG: "xyz", ATTITUDE: "wxyz"}

_TIMES = {"t", "epoch", "epoc", "elapsed", "millis", "micros", "secondselapsed", "gpstow", "tow"}
"""Names of times without "time" in them."""

_TIME_UNITS = {"millis": "ms", "micros": "us", "secondselapsed": "s", "gpstow": "s", "tow": "s"}
"""Units of times that their names say."""

_COUNTERS = {"packetnumber", "packetcounter", "counter", "packetid", "packet", "sampleindex", "sample", "index",
             "loopiteration", "sampletimefine"}
_RANKS = (("uncal", 2), ("raw", 1), ("linear", 1), ("filtered", 1), ("user", 3), ("without", 3), ("unfilt", 2),
          ("free", 3))
"""Words that make a source less wanted where there are several."""

_EXCLUDED = {"bias", "offset", "cov", "covariance", "variance", "std", "temp", "temperature", "integral", "dt", "debug",
             "setpoint", "norm", "magnitude", "abs", "absolute", "angle", "uncertainty", "error", "increment"}
"""Words of columns that hold no samples."""

_NO_SENSOR = {"gravity", "linear", "user", "free", "velocity", "position", "angle", "target", "reference"}
"""Words of columns that hold no samples although their unit is one of a sensor."""

_TAILS = {"axis", "cal", "element"}
"""Words after the axis that say nothing about it."""


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
    """Label and unit of a header cell: "Gyroscope X (deg/s)", "w_RS_S_x [rad s^-1]", "Gyro X - deg/s", "Time, s"."""
    match = re.fullmatch(r"\s*#?\s*(.*?)\s*(?:\((.*)\)|\[([^\[\]]*)\])\s*", cell)
    if match:
        unit = (match[2] if match[2] is not None else match[3]).strip()
        if not re.fullmatch(r"[0-3]", unit):
            return match[1], unit or None
    match = re.fullmatch(r"\s*#?\s*(.*?)\s*(?: -|[,;:])\s+(\S+)\s*", cell)
    if match and quantity(match[2]):
        return match[1], match[2]
    return cell.strip().lstrip("#").strip(), None


def _kind(words):
    """Quantity of the words of a name without axis and unit, or None."""
    text = "".join(words)
    if text in _COUNTERS:
        return COUNTER
    if _EXCLUDED.intersection(words):
        return None
    if text in _TIMES or text.startswith("time") or text.endswith("time") or "timestamp" in text or \
            text.endswith("stamp"):
        return TIME
    if "gyr" in text or "angularvel" in text or "angularrate" in text or "rotationrate" in text or \
            text in ("g", "w", "omega", "wrss", "as"):
        return GYRO
    if "acc" in text or "specificforce" in text or text in ("a", "f", "gf", "arss"):
        return ACCEL
    if "mag" in words or "magn" in text or "compass" in text or text.startswith("mag") or text in ("m", "h", "b"):
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
        elif re.fullmatch(r"[gamhwbf][xyz]|q[wxyz]", words[place]):
            yield place, words[place][1], [*words[:place], words[place][0]]


def _numbered(words, numbers):
    """The same for axes that are numbers; ``numbers`` are those of the first axes."""
    for place, word in enumerate(words):
        if place and word in list(numbers):
            yield place, word, words[:place]


def _column(cell, index, default, numbers):
    """Column of a header cell, or None. ``default`` is the quantity of columns that are only called X, Y and Z;
    ``numbers`` are those of axes."""
    label, unit = _parted(cell)
    words = _tokens(label)
    for place, axis, before in (*_lettered(words), *_numbered(words, numbers)):
        tail = "".join(word for word in words[place + 1:] if word not in _TAILS)
        kind = _kind(before) if before else default
        if kind is None and (after := _kind(words[place + 1:])):
            # The quantity may stand behind the axis.
            kind, tail = after, ""
        kind = kind or _kind_of_unit(unit, words)
        if kind not in AXES or (tail and (unit is not None or factor(kind, tail) is None)):
            continue
        axis = axis if axis.isalpha() else dict(zip(numbers, AXES[kind], strict=False)).get(axis, "")
        if axis in list(AXES[kind]):
            return Column(kind, axis, " ".join(before) or kind, unit if unit is not None else tail or None, index)
    for count in range(len(words), 0, -1):
        kind, tail = _kind(words[:count]), "".join(words[count:])
        if kind in (TIME, COUNTER, PRESSURE) and (
                not tail or (kind != COUNTER and unit is None and factor(kind, tail))):
            unit = unit if unit is not None else tail or _TIME_UNITS.get("".join(words[:count]))
            return Column(kind, "", " ".join(words[:count]), unit, index)
    if unit is None and len(words) > 1 and words[-1] in ("ms", "us", "ns"):
        unit = words[-1]
    if _kind_of_unit(unit, words) == TIME:
        return Column(TIME, "", OTHER_TIME, unit, index)
    return None


OTHER_TIME = "of its unit"
"""Source of a column that is a time by its unit alone."""


def _kind_of_unit(unit, words):
    """Quantity of a column whose name says none. A leading b, as in b_w_RS_S_x, stands for a bias."""
    if unit is None or (_EXCLUDED | _NO_SENSOR).intersection(words) or words[:1] == ["b"]:
        return None
    return quantity(unit)


def _rank(column):
    return sum(rank for word, rank in _RANKS if word in column.source.replace(" ", ""))


def columns_of(table: Table, *, given: Mapping[str, str] | None = None, default: str | None = None) -> Columns:
    """The columns of a table.

    Parameters
    ----------
    table : Table
    given : mapping
        Names such as "time" and "gyro_x" to header cells, or to COLUMN:UNIT; they go before what names say. "gyro" to
        :UNIT is the unit of all axes.
    default : str, optional
        Quantity of columns that are only called X, Y and Z, from the name of the file.

    Raises: RecordingError for a column of ``given`` that is not there, a column that appears twice, and a sensor that
    lacks an axis.
    """
    # Axes that are numbers begin with 0, or with 1 if there is no 0.
    numbers = "0123" if any("0" in _tokens(_parted(cell)[0]) for cell in table.header) else "1234"
    found = [column for index, cell in enumerate(table.header) if (column := _column(cell, index, default, numbers))]
    if not any(column.kind == TIME for column in found):
        found += [Column(TIME, "", OTHER_TIME, None, number) for number in sorted(table.moments)]
    chosen: dict[str, list[Column]] = {}
    units: dict[str, str] = {}
    for name, cell in (given or {}).items():
        if name in NAMES and cell.startswith(":"):
            units[name] = cell[1:]
            continue
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
            best = min(sources.values(), key=lambda columns: (*_time_rank(table, columns[0]), columns[0].number))
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
    for kind, unit in units.items():
        chosen[kind] = [column._replace(unit=unit) for column in chosen.get(kind, ())]
    used = {column.number for columns in chosen.values() for column in columns}
    return Columns(chosen, [cell for index, cell in enumerate(table.header) if index not in used and cell])


def _time_rank(table, column):
    """How little a column is wanted as time: one that does not increase, that goes back, that has no unit."""
    step = np.diff(table.values[:, column.number])
    step = step[np.isfinite(step)]
    return (2 * np.count_nonzero(step > 0) <= len(step), bool((step < 0).any()), column.source == OTHER_TIME,
            _written(table, column) is None)


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
        unit = column.unit
        if unit is None or factor(kind, unit) is None:
            unit = (units or {}).get(kind, unit)
        known = factor(kind, unit) if unit is not None else None
        if known is None and kind == ATTITUDE:
            known = 1.0, ""
        if known is None:
            raise RecordingError(f"{table.path}: column {_name(column)!r}{_unknown(unit)}; units are {listed(kind)}, "
                                 "in parentheses after the name, or for all axes in --columns "
                                 f"{kind}=:{_EXAMPLE[kind]}")
        found.append(known)
    if len({unit for _, unit in found}) > 1:
        raise RecordingError(f"{table.path}: {NAMES[kind]} axes have units {', '.join(unit for _, unit in found)}; "
                             "use one for all")
    check_numbers(table, columns)
    factors = np.array([size for size, _ in found])
    return factors * table.values[:, [column.number for column in columns]], found[0][1]


def check_numbers(table: Table, columns: Sequence[Column]) -> None:
    """Raise a RecordingError if a cell of the columns is neither a number, nor empty, nor a word."""
    for column in columns:
        if column.number in table.unreadable:
            line, cell = table.unreadable[column.number]
            raise RecordingError(f"{table.path}: line {line}, column {table.header[column.number]!r}: {cell!r} is not "
                                 "a number; correct or delete the line")


_EXAMPLE = {TIME: "ms", GYRO: "deg/s", ACCEL: "g", MAG: "uT", PRESSURE: "hPa"}


def _written(table, column):
    """Unit of a column of time: as written, that of a date, or that of a time since 1970, from its size."""
    if column.number in table.moments:
        return "s"
    if column.unit and factor(TIME, column.unit):
        return column.unit
    if column.unit:
        return None
    values = table.values[:, column.number]
    first = next(iter(values[np.isfinite(values)]), np.nan)
    return next((name for size, name in _EPOCHS.items() if 0.3 * size < first < 10 * size), None)


_EPOCHS = {1e9: "s", 1e12: "ms", 1e15: "us", 1e18: "ns"}
"""Times since 1970 in each unit."""

_STEPS = {0.5: "s", 500.0: "ms", 5e5: "us", np.inf: "ns"}
"""Steps below which a time is in a unit, if the rate is between 2 Hz and 2 kHz."""


def unit_of_steps(table: Table, column: Column) -> str | None:
    """Unit of a column of time without one, which its steps say; None if it has a unit, or does not increase."""
    step = np.diff(table.values[:, column.number])
    step = step[step > 0]
    if column.unit or _written(table, column) or not len(step):
        return None
    return next(unit for limit, unit in _STEPS.items() if np.median(step) < limit)


def seconds(table: Table, column: Column, origin: float | None = None) -> np.ndarray:
    """Time of the rows in seconds. Raises: RecordingError.

    That of an epoch counts from ``origin``, a value of the column in its own unit, or else from the first row.
    """
    values = table.values[:, column.number]
    first = next(iter(values[np.isfinite(values)]), np.nan)
    written = _written(table, column) or unit_of_steps(table, column)
    known = factor(TIME, written) if written is not None else None
    if known is None:
        name = table.header[column.number].strip()
        raise RecordingError(f"{table.path}: column {name!r}{_unknown(column.unit)}; units are {listed(TIME)}, in "
                             f"parentheses after the name, or in --columns time=:ms")
    check_numbers(table, [column])
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
    return _apart(streams)


def _apart(streams):
    """Streams of their own rows, where each row holds a sample of one sensor, and the cells of others are empty."""
    rows = {stream.kind: np.isfinite(stream.values).all(axis=1) for stream in streams}
    if GYRO not in rows or ACCEL not in rows or 2 * (rows[GYRO] & rows[ACCEL]).sum() >= min(
            rows[GYRO].sum(), rows[ACCEL].sum()):
        return streams
    return [replace(stream, time_s=stream.time_s[rows[stream.kind]], values=stream.values[rows[stream.kind]])
            for stream in streams]


def _unknown(unit):
    """What is wrong with a unit, for a message."""
    return f": unit {unit!r} is not known" if unit else " has no unit"
