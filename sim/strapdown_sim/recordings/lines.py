"""Recorded lines of both sensors: NumPy archives, CSV files, and pictures whose rows are lines."""

import os
import zipfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ..instrument.image import FULL_SCALE
from .recording import RecordingError

__all__ = ["read_lines"]

BIT_DEPTH = 24
"""Place of the bit depth in a PNG file, in the chunk IHDR, which is the first."""


def read_lines(path: str | os.PathLike, pixels: int, full_scale: int | None = None) -> np.ndarray:
    """Lines of the roll and of the pitch sensor, counts of 12 bits, light positive: shape (2, N, pixels) of uint16.

    Parameters
    ----------
    path : path-like
        ``.npz``: arrays ``roll`` and ``pitch``, a row for each line. ``.csv``, without a header, and ``.png``: a row
        for each line, with the pixels of the roll sensor and then those of the pitch sensor. Counts are whole numbers.
    pixels : int
        Pixels of a sensor.
    full_scale : int or None
        Value in a picture that stands for the count 4095; its counts are rounded. By default white does: 255, or 65535
        with 16 bits. A picture of 16 bits with no value above 4095 needs it, because its values may be counts.

    Raises: RecordingError.
    """
    path = Path(path)
    readers: dict[str, Callable] = {".npz": _npz, ".csv": _csv, ".png": partial(_png, full_scale=full_scale)}
    if path.suffix.lower() not in readers:
        raise RecordingError(f"{path}: suffix {path.suffix.lower()!r} is not known; lines are in .npz, .csv or .png "
                             "files")
    if full_scale is not None and path.suffix.lower() != ".png":
        raise RecordingError(f"{path}: holds counts; only pictures have a full scale")
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
        if (fractions := lines[lines != np.rint(lines)]).size:
            raise RecordingError(f"{path}: the {name} sensor has the count {fractions[0]:g}; counts must be whole "
                                 "numbers, so round them")
    if len(roll) != len(pitch):
        raise RecordingError(f"{path}: {len(roll)} lines of the roll sensor and {len(pitch)} of the pitch sensor; "
                             "cut the longer one")
    return np.array([roll, pitch]).astype(np.uint16)


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


def _png(path, full_scale):
    from matplotlib.image import imread

    try:
        picture = imread(path, format="png")
    except (SyntaxError, ValueError):
        raise RecordingError(f"{path}: not a PNG picture") from None
    if picture.ndim != 2:
        raise RecordingError(f"{path}: the picture has colours; it must be grey")
    # The picture's values are those in the file, over the largest that their bits can hold.
    white = 0xFFFF if path.read_bytes()[BIT_DEPTH] == 16 else 0xFF
    values = np.rint(picture * float(white))
    if full_scale is None and white > FULL_SCALE >= values.max():
        raise RecordingError(f"{path}: a picture of 16 bits with no value above {values.max():.0f}; say what is full "
                             f"scale: --full-scale {FULL_SCALE} if the values are counts of 12 bits, --full-scale "
                             f"{white} if not")
    return _halves(np.rint(values * (FULL_SCALE / (full_scale or white))))


def _halves(rows):
    """Both halves of rows."""
    middle = rows.shape[1] // 2
    return rows[:, :middle], rows[:, middle:]
