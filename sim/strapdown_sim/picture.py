"""Pictures of attitude over time, for reports. Equal data give PNG files of equal bytes."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .curves import ESTIMATE, GRID, HARDWARE, REFERENCE, few, span, without_jumps
from .errors import angle_difference

__all__ = ["attitude_picture", "outputs_picture"]

_ANGLES = "roll", "pitch", "yaw"
_ANGLE_COLOURS = "#3366aa", "#cc6633", "#448855"
_GAP = "#f3c6c6"
_ENVELOPE_POINTS = 600


def attitude_picture(path, *, title, time_s, hardware, reference_model, rotation, device=None, bridged=(),
                     labels=("hardware", "float64 reference", "the device's own estimate")):
    """Draw three Euler angles over time and, below them, hardware against the reference model.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    title : str
        Headline.
    time_s : ndarray, shape (N,)
        Time, seconds.
    hardware, reference_model : ndarray, shape (N, 3)
        Roll, pitch and yaw, degrees.
    rotation : ndarray, shape (N,)
        Angle of the rotation from the reference model's attitude to the hardware's, degrees.
    device : ndarray, shape (N, 3), optional
        A third estimate of the same angles; NaN where it has no value.
    bridged : sequence of (float, float)
        Ends of the gaps of the recording, seconds; drawn as bands.
    labels : sequence of str
        Names of hardware, reference model and third estimate, for the legend.

    Notes
    -----
    The magnitude of the difference is drawn on a logarithmic scale, as the largest value in each of at
    most 600 equal groups of samples: that of the rotation, which is the error of the attitude, and those of the Euler
    angles. Near a pitch of ±90° roll and yaw are rotations about almost the same axis, and each may have a large error
    although the attitude is correct. Jumps by a full turn are neither drawn nor counted.
    """
    time_s, hardware, reference_model = (np.asarray(a, float) for a in (time_s, hardware, reference_model))
    figure = Figure(figsize=(9.0, 8.4), dpi=150, layout="constrained")
    *panels, difference = figure.subplots(4, 1, sharex=True, height_ratios=(1, 1, 1, 0.9))

    for k, (axes, angle) in enumerate(zip(panels, _ANGLES, strict=True)):
        handles = [
            *_line(axes, time_s, without_jumps(hardware[:, k]), color=HARDWARE, linewidth=0.8, zorder=3),
            *_line(axes, time_s, without_jumps(reference_model[:, k]), color=REFERENCE, linewidth=3.2, zorder=2)]
        if device is not None:
            # Points, not lines: the estimate may have a lower rate than the samples, or gaps.
            handles += _points(axes, time_s, np.asarray(device, float)[:, k])
        axes.set_ylabel(f"{angle} (°)")
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=(1, 1.5, 3, 4.5, 9, 10)))

    for k, angle in enumerate(_ANGLES):
        size = np.abs(angle_difference(hardware[:, k], reference_model[:, k]))
        _line(difference, *_envelope(time_s, size), color=_ANGLE_COLOURS[k], linewidth=0.9, label=angle)
    _line(difference, *_envelope(time_s, np.asarray(rotation, float)), color=HARDWARE, linewidth=1.6,
          label="rotation angle")
    difference.set_yscale("log", nonpositive="mask")
    difference.set_ylabel("|difference| (°)")
    difference.set_xlabel("time (s)")
    difference.legend(loc="lower right", ncols=4, frameon=False, fontsize="small", title_fontsize="small",
                      title=f"{labels[0]} against {labels[1]}; roll and yaw have little meaning near a pitch of 90°")

    for axes in (*panels, difference):
        _bands(axes, bridged)
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    difference.set_xlim(span(time_s))
    figure.align_ylabels()
    panels[0].set_title(title, loc="left", fontweight="bold", pad=26, parse_math=False)
    # Points of many are too small for a legend.
    small = device is not None and not few(np.asarray(device, float)[:, 0])
    panels[0].legend(handles, labels[:len(handles)], loc="lower left", bbox_to_anchor=(0, 1), ncols=len(handles),
                     frameon=False, fontsize="small", borderaxespad=0.3, markerscale=3 if small else 1)
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})


def outputs_picture(path, *, title, time_s, hardware, reference_model, meanings, recorded=None, bridged=()):
    """Draw outputs of a core over time, each in one panel, with those of the reference model behind them.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    title : str
        Headline.
    time_s : ndarray, shape (N,)
        Time, seconds.
    hardware, reference_model : dict
        Map each output port to numbers, shape (N,).
    meanings : dict
        Maps each output port to its meaning, with the unit.
    recorded : dict, optional
        Maps some output ports to what the log says, shape (N,); NaN where it says nothing.
    bridged : sequence of (float, float)
        Ends of the gaps of the recording, seconds; drawn as bands.

    Notes
    -----
    Outputs whose meaning has the unit degrees have a gap where they jump by more than half a turn.
    """
    time_s = np.asarray(time_s, float)
    figure = Figure(figsize=(9.0, 0.9 + 1.5 * len(hardware)), dpi=150, layout="constrained")
    for axes, (port, values) in zip(figure.subplots(len(hardware), 1, sharex=True, squeeze=False)[:, 0],
                                    hardware.items(), strict=True):
        drawn = without_jumps if "degrees" in meanings[port] else np.asarray
        handles = [*_line(axes, time_s, drawn(values), color=HARDWARE, linewidth=0.8, zorder=3),
                   *_line(axes, time_s, drawn(reference_model[port]), color=REFERENCE, linewidth=3.2, zorder=2)]
        if recorded and port in recorded:
            marked = _points(axes, time_s, recorded[port])
        axes.set_ylabel(port.removeprefix("out_"))
        _bands(axes, bridged)
        axes.set_title(meanings[port], loc="left", fontsize="small", color="0.35")
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("time (s)")
    axes.set_xlim(span(time_s))
    figure.align_ylabels()
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", parse_math=False)
    labels = ["hardware", "kernel in float64", *(["the log's own"] if recorded else [])]
    figure.legend([*handles, *(marked if recorded else [])], labels, loc="outside lower right", ncols=3, frameon=False,
                  fontsize="small")
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})


def _line(axes, time_s, values, *, linewidth, **options):
    """A curve, with its points if they are few."""
    return axes.plot(time_s, values, linewidth=linewidth, marker="." if few(values) else None,
                     markersize=4 + 1.5 * linewidth, markeredgewidth=0, **options)


def _points(axes, time_s, values):
    """The points of a third estimate."""
    return axes.plot(time_s, values, ".", color=ESTIMATE, markersize=8 if few(values) else 2.5, markeredgewidth=0,
                     zorder=1)


def _bands(axes, bridged):
    """Bands over the stretches of time in which samples were filled in."""
    for start, end in bridged:
        axes.axvspan(start, end, color=_GAP, linewidth=0.4, zorder=0)


def _envelope(time_s, size):
    """First time of each group of samples, and the largest value in the group; NaN in place of zero."""
    starts = np.unique(np.linspace(0, len(size), _ENVELOPE_POINTS, endpoint=False).astype(int))
    largest = np.fmax.reduceat(size, starts)
    return time_s[starts], np.where(largest > 0, largest, np.nan)
