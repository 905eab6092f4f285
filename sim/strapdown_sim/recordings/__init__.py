"""Recordings of inertial sensors, read and checked.

Every format has a module in this package and a line in `FORMATS`. The module reads a file into a `Recording`, which
always has the same units. A file with an error raises a `RecordingError` of one line that names file, place and
remedy. ``docs/recordings.md`` describes the formats.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from .npz import read_npz
from .plain_csv import read_plain_csv
from .recording import STANDARD_GRAVITY, Recording, RecordingError, Reference, check_gravity
from .x_imu import X_IMU_RATE_HZ, read_x_imu

__all__ = ["FORMATS", "STANDARD_GRAVITY", "X_IMU_RATE_HZ", "Format", "Recording", "RecordingError", "Reference",
           "read_recording"]

HEAD_BYTES = 4096
"""Bytes of a file that are read to recognise its format."""


class Format(NamedTuple):
    """A file format of recordings.

    Attributes
    ----------
    recognises : callable
        ``recognises(path, head)`` is true if a file with this path and these first bytes has this format.
    read : callable
        ``read(path, **options)`` returns the Recording.
    options : tuple of str
        Options of ``read_recording`` that the format takes.
    """

    recognises: Callable[[Path, bytes], bool]
    read: Callable[..., Recording]
    options: tuple[str, ...] = ()


def _is_csv(path, head):
    return path.suffix.lower() == ".csv"


def _is_x_imu(path, head):
    return _is_csv(path, head) and b"packet number" in head.partition(b"\n")[0].lower()


FORMATS = (
    Format(_is_x_imu, read_x_imu, ("sample_rate_hz", "reference")),
    Format(_is_csv, read_plain_csv),
    Format(lambda path, head: path.suffix.lower() == ".npz", read_npz),
)
"""All formats; the first that recognises a file reads it."""

REFUSALS = {"sample_rate_hz": "the file contains its time; leave out the sample rate",
            "reference": "only x-IMU exports have a separate reference; leave it out"}


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
        Quaternion file of an x-IMU export; by default ``..._Quaternion.csv`` in the same folder, if it exists.

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
    given = {name: value for name, value in (("sample_rate_hz", sample_rate_hz), ("reference", reference))
             if value is not None}
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
        form = next((form for form in FORMATS if form.recognises(path, head)), None)
        if form is None:
            raise RecordingError(f"{path}: suffix {path.suffix.lower()!r} is not known; "
                                 "recordings are .csv or .npz files")
        for name in given:
            if name not in form.options:
                raise RecordingError(f"{path}: {REFUSALS[name]}")
        recording = form.read(path, **given)
    except OSError as error:
        raise RecordingError(f"{error.filename or path}: {error.strerror or 'cannot be read'}") from None
    check_gravity(path, recording)
    return recording
