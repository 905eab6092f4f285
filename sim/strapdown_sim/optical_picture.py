"""Pictures of a run of the optical attitude sensor. Equal data give PNG files of equal bytes."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from strapdown.blocks.exposure import LOW, TOO_HIGH

from .curves import ESTIMATE, GRID, HARDWARE, REFERENCE, few
from .errors import rms

__all__ = ["PARTS", "SENSOR_COLOURS", "angles_picture", "budget_picture", "exposure_picture", "lines_picture",
           "run_begin"]

_SENSORS = "roll", "pitch"
SENSOR_COLOURS = "#3366aa", "#cc6633"
PARTS = {"total": "circuit - truth", "light": "light: noise, finder", "equations": "equations: float64 - truth",
         "arithmetic": "circuit - float64"}
"""Parts of the error, and their names in pictures."""

_MOST_ROWS, _MOST_COLUMNS = 400, 1024

LEAST_DEG = 1e-6
"""Begin of the scale of errors: half the distance of binary32 numbers at 25°."""


def lines_picture(path, *, title, light, spots, index, line):
    """Draw the lines of an update with threshold, run and centre of gravity, and all lines as a stack.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    title : str
    light : ndarray, shape (2, N, pixels)
        Lines of the roll and of the pitch sensor, counts.
    spots : pair of Spots
        What was found in them.
    index : int
        Update whose lines are drawn.
    line : ndarray of int, shape (N,)
        Numbers of the lines.
    """
    figure = Figure(figsize=(11, 9), dpi=120, layout="constrained")
    grid = figure.subplots(3, 2, height_ratios=(1, 1, 1.2))
    pixels = light.shape[2]
    for ccd, (name, own) in enumerate(zip(_SENSORS, spots, strict=True)):
        whole, near, stack = grid[:, ccd]
        counts = light[ccd, index]
        black, lo, hi = (int(own.results[key][index]) for key in ("black", "lo", "hi"))
        width, good = int(own.results["width"][index]), bool(own.good[index])
        centre = own.position[index] / 4096
        reach = max(8, 2 * width)
        middle = round(centre) if own.position[index] >= 0 else pixels // 2
        for axes in whole, near:
            axes.step(np.arange(pixels), counts, where="mid", color=HARDWARE, linewidth=0.8, label="pixels")
            for level, label, style in ((black, "black level", ":"), (black + lo, "threshold", "-"),
                                        (black + hi, "least peak", "--")):
                axes.axhline(level, color=ESTIMATE, linestyle=style, linewidth=1, label=label)
            axes.set_ylabel("counts")
            axes.set_xlabel("pixel")
        if good:
            _mark_run(near, counts, black + lo, centre, width)
            whole.axvline(centre, color=SENSOR_COLOURS[1], linewidth=0.8)
        whole.set_xlim(-0.5, pixels - 0.5)
        near.set_xlim(middle - reach, middle + reach)
        found = f"position {centre:.3f}, peak {int(own.results['peak'][index])}" if good else "no spot"
        whole.set_title(f"{name} sensor, line {int(line[index])}: {found}", loc="left", fontsize="medium")
        near.legend(loc="upper right", fontsize="x-small", frameon=False)
        _stack(stack, light[ccd], own)
    _finish(figure, grid[:2].ravel(), title)
    _print(figure, path)


def _mark_run(axes, counts, threshold, centre, width):
    """The run that holds a centre: its pixels above the threshold, and the centre."""
    begin = run_begin(counts, threshold, centre, width)
    run = np.arange(begin, begin + width)
    axes.fill_between(run, threshold, counts[run], where=counts[run] > threshold, step="mid", color=REFERENCE,
                      alpha=0.7, label=f"run of {width} pixels from {begin}")
    axes.axvline(centre, color=SENSOR_COLOURS[1], linewidth=1.2, label=f"centre of gravity {centre:.3f}")


def run_begin(counts, threshold, centre, width):
    """First pixel of the run above a threshold that has a centre and a width; pixels.

    A finder cuts long runs, so runs may touch. Of the places where a run of this width can begin, it is that with the
    nearest centre of gravity.
    """
    weight = np.maximum(counts.astype(int) - threshold, 0)
    total, moment = (np.concatenate([[0], np.cumsum(sums)]) for sums in (weight, weight * np.arange(len(weight))))
    first = np.flatnonzero(weight[:len(weight) - width + 1] * weight[width - 1:])
    first = first[(first <= centre) & (centre < first + width)]
    found = (moment[first + width] - moment[first]) / (total[first + width] - total[first])
    return int(first[np.argmin(np.abs(found - centre))])


def _stack(axes, lines, own):
    """All lines as a picture, and the positions in it; of many lines or pixels the brightest ones are drawn."""
    rows = _brightest(lines, _MOST_ROWS, axis=0)
    picture = _brightest(rows, _MOST_COLUMNS, axis=1)
    axes.imshow(picture, aspect="auto", cmap="gray", interpolation="nearest",
                extent=(-0.5, lines.shape[1] - 0.5, len(lines) - 0.5, -0.5))
    updates = np.flatnonzero(own.good)
    axes.plot(own.position[updates] / 4096, updates, ".", color=SENSOR_COLOURS[1], markersize=2, markeredgewidth=0)
    axes.set_xlabel("pixel")
    axes.set_ylabel("update")


def _brightest(values, most, *, axis):
    """At most ``most`` rows or columns: the largest value of each group of neighbours."""
    starts = np.unique(np.linspace(0, values.shape[axis], most, endpoint=False).astype(int))
    return np.maximum.reduceat(values, starts, axis=axis)


def angles_picture(path, *, title, time_s, angles, measured, truth, time_of_errors, reference, parts):
    """Draw roll and pitch over time, and the errors.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    title : str
    time_s : ndarray, shape (N,)
        Seconds.
    angles, measured : Turned
        Angles of the circuit, and those against the rotor, degrees, shape (N,); NaN where nothing is drawn.
    truth : Turned or None
    time_of_errors : ndarray, shape (M,)
        Times of ``reference`` and ``parts``.
    reference : Turned
        Angles in float64.
    parts : dict
        Parts of the error, as from ``errors_of``.
    """
    figure = Figure(figsize=(10, 9), dpi=120, layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    for axis, axes, below in zip(_SENSORS, panels[:2], panels[2:], strict=True):
        behind, label = (truth, "truth") if truth else (reference, "float64")
        marker = "." if few(getattr(angles, axis)) else None
        for time, values, colour, width, name in (
                (time_s if truth else time_of_errors, behind, REFERENCE, 3.2, label),
                (time_s, measured, ESTIMATE, 0.8, "measured against the rotor"),
                (time_s, angles, HARDWARE, 0.9, "circuit")):
            axes.plot(time, getattr(values, axis), color=colour, linewidth=width, label=name, marker=marker)
        axes.set_ylabel(f"{axis} (°)")
        shown = "total" if "total" in parts else "arithmetic"
        if parts:
            below.plot(time_of_errors, getattr(parts[shown], axis), color=HARDWARE, linewidth=0.8, marker=marker)
        below.set_ylabel(f"{axis}:\n{PARTS[shown]} (°)")
    panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize="small")
    panels[-1].set_xlabel("time (s)")
    _finish(figure, panels, title)
    _print(figure, path)


def budget_picture(path, *, title, parts):
    """Draw RMS and largest value of each part of the error, as from ``errors_of``, on a logarithmic scale.

    The scale begins at ``LEAST_DEG``. Of a smaller part only the number is drawn.
    """
    figure = Figure(figsize=(9, 4.5), dpi=120, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axis, axes in zip(_SENSORS, panels, strict=True):
        sizes = [np.abs(getattr(parts[name], axis)) for name in PARTS]
        place = np.arange(len(PARTS))
        for offset, colour, label, values in (
                (-0.2, SENSOR_COLOURS[0], "RMS", [rms(size) for size in sizes]),
                (0.2, SENSOR_COLOURS[1], "largest", [size.max() for size in sizes])):
            bars = axes.barh(-place - offset, np.maximum(values, LEAST_DEG), 0.38, color=colour, label=label)
            axes.bar_label(bars, [f"{value:.2g}" for value in values], padding=3, fontsize="x-small")
        axes.set_yticks(-place, PARTS.values())
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(_plain_number)
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(f"error of {axis} (°)")
    highest = max(np.abs(values).max() for part in parts.values() for values in part)
    # The numbers need room beside the longest bars.
    panels[0].set_xlim(LEAST_DEG, 10 * max(highest, LEAST_DEG))
    panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False, fontsize="small")
    _finish(figure, panels, title)
    _print(figure, path)


def exposure_picture(path, *, title, time_s, exposure_us, peaks, flags):
    """Draw exposure, peak and status over time.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    title : str
    time_s : ndarray, shape (N,)
        Seconds.
    exposure_us : ndarray, shape (N, 2)
        Exposures of the roll and of the pitch sensor.
    peaks : pair of ndarray, shape (N,)
        Peaks above black, counts.
    flags : dict
        Name of a status bit to bools, shape (N,).
    """
    figure = Figure(figsize=(10, 7), dpi=120, layout="constrained")
    exposure, peak, status = figure.subplots(3, 1, sharex=True)
    for ccd, name in enumerate(_SENSORS):
        drawn = {"where": "mid", "color": SENSOR_COLOURS[ccd], "linewidth": 1}
        exposure.step(time_s, exposure_us[:, ccd], label=f"{name} sensor", **drawn)
        peak.step(time_s, peaks[ccd], **drawn)
    exposure.set_yscale("log")
    middle = np.sqrt(np.nanmin(exposure_us) * np.nanmax(exposure_us))
    exposure.set_ylim(min(np.nanmin(exposure_us), middle / 2) / 1.2, max(np.nanmax(exposure_us), middle * 2) * 1.2)
    exposure.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    exposure.yaxis.set_major_formatter(_plain_number)
    exposure.yaxis.set_minor_formatter(NullFormatter())
    exposure.set_ylabel("exposure (µs)")
    exposure.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False, fontsize="small")
    peak.axhspan(LOW, TOO_HIGH, color=GRID, zorder=0)
    peak.set_ylabel("peak above black (counts)")
    for row, flag in enumerate(flags.values()):
        status.plot(time_s[flag], np.full(flag.sum(), row), "|", color=HARDWARE, markersize=8)
    status.set_yticks(np.arange(len(flags)), flags)
    status.set_ylim(len(flags) - 0.5, -0.5)
    status.set_xlabel("time (s)")
    _finish(figure, (exposure, peak, status), title)
    _print(figure, path)


def _plain_number(value, place):
    """Text of a tick; those of matplotlib need the fonts of formulas."""
    return f"{value:g}"


def _plain(axes):
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _finish(figure, panels, title):
    for axes in panels:
        _plain(axes)
    figure.align_ylabels()
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold")


def _print(figure, path):
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
