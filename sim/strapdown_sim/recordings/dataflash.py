"""DataFlash logs of ArduPilot, binary and as text. FMT messages describe the others, so every version can be read.

Messages are in forward, right, down and north, east, down; they are turned to the axes of a Log.

=======================================  ==============================================================
message                                  stream
=======================================  ==============================================================
``IMU``, ``IMU2``, ``IMU3``, ``I``=0..   ``Gyr`` gyro, rad/s; ``Acc`` accel, m/s²
``GYR`` and ``ACC``, ``GYR1``, ...       the same at the sensor's rate, at ``SampleUS``
``MAG``, ``MAG2``, ``MAG3``, ``I``=0..   ``Mag`` mag, milligauss, offsets removed by the autopilot
``ATT``                                  attitude: ``Roll``, ``Pitch``, ``Yaw``, degrees
``XKF1``, ``NKF1``, ``EKF1``             the same, of an estimator; velocity ``VE``, ``VN``, ``VD``
``AHR2``                                 the same, of the estimator in reserve
``GPS``                                  position ``Lat``, ``Lng``, ``Alt``
``BARO``                                 pressure ``Press``, Pa
=======================================  ==============================================================
"""

import re
from typing import NamedTuple

import numpy as np

from .log import (
    ACCEL,
    ATTITUDE,
    GYRO,
    MAG,
    POSITION,
    PRESSURE,
    VELOCITY,
    Log,
    Stream,
    from_frd,
    own_estimate,
    quaternion_from_angles,
    quaternion_from_ned,
)
from .recording import RecordingError

__all__ = ["is_dataflash", "read_dataflash"]

START = b"\xa3\x95"
"""First bytes of a message; its type follows."""

FMT, FMT_LENGTH = 128, 89
"""Type and length of the message that describes another."""

TYPES = {"a": "<i2", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8",
         "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
         "M": "u1", "q": "<i8", "Q": "<u8"}
"""NumPy's type of each letter of a format; a is an array of 32."""

SCALES = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}
"""Factors that letters stand for."""

FIELDS = {"IMU": ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"), "GYR": ("GyrX", "GyrY", "GyrZ"),
          "ACC": ("AccX", "AccY", "AccZ"), "MAG": ("MagX", "MagY", "MagZ"), "ATT": ("Roll", "Pitch", "Yaw"), "GPS": (),
          "BARO": ("Press",)}
"""Fields of messages that are read; estimators have those of ATT."""

WANTED = re.compile(r"(IMU|MAG|GYR|ACC)\d?|ATT|AHR2|[XNE]KF1|GPS|BARO")


def _size(letter):
    """Bytes of a field; so many of an unknown one that no message has them."""
    return np.dtype(TYPES.get(letter, "V256")).itemsize * (32 if letter == "a" else 1)


class Format(NamedTuple):
    """A message: length in bytes, letters of its fields, and their names."""

    length: int
    letters: str
    names: list[str]


def is_dataflash(head):
    """Whether the first bytes of a file are those of a DataFlash log, binary or text."""
    return head.startswith(START + bytes([FMT])) or bool(re.search(rb"(?m)^FMT, ?128,", head))


def read_dataflash(path):
    """The Log of a DataFlash file. Raises: RecordingError."""
    data = path.read_bytes()
    messages, skipped = _binary(data) if data.startswith(START) else _text(data)
    streams = _streams(_whole(messages))
    if not any(stream.kind == GYRO for stream in streams):
        raise RecordingError(f"{path}: the log has no IMU messages with a time; set the IMU bits of LOG_BITMASK, "
                             "unless the file is cut off")
    notes = (f"{skipped:,} bytes that are no message, left out",) if skipped else ()
    return Log(path, "DataFlash", tuple(streams), notes=notes)


def _binary(data):
    """Messages by name, as structured arrays, and the number of bytes between messages."""
    formats, names = {FMT: FMT_LENGTH}, {}
    places: dict[int, list[int]] = {}
    at, skipped, end = 0, 0, len(data)
    while at + 3 <= end:
        length = formats.get(data[at + 2]) if data[at:at + 2] == START else None
        if length is None or at + length > end:
            following = data.find(START, at + 1)
            following = end if following < 0 else following
            skipped, at = skipped + following - at, following
            continue
        kind = data[at + 2]
        if kind == FMT:
            number, size = data[at + 3], data[at + 4]
            name, letters, labels = (data[at + first:at + last].split(b"\0")[0].decode("ascii", "replace")
                                     for first, last in ((5, 9), (9, 25), (25, 89)))
            if len(letters) == len(labels.split(",")) and size == 3 + sum(map(_size, letters)):
                formats[number], names[number] = size, (name, Format(size, letters, labels.split(",")))
        elif kind in names and WANTED.fullmatch(names[kind][0]):
            places.setdefault(kind, []).append(at)
        at += length
    raw = np.frombuffer(data, np.uint8)
    messages = {}
    for kind, starts in places.items():
        name, form = names[kind]
        fields = [(label, TYPES[letter], (32,)) if letter == "a" else (label, TYPES[letter])
                  for label, letter in zip(form.names, form.letters, strict=True)]
        dtype = np.dtype(fields)
        rows = raw[np.array(starts)[:, None] + np.arange(3, 3 + dtype.itemsize)].copy().view(dtype)[:, 0]
        messages[name] = {label: rows[label] * SCALES.get(letter, 1) for label, letter
                          in zip(form.names, form.letters, strict=True) if letter not in "anNZ"}
    return messages, skipped


