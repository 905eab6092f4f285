"""What is in a log: streams with rates, gaps and ranges, what a replay would use, and a picture of it."""

import os
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .curves import GRID, few
from .recordings import Log, Recording, Stream
from .recordings.clock import gaps, mended
from .recordings.merge import saturated

__all__ = ["UNITS", "StreamFacts", "inspect", "inspection_picture"]

UNITS = {"gyro": "deg/s", "accel": "m/s²", "mag": "µT", "velocity": "m/s", "pressure": "Pa", "position": "°, °, m",
         "attitude": ""}
"""Units of the values of streams, for people."""

_COLOURS = "#3366aa", "#cc6633", "#448855", "#10243e"
_BAND = "#f3c6c6"
_POINTS = 4000


class StreamFacts(NamedTuple):
    """Facts of a stream.

    Fields
    ------
    samples : int
        Samples that hold numbers.
    rate_hz : float
        Mean rate; NaN of a single sample.
    lost, longest_gap_s : int, float
        Samples that are missing, and the longest gap.
    faults : dict
        Faults of the time stamps, as in a Timing.
    lowest, highest : ndarray, shape (k,)
        Range of each axis.
    length : tuple of float
        Mean and standard deviation of the length of the vector.
    saturated : int
        Samples with an axis at the end of the sensor's range.
    """

    samples: int
    rate_hz: float
    lost: int
    longest_gap_s: float
    faults: dict[str, int]
    lowest: np.ndarray
    highest: np.ndarray
    length: tuple[float, float]
    saturated: int


def inspect(log: Log) -> tuple[StreamFacts, ...]:
    """Facts of the streams of a log, in its order."""
    return tuple(_facts(stream) for stream in log.streams)


def _facts(stream: Stream) -> StreamFacts:
    clock = mended(stream.time_s)
    values = stream.values[clock.rows]
    good = np.isfinite(values).all(axis=1)
    values, time_s = values[good], clock.time_s[good]
    nothing = np.full(stream.values.shape[1], np.nan)
    if len(time_s) < 2:
        return StreamFacts(len(time_s), np.nan, 0, 0.0, clock.faults, nothing, nothing, (np.nan, np.nan), 0)
    found = gaps(time_s).lost
    length = np.linalg.norm(values, axis=1)
    return StreamFacts(
        len(time_s), float((len(time_s) - 1) / (time_s[-1] - time_s[0])), sum(gap.lost for gap in found),
        max((gap.end_s - gap.start_s for gap in found), default=0.0), clock.faults, values.min(axis=0),
        values.max(axis=0), (float(length.mean()), float(length.std())),
        int(saturated(stream.kind, values).sum()) if stream.kind in ("gyro", "accel") else 0)


def inspection_picture(path: str | os.PathLike, log: Log, recording: Recording | None) -> None:
    """Draw the streams of a log over time, and bands where a replay would bridge gaps.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    log : Log
    recording : Recording or None
        What a replay would use; None if it would refuse the log.
    """
    streams = [stream for stream in log.streams if np.isfinite(stream.time_s).sum() > 1] or list(log.streams)
    figure = Figure(figsize=(9.0, 0.9 + 1.5 * len(streams)), dpi=120, layout="constrained")
    for axes, stream in zip(figure.subplots(len(streams), 1, sharex=True, squeeze=False)[:, 0], streams, strict=True):
        clock = mended(stream.time_s)
        every = max(len(clock.rows) // _POINTS, 1)
        for axis, colour in zip(stream.values[clock.rows].T, _COLOURS, strict=False):
            axes.plot(clock.time_s[::every], axis[::every], ".", markersize=6 if few(axis) else 1.5, markeredgewidth=0,
                      color=colour)
        for start, end in recording.timing.bridged if recording is not None and recording.timing is not None else ():
            axes.axvspan(start, end, color=_BAND, linewidth=0.4, zorder=0)
        axes.set_title(f"{stream.kind}: {stream.name}", loc="left", fontsize="small", color="0.35",
                       parse_math=False)
        axes.set_ylabel(UNITS[stream.kind])
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("time (s)")
    figure.suptitle(f"{log.title}: {log.form}", x=0.01, ha="left", fontweight="bold", parse_math=False)
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
