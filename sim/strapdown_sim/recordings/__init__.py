"""Logs and recordings of inertial sensors, read and checked.

Every format has a reader in this package and a line in `FORMATS`. The reader turns a file, or files that belong
together, into a `Log`: streams with time stamps of their own, in fixed units and axes. ``recording_of`` merges the
streams into a `Recording`. A file with an error raises a `RecordingError` of one line that names file, place and
remedy. ``docs/recordings.md`` describes the formats.
"""

import gzip
import os
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from .bags import ZSTD_MAGIC, is_bag, read_bag, unzstd
from .blackbox import MAGIC as BLACKBOX_MAGIC
from .blackbox import read_blackbox
from .dataflash import is_dataflash, read_dataflash
from .extra import needed
from .kitti import is_kitti, is_kitti_drive, read_kitti
from .log import Log, Stream
from .merge import recording_of, recordings_of
from .npz import read_npz
from .plain_csv import read_csv
from .recording import (
    STANDARD_GRAVITY,
    NotARecordingError,
    PartError,
    Recording,
    RecordingError,
    Reference,
    Timing,
    Track,
    listing,
)
from .sensor_files import is_euroc, is_sensor_files, read_sensor_files
from .table import looks_like_table
from .ulog import MAGIC as ULOG_MAGIC
from .ulog import read_ulog
from .ulog_csv import is_ulog_csv, read_ulog_csv
from .x_imu import X_IMU_RATE_HZ

__all__ = ["FORMATS", "STANDARD_GRAVITY", "X_IMU_RATE_HZ", "Choice", "Format", "Log", "NotARecordingError", "PartError",
           "Recording", "RecordingError", "Reference", "Stream", "Timing", "Track", "is_one_log", "read_log",
           "read_recording", "recording_of", "recordings_of"]

HEAD_BYTES = 4096
"""Bytes of a file that are read to recognise its format."""


class Choice(NamedTuple):
    """What of a log is used: options of ``read_log``, and options of ``recording_of``."""

    reading: dict[str, Any]
    merging: dict[str, Any]


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
    Format("ULog topics as CSV", is_ulog_csv, read_ulog_csv),
    Format("KITTI", is_kitti, read_kitti),
    Format("folder of one file for each sensor", is_sensor_files, read_sensor_files),
    Format("table of text", lambda path, head: path.is_file() and looks_like_table(head), read_csv,
           ("columns", "sample_rate_hz", "reference")),
)
"""All formats; the first that recognises a file reads it."""

OTHERS = (
    (b"\xd0\xcf\x11\xe0", "an Excel workbook; save its sheet as CSV, or export CSV (phyphox: Comma, decimal point)"),
    (b"\x89HDF", "an HDF5 or MATLAB file; write the signals as a table of text, or with numpy.savez"),
    (b"MATLAB 5.0", "a MATLAB file; write the signals as a table of text (writetable), or with numpy.savez"),
    (b"MATLAB 7.3", "a MATLAB file; write the signals as a table of text (writetable), or with numpy.savez"),
    (b"{", "JSON; export CSV (Sensor Logger: Zipped CSV)"),
    (b"[{", "JSON; export CSV (Sensor Logger: Zipped CSV)"),
    (b"PAR1", "a Parquet file; write it as CSV"),
    (b"7z\xbc\xaf", "a 7z archive; unpack it"),
    (b"Rar!", "a RAR archive; unpack it"),
    (b"#ROSBAG V1", "a bag of ROS before 2010; convert it with rosbag fix"),
    (b"\xfa\xff", "a binary log of Xsens; export it as text with MT Manager"),
    (b"version https://git-lfs", "a pointer of Git LFS in place of the file; fetch it with git lfs pull"),
    (b"<", "a page of the web or XML, not a log; download the file itself"),
)
"""First bytes of files that are not read, and what they are, with a remedy."""

REFUSALS = {"sample_rate_hz": "the file contains its time; leave out the sample rate",
            "reference": "only x-IMU exports have a separate reference; leave it out",
            "columns": "only text files have columns to name; leave out --columns",
            "log": "the file has one log; leave out --log"}


def is_one_log(folder: Path) -> bool:
    """Whether a folder is a log by its structure: a ROS 2 bag, a drive of KITTI, a set of EuRoC."""
    return is_bag(folder, b"") or is_kitti_drive(folder) or is_euroc(folder)


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
        path = _innermost(path)
        head = b""
        if not path.is_dir():
            with path.open("rb") as file:
                head = file.read(HEAD_BYTES)
        if path.is_file():
            _refuse_others(path, head)
        if (unpack := _unpacker(path, head)) is not None:
            return _unpacked(path, unpack, given)
        form = next((form for form in FORMATS if form.recognises(path, head)), None)
        if form is None:
            raise NotARecordingError(f"{path}: {_nothing(path, head)}")
        for name in given:
            if name not in form.options:
                raise RecordingError(f"{path}: {REFUSALS[name]}")
        return form.read(path, **given)
    except OSError as error:
        raise RecordingError(f"{error.filename or path}: {error.strerror or 'cannot be read'}") from None


def _unpacker(path, head):
    """Function that writes the content of a compressed file into a folder; None for other files."""
    if head.startswith(b"\x1f\x8b"):
        return _gunzip
    if head.startswith(ZSTD_MAGIC):
        return _unzstd
    return _unzip if head.startswith(b"PK") and not _is_npz(path, head) else None


def _gunzip(path, folder):
    name = path.stem if path.suffix.lower() in (".gz", ".gzip") else path.name
    with gzip.open(path) as source, (folder / name).open("wb") as target:
        shutil.copyfileobj(source, target)


def _unzstd(path, folder):
    needed(path, "compressed ROS", "rosbags")
    (folder / path.name.removesuffix(".zstd").removesuffix(".zst")).write_bytes(unzstd(path.read_bytes()))


def _unzip(path, folder):
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder, [name for name in archive.namelist() if "__MACOSX" not in name])


def _unpacked(path, unpack, given):
    """The Log in a compressed file."""
    with tempfile.TemporaryDirectory() as folder:
        inner = Path(folder)
        try:
            unpack(path, inner)
        except (EOFError, gzip.BadGzipFile, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError):
            raise RecordingError(f"{path}: the archive is damaged, or has a password; unpack it") from None
        if (inner / "xl").is_dir():
            raise RecordingError(f"{path}: this is {OTHERS[0][1]}")
        while inner.is_dir() and len(files := _visible(inner)) == 1:
            inner = files[0]
        try:
            return replace(read_log(inner, **given), path=path, beside=())
        except RecordingError as error:
            raise RecordingError(str(error).replace(str(inner), str(path))) from None


def _innermost(path: Path) -> Path:
    """The innermost folder of one that holds only another one."""
    while path.is_dir() and len(inside := _visible(path)) == 1 and inside[0].is_dir():
        path = inside[0]
    return path


def _visible(folder):
    """Files and folders in a folder, without hidden ones."""
    return sorted(file for file in folder.iterdir() if not file.name.startswith("."))


def _refuse_others(path, head):
    """Raise a RecordingError for a file of a kind that is known, but not read."""
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    for magic, what in OTHERS:
        if start.startswith(magic):
            raise NotARecordingError(f"{path}: this is {what}")


def _nothing(path, head):
    """What is wrong with a path that has no known format."""
    if path.is_dir():
        names = [file.name for file in _visible(path)]
        if not names:
            return "the folder is empty"
        return f"no log of one recording is in the folder ({listing(names)}); name one of its files"
    if not head:
        return "the file is empty"
    return f"not a log of a known format; known are {', '.join(form.name for form in FORMATS)}"


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
