"""Tables of numbers in text files: header, delimiter, decimal sign and comments are found from the text."""

import codecs
import csv
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

import numpy as np

from .recording import RecordingError
from .units import UNITS, factor

__all__ = ["PACKET", "Table", "holds_numbers", "looks_like_table", "parse_table", "read_table", "require"]

PACKET = "Packet number"

COMMENT = "#", "//", "%"
"""Starts of lines that are not part of the table, but for the last one before the numbers, which may be its header."""

HEAD_BYTES = 4096
"""First bytes of a file, from which its encoding is found."""

SAMPLES = 16
"""One more than the lines from which the number of columns is found."""

FEW = 0.01
"""Share of damaged lines, and of damaged cells of a column, that is left out like lost samples."""

EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "+nan", "-nan"}
"""Cells without a number, in lower case."""


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers of a text file.

    Fields
    ------
    path : Path
    header : list of str
        Cells of the header, stripped; numbers of the columns, from 1 on, without a header.
    values : ndarray, shape (N, columns)
        NaN for a cell without a number.
    lines : Sequence of int
        Number of the line of each row.
    comments : tuple of str
        Lines of comments, and other lines before the header, stripped.
    columns : dict
        Maps names that the reader knows to columns.
    unreadable : dict
        Maps a column to the line and the text of its first cell that is neither a number, nor empty, nor a word, if
        there are more than a few.
    moments : frozenset of int
        Columns of dates and times of day, which are seconds in ``values``.
    notes : tuple of str
        On lines that are damaged, and left out.
    """

    path: Path
    header: list[str]
    values: np.ndarray
    lines: Sequence[int]
    comments: tuple[str, ...]
    columns: dict[str, int]
    unreadable: dict[int, tuple[int, str]] = field(default_factory=dict)
    moments: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    def __getitem__(self, names):
        """Values of one known column, shape (N,), or of several, shape (N, len(names))."""
        if isinstance(names, str):
            return self.values[:, self.columns[names]]
        return self.values[:, [self.columns[name] for name in names]]


def decoded(data: bytes) -> str:
    """Text of a file: UTF-8; UTF-16, also without a byte order mark; or else Windows-1252."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if (order := _utf16(data)) is not None:
        return data.decode(order, errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _utf16(data):
    """The name of UTF-16 if every second byte of the first ones is zero, as in plain letters; or else None."""
    head = data[:HEAD_BYTES]
    return next((name for name, first in (("utf-16-le", 1), ("utf-16-be", 0))
                 if head[first::2].count(0) > 0.9 * len(head) / 2 and not head[1 - first::2].count(0)), None)


def looks_like_table(head: bytes) -> bool:
    """Whether the first bytes of a file are text."""
    text = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" not in head or _utf16(head) is not None
    return bool(head) and text


def holds_numbers(text: str) -> bool:
    """Whether at least half of the lines of a text, of those that are looked at, are numbers."""
    found = _spread(text.splitlines())
    return 2 * sum(numeric is not None for numeric in found) >= max(len(found), 1)


def parse_table(path: Path, text: str) -> Table:
    """A Table from text. Raises: RecordingError."""
    lines = text.splitlines()
    start, names, delimiter, comma, comments = _layout(path, lines)
    width, cells, numbers, count = len(names), array("d"), array("q"), 0
    unreadable: dict[int, tuple[int, str]] = {}
    bad: Counter[int] = Counter()
    damaged, moments = [], set[int]()
    for number, line in enumerate(lines[start:], start + 1):
        if not line.strip() or line.lstrip().startswith(COMMENT):
            continue
        row = _split(line, delimiter)
        if len(row) == width + 1 and not row[-1].strip():
            row.pop()
        if len(row) != width and not any(rest.strip() for rest in lines[number:]):
            # The logger was switched off while it wrote the last line.
            break
        if len(row) != width:
            damaged.append(f"line {number} has {len(row)} cells, the header {width}")
            continue
        try:
            cells.extend(map(float, row) if not comma else (float(cell.replace(",", ".")) for cell in row))
        except ValueError:
            del cells[count * width:]
            cells.extend(_number(cell, comma, number, column, unreadable, bad, moments)
                         for column, cell in enumerate(row))
        numbers.append(number)
        count += 1
    if len(damaged) > FEW * count:
        raise RecordingError(f"{path}: {damaged[0]}; complete or delete it")
    if count < 2:
        raise RecordingError(f"{path}: {count} rows of numbers; at least 2 are needed, below a line with their names")
    values = np.frombuffer(cells, float).reshape(count, width)
    notes = (f"damaged lines, left out: {len(damaged)}; the first is {damaged[0]}",) if damaged else ()
    unreadable = {column: first for column, first in unreadable.items() if bad[column] > FEW * count}
    return Table(path, names, values, numbers, comments, {}, unreadable, frozenset(moments), notes)


def _number(cell, comma, line, column, unreadable, bad, moments):
    """The number in a cell; NaN without one."""
    text = cell.strip()
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        pass
    if (moment := _moment(text)) is not None:
        moments.add(column)
        return moment
    # Words, such as a flag or a name, are no numbers of the recording.
    if text.casefold() not in EMPTY and not re.match(r"[A-Za-z\"']", text):
        unreadable.setdefault(column, (line, cell))
        bad[column] += 1
    return np.nan


MONTHS = "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"

_DATE = r"(?:(\d{1,4})[-/.](\d{1,2}|[A-Za-z]{3})[-/.](\d{1,4})[T _,]*)?"
_MOMENT = re.compile(_DATE + r"(?<![\d.])(\d{1,2})([-:])(\d{1,2})(?:[-:](\d{1,2}))?(?:([.:,_])(\d{1,9}))?"
                             r"\s*([AaPp][Mm])?\s*(?:Z|UTC|GMT|[-+]\d{2}:?\d{2})?")


def _moment(text):
    """Seconds of a date with a time, since 1970, or of a time of day; None for another text.

    Time zones do not matter, because only differences do. Three or less digits after a colon are milliseconds.
    """
    match = _MOMENT.fullmatch(text)
    if match is None or (match[7] is None and match[8] not in (".", ",")):
        return None
    first, month, last, hours, _, minutes, seconds, sign, digits, half = match.groups()
    if seconds is None:
        # Minutes and seconds.
        hours, minutes, seconds = 0, hours, minutes
    fraction = 0.0 if digits is None else int(digits) / 1000 if sign == ":" else float(f"0.{digits}")
    clock = (int(hours) % 12 + 12 * (half.lower() == "pm") if half else int(hours)) * 3600 + int(minutes) * 60 + \
        int(seconds) + fraction
    if first is None:
        return clock
    number = MONTHS.index(month.lower()) + 1 if month.lower() in MONTHS else int(month) if month.isdigit() else 0
    year, day = (int(first), int(last)) if len(first) > 2 else (int(last), int(first))
    if number > 12:
        number, day = day, number
    try:
        return (date(year if year > 99 else 2000 + year, number, day) - date(1970, 1, 1)).days * 86400 + clock
    except ValueError:
        return None


def _split(line, delimiter):
    if delimiter is None:
        return line.split()
    if '"' in line:
        return next(csv.reader([line], delimiter=delimiter))
    return line.split(delimiter)


def _is_numbers(cells):
    """Whether most cells are numbers, with either decimal sign, and at least one is."""
    filled = [cell.strip().replace(",", ".") for cell in cells if cell.strip()]
    good = sum(_is_number(cell) for cell in filled)
    return good > 0 and good >= len(filled) / 2


def _is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _layout(path, lines):
    """First line of numbers (index), names, delimiter, whether the decimal sign is a comma, and comments."""
    comments, before, width = [], [], _usual_width(lines)
    for index, line in enumerate(lines):
        text = line.strip()
        if not text:
            continue
        if text.startswith(COMMENT):
            comments.append(text)
            before.append(text.lstrip("#/% "))
            continue
        found = _numeric(text, before[-1:])
        # Lines before the table may hold numbers too, such as settings.
        if found is None or (width is not None and abs(len(_split(text, width[0])) - width[1]) > 1):
            before.append(text)
            continue
        delimiter, cells = found
        comma = any(_decimal_comma(delimiter, cell) for each in lines[index:index + SAMPLES]
                    for cell in _split(each, delimiter))
        # The header is the last line with as many cells, or one less where lines end with a delimiter; a line of units
        # may stand below it.
        count = len(cells)
        heads = [[_name(cell) for cell in _split(each, delimiter)] for each in before[-2:]]
        heads = [head[:count] for head in heads if len(head) in (count, count + 1)
                 or (len(head) == count - 1 and not cells[-1].strip())]
        if not heads:
            return index, [str(number + 1) for number in range(count)], delimiter, comma, (*comments, *before)
        names = heads[-1]
        if len(heads) == 2 and len(heads[0]) == len(names) and _are_units(names):
            units = [re.sub(r"^[(\[](.*)[)\]]$", r"\1", unit) for unit in names]
            names = [f"{name} [{unit}]" if unit else name for name, unit in zip(heads[0], units, strict=True)]
        return index, names, delimiter, comma, (*comments, *before[:-1])
    if not any(line.strip() for line in lines):
        raise RecordingError(f"{path}: the file is empty")
    first = next(line for line in lines if line.strip())
    delimiter = max(",;\t", key=first.count)
    return len(lines), [_name(cell) for cell in first.split(delimiter)], delimiter, False, ()


def _name(cell):
    """A cell of the header; those of the 3-Space sensors are written as formats, %float(RawGyroX)."""
    name = cell.strip().strip('"')
    match = re.search(r"%\w+\((\w+)\)$", name)
    return match[1] if match else name


def _decimal_comma(delimiter, cell):
    """Whether a cell has a decimal comma. Between commas as delimiters, 1,000 would be a thousand."""
    return bool(re.fullmatch(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", cell)) and (
        delimiter != "," or not re.fullmatch(r"\s*[-+]?[1-9]\d{0,2}(,\d{3})+\s*", cell))


def _spread(lines):
    """Delimiter and cells of some lines all over the file, None for one that does not hold numbers."""
    rows = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT)]
    places = [len(rows) * part // SAMPLES for part in range(1, SAMPLES)] if len(rows) > 1 else []
    return [_numeric(rows[place].strip(), rows[place - 1:place]) for place in places]


def _usual_width(lines):
    """Delimiter and number of cells of most lines in the file, or None if it has no numbers."""
    counts = Counter((numeric[0], len(numeric[1])) for numeric in _spread(lines) if numeric)
    return counts.most_common(1)[0][0] if counts else None


def _are_units(cells):
    """Whether at least half of the cells that are not empty are units."""
    filled = [re.sub(r"^[(\[](.*)[)\]]$", r"\1", cell) for cell in cells if cell]
    known = sum(any(factor(kind, cell) for kind in UNITS) for cell in filled)
    return known > 0 and known >= len(filled) / 2


def _numeric(line, head):
    """Delimiter and cells of a line of numbers, or None; ``head`` holds the line before it, if there is one.

    Of several possible delimiters that counts which parts the line before into as many cells.
    """
    possible: list[tuple[bool, int, str | None, list[str]]] = []
    for delimiter in "\t", ";", "|", ",", None:
        cells = _split(line, delimiter) if delimiter is None or delimiter in line else []
        if len(cells) > 1 and _is_numbers(cells):
            fits = any(1 < len(_split(each, delimiter)) in range(len(cells) - 1, len(cells) + 2) for each in head)
            possible.append((not fits, len(possible), delimiter, cells))
    return min(possible)[2:] if possible else None


def read_table(path: Path, known: Sequence[str]) -> Table:
    """A table whose columns all have known names, with or without units in parentheses, and whose cells are numbers.

    Raises: RecordingError.
    """
    table = parse_table(path, decoded(path.read_bytes()))
    canonical = {name.casefold(): name for name in known}
    columns: dict[str, int] = {}
    for index, cell in enumerate(table.header):
        label = cell.strip().removesuffix(")").rpartition("(")[0] if cell.strip().endswith(")") else cell
        name = canonical.get(" ".join(label.split()).casefold())
        if name is None:
            raise RecordingError(f"{path}: column {cell.strip()!r} is not known; columns are {', '.join(known)}")
        if name in columns:
            raise RecordingError(f"{path}: column {name!r} appears twice; delete one")
        columns[name] = index
    for row, column in np.argwhere(~np.isfinite(table.values))[:1]:
        raise RecordingError(f"{path}: line {table.lines[row]}, column {table.header[column]!r}: no finite number; "
                             "correct or delete the line")
    return Table(path, table.header, table.values, table.lines, table.comments, columns)


def require(table: Table, names: Sequence[str]) -> None:
    """Raise a RecordingError if a known column is missing."""
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise RecordingError(f"{table.path}: no column {', '.join(repr(name) for name in missing)}; add it")
