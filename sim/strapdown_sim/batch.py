"""Replays many logs through one core, as jobs, and puts their results into one table and one page."""

import csv
import glob
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from strapdown.config import Config, ConfigError
from strapdown.cores import main_module, make_core
from strapdown.export import verilog_text, without_comments
from strapdown.files import written_together
from strapdown.markdown import markdown_table
from strapdown.tools import ToolError

from .cache import digest
from .drivers.toolchain import SimulatorMissingError
from .jobs import JobLostError, JobsError, Workers, completed, outcome
from .page import Column, TablePage, write_table_page
from .recordings import (
    Choice,
    NotARecordingError,
    PartError,
    Recording,
    RecordingError,
    is_one_log,
    read_log,
    recordings_of,
)
from .replay import build_model, refusal, replay_recordings, replayed_module

__all__ = ["COLUMNS", "Batch", "Found", "find_logs", "replay_batch", "write_table"]

SUFFIXES = {".7z", ".bag", ".bbl", ".bfl", ".bin", ".csv", ".db3", ".gz", ".h5", ".mat", ".mcap", ".npz", ".parquet",
            ".rar", ".ulg", ".xls", ".xlsx", ".zip", ".zst"}
"""Suffixes of logs. A file with another one is no log if its content is none."""

READ = {".bag", ".csv", ".db3", ".mcap", ".txt", ".yaml", ".zstd"}
"""Suffixes of the files in a folder that readers read; others are pictures."""

COLUMNS = (
    Column("file", "file"),
    Column("format", "format"),
    Column("duration_s", "duration (s)", ".1f"),
    Column("samples", "samples", ",d"),
    Column("sample_rate_hz", "rate (Hz)", ".5g"),
    Column("mag_rate_hz", "field rate (Hz)", ".4g"),
    Column("gaps_bridged", "gaps bridged", ",d"),
    Column("samples_filled", "samples filled in", ",d"),
    Column("refused_updates", "updates refused", ",d"),
    Column("reference", "compared with"),
    Column("total_rms_deg", "total error, RMS (°)", ".2f"),
    Column("inclination_rms_deg", "inclination (°)", ".2f"),
    Column("heading_rms_deg", "heading (°)", ".2f"),
    Column("horizontal_rms_m", "horizontal (m)", ".2f"),
    Column("vertical_rms_m", "vertical (m)", ".2f"),
    Column("float64_max_deg", "largest angle to float64 (°)", ".6f"),
    Column("bits_differing", "bits off the twin", ",d"),
    Column("status", "updates with status"),
    Column("wall_s", "time (s)", ".1f"),
    Column("error", "error"),
)
"""Columns of the table; a row is a dict with these keys, None where there is no value."""

RESULT = "batch.json"
"""File in the folder of a log with its row, and all on which it depends."""


class Found(NamedTuple):
    """Files and folders that may be logs, by the names of their rows."""

    logs: dict[str, Path]
    words_without: list[str]
    """Words that match nothing."""


