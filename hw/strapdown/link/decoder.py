"""The receiver of the serial line, in Python: it turns bytes into frames."""

from dataclasses import dataclass

import numpy as np

from .frame import FRAME_TYPES, SYNC, crc, frame_size, place

__all__ = ["Frame", "FrameDecoder"]


@dataclass(frozen=True)
class Frame:
    """A complete frame.

    Attributes
    ----------
    type : int
        Number of its type in FRAME_TYPES.
    number : int
        Updates since the first frame, without the overflows of the counter.
    status : int
        Status bits of the core.
    values : ndarray, shape (9,)
        The quantities of its type, float32 or float64, as sent.
    """

    type: int
    number: int
    status: int
    values: np.ndarray


class FrameDecoder:
    """Finds frames in a stream of bytes, with or without garbage.

    Parameters
    ----------
    every : int
        Updates from one frame to the next.

    Attributes
    ----------
    frames, crc_errors : int
        Complete frames; bytes that look like a frame, with a wrong CRC.
    lost : int
        Frames missing between the frames, by their counters.
    restarts : int
        Number of times that the counter did not change, or went back by up to 32,768: the core was reset.
    skipped_bytes : int
        Bytes that belong to no complete frame.
    """

    def __init__(self, every=1):
        self._every = every
        self.frames = self.crc_errors = self.lost = self.restarts = self.skipped_bytes = 0
        self._pending = bytearray()
        self._counter = None
        self._number = 0

    def feed(self, data):
        """Take any number of bytes; return the Frames that they complete."""
        self._pending += data
        found, start = [], 0
        while (size := self._candidate(start)) is not None:
            if size and (frame := self._decode(start, size)):
                found.append(frame)
                start += size
            else:
                # Another frame may begin inside these bytes.
                begin = self._pending.find(SYNC[:1], start + 1)
                begin = len(self._pending) if begin < 0 else begin
                self.skipped_bytes += begin - start
                start = begin
        del self._pending[:start]
        return found

    def finish(self):
        """End of the stream: return the Frames inside bytes that looked like the beginning of a longer frame."""
        found = []
        while self._pending:
            del self._pending[0]
            self.skipped_bytes += 1
            found += self.feed(b"")
        return found

    def _candidate(self, start):
        """Size of the frame that may begin at ``start``; 0 if none does, None if more bytes are needed."""
        head = self._pending[start:start + place("type").stop]
        if not head:
            return None
        if not SYNC.startswith(head[:len(SYNC)]):
            return 0
        if len(head) < place("type").stop:
            return None
        kind = FRAME_TYPES.get(head[place("type").start])
        length = head[place("length").start]
        if kind is None or length not in kind.payload_sizes:
            return 0
        size = frame_size(length)
        return size if len(self._pending) >= start + size else None

    def _decode(self, start, size):
        """The Frame at ``start``, or None if its CRC is wrong."""
        frame = bytes(self._pending[start:start + size])
        length = frame[place("length")][0]
        check = place("crc", length)
        if crc(frame[place("sync").stop:check.start]) != int.from_bytes(frame[check], "big"):
            self.crc_errors += 1
            return None
        counter = int.from_bytes(frame[place("counter")], "little")
        if self._counter is not None:
            step = (counter - self._counter) & 0xFFFF
            if 1 <= step < 0x8000:
                self.lost += max(step // self._every - 1, 0)
                self._number += step
            else:
                self.restarts += 1
                self._number += 1
        self._counter = counter
        self.frames += 1
        number_size = FRAME_TYPES[frame[place("type").start]].payload_sizes[length]
        values = np.frombuffer(frame[place("payload", length)], dtype=f"<f{number_size}")
        return Frame(frame[place("type").start], self._number, frame[place("status").start], values)
