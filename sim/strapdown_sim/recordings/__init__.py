"""Logs and recordings of inertial sensors, read and checked.

Every format has a reader in this package and a line in `FORMATS`. The reader turns a file, or files that belong
together, into a `Log`: streams with time stamps of their own, in fixed units and axes. ``recording_of`` merges the
streams into a `Recording`. A file with an error raises a `RecordingError` of one line that names file, place and
remedy. ``docs/recordings.md`` describes the formats.
"""

import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .bags import is_bag, read_bag
from .blackbox import MAGIC as BLACKBOX_MAGIC
from .blackbox import read_blackbox
from .dataflash import is_dataflash, read_dataflash
from .kitti import is_kitti, read_kitti
from .log import Log, Stream
from .merge import recording_of, recordings_of
from .npz import read_npz
from .plain_csv import read_csv
from .recording import STANDARD_GRAVITY, Recording, RecordingError, Reference, Timing, Track
from .sensor_files import is_sensor_files, read_sensor_files
from .table import looks_like_table
from .ulog import MAGIC as ULOG_MAGIC
from .ulog import read_ulog
from .x_imu import X_IMU_RATE_HZ

__all__ = ["FORMATS", "STANDARD_GRAVITY", "X_IMU_RATE_HZ", "Format", "Log", "Recording", "RecordingError", "Reference",
           "Stream", "Timing", "Track", "read_log", "read_recording", "recording_of",
           "recordings_of"]

HEAD_BYTES = 4096
"""Bytes of a file that are read to recognise its format."""


class Format(NamedTuple):
    """A file format of logs.

    Attributes
    ----------
    name : str
        What it is called in messages.
    recognises : callable
        ``recognises(path, head)`` is true if a file with this path and these first bytes has this format; of a folder,
        ``head`` is empty.
    read : callable
        ``read(path, **options)`` returns the Log.
    options : tuple of str
        Options of ``read_log`` that the format takes.
    """

    name: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[..., Log]
    options: tuple[str, ...] = ()


def _is_npz(path, head):
    if not head.startswith(b"PK"):
        return path.suffix.lower() == ".npz" and path.is_file()
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except zipfile.BadZipFile:
        return path.suffix.lower() == ".npz"


FORMATS = (
    Format("NumPy archive", _is_npz, read_npz),
    Format("ULog", lambda path, head: head.startswith(ULOG_MAGIC), read_ulog),
    Format("DataFlash", lambda path, head: is_dataflash(head), read_dataflash),
    Format("blackbox", lambda path, head: head.startswith(BLACKBOX_MAGIC), read_blackbox, ("log",)),
    Format("ROS bag or MCAP", is_bag, read_bag),
    Format("KITTI", is_kitti, read_kitti),
    Format("folder or zip of one file for each sensor", is_sensor_files, read_sensor_files),
    Format("table of text", lambda path, head: path.is_file() and looks_like_table(head), read_csv,
           ("columns", "sample_rate_hz", "reference")),
)
"""All formats; the first that recognises a file reads it."""

REFUSALS = {"sample_rate_hz": "the file contains its time; leave out the sample rate",
            "reference": "only x-IMU exports have a separate reference; leave it out",
            "columns": "only text files have columns to name; leave out --columns",
            "log": "the file has one log; leave out --log"}


def read_log(path: str | os.PathLike, **options: Any) -> Log:
    """Read the streams of a file.

    Parameters
    ----------
    path : path-like
        A file or folder; its content says which of `FORMATS` it has.
    **options
        sample_rate_hz : float, of a file without time stamps; reference : path-like, quaternion file of an x-IMU
        export;
        columns : mapping of quantities ("time", "gyro_x") to columns (NAME or NAME:UNIT) of a text file; log : str,
        name or number of one of several logs in a file. None stands for an option that is not given.

    Raises
    ------
    RecordingError
        If the file does not exist, has no known format, or cannot be read.
    """
    path = Path(path)
    given = {name: value for name, value in options.items() if value is not None}
    try:
        head = b""
        if not path.is_dir():
            with path.open("rb") as file:
                head = file.read(HEAD_BYTES)
        form = next((form for form in FORMATS if form.recognises(path, head)), None)
        if form is None:
            known = ", ".join(form.name for form in FORMATS)
            raise RecordingError(f"{path}: " + ("the file is empty" if path.is_file() and not head else
                                                f"not a log of a known format; known are {known}"))
        for name in given:
            if name not in form.options:
                raise RecordingError(f"{path}: {REFUSALS[name]}")
        return form.read(path, **given)
    except OSError as error:
        raise RecordingError(f"{error.filename or path}: {error.strerror or 'cannot be read'}") from None


def read_recording(path: str | os.PathLike, *, sample_rate_hz: float | None = None,
                   reference: str | os.PathLike | None = None, columns: Mapping[str, str] | None = None,
                   log: str | None = None, imu: str | None = None, mag: str | None = None,
                   start_s: float | None = None, stop_s: float | None = None) -> Recording:
    """Read a file, and merge its streams into a Recording.

    Parameters
    ----------
    path, sample_rate_hz, reference, columns, log
        See ``read_log``.
    imu, mag, start_s, stop_s
        See ``recording_of``.

    Raises
    ------
    RecordingError
        If the file cannot be read, lacks a gyro or an accelerometer, or has gaps, units or values with which the result
        would be wrong.
    """
    return recording_of(read_log(path, sample_rate_hz=sample_rate_hz, reference=reference, columns=columns, log=log),
                        imu=imu, mag=mag, start_s=start_s, stop_s=stop_s)
