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
``geometry_msgs/Vector3Stamped``  ``vector`` mag of drivers before ``MagneticField``, if the topic's name has "mag"
================================  =================================================================

Time is that of the header, or of the log where the header has none.
"""

import bz2
import importlib
import io
import sqlite3
import sys
from contextlib import closing

import numpy as np

from .extra import needed
from .log import ACCEL, ATTITUDE, GYRO, MAG, POSITION, PRESSURE, Log, Stream, own_estimate
from .recording import RecordingError
from .units import UNITS, unit_of_force

__all__ = ["MCAP_MAGIC", "ROS1_MAGIC", "SQLITE_MAGIC", "ZSTD_MAGIC", "is_bag", "read_bag", "unzstd"]

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
ROS1_MAGIC, MCAP_MAGIC, SQLITE_MAGIC = b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0"

IMU, FIELD, FIX, FLUID = (f"sensor_msgs/msg/{name}" for name in ("Imu", "MagneticField", "NavSatFix", "FluidPressure"))
VECTOR = "geometry_msgs/msg/Vector3Stamped"


def is_bag(path, head):
    """Whether a file or folder is a bag."""
    return head.startswith((ROS1_MAGIC, MCAP_MAGIC, SQLITE_MAGIC)) or (path / "metadata.yaml").is_file()


def read_bag(path):
    """The Log of a bag. Raises: RecordingError."""
    needed(path, "ROS", "rosbags")
    topics: dict[str, str] = {}
    try:
        messages = _messages(path, topics)
    except RecordingError:
        raise
    except sqlite3.DatabaseError as error:
        raise RecordingError(f"{path}: not a bag that can be read ({error}); recover it: "
                             f"sqlite3 {path.name} .recover | sqlite3 NEW.db3") from None
    except Exception as error:  # the libraries raise what their parsers meet
        raise RecordingError(f"{path}: not a bag that can be read ({type(error).__name__}: {error})".splitlines()[0]) \
            from None
    notes: list[str] = []
    streams = _streams(messages, notes)
    if not any(stream.kind == GYRO for stream in streams):
        found = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items())) or "none"
        raise RecordingError(f"{path}: the bag has no messages of type sensor_msgs/Imu with a rate, in the encoding of "
                             f"ROS; record or convert to them; its topics: {found}")
    return Log(path, "ROS bag", tuple(streams), notes=tuple(notes))


def _messages(path, topics):
    """Topic to its type and messages, each with its time in the log, ns; all topics are put into ``topics``."""
    head = b""
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(16)
    found: dict[str, tuple[str, list]] = {}
    readers = {MCAP_MAGIC: _mcap, SQLITE_MAGIC: _sqlite, ROS1_MAGIC: _ros1}
    read = next((reader for magic, reader in readers.items() if head.startswith(magic)), _ros2)
    for topic, kind, time_ns, message in read(path, topics):
        found.setdefault(topic, (kind, []))[1].append((time_ns, message))
    return found


def _wanted(topic, kind):
    return kind in (IMU, FIELD, FIX, FLUID) or (kind == VECTOR and "mag" in topic.lower())


def _ros2(path, topics):
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with Reader(path) as reader:
        topics.update({each.topic: each.msgtype for each in reader.connections})
        wanted = [each for each in reader.connections if _wanted(each.topic, each.msgtype)]
        for connection, time_ns, raw in reader.messages(connections=wanted) if wanted else ():
            yield connection.topic, connection.msgtype, time_ns, store.deserialize_cdr(raw, connection.msgtype)


def _sqlite(path, topics):
    """Messages of a file of a ROS 2 bag without its metadata."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as base:
        named = {number: (topic, kind) for number, topic, kind in base.execute("SELECT id, name, type FROM topics")}
        topics.update(named.values())
        for number, time_ns, raw in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"):
            topic, kind = named[number]
            if _wanted(topic, kind):
                yield topic, kind, time_ns, store.deserialize_cdr(_plain(raw), kind)


BAG_CHUNK, BAG_CONNECTION, BAG_MESSAGE = 5, 7, 2
"""Kinds of records of a ROS 1 bag."""


