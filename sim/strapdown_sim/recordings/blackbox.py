"""Blackbox logs of Betaflight, INAV and Cleanflight, in their binary form.

A file holds one log after the other. Each begins with lines of text, which name the fields of its frames and say how
each field is predicted from earlier frames and encoded. ``gyroADC`` times ``gyro_scale`` is the rate in deg/s,
``accSmooth`` over ``acc_1G`` the specific force in g, ``magADC`` the field in units of the device; axes are x forward,
y left, z up. Time is in microseconds, in 32 bits.

Source: the format's description in the documentation of Cleanflight ("Blackbox logging internals").
"""

import re
import struct
from typing import NamedTuple

import numpy as np

from .log import ACCEL, GYRO, MAG, Log, Stream
from .recording import STANDARD_GRAVITY, RecordingError

__all__ = ["MAGIC", "one_g", "read_blackbox"]

MAGIC = b"H Product:Blackbox"

LONGEST_FRAME = 256
"""Bytes of a frame; a longer one is damaged."""

FRAMES = b"IPSGHE"
"""First bytes of frames."""

LONGEST_STEP_US = 10_000_000
"""Longest step of time between two frames; a longer one is damage."""


class Part(NamedTuple):
    """A log of a file: its headers, and its frames as bytes."""

    headers: dict[str, str]
    frames: bytes


class DamagedFrameError(Exception):
    """A frame that cannot be decoded."""


def read_blackbox(path, *, log=None):
    """The Log of a blackbox file: the longest one in the file, or that with the number ``log``, from 1 on.

    Raises: RecordingError.
    """
    parts = [_part(text) for text in _split(path.read_bytes())]
    number = max(range(len(parts)), key=lambda index: len(parts[index].frames))
    if log is not None:
        if not re.fullmatch(r"\d+", log) or not 1 <= int(log) <= len(parts):
            raise RecordingError(f"{path}: --log {log} is not in the file; it has logs 1 to {len(parts)}")
        number = int(log) - 1
    headers, frames = parts[number]
    wanted = [name for name in headers.get("Field I name", "").split(",")
              if re.fullmatch(r"time|(gyroADC|accSmooth|magADC)\[[0-2]\]", name)]
    if "gyroADC[0]" not in wanted or "accSmooth[0]" not in wanted:
        raise RecordingError(f"{path}: log {number + 1} has no gyro and accelerometer; set blackbox_disable_acc = OFF")
    try:
        decoder, scale, unit = _Decoder(headers, wanted), _gyro_scale(headers), float(headers.get("acc_1G") or 0)
    except (KeyError, ValueError, struct.error):
        raise RecordingError(f"{path}: the headers of log {number + 1} are damaged, or the file is cut off") from None
    values, damaged = decoder.decode(frames)
    if len(values) < 2:
        raise RecordingError(f"{path}: log {number + 1} has {len(values)} frames that can be decoded")
    time_s = (values[:, wanted.index("time")] - values[0, wanted.index("time")]) * 1e-6

    def vectors(name):
        return values[:, [wanted.index(f"{name}[{axis}]") for axis in range(3)]].astype(float)

    notes = []
    if not unit:
        unit, note = one_g(vectors("accSmooth"))
        notes.append(note)
    streams = [Stream(GYRO, "gyroADC", time_s, scale * vectors("gyroADC"), "deg/s"),
               Stream(ACCEL, "gyroADC", time_s, STANDARD_GRAVITY / unit * vectors("accSmooth"), "g")]
    if "magADC[2]" in wanted and vectors("magADC").any():
        streams.append(Stream(MAG, "magADC", time_s, vectors("magADC"), "a.u."))
    if len(parts) > 1:
        others = ", ".join(f"{index + 1} ({len(part.frames):,} bytes)" for index, part in enumerate(parts)
                           if index != number)
        why = "asked for" if log is not None else "the longest"
        notes.append(f"log {number + 1} of {len(parts)} is taken, {why}; the others are {others}: --log NUMBER takes "
                     "one")
    if damaged:
        notes.append(f"damaged frames: {damaged}; frames until the next full one are left out")
    return Log(path, "blackbox", tuple(streams), notes=tuple(notes))


def one_g(force: np.ndarray) -> tuple[float, str]:
    """Counts of one g of a specific force, shape (N, 3), whose log does not have ``acc_1G``, and a note on it.

    Sensors have a power of two: that next to the median.
    """
    unit = float(2 ** np.rint(np.log2(np.nanmedian(np.linalg.norm(force, axis=1)))))
    return unit, f"accelerometer: {unit:g} units are taken as one g"


def _split(data):
    starts = [match.start() for match in re.finditer(re.escape(MAGIC), data)]
    return [data[start:end] for start, end in zip(starts, [*starts[1:], len(data)], strict=True)]


