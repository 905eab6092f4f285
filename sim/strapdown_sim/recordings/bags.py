"""Bags of ROS 1 and ROS 2, and MCAP files. Axes are those of REP-103: x forward, y left, z up; east, north, up.

================================  =================================================================
message                           stream
================================  =================================================================
``sensor_msgs/Imu``               ``angular_velocity`` gyro, rad/s; ``linear_acceleration`` accel, m/s², which is the
                                  specific force; ``orientation`` attitude, body to ENU, unless its covariance says
                                  that there is none
``sensor_msgs/MagneticField``     ``magnetic_field`` mag, tesla; NaN where there is none
``sensor_msgs/NavSatFix``         position
``sensor_msgs/FluidPressure``     pressure, Pa
================================  =================================================================

Time is that of the header, or of the log where the header has none.
"""

import importlib
import io
import sqlite3
import sys
from contextlib import closing

import numpy as np

from .extra import needed
from .log import ACCEL, ATTITUDE, GYRO, MAG, POSITION, PRESSURE, Log, Stream
from .recording import RecordingError

__all__ = ["MCAP_MAGIC", "ROS1_MAGIC", "SQLITE_MAGIC", "is_bag", "read_bag"]

ROS1_MAGIC, MCAP_MAGIC, SQLITE_MAGIC = b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0"

IMU, FIELD, FIX, FLUID = (f"sensor_msgs/msg/{name}" for name in ("Imu", "MagneticField", "NavSatFix", "FluidPressure"))

OWN_ESTIMATE = "the log's own estimate, not truth"


def is_bag(path, head):
    """Whether a file or folder is a bag."""
    return head.startswith((ROS1_MAGIC, MCAP_MAGIC, SQLITE_MAGIC)) or (path / "metadata.yaml").is_file()


def read_bag(path):
    """The Log of a bag. Raises: RecordingError."""
    needed(path, "ROS", "rosbags")
    try:
        messages = _messages(path)
    except RecordingError:
        raise
    except Exception as error:  # the libraries raise what their parsers meet
        raise RecordingError(f"{path}: not a bag that can be read ({type(error).__name__}: {error})".splitlines()[0]) \
            from None
    streams = _streams(messages)
    if not any(stream.kind == GYRO for stream in streams):
        found = ", ".join(f"{topic} ({kind})" for topic, (kind, _) in messages.items()) or "none"
        raise RecordingError(f"{path}: the bag has no messages of type sensor_msgs/Imu with a rate; topics that can be "
                             f"read: {found}")
    return Log(path, "ROS bag", tuple(streams))


def _messages(path):
    """Topic to its type and messages, each with its time in the log, ns."""
    head = b""
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(16)
    found: dict[str, tuple[str, list]] = {}
    readers = {MCAP_MAGIC: _mcap, SQLITE_MAGIC: _sqlite, ROS1_MAGIC: _ros1}
    read = next((reader for magic, reader in readers.items() if head.startswith(magic)), _ros2)
    for topic, kind, time_ns, message in read(path):
        found.setdefault(topic, (kind, []))[1].append((time_ns, message))
    return found


def _wanted(kind):
    return kind in (IMU, FIELD, FIX, FLUID)


def _ros1(path):
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import Stores, get_typestore

    return _bag(Reader(path), get_typestore(Stores.ROS1_NOETIC).deserialize_ros1)


def _ros2(path):
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    return _bag(Reader(path), get_typestore(Stores.LATEST).deserialize_cdr)


def _bag(reader, deserialize):
    """The wanted messages of a reader of rosbags: topic, type, time, message."""
    with reader:
        wanted = [each for each in reader.connections if _wanted(each.msgtype)]
        for connection, time_ns, raw in reader.messages(connections=wanted) if wanted else ():
            yield connection.topic, connection.msgtype, time_ns, deserialize(raw, connection.msgtype)