@dataclass
class Batch:
    """Results of a batch.

    Fields
    ------
    rows : list of dict
        A row for each log, in the order of their names; see COLUMNS.
    kept : int
        Number of logs that were not run again.
    skipped : list of str
        Names of files that are no recordings.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    kept: int = 0
    skipped: list[str] = field(default_factory=list)


def find_logs(words: Iterable[str], apart: Path) -> Found:
    """Files that may be logs: those that words name, or match as patterns, and those in the folders among them.

    A folder that is one log by its structure counts as one. Files whose names begin with a dot, and what is in the
    folder ``apart``, do not count. Names are paths from the folder that contains all.
    """
    found: dict[Path, None] = {}
    tops, without = [], []
    for word in words:
        matches = [Path(word)] if Path(word).exists() else [Path(match) for match in sorted(
            glob.glob(word, recursive=True))]
        if not matches:
            without.append(word)
        for match in matches:
            tops.append(match if match.is_dir() and not is_one_log(match) else match.parent)
            found |= dict.fromkeys(_below(match.resolve(), apart.resolve()))
    if not found:
        return Found({}, without)
    top = os.path.commonpath([place.resolve() for place in tops])
    return Found({path.relative_to(top).as_posix(): path for path in found}, without)


def _below(path, apart):
    if path.is_relative_to(apart) or path.name.startswith("."):
        return
    if not path.is_dir() or is_one_log(path):
        yield path
        return
    for inner in sorted(path.iterdir()):
        yield from _below(inner, apart)


class _Log(NamedTuple):
    """A log that has been read: what its row says of it."""

    name: str
    path: Path
    form: str
    beside: tuple[Path, ...]
    content: str
    recordings: Sequence[Recording]
    seconds: float


class _Replayed(NamedTuple):
    """Result of a job: the files by their names, the summary, the time that it took."""

    files: dict[str, bytes]
    summary: dict[str, Any]
    seconds: float


def _replayed(configured, recordings, build, command):
    """A job: replay the recordings of a log."""
    begun = time.monotonic()
    with TemporaryDirectory() as folder:
        result = replay_recordings(recordings, configured(), folder, build=build, command=command)
        files = {path.relative_to(folder).as_posix(): path.read_bytes()
                 for path in sorted(Path(folder).rglob("*")) if path.is_file()}
    return _Replayed(files, result.summary, time.monotonic() - begun)


def replay_batch(logs: Mapping[str, Path], configured: Callable[[], Config], directory: Path, *, choice: Choice,
                 build: str | os.PathLike, command: Sequence[str], pool: Workers,
                 progress: Callable[[str, int, int], object] = lambda stage, done, total: None) -> Batch:
    """Replay logs as jobs. The results of each are in a folder ``logs/NAME``.

    A log that does not go in gets a row with the reason. One whose files, configuration, choice and version of this
    package are those of an earlier batch is not run again. A file that belongs to another log gets no row.

    Parameters
    ----------
    logs : dict
        As from ``find_logs``.
    configured : callable
        Makes the configuration; it is called in the workers too, so it must be a function with a name, or a partial of
        one.
    directory : Path
        Folder to write to.
    choice : Choice
        What of each log is used.
    build : path-like
        Folder for compiled models. On another machine it is made there.
    command : sequence of str
        See ``replay``.
    pool : Workers
    progress : callable
        ``progress(stage, done, total)``; stages are "build" and "logs".

    Raises: ConfigError for a core that takes no recording; SimulatorMissingError, ToolError if the model cannot be
    compiled; JobsError if all workers are lost; OSError.
    """
    return _Run(logs, configured, Path(directory) / "logs", choice, build, command, pool, progress).batch()


class _Run:
    """The state of a batch: rows by their names, files that were read, files that belong to those beside them, and
    folders that may be one log."""

    def __init__(self, logs, configured, folder, choice, build, command, pool, progress):
        self._logs, self._configured, self._folder, self._choice = dict(logs), configured, folder, choice
        self._build, self._command, self._pool, self._progress = build, command, pool, progress
        self._config = configured()
        module = replayed_module(self._config)
        circuit = without_comments(verilog_text(make_core(module, self._config), self._config))
        self._key = digest(circuit, json.dumps([self._config.values, *choice, _row()], sort_keys=True, default=str),
                           version("strapdown"))
        self._built = pool.remote
        self._rows: dict[str, dict] = {}
        self._beside: set[Path] = set()
        self._read: set[Path] = set()
        self._wholes: dict[Path, None] = {}
        self._found = Batch()

    def batch(self):
        self._go(self._logs)
        # Folders of one file for each sensor, if none of their files is a recording by itself.
        wholes = {self._named(folder): folder for folder in self._wholes
                  if folder not in {path.parent for path in self._read}}
        self._logs |= wholes
        self._go(wholes)
        for name, path in self._logs.items():
            part = any(path != whole and path.is_relative_to(whole) for whole in wholes.values())
            if name in self._rows and self._rows[name]["error"] and (part or path in self._beside):
                del self._rows[name]
        self._found.rows = [self._rows[name] for name in sorted(self._rows)]
        self._found.skipped = [name for name in self._found.skipped if self._logs[name] not in self._beside]
        return self._found

    def _named(self, folder):
        """Name of a folder whose files have names."""
        name, path = next((name, path) for name, path in self._logs.items() if path.parent == folder)
        return str(Path(name).parent) if len(Path(name).parts) > 1 else path.parent.name

    def _go(self, logs):
        done = 0
        self._progress("logs", done, len(logs))

        def counted(tasks):
            nonlocal done
            for name, path in tasks:
                if (task := self._task(name, path)) is None:
                    done += 1
                    self._progress("logs", done, len(logs))
                else:
                    yield task

        for log, future in completed(self._pool, _replayed, counted(logs.items())):
            self._keep(log, future)
            done += 1
            self._progress("logs", done, len(logs))

    def _task(self, name, path):
        """The log, and the arguments of its job; None if there is nothing to run."""
        if (kept := self._result(name, path)) is not None:
            if not self._known(path, [path.with_name(other) for other in kept["beside"]]):
                self._rows[name] = kept["row"]
                self._found.kept += 1
            return None
        begun = time.monotonic()
        try:
            log = read_log(path, **self._choice.reading)
            recordings = recordings_of(log, self._config.channels, **self._choice.merging)
            if self._known(path, log.beside):
                return None
            if not self._built:
                self._progress("build", 0, 1)
                build_model(recordings, self._config, self._build)
                self._built = True
                self._progress("build", 1, 1)
        except NotARecordingError as error:
            if path.suffix.lower() in SUFFIXES:
                self._refuse(name, error)
            else:
                self._found.skipped.append(name)
            return None
        except (SimulatorMissingError, ToolError):
            raise
        except Exception as error:
            if isinstance(error, PartError):
                self._wholes[error.whole] = None
            self._refuse(name, error)
            return None
        found = _Log(name, path, log.form, log.beside, _content(path, log.beside), recordings, time.monotonic() - begun)
        return found, (self._configured, recordings, self._build, self._command)

    def _known(self, path, beside):
        """Whether a file is one of a log that was read before; notes what is known of it."""
        known = path in self._beside and not self._read.isdisjoint(beside)
        self._read.add(path)
        self._beside |= set(beside)
        return known

    def _refuse(self, name: str, error: Exception, **known: Any) -> None:
        """A row with the reason why a log does not go in, in one line."""
        if isinstance(error, ToolError):
            line = error.line
        else:
            line = (str(error).splitlines() or [""])[0]
            if not isinstance(error, ConfigError | RecordingError | JobLostError | SimulatorMissingError):
                line = f"{type(error).__name__}: {line}"
        self._rows[name] = _row(file=name, **known, error=line)

    def _keep(self, log: _Log, future: Future) -> None:
        """The row of a log, and its files."""
        try:
            result = outcome(future)
        except JobLostError as error:
            self._refuse(log.name, error, format=log.form)
            return
        except JobsError:
            raise
        except Exception as error:
            self._refuse(log.name, error, format=log.form)
            return
        row = _row(**_figures(log, result))
        self._rows[log.name] = row
        with written_together(self._folder / log.name) as partial:
            for name, data in result.files.items():
                (partial / name).parent.mkdir(parents=True, exist_ok=True)
                (partial / name).write_bytes(data)
            kept = {"key": self._key, "content": log.content,
                    "beside": [path.name for path in log.beside], "row": row}
            (partial / RESULT).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")

    def _result(self, name, path):
        """What an earlier batch wrote of a log, if nothing has changed."""
        try:
            kept = json.loads((self._folder / name / RESULT).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        same = kept["key"] == self._key and kept["content"] == _content(
            path, [path.with_name(other) for other in kept["beside"]])
        return kept if same else None


def _content(path, beside):
    """Digest of the names and the contents of the files of a log."""
    found = hashlib.sha256()
    files = sorted(inner for inner in path.rglob("*") if inner.suffix.lower() in READ) if path.is_dir() else [path]
    for file in (*files, *beside):
        found.update(f"{file.name}\0{file.is_file():d}".encode())
        if file.is_file():
            with file.open("rb") as data:
                found.update(hashlib.file_digest(data, "sha256").digest())
    return found.hexdigest()


def _row(**values: Any) -> dict[str, Any]:
    return {column.key: values.get(column.key) for column in COLUMNS}


def _figures(log: _Log, result: _Replayed) -> dict[str, Any]:
    """Values of the row of a log that went in."""
    first, summary = log.recordings[0], result.summary
    # Of several channels the first one.
    own = summary | summary.get("channels", {}).get("0", {})
    timing = summary.get("time", {"faults": {}, "bridged_s": []})
    figures: dict[str, Any] = {
        "file": log.name, "format": log.form, "duration_s": float(first.time_s[-1] - first.time_s[0]),
        "samples": summary["samples"], "sample_rate_hz": summary["sample_rate_hz"], "mag_rate_hz": _field_rate(first),
        "gaps_bridged": len(timing["bridged_s"]),
        "samples_filled": timing["faults"].get("samples lost, filled in on a line", 0),
        "refused_updates": summary["refused_updates"],
        "status": ", ".join(f"{name.replace('_', ' ')} {count:,}"
                            for name, count in summary["updates_by_status"].items() if count),
        "bits_differing": summary["bits_differing_from_twin"], "wall_s": log.seconds + result.seconds,
        "error": refusal(summary) or None}
    if recorded := own.get("against_recorded_reference_deg"):
        figures["reference"] = recorded["reference"]
        figures |= {f"{name}_deg": recorded[name] for name in ("total_rms", "inclination_rms", "heading_rms")}
    if track := own.get("against_recorded_position_m"):
        figures.setdefault("reference", "the log's position")
        figures |= {f"{name}_rms_m": track[name]["rms"] for name in ("horizontal", "vertical")}
    exact = own.get("against_float64_reference_deg") or own.get("against_exact_rotations_deg")
    return figures | ({"float64_max_deg": exact["max"]} if exact else {})


def _field_rate(recording):
    """Samples of the magnetometer in a second; None without one."""
    if recording.mag is None:
        return None
    new = recording.mag_new if recording.mag_new is not None else np.any(recording.mag != 0, axis=1)
    return float(new.mean() * recording.sample_rate_hz)


def write_table(batch: Batch, directory: Path, config: Config, *, html: bool = False) -> None:
    """Write ``batch.csv`` and ``batch.md``, and ``batch.html`` if asked: the rows of a batch.

    Raises: MissingPlotlyError for a page without plotly; OSError.
    """
    used = [column for column in COLUMNS if any(row[column.key] is not None for row in batch.rows)]
    with written_together(directory) as partial:
        with (partial / "batch.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(column.key for column in COLUMNS)
            writer.writerows([row[column.key] for column in COLUMNS] for row in batch.rows)
        cells = ([column.text(row[column.key]).replace("|", "\\|") for column in used] for row in batch.rows)
        (partial / "batch.md").write_text(markdown_table(
            [column.title + ":" * bool(column.form) for column in used], cells) + "\n", encoding="utf-8")
        if html:
            write_table_page(partial / "batch.html", TablePage(
                title=f"{len(batch.rows)} logs: {main_module(config)}, configuration {config.name}", columns=used,
                rows=batch.rows, links={row["file"]: f"logs/{row['file']}" for row in batch.rows if row["samples"]},
                panels={"RMS error (°)": ["total_rms_deg", "inclination_rms_deg", "heading_rms_deg"],
                        "RMS error (m)": ["horizontal_rms_m", "vertical_rms_m"],
                        "to float64 (°)": ["float64_max_deg"]}))
