"""Pictures of a report. Equal figures give PNG files of equal bytes."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from .anchors import CORE_ANCHORS, OPERATOR_ANCHORS
from .drawing import INK, OURS, around, finish, labelled_figure, place_labels, save
from .tables import microseconds

__all__ = ["core_plot", "operator_plot"]

_MARKERS = "o^sv"
"""Markers of the curves of one colour in a panel."""

_GRADUAL, _ANCHOR = "#cc6633", "#8a94a3"


def core_plot(path, report):
    """LUTs against the time of an update, for our cores and public ones; both axes are logarithmic.

    ``report`` is that of ``cores.json`` with place and route.
    """
    figure = labelled_figure(9.0, 6.0)
    axes = figure.subplots()
    software = [anchor for anchor in CORE_ANCHORS if anchor.lut is None]
    public = [(anchor, anchor.microseconds, anchor.lut) for anchor in CORE_ANCHORS if anchor.lut is not None]
    labels = [((time, lut), f"{anchor.design}\n{anchor.dsp} DSP", {"color": INK}) for anchor, time, lut in public]
    # The public cores compute in at most binary32, so navigators in binary64 are not drawn beside them.
    drawn = [row for row in report["cores"] if "ecp5" in row and row["module"] != "SINS_top"]
    for names, row in _merged(drawn):
        labels.append(((microseconds(row), row["xc7"]["lut"]), f"{', '.join(names)}\n{row['xc7']['dsp']} DSP",
                       {"color": OURS, "fontweight": "bold"}))
    for anchor, time, lut in public:
        axes.scatter(time, lut, s=70, linewidth=1.6, zorder=3, edgecolor=_ANCHOR,
                     facecolor="white" if anchor.basis == "estimate" else _ANCHOR)
    ours = labels[len(public):]
    axes.scatter([x for (x, _), _, _ in ours], [y for (_, y), _, _ in ours], s=150, marker="*", color=OURS, zorder=4)
    notes = []
    for anchor in software:
        axes.axvline(anchor.microseconds, color=_ANCHOR, linewidth=1.0, linestyle=(0, (4, 4)), zorder=1)
        notes.append(axes.annotate(f"{anchor.design}, {anchor.microseconds:g} µs", (anchor.microseconds, 0.985),
                                   xycoords=("data", "axes fraction"), rotation=90, xytext=(3, 0),
                                   textcoords="offset points", ha="left", va="top", fontsize=8, color=_ANCHOR))

    axes.set(xscale="log", yscale="log", ylabel="LUTs",
             xlabel="one update (µs), public cores at their own clock, ours as routed on an ECP5-6")
    xs, ys = zip(*(point for point, _, _ in labels), strict=True)
    axes.set_xlim(min(xs) / 2.5, max(xs) * 3)
    axes.set_ylim(min(ys) / 3, max(ys) * 2)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axes.set_title("Navigation cores: area against time", loc="left", fontweight="bold", pad=24)
    axes.text(0, 1.02, "blue: measured here;  grey: public cores, their authors' figures (open: before routing);  "
              "dashed: software", transform=axes.transAxes, fontsize=8.5, color=INK)
    finish(axes)
    figure.draw_without_rendering()  # The axes do not change after this.
    place_labels(axes, labels, [note.get_window_extent() for note in notes], fontsize=8)
    save(figure, path)


def _merged(rows):
    """Cores with almost equal figures as one point, that of the first, with the names of all their configurations."""
    merged: list[tuple[list, dict]] = []
    for row in rows:
        names = next((names for names, other in merged if _alike(row, other)), None)
        if names is None:
            merged.append((names := [], row))
        names.append(row["config"])
    return merged


def _alike(row, other):
    """True if two cores are the same module, with equal DSPs, and within 10 % in LUTs and time: their stars overlap."""
    return (row["module"], row["xc7"]["dsp"]) == (other["module"], other["xc7"]["dsp"]) and np.allclose(
        (microseconds(row), row["xc7"]["lut"]), (microseconds(other), other["xc7"]["lut"]), rtol=0.1, atol=0)


def operator_plot(path, report):
    """LUTs and clock frequency of the pipelined operators against their latency.

    Operators with at least three latencies are drawn. ``report`` is that of ``operators.json``; speeds are
    those of the placed and routed variants.
    """
    curves = _curves(report["operators"])
    columns = 3
    blocks = -(-len(curves) // columns)
    figure = labelled_figure(9.0, 4.4 * blocks + 0.4)
    panels = figure.subplots(2 * blocks, columns, squeeze=False, height_ratios=(1.5, 1) * blocks)
    for axes in panels.flat:
        axes.set_visible(False)
    named: list[tuple] = []
    for index, (operator, series) in enumerate(curves.items()):
        block, column = divmod(index, columns)
        area, speed = panels[2 * block:2 * block + 2, column]
        _draw_operator(area, speed, operator, series)
        rows = [row for each in series for row in each.rows]
        labels = [((anchor.latency, anchor.lut), anchor.design, {"color": _ANCHOR}) for anchor in _anchors(operator)]
        if len({each.colour for each in series}) < len(series):
            # Several curves have the same colour, so they have names.
            labels += [((each.rows[-1]["latency"], each.rows[-1]["xc7"]["lut"]), each.name, {"color": each.colour})
                       for each in series]
        named.append((area, labels, [(row["latency"], row["xc7"]["lut"]) for row in rows]))
    for axes in panels.flat:
        finish(axes)
    figure.align_ylabels()
    ours: dict[str, Any] = {"marker": "o", "linestyle": "-", "markersize": 5}
    public: dict[str, Any] = {"marker": "D", "linestyle": "none", "markersize": 5, "markerfacecolor": "white"}
    handles = [Line2D([], [], color=OURS, label="flushes subnormals", **ours),
               Line2D([], [], color=_GRADUAL, label="keeps subnormals", **ours),
               Line2D([], [], color=OURS, label="public, flushes", **public),
               Line2D([], [], color=_GRADUAL, label="public, keeps", **public)]
    figure.legend(handles=handles, loc="outside upper left", ncols=4, frameon=False, fontsize=9)
    figure.draw_without_rendering()  # The axes do not change after this.
    for area, labels, points in named:
        place_labels(area, labels, [around(area, point) for point in points], fontsize=7)
    save(figure, path)


def _draw_operator(area, speed, operator, series):
    """LUTs of an operator in the upper panel, its frequency in the lower panel, with a common latency axis."""
    area.set_visible(True)
    bottom = area
    used: Counter = Counter()
    for each in series:
        rows, colour = each.rows, each.colour
        style = {"color": colour, "linewidth": 1.6, "markersize": 5, "marker": _MARKERS[used[colour]], "zorder": 4}
        used[colour] += 1
        area.plot([row["latency"] for row in rows], [row["xc7"]["lut"] for row in rows], **style)
        if placed := each.placed:
            bottom = speed
            latency = [row["latency"] for row in placed]
            spread = np.array([row["ecp5"]["fmax_mhz_of_seeds"] for row in placed])
            speed.plot(latency, [_megahertz(row) for row in placed], **style)
            speed.fill_between(latency, spread.min(axis=1), spread.max(axis=1), color=colour, alpha=0.18, linewidth=0)
    for anchor in _anchors(operator):
        area.plot(anchor.latency, anchor.lut, "D", markersize=5, markerfacecolor="white", zorder=3,
                  markeredgecolor=_GRADUAL if anchor.gradual else OURS)
    area.set_title(operator, loc="left", fontweight="bold", fontsize=9)
    area.set_ylabel("LUTs, 7 series", fontsize=8)
    area.set_ylim(0, area.get_ylim()[1] * 1.08)
    area.margins(x=0.2)  # room for names
    area.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=7))
    if bottom is speed:
        speed.set_visible(True)
        speed.sharex(area)
        speed.set_ylim(0, speed.get_ylim()[1] * 1.08)
        speed.set_ylabel("MHz, ECP5-6", fontsize=8)
        area.tick_params(labelbottom=False)
    bottom.set_xlabel("latency (cycles)", fontsize=8)
    for axes in (area, speed):
        axes.tick_params(labelsize=8)


class _Curve(NamedTuple):
    """The points of one line: an operator with the same formats and policy, in the order of its latency."""

    name: str
    colour: str
    rows: list

    @property
    def placed(self):
        """The rows that were placed and routed."""
        return [row for row in self.rows if "ecp5" in row]


def _megahertz(row):
    """Clock frequency of a row that was placed and routed: the median of its seeds."""
    return np.median(row["ecp5"]["fmax_mhz_of_seeds"])


def _curves(rows):
    """Maps each pipelined operator with at least three latencies to its curves."""
    curves: dict[str, dict[tuple, list]] = {}
    for row in rows:
        if row["interval"] == 1:
            kinds = [name.replace("_", " ") for name, value in row["parameters"].items() if value is True]
            name = ", ".join([" to ".join(row["formats"]), *kinds])
            curves.setdefault(row["operator"], {}).setdefault((row["subnormals"], name), []).append(row)
    return {operator: [
        _Curve(name, _GRADUAL if policy == "gradual" else OURS,
               sorted(group, key=lambda row: row["latency"])) for (policy, name), group in groups.items()]
        for operator, groups in curves.items()
        if max(len({row["latency"] for row in group}) for group in groups.values()) >= 3}


def _anchors(operator):
    """Public pipelined operators with known latency."""
    return [anchor for anchor in OPERATOR_ANCHORS
            if anchor.operator == operator and anchor.pipelined and anchor.latency is not None]
