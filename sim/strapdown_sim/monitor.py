"""The monitor of the serial link: writes frames as CSV and draws them."""

import csv
import errno
import io
import os
import select
from collections import deque
from contextlib import closing, suppress
from itertools import chain

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.files import written_together
from strapdown.link import FRAME_TYPES, Frame, FrameDecoder

__all__ = ["Curves", "MonitorError", "monitor", "read_port"]

CHUNK = 1 << 16
PATIENCE_S = 0.1
"""Longest wait for bytes before the window is redrawn."""

WINDOW = 3000
"""Number of frames that a window shows."""


def _titles(type):
    """What the numbers of a frame are, and their units."""
    return [f"{quantity.meaning.split(',')[0]} ({quantity.unit})" for quantity in FRAME_TYPES[type].quantities]


class MonitorError(ValueError):
    """A port or file cannot be read. The message is one line."""


def read_port(port, baud_rate=None):
    """Read the bytes of a file or port as they arrive.

    Parameters
    ----------
    port : path-like or str
        A recorded file, a FIFO, a terminal with its present settings, or, with ``baud_rate``, a serial port.
    baud_rate : int or None
        Rate of the serial port, 8N1; needs the package pyserial.

    Yields
    ------
    bytes
        Empty if nothing arrived for a tenth of a second.

    Raises: MonitorError.
    """
    return _read_file(port) if baud_rate is None else _read_serial(port, baud_rate)


def _read_file(port):
    try:
        # The terminal must not become the controlling one: its Ctrl-C would end this program.
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
                # The terminal no longer exists: its other side was closed, or its adapter was disconnected.
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
    """The numbers of frames over the number of the frame, on a figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty; that of a window, or one to save.
    type : int
        Type of the frames.
    """

    def __init__(self, figure, type):
        self._panels = []
        grid = figure.subplots(3, 3, sharex=True)
        for axes, title in zip(grid.ravel(), _titles(type), strict=True):
            line, = axes.plot([], [], ".", markersize=2, color="#10243e")
            axes.set_title(title, fontsize="small")
            axes.ticklabel_format(useOffset=False)
            axes.grid(color="#e4e4e4", linewidth=0.6)
            axes.spines[["top", "right"]].set_visible(False)
            self._panels.append((axes, line))
        for axes in grid[-1]:
            axes.set_xlabel("frame")

    def show(self, frames):
        """Draw these Frames and no others."""
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
            self._figure = plt.figure(figsize=(10, 7), layout="constrained")
            has_window = self._figure.canvas.required_interactive_framework is not None
        except ImportError:
            has_window = False
        if not has_window:
            raise MonitorError("--live needs a display, but none is available")
        self._curves = None
        self._pause = plt.pause

    def show(self, frames):
        """Draw these Frames, if there are any, and process the events of the window."""
        if frames:
            self._curves = self._curves or Curves(self._figure, frames[0].type)
            self._curves.show(frames)
        self._pause(0.001)


def monitor(chunks, output, *, plot=None, live=False, every=1):
    """Decode bytes to a CSV file until they end or the user interrupts.

    All frames have the type of the first one; others are left out.

    Parameters
    ----------
    chunks : generator of bytes
        From ``read_port``.
    output : Path
        CSV file: one row per frame, with enough digits to restore the same bits. The first frame creates it.
    plot : Path or None
        PNG file to draw at the end.
    live : bool
        True to draw in a window at the same time.
    every : int
        Updates from one frame to the next.

    Returns
    -------
    FrameDecoder
        With its counts.

    Raises: MonitorError, also if the bytes contain no frame, in which case no file is written; OSError if the output
    cannot be written. The file always has complete rows only.
    """
    with closing(chunks):
        # Port and display are opened before a file is overwritten.
        window = _Window() if live else None
        first = next(chunks, b"")
        decoder = FrameDecoder(every)
        frames: deque[Frame] = deque(maxlen=None if plot else WINDOW)
        with _Rows(output) as rows:
            def keep(new):
                rows.append(new := [frame for frame in new if frame.type == (frames or new)[0].type])
                frames.extend(new)

            try:
                for data in chain((first,), chunks):
                    keep(new := decoder.feed(data))
                    if window:
                        window.show(tuple(frames)[-WINDOW:] if new else ())
            except KeyboardInterrupt:
                pass
            finally:
                # Frames that arrived before a port failed are kept.
                keep(decoder.finish())
                if plot and frames:
                    _picture(plot, frames)
    if not decoder.frames:
        raise MonitorError(f"no frame was found in {decoder.skipped_bytes} bytes: are they of SINS_uart or "
                           "OPT_top, at this baud rate?")
    return decoder


class _Rows:
    """A CSV file that the first frames create: a context manager that closes it.

    A row that cannot be written completely is removed.
    """

    def __init__(self, path):
        self._path, self._file, self._size = path, None, 0

    def __enter__(self):
        return self

    def append(self, frames):
        """Write a row for each frame immediately. Raises: OSError."""
        if not frames:
            return
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if self._file is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("wb", buffering=0)
            writer.writerow(("Frame", "Status", *(title[0].upper() + title[1:] for title in _titles(frames[0].type))))
        # str of a NumPy number is the shortest decimal that restores the same bits.
        writer.writerows((frame.number, frame.status, *map(str, frame.values)) for frame in frames)
        data, sent = text.getvalue().encode(), 0
        try:
            while sent < len(data):
                sent += self._file.write(data[sent:])
        except OSError:
            sent = data.rfind(b"\n", 0, sent) + 1
            # A terminal or a pipe cannot be truncated.
            with suppress(OSError):
                self._file.truncate(self._size + sent)
                self._file.seek(0, os.SEEK_END)
            raise
        finally:
            self._size += sent

    def __exit__(self, *error):
        if self._file is not None:
            self._file.close()


def _picture(path, frames):
    figure = Figure(figsize=(10, 7), dpi=100, layout="constrained")
    Curves(figure, frames[0].type).show(frames)
    with written_together(path.parent) as folder:
        FigureCanvasAgg(figure).print_png(folder / path.name)
