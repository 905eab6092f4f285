"""Recorded lines of both sensors: NumPy archives, CSV files, and pictures whose rows are lines."""

import os
import zipfile
import zlib
from pathlib import Path

import numpy as np

from ..instrument.image import FULL_SCALE
from .recording import RecordingError

__all__ = ["read_lines"]

def read_lines(path: str | os.PathLike, pixels: int) -> np.ndarray:
    """Lines of the roll and of the pitch sensor, counts of 12 bits, light positive: shape (2, N, pixels) of uint16.

    Parameters
    ----------
    path : path-like
        ``.npz``: arrays ``roll`` and ``pitch``, a row for each line. ``.csv``, without a header, and ``.png``: a row
        for each line, with the pixels of the roll sensor and then those of the pitch sensor. White is full scale.
    pixels : int
        Pixels of a sensor.

    Raises: RecordingError.
    """
    path = Path(path)
    readers = {".npz": _npz, ".csv": _csv, ".png": _png}
    if path.suffix.lower() not in readers:
        raise RecordingError(f"{path}: suffix {path.suffix.lower()!r} is not known; lines are in .npz, .csv or .png "
                             "files")
    try:
        roll, pitch = readers[path.suffix.lower()](path)
    except OSError as error:
        raise RecordingError(f"{error.filename or path}: {error.strerror or 'cannot be read'}") from None
    for name, lines in ("roll", roll), ("pitch", pitch):
        if lines.ndim != 2 or lines.shape[1] != pixels or not len(lines):
            raise RecordingError(f"{path}: the {name} sensor has lines in shape {lines.shape}; the configuration's "
                                 f"sensor needs (lines, {pixels})")
        if lines.dtype.kind not in "fiu" or not np.isfinite(lines).all():
            raise RecordingError(f"{path}: the lines of the {name} sensor must be finite numbers")
        if lines.min() < 0 or lines.max() > FULL_SCALE:
            raise RecordingError(f"{path}: the {name} sensor has counts from {lines.min():g} to {lines.max():g}; "
                                 f"they must be from 0 to {FULL_SCALE}")
    if len(roll) != len(pitch):
        raise RecordingError(f"{path}: {len(roll)} lines of the roll sensor and {len(pitch)} of the pitch sensor; "
                             "cut the longer one")
    return np.rint([roll, pitch]).astype(np.uint16)


def _npz(path):
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = dict(archive)
    except (EOFError, TypeError, ValueError, zipfile.BadZipFile, zlib.error):
        raise RecordingError(f"{path}: not a NumPy archive of plain arrays; write it with numpy.savez") from None
    for name in "roll", "pitch":
        if name not in arrays:
            raise RecordingError(f"{path}: no array {name!r}; add it")
    return arrays["roll"], arrays["pitch"]


def _csv(path):
    try:
        rows = path.read_text(encoding="utf-8-sig").split("\n")
        table = np.loadtxt(rows, delimiter=",", ndmin=2) if any(row.strip() for row in rows) else None
    except ValueError as error:
        raise RecordingError(f"{path}: not a table of numbers: {error}".splitlines()[0]) from None
    if table is None:
        raise RecordingError(f"{path}: the file is empty")
    return _halves(table)


def _png(path):
    from matplotlib.image import imread

    try:
        picture = imread(path, format="png")
    except (SyntaxError, ValueError):
        raise RecordingError(f"{path}: not a PNG picture") from None
    if picture.ndim != 2:
        raise RecordingError(f"{path}: the picture has colours; it must be grey")
    return _halves(picture * float(FULL_SCALE))


def _halves(rows):
    """Both halves of rows."""
    middle = rows.shape[1] // 2
    return rows[:, :middle], rows[:, middle:]
