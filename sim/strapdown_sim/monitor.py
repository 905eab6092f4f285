"""What comes over the serial link: frames found, checked, counted, written as CSV and drawn."""

import csv
import errno
import os
import select
from collections import deque
from contextlib import closing
from dataclasses import dataclass
from itertools import chain

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.link import FRAME_TYPES, NAVIGATION, SYNC, crc, frame_size, place

__all__ = ["Curves", "Frame", "FrameDecoder", "MonitorError", "monitor", "read_port"]

CHUNK = 1 << 16
PATIENCE_S = 0.1
"""How long a port is waited for before the window is looked after."""

WINDOW = 3000
"""Frames that a window shows."""

HEADER = ("Frame", "Status", *(f"{quantity.meaning.split(',')[0].capitalize()} ({quantity.unit})"
                               for quantity in NAVIGATION.quantities))
"""Header of the CSV file."""


class MonitorError(ValueError):
    """A port or file that cannot be read; one line."""


@dataclass(frozen=True)
class Frame:
    """A frame that arrived whole.

    Attributes
    ----------
    number : int
        Updates since the first frame that was seen, the counter's overflows undone.
    status : int
        Status bits of the core.
    values : ndarray, shape (9,)
        The quantities of NAVIGATION, float32 or float64 as they were sent.
    """

    number: int
    status: int
    values: np.ndarray


class FrameDecoder:
    """Frames from a stream of bytes, with or without garbage.

    Attributes
    ----------
    frames, crc_errors : int
        Frames that arrived whole, and what looked like one but failed its CRC.
    lost : int
        Updates missing between those that arrived, by their counters.
    restarts : int
        Times that the counter stood still or went back, by up to 32,768: the core was reset.
    skipped_bytes : int
        Bytes that belong to no whole frame.
    """

    def __init__(self):
        self.frames = self.crc_errors = self.lost = self.restarts = self.skipped_bytes = 0
        self._pending = bytearray()
        self._counter = None
        self._number = 0

    @property
    def pending_bytes(self):
        """Bytes that may still become a frame."""
        return len(self._pending)

    def feed(self, data):
        """Take bytes, as many as there are; returns the Frames that they complete."""
        self._pending += data
        found, start = [], 0
        while (size := self._candidate(start)) is not None:
            if size and (frame := self._decode(start, size)):
                found.append(frame)
                start += size
            else:
                # Within what was no frame, a frame may begin.
                begin = self._pending.find(SYNC[:1], start + 1)
                begin = len(self._pending) if begin < 0 else begin
                self.skipped_bytes += begin - start
                start = begin
        del self._pending[:start]
        return found

    def finish(self):
        """The stream has ended: returns the Frames in what looked like the beginning of a longer one."""
        found = []
        while self._pending:
            del self._pending[0]
            self.skipped_bytes += 1
            found += self.feed(b"")
        return found

    def _candidate(self, start):
        """Size of the frame that may begin at ``start``; 0 if none does, None if more bytes must tell."""
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
        """The frame at ``start``, or None if its CRC is wrong."""
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
                self.lost += step - 1
                self._number += step
            else:
                self.restarts += 1
                self._number += 1
        self._counter = counter
        self.frames += 1
        number_size = FRAME_TYPES[frame[place("type").start]].payload_sizes[length]
        values = np.frombuffer(frame[place("payload", length)], dtype=f"<f{number_size}")
        return Frame(self._number, frame[place("status").start], values)


def read_port(port, baud_rate=None):
    """Bytes of a file or port, as they come.

    Parameters
    ----------
    port : path-like or str
        A recorded file, a FIFO, a terminal as it is set, or with ``baud_rate`` a serial port.
    baud_rate : int or None
        Rate to open a serial port with, 8N1; needs the package pyserial.

    Yields
    ------
    bytes
        Empty where nothing came for a tenth of a second.

    Raises: MonitorError.
    """
    return _read_file(port) if baud_rate is None else _read_serial(port, baud_rate)


