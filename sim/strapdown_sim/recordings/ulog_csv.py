"""Topics of a ULog file as the tables that ``ulog2csv`` writes: PREFIX_sensor_combined_0.csv and so on."""

import re

import numpy as np

from .log import GYRO, Log
from .recording import RecordingError
from .table import decoded, parse_table
from .ulog import TOPICS, streams_of_topics

__all__ = ["is_ulog_csv", "read_ulog_csv"]

GYROS = "sensor_combined", "vehicle_imu", "sensor_gyro"
"""Topics with a gyro, one of which a log needs."""


def is_ulog_csv(path, head):
    """Whether a path is a folder with tables of topics, or one such table."""
    files = path.iterdir() if path.is_dir() else [path] if head.startswith(b"timestamp") else []
    return any(_topic(file)[1] in GYROS for file in files)


def _topic(file):
    """Prefix, topic and instance in the name of a file."""
    match = re.fullmatch(rf"(.*?)_?({'|'.join(TOPICS)})_(\d+)\.csv", file.name)
    return match.groups() if match else (None, None, None)


def read_ulog_csv(path):
    """The Log of a folder of tables, or of a table and those beside it. Raises: RecordingError."""
    files = sorted(path.iterdir() if path.is_dir() else path.parent.iterdir())
    prefix = _topic(path)[0] if path.is_file() else next(_topic(file)[0] for file in files if _topic(file)[1] in GYROS)
    topics = {}
    for file in files:
        begin, topic, instance = _topic(file)
        if topic is None or begin != prefix:
            continue
        try:
            table = parse_table(file, decoded(file.read_bytes()))
        except RecordingError:
            continue
        if table.header[0] == "timestamp":
            topics[topic, int(instance)] = dict(zip(table.header, np.ascontiguousarray(table.values.T), strict=True))
    streams = streams_of_topics(topics)
    if not any(stream.kind == GYRO for stream in streams):
        raise RecordingError(f"{path}: no table of {', '.join(GYROS)} can be read; write them with ulog2csv")
    beside = tuple(file for file in files if file != path and _topic(file)[0] == prefix) if path.is_file() else ()
    return Log(path, "ULog topics as CSV", tuple(streams), beside=beside)