def _sqlite(path):
    """Messages of a file of a ROS 2 bag without its metadata."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as base:
        topics = {number: (topic, kind) for number, topic, kind in base.execute("SELECT id, name, type FROM topics")}
        for number, time_ns, raw in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"):
            topic, kind = topics[number]
            if _wanted(kind):
                yield topic, kind, time_ns, store.deserialize_cdr(raw, kind)


SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6
"""Kinds of records of MCAP."""


def _mcap(path):
    """Messages of an MCAP file of ROS 2 (cdr) or ROS 1, in the order of the file; its index is not needed."""
    from rosbags.typesys import Stores, get_typestore

    new, old = get_typestore(Stores.LATEST), get_typestore(Stores.ROS1_NOETIC)
    schemas, channels = {}, {}
    with path.open("rb") as file:
        file.seek(len(MCAP_MAGIC))
        for kind, body in _records(file):
            number = int.from_bytes(body[:2], "little")
            if kind == SCHEMA:
                name, _ = _string(body, 2)
                schemas[number] = name if "/msg/" in name else name.replace("/", "/msg/")
            elif kind == CHANNEL:
                topic, at = _string(body, 4)
                channels[number] = schemas.get(int.from_bytes(body[2:4], "little"), ""), topic, _string(body, at)[0]
            elif kind == MESSAGE and number in channels:
                schema, topic, encoding = channels[number]
                if _wanted(schema) and encoding in ("cdr", "ros1"):
                    read = new.deserialize_cdr if encoding == "cdr" else old.deserialize_ros1
                    yield topic, schema, int.from_bytes(body[6:14], "little"), read(body[22:], schema)


def _records(file):
    """Kind and content of the records of an MCAP file, and of those in its chunks."""
    while len(head := file.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        if kind not in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
            file.seek(length, io.SEEK_CUR)
            continue
        body = file.read(length)
        if len(body) < length:
            # The logger was switched off.
            return
        if kind == CHUNK:
            compression, at = _string(body, 28)
            yield from _records(io.BytesIO(_decompressed(compression, body[at + 8:])))
        else:
            yield kind, body


def _string(body, at):
    """A string of a record, and the place after it."""
    end = at + 4 + int.from_bytes(body[at:at + 4], "little")
    return body[at + 4:end].decode(), end


def _decompressed(compression, data):
    if compression == "lz4":
        return importlib.import_module("lz4.frame").decompress(data)
    if compression == "zstd":
        module = "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
        return importlib.import_module(module).decompress(data)
    return data


def _stamps(messages):
    """Time of messages, ns: of their headers, or of the log if those are zero."""
    headers = np.array([message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, message in messages])
    return headers if headers.any() else np.array([time_ns for time_ns, _ in messages])


def _vectors(messages, field):
    return np.array([[vector.x, vector.y, vector.z] for vector in (getattr(message, field) for _, message in messages)])


def _streams(found):
    stamps = {topic: _stamps(messages) for topic, (_, messages) in found.items()}
    imus = [topic for topic, (kind, _) in found.items() if kind == IMU]
    origin = min((stamps[topic][0] for topic in imus), default=0)
    gyros, forces, others = [], [], []
    for topic, (kind, messages) in found.items():
        time_s = (stamps[topic] - origin) * 1e-9
        if kind == IMU:
            rate, force = _vectors(messages, "angular_velocity"), _vectors(messages, "linear_acceleration")
            if np.nan_to_num(rate).any():
                gyros.append(Stream(GYRO, topic, time_s, np.degrees(rate), "rad/s"))
            if np.nan_to_num(force).any():
                forces.append(Stream(ACCEL, topic, time_s, force, "m/s^2"))
            q = np.array([[m.orientation.w, m.orientation.x, m.orientation.y, m.orientation.z] for _, m in messages])
            absent = np.array([m.orientation_covariance[0] == -1 for _, m in messages])
            constant = (q == q[0]).all() and np.abs(q[0]).max() == 1
            if not absent.all() and q.any() and not constant:
                others.append(Stream(ATTITUDE, topic, time_s, np.where(absent[:, None], np.nan, q), frame="ENU",
                                     meaning=OWN_ESTIMATE))
        elif kind == FIELD:
            others.append(Stream(MAG, topic, time_s, 1e6 * _vectors(messages, "magnetic_field"), "T"))
        elif kind == FIX:
            others.append(Stream(POSITION, topic, time_s, np.array(
                [[m.latitude, m.longitude, m.altitude] for _, m in messages]), "deg"))
        else:
            others.append(Stream(PRESSURE, topic, time_s, np.array([[m.fluid_pressure] for _, m in messages]), "Pa"))
    # First what has both sensors, then what has most samples.
    both = {stream.name for stream in forces}
    gyros.sort(key=lambda stream: (stream.name not in both, -len(stream.time_s)))
    forces.sort(key=lambda stream: -len(stream.time_s))
    return [*gyros, *forces, *others]
