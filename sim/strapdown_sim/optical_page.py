"""The page of a run of the optical attitude sensor: its curves, status bits, attitude, and the lines at the cursor."""

from pathlib import Path
from typing import Any

import numpy as np

from .curves import ESTIMATE, HARDWARE, REFERENCE
from .drivers.optical import OpticalRun, Spots
from .optical_picture import PARTS, SENSOR_COLOURS, run_begin
from .page import COLOURS, Curve, LineView, Panel, write_page
from .recordings.log import quaternion_from_angles

__all__ = ["lost_lines", "optical_page"]

WINDOW = 64
"""Pixels of a line in the view: more than twice the width of a usual run."""

AXES = "roll", "pitch"


def lost_lines(line: np.ndarray) -> np.ndarray:
    """Lines lost before each update but the first, shape (N - 1,), by the numbers of all, which have 16 bits."""
    return (np.diff(line) - 1) % 65536


def optical_page(path: Path, *, title: str, time_s: np.ndarray, run: OpticalRun, spots: tuple[Spots, Spots],
                 angles: Any, measured: Any, truth: Any, reference: Any, parts: dict[str, Any], rows: slice,
                 exposure_us: np.ndarray, flags: dict[str, np.ndarray], facts: list[tuple[str, str]]) -> None:
    """Write the page of a run with N updates.

    Parameters
    ----------
    path : Path
        HTML file to write.
    title : str
    time_s : ndarray, shape (N,)
        Middle of the exposures of the roll sensor, seconds; NaN without a line. Such updates are left out.
    run, spots
        See ``judged``.
    angles, measured : Turned
        Angles of the circuit, and those against the rotor, degrees, shape (N,); NaN where nothing is drawn.
    truth : Turned or None
    reference, parts, rows
        As from ``errors_of``.
    exposure_us : ndarray, shape (N, 2)
        Of the roll and of the pitch sensor.
    flags : dict
        Name of a status bit to bools, shape (N,).
    facts : list of (str, str)
        Rows of the table.

    Raises: MissingPlotlyError.
    """
    count, shown = len(time_s), np.isfinite(time_s)

    def all_updates(values):
        padded = np.full(count, np.nan)
        padded[rows] = values
        return padded

    panels = [Panel(f"{axis} (°)", [
        Curve("truth", getattr(truth, axis)[shown], colour=REFERENCE, width=4) if truth else
        Curve("float64", all_updates(getattr(reference, axis))[shown], colour=REFERENCE, width=4),
        Curve("measured against the rotor", getattr(measured, axis)[shown], colour=ESTIMATE),
        Curve("circuit", getattr(angles, axis)[shown], colour=HARDWARE)]) for axis in AXES]
    if parts:
        # The whole error is drawn over its parts.
        drawn = [(part, colour) for part, colour in zip(PARTS, COLOURS, strict=False) if part in parts][::-1]
        panels += [Panel(f"error of {axis} (°)", [
            Curve(PARTS[part], all_updates(getattr(parts[part], axis))[shown], colour=colour)
            for part, colour in drawn]) for axis in AXES]
    panels += [_of_sensors(title, values, shown, logarithmic) for title, values, logarithmic in (
        ("position (pixels)", [np.where(own.position < 0, np.nan, own.position / 4096) for own in spots], False),
        ("exposure (µs)", exposure_us.T, True),
        ("peak above black (counts)", [own.results["peak"] for own in spots], False))]
    times = time_s[shown]
    ends = np.flatnonzero(lost_lines(run.line[shown])) + 1
    write_page(path, title=title, time_s=times, panels=panels,
               status={name: bits[shown] for name, bits in flags.items()},
               gaps=[(float(times[end - 1]), float(times[end])) for end in ends],
               quaternion=quaternion_from_angles(angles.roll, angles.pitch, np.zeros(count))[shown], frame="level",
               lines=[_view(f"{axis} sensor", light[shown], own, shown)
                      for axis, light, own in zip(AXES, run.light, spots, strict=True)], facts=facts)


def _of_sensors(title, values, shown, logarithmic):
    """A panel with a curve of each sensor."""
    return Panel(title, [Curve(f"{axis} sensor", np.asarray(own, float)[shown], colour=colour)
                         for axis, own, colour in zip(AXES, values, SENSOR_COLOURS, strict=True)], logarithmic)


def _view(name, light, own, shown):
    """The lines of a sensor near their spots; near the brightest pixel, where there is no good one."""
    results = {key: values[shown] for key, values in own.results.items()}
    good, pixels = own.good[shown], light.shape[1]
    centre = np.where(good, own.position[shown] / 4096, light.argmax(axis=1))
    first = np.clip(np.rint(centre).astype(int) - WINDOW // 2, 0, pixels - WINDOW)
    threshold = results["black"] + results["lo"]
    begin = [run_begin(*line) if is_good else 0 for is_good, *line in zip(
        good.tolist(), light, threshold, centre, results["width"], strict=True)]
    return LineView(name, first, np.take_along_axis(light, first[:, None] + np.arange(WINDOW), axis=1),
                    {"black": results["black"], "threshold": threshold, "least peak": results["black"] + results["hi"]},
                    np.array(begin), np.where(good, results["width"], 0), centre)