def _part(text):
    headers, at = {}, 0
    while text[at:at + 2] == b"H ":
        end = text.find(b"\n", at)
        if end < 0:
            end = len(text)
        name, _, value = text[at + 2:end].decode("latin-1").partition(":")
        headers[name] = value.strip()
        at = end + 1
    return Part(headers, text[at:])


def _gyro_scale(headers):
    """deg/s per unit of gyroADC."""
    text = headers.get("gyro_scale", headers.get("gyro.scale", "0x3f800000"))
    scale = struct.unpack("<f", struct.pack("<I", int(text, 16)))[0] if text.startswith("0x") else float(text)
    if headers.get("Firmware type", "").startswith("Baseflight"):
        # There it is in rad/us.
        scale = float(np.degrees(scale * 1e6))
    return scale / (10 if headers.get("blackbox_high_resolution") == "1" else 1)


class _Decoder:
    """Decodes the frames of one log.

    Fields are signed integers, except those of time. The history is that of the format: after a full frame (I) both
    earlier frames are that one.
    """

    def __init__(self, headers, wanted):
        names = headers["Field I name"].split(",")

        def numbers(key):
            return [int(number) for number in headers[key].split(",")]

        self._names = names
        self._wanted = [names.index(name) for name in wanted]
        self._full = list(zip(numbers("Field I predictor"), numbers("Field I encoding"), strict=True))
        self._change = list(zip(numbers("Field P predictor"), numbers("Field P encoding"), strict=True)) \
            if "Field P predictor" in headers else []
        self._other = {ord(kind): [(0, code) for code in numbers(f"Field {kind} encoding")]
                       for kind in "SGH" if f"Field {kind} encoding" in headers}
        self._minthrottle = int(headers.get("minthrottle", 0))
        self._motor_low = int(headers.get("motorOutput", "0").split(",")[0])
        self._vbat = int(headers.get("vbatref", 0))
        self._motor = names.index("motor[0]") if "motor[0]" in names else 0
        self._time = names.index("time")
        self._data, self._at = b"", 0

    def decode(self, data):
        """Values of the wanted fields, shape (N, fields), int64, and the number of damaged frames."""
        self._data, self._at = data, 0
        rows, damaged, before, before2, wraps = [], 0, None, None, 0
        while self._at < len(data):
            kind, start = data[self._at], self._at
            self._at += 1
            try:
                frame = self._frame(kind, before, before2)
                if self._at - start > LONGEST_FRAME or (self._at < len(data) and data[self._at] not in FRAMES
                                                        and frame is not ...):
                    raise DamagedFrameError
            except (DamagedFrameError, IndexError):
                if kind in FRAMES and start + 1 < len(data):
                    damaged += before is not None or kind == 0x49
                    before = before2 = None
                self._at = self._next(start + 1)
                continue
            if frame is ...:
                break
            if frame is None:
                continue
            if before is not None:
                step = frame[self._time] - before[self._time]
                if step < -2**31:
                    wraps += 2**32
                elif not 0 <= step < LONGEST_STEP_US:
                    damaged, before, before2 = damaged + 1, None, None
                    if kind == 0x50:
                        continue
            row = [frame[index] for index in self._wanted]
            row[0 if self._wanted[0] == self._time else self._wanted.index(self._time)] += wraps
            rows.append(row)
            before, before2 = frame, frame if kind == 0x49 else before
        return np.array(rows, np.int64).reshape(len(rows), len(self._wanted)), int(damaged)

    def _next(self, start):
        """Place of the next full frame."""
        found = self._data.find(b"I", start)
        return len(self._data) if found < 0 else found

    def _frame(self, kind, before, before2):
        """Fields of a main frame; None for another frame, and for a change without the frame before it; ... at the
        end of the log."""
        if kind == 0x49:
            return self._main(self._full, before, before, full=True)
        if kind == 0x50 and self._change:
            frame = self._main(self._change, before or [0] * len(self._names), before2 or [0] * len(self._names))
            return frame if before is not None else None
        if kind in self._other:
            self._read(self._other[kind])
            return None
        if kind == 0x45:
            return self._event()
        raise DamagedFrameError

    def _event(self):
        kind = self._byte()
        if kind == 255:
            if self._data[self._at:self._at + 10] == b"End of log":
                return ...
            raise DamagedFrameError
        if kind in (0, 15):
            self._unsigned()
        elif kind in (14, 30):
            self._unsigned(), self._unsigned()
        elif kind == 13:
            if self._byte() >= 128:
                self._at += 4
            else:
                self._unsigned()
        elif kind in (10, 11, 20):
            self._at += {10: 1, 11: 4, 20: 3}[kind]
        else:
            raise DamagedFrameError
        return None

    def _main(self, fields, before, before2, full=False):
        raw = self._read(fields)
        frame: list[int] = []
        for index, ((predictor, _), value) in enumerate(zip(fields, raw, strict=True)):
            if predictor == 0:
                pass
            elif predictor == 1:
                value += before[index]
            elif predictor == 2:
                value += 2 * before[index] - before2[index]
            elif predictor == 3:
                # Half of the sum, towards zero, as in C.
                total = before[index] + before2[index]
                value += total // 2 if total >= 0 else -(-total // 2)
            elif predictor == 4:
                value += self._minthrottle
            elif predictor == 5:
                value += frame[self._motor]
            elif predictor == 6:
                value = before[index] + 1
            elif predictor == 8:
                value += 1500
            elif predictor == 9:
                value += self._vbat
            elif predictor == 11:
                value += self._motor_low
            else:
                raise DamagedFrameError
            frame.append(value & 0xFFFFFFFF if index == self._time else _signed32(value))
        return frame

    def _read(self, fields):
        """Encoded values of the fields of a frame."""
        values, index, count = [], 0, len(fields)
        while index < count:
            code = fields[index][1]
            if code == 0:
                values.append(_zigzag(self._unsigned()))
            elif code == 1:
                values.append(self._unsigned())
            elif code == 3:
                value = self._unsigned() & 0x3FFF
                values.append(-(value - 0x4000 if value & 0x2000 else value))
            elif code == 6:
                group = 1
                while group < 8 and index + group < count and fields[index + group][1] == 6:
                    group += 1
                values += self._tag8(group)
                index += group - 1
            elif code == 7:
                values += self._tag2()
                index += 2
            elif code == 8:
                values += self._tag4()
                index += 3
            elif code == 9:
                values.append(0)
            elif code == 10:
                values += self._tag2_variable()
                index += 2
            else:
                raise DamagedFrameError
            index += 1
        return values[:count]

    def _byte(self):
        value = self._data[self._at]
        self._at += 1
        return value

    def _unsigned(self):
        data, at, value, shift = self._data, self._at, 0, 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            if byte < 128:
                self._at = at
                return value
            shift += 7
            if shift > 28:
                raise DamagedFrameError

    def _tag8(self, group):
        if group == 1:
            return [_zigzag(self._unsigned())]
        head = self._byte()
        return [_zigzag(self._unsigned()) if head >> bit & 1 else 0 for bit in range(group)]

    def _tag2(self):
        lead = self._byte()
        kind = lead >> 6
        if kind == 0:
            return [_signed(lead >> shift & 3, 2) for shift in (4, 2, 0)]
        if kind == 1:
            second = self._byte()
            return [_signed(lead & 15, 4), _signed(second >> 4, 4), _signed(second & 15, 4)]
        if kind == 2:
            return [_signed(lead & 63, 6), _signed(self._byte() & 63, 6), _signed(self._byte() & 63, 6)]
        return self._whole(lead)

    def _tag2_variable(self):
        lead = self._byte()
        kind = lead >> 6
        if kind == 0:
            return [_signed(lead >> shift & 3, 2) for shift in (4, 2, 0)]
        if kind == 1:
            # Five, five and four bits.
            second = self._byte()
            return [_signed(lead >> 1 & 31, 5), _signed((lead & 1) << 4 | second >> 4, 5), _signed(second & 15, 4)]
        if kind == 2:
            # Eight, seven and seven bits.
            second, third = self._byte(), self._byte()
            return [_signed((lead & 63) << 2 | second >> 6, 8), _signed((second & 63) << 1 | third >> 7, 7),
                    _signed(third & 127, 7)]
        return self._whole(lead)

    def _whole(self, lead):
        """Three values of one to four bytes, as two bits for each in the first byte say."""
        values = []
        for _ in range(3):
            size = (lead & 3) + 1
            values.append(int.from_bytes(self._data[self._at:self._at + size], "little", signed=True))
            self._at += size
            lead >>= 2
        if self._at > len(self._data):
            raise DamagedFrameError
        return values

    def _tag4(self):
        """Four values of zero, four, eight or sixteen bits, in nibbles with the high one first."""
        head, values, half = self._byte(), [], None
        for _ in range(4):
            size = head & 3
            head >>= 2
            if size == 0:
                values.append(0)
                continue
            nibbles = (0, 1, 2, 4)[size]
            number = 0
            for _ in range(nibbles):
                if half is None:
                    byte = self._byte()
                    number, half = number << 4 | byte >> 4, byte & 15
                else:
                    number, half = number << 4 | half, None
            values.append(_signed(number, 4 * nibbles))
        return values


def _zigzag(value):
    return value >> 1 ^ -(value & 1)


def _signed(value, bits):
    return value - (1 << bits) if value >> (bits - 1) else value


def _signed32(value):
    return (value + 2**31 & 0xFFFFFFFF) - 2**31