def _read_file(port):
    try:
        # A terminal must not become the one whose Ctrl-C ends this program.
        descriptor = os.open(port, os.O_RDONLY | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0))
    except OSError as error:
        raise MonitorError(f"cannot open {port}: {error.strerror}") from None
    try:
        while True:
            if os.name == "posix" and not select.select([descriptor], [], [], PATIENCE_S)[0]:
                yield b""
                continue
            try:
                data = os.read(descriptor, CHUNK)
            except OSError as error:
                # A terminal that is gone: its other side was closed, or its adapter unplugged.
                if error.errno == errno.EIO:
                    return
                raise MonitorError(f"cannot read {port}: {error.strerror}") from None
            if not data:
                return
            yield data
    finally:
        os.close(descriptor)


def _read_serial(port, baud_rate):
    try:
        import serial
    except ModuleNotFoundError:
        raise MonitorError("--baud needs the package pyserial: pip install 'strapdown[monitor]'") from None
    try:
        with serial.Serial(str(port), baud_rate, timeout=PATIENCE_S) as line:
            while True:
                yield line.read(max(1, min(line.in_waiting, CHUNK)))
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise MonitorError(f"cannot read {port}: {error}".splitlines()[0]) from None


class Curves:
    """Position, velocity and attitude over the number of the frame, on a figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty; a window's, or one to save.
    """

    def __init__(self, figure):
        self._panels = []
        grid = figure.subplots(3, 3, sharex=True)
        for axes, quantity in zip(grid.ravel(), NAVIGATION.quantities, strict=True):
            line, = axes.plot([], [], ".", markersize=2, color="#10243e")
            axes.set_title(f"{quantity.meaning.split(',')[0]} ({quantity.unit})", fontsize="small")
            axes.ticklabel_format(useOffset=False)
            axes.grid(color="#e4e4e4", linewidth=0.6)
            axes.spines[["top", "right"]].set_visible(False)
            self._panels.append((axes, line))
        for axes in grid[-1]:
            axes.set_xlabel("frame")

    def show(self, frames):
        """Draw these Frames, and no others."""
        numbers = [frame.number for frame in frames]
        for index, (axes, line) in enumerate(self._panels):
            line.set_data(numbers, [frame.values[index] for frame in frames])
            axes.relim()
            axes.autoscale_view()


class _Window:
    """Curves in a window. Raises: MonitorError without a display."""

    def __init__(self):
        import matplotlib.pyplot as plt

        try:
            figure = plt.figure(figsize=(10, 7), layout="constrained")
            has_window = figure.canvas.required_interactive_framework is not None
        except ImportError:
            has_window = False
        if not has_window:
            raise MonitorError("--live needs a display, and there is none")
        self._curves = Curves(figure)
        self._pause = plt.pause

    def show(self, frames):
        """Draw these Frames, if there are any, and let the window live."""
        if frames:
            self._curves.show(frames)
        self._pause(0.001)


def monitor(chunks, output, *, plot=None, live=False):
    """Decode bytes to a CSV file, until they end or the user interrupts.

    Parameters
    ----------
    chunks : generator of bytes
        As ``read_port`` gives them.
    output : Path
        CSV file: a row a frame, numbers that read back to the same bits.
    plot : Path or None
        PNG file to draw at the end.
    live : bool
        Whether to draw in a window meanwhile.

    Returns
    -------
    FrameDecoder
        With its counts.

    Raises: MonitorError; OSError where nothing can be written.
    """
    with closing(chunks):
        # Port and display are tried before a file is overwritten.
        window = _Window() if live else None
        first = next(chunks, b"")
        output.parent.mkdir(parents=True, exist_ok=True)
        decoder = FrameDecoder()
        frames: deque[Frame] = deque(maxlen=None if plot else WINDOW)
        with output.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(HEADER)

            def keep(new):
                # str of a NumPy number is the shortest decimal that reads back to the same bits.
                writer.writerows((frame.number, frame.status, *map(str, frame.values)) for frame in new)
                file.flush()
                frames.extend(new)

            try:
                for data in chain((first,), chunks):
                    keep(new := decoder.feed(data))
                    if window:
                        window.show(tuple(frames)[-WINDOW:] if new else ())
            except KeyboardInterrupt:
                pass
            finally:
                # What came before a port broke down is worth as much.
                keep(decoder.finish())
                if plot:
                    _picture(plot, frames)
    return decoder


def _picture(path, frames):
    figure = Figure(figsize=(10, 7), dpi=100, layout="constrained")
    Curves(figure).show(frames)
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_png(path)