def _ros1(path, topics):
    """Messages of a ROS 1 bag in the order of the file; its index is not needed, so a damaged bag can be read."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    connections = {}
    with path.open("rb") as file:
        file.readline()
        for kind, fields, data in _bag_records(file):
            number = fields.get(b"conn", b"")
            if kind == BAG_CONNECTION:
                topic = fields[b"topic"].decode()
                connections[number] = topic, _fields(data)[b"type"].decode().replace("/", "/msg/")
                topics[topic] = connections[number][1]
            elif kind == BAG_MESSAGE and number in connections and _wanted(*connections[number]):
                seconds, nanoseconds = (int.from_bytes(fields[b"time"][at:at + 4], "little") for at in (0, 4))
                topic, name = connections[number]
                yield topic, name, seconds * 10**9 + nanoseconds, store.deserialize_ros1(data, name)


def _bag_records(file):
    """Kind, fields and data of the records of a ROS 1 bag, and of those in its chunks."""
    while True:
        parts: list[bytes] = []
        for _ in range(2):
            size = file.read(4)
            part = file.read(int.from_bytes(size, "little"))
            if len(size) < 4 or len(part) < int.from_bytes(size, "little"):
                if parts and _fields(parts[0]).get(b"compression") == b"none":
                    # The beginning of a chunk whose end is lost.
                    yield from _bag_records(io.BytesIO(part))
                return
            parts.append(part)
        fields = _fields(parts[0])
        kind = fields[b"op"][0]
        if kind != BAG_CHUNK:
            yield kind, fields, parts[1]
            continue
        try:
            chunk = _decompressed(fields[b"compression"].decode(), parts[1])
        except (EOFError, OSError, RuntimeError, ValueError):
            # Damaged; its time remains as a gap.
            continue
        yield from _bag_records(io.BytesIO(chunk))


def _fields(data):
    """Fields NAME=VALUE, each behind its length."""
    fields, at = {}, 0
    while at < len(data):
        size = int.from_bytes(data[at:at + 4], "little")
        name, _, value = data[at + 4:at + 4 + size].partition(b"=")
        fields[name], at = value, at + 4 + size
    return fields


SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6
"""Kinds of records of MCAP."""


def _mcap(path, topics):
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
                topics[topic] = f"{channels[number][0]}, {channels[number][2]}"
            elif kind == MESSAGE and number in channels:
                schema, topic, encoding = channels[number]
                if _wanted(topic, schema) and encoding in ("cdr", "ros1"):
                    read = new.deserialize_cdr if encoding == "cdr" else old.deserialize_ros1
                    yield topic, schema, int.from_bytes(body[6:14], "little"), read(_plain(body[22:]), schema)


def _records(file):
    """Kind and content of the records of an MCAP file, and of those in its chunks."""
    while len(head := file.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        if kind not in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
            file.seek(length, io.SEEK_CUR)
            continue
        body = file.read(length)
        whole = len(body) == length
        if kind == CHUNK and len(body) > 40:
            compression, at = _string(body, 28)
            if whole or not compression:
                yield from _records(io.BytesIO(_decompressed(compression, body[at + 8:])))
        if not whole:
            # The logger was switched off.
            return
        if kind == CHUNK:
            continue
        yield kind, body


def _string(body, at):
    """A string of a record, and the place after it."""
    end = at + 4 + int.from_bytes(body[at:at + 4], "little")
    return body[at + 4:end].decode(), end


def _decompressed(compression, data):
    if compression == "lz4":
        return importlib.import_module("lz4.frame").decompress(data)
    if compression == "bz2":
        return bz2.decompress(data)
    return unzstd(data) if compression == "zstd" else data


def unzstd(data: bytes) -> bytes:
    """Decompressed data of Zstandard, with what the extra ``logs`` installs. Raises: EOFError if they are damaged."""
    zstd = importlib.import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
    try:
        return zstd.decompress(data)
    except zstd.ZstdError as error:
        raise EOFError(str(error)) from None


def _plain(raw):
    """A message, which may be compressed by itself."""
    return unzstd(raw) if raw[:4] == ZSTD_MAGIC else raw


def _stamps(messages):
    """Time of messages, ns: of their headers, or of the log if those are zero."""
    headers = np.array([message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, message in messages])
    return headers if headers.any() else np.array([time_ns for time_ns, _ in messages])


def _vectors(messages, field):
    return np.array([[vector.x, vector.y, vector.z] for vector in (getattr(message, field) for _, message in messages)])


def _streams(found, notes):
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
                unit = unit_of_force(force) or "m/s^2"
                if unit != "m/s^2":
                    notes.append(f"{topic}: the specific force is not in m/s^2, as it should be; {unit} makes its "
                                 "median one g")
                forces.append(Stream(ACCEL, topic, time_s, UNITS[ACCEL][unit] * force, unit))
            q = np.array([[m.orientation.w, m.orientation.x, m.orientation.y, m.orientation.z] for _, m in messages])
            absent = np.array([m.orientation_covariance[0] == -1 for _, m in messages])
            constant = (q == q[0]).all() and np.abs(q[0]).max() == 1
            if not absent.all() and q.any() and not constant:
                others.append(Stream(ATTITUDE, topic, time_s, np.where(absent[:, None], np.nan, q), frame="ENU",
                                     meaning=own_estimate("log")))
        elif kind == FIELD:
            others.append(Stream(MAG, topic, time_s, 1e6 * _vectors(messages, "magnetic_field"), "T"))
        elif kind == VECTOR:
            others.append(Stream(MAG, topic, time_s, _vectors(messages, "vector"), "a.u."))
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