def _text(data):
    """Messages of a log as text, whose numbers are scaled already."""
    names: dict[str, list[str]] = {}
    rows: dict[str, list[list[str]]] = {}
    for line in data.decode("utf-8", errors="replace").splitlines():
        name, *cells = [cell.strip() for cell in line.split(",")]
        if name == "FMT" and len(cells) > 4:
            names[cells[2]] = cells[4:]
        elif name in names and WANTED.fullmatch(name) and len(cells) == len(names[name]):
            rows.setdefault(name, []).append(cells)
    return {name: {label: np.array([_number(cell) for cell in column]) for label, column
                   in zip(names[name], zip(*values, strict=True), strict=True)} for name, values in rows.items()}, 0


def _number(cell):
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _instances(messages, base):
    """Name and messages of each instance of a kind: IMU, IMU2, ..., or the values of the field I."""
    for name in sorted(messages):
        if re.fullmatch(rf"{base}\d?", name):
            message = messages[name]
            if "I" in message and name == base:
                for instance in np.unique(message["I"]):
                    yield f"{base} {int(instance)}", {label: values[message["I"] == instance]
                                                      for label, values in message.items()}
            else:
                yield name, message


def _whole(messages):
    """Messages with a time, which those of logs before 2014 do not have, and with the fields that are read."""
    return {name: message for name, message in messages.items()
            if ("TimeUS" in message or "TimeMS" in message)
            and all(field in message for field in FIELDS.get(name.rstrip("0123456789"), FIELDS["ATT"]))}


def _streams(messages):
    first = [message["TimeUS"][0] for name, message in messages.items() if "TimeUS" in message and name[:3] in (
        "IMU", "GYR")]
    origin = min(first, default=0)

    def time_of(message):
        if "SampleUS" in message and (message["SampleUS"] > 0).all():
            return (message["SampleUS"] - float(origin)) * 1e-6
        if "TimeUS" in message:
            return (message["TimeUS"] - float(origin)) * 1e-6
        return message["TimeMS"] * 1e-3

    def vectors(message, label):
        return from_frd(np.stack([message[f"{label}{axis}"] for axis in "XYZ"], axis=-1))

    streams = []
    for name, message in _instances(messages, "IMU"):
        time_s = time_of(message)
        streams += [Stream(GYRO, name, time_s, np.degrees(vectors(message, "Gyr")), "rad/s"),
                    Stream(ACCEL, name, time_s, vectors(message, "Acc"), "m/s^2")]
    for base, label, kind, scale, unit in ("GYR", "Gyr", GYRO, np.degrees(1.0), "rad/s"), \
            ("ACC", "Acc", ACCEL, 1.0, "m/s^2"):
        streams += [Stream(kind, name.replace(base, "GYR"), time_of(message), scale * vectors(message, label), unit)
                    for name, message in _instances(messages, base)]
    # Messages at the sensor's own rate are better than those of a decimated one.
    usual = len(streams[0].time_s) if streams else 0
    streams.sort(key=lambda stream: len(stream.time_s) <= 2 * usual)
    for name, message in _instances(messages, "MAG"):
        healthy = message.get("Health", np.ones(1)) != 0
        streams.append(Stream(MAG, name, time_of(message),
                              np.where(np.reshape(healthy, (-1, 1)), 0.1 * vectors(message, "Mag"), np.nan), "mG"))
    for base in "ATT", "XKF1", "NKF1", "EKF1", "AHR2":
        if base in messages:
            message = messages[base]
            if "C" in message:
                message = {label: values[message["C"] == message["C"].min()] for label, values in message.items()}
            q = quaternion_from_angles(message["Roll"], message["Pitch"], message["Yaw"])
            streams.append(Stream(ATTITUDE, base, time_of(message), quaternion_from_ned(q), frame="NWU",
                                  meaning=own_estimate("autopilot")))
            if "VE" in message:
                streams.append(Stream(VELOCITY, base, time_of(message), np.stack(
                    [message["VE"], message["VN"], -message["VD"]], axis=-1), "m/s"))
    if "GPS" in messages and "Lat" in messages["GPS"]:
        message = messages["GPS"]
        streams.append(Stream(POSITION, "GPS", time_of(message), np.stack(
            [message["Lat"], message["Lng"], message["Alt"]], axis=-1), "deg"))
    for name, message in _instances(messages, "BARO"):
        streams.append(Stream(PRESSURE, name, time_of(message), message["Press"][:, None], "Pa"))
    return streams
