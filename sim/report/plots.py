"""Pictures of a report: PNG files of equal bytes for equal figures."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from .anchors import CORE_ANCHORS, OPERATOR_ANCHORS
from .tables import microseconds

__all__ = ["core_plot", "operator_plot"]

_INK, _OURS, _GRADUAL, _ANCHOR, _GRID = "#10243e", "#1f6fb4", "#cc6633", "#8a94a3", "#e4e4e4"


def core_plot(path, report):
    """LUTs against the time of an update, our cores among the public ones, both axes logarithmic.

    ``report`` is that of ``cores.json`` with place and route.
    """
    figure = Figure(figsize=(9.0, 5.6), dpi=150, layout="constrained")
    axes = figure.subplots()
    anchors = [(anchor, anchor.lut) for anchor in CORE_ANCHORS if anchor.lut is not None]
    for anchor, lut in anchors:
        axes.scatter(anchor.microseconds, lut, s=70, linewidth=1.6, zorder=3, edgecolor=_ANCHOR,
                     facecolor="white" if anchor.basis == "estimate" else _ANCHOR)
    for anchor in CORE_ANCHORS:
        if anchor.lut is None:
            axes.axvline(anchor.microseconds, color=_ANCHOR, linewidth=1.0, linestyle=(0, (4, 4)), zorder=1)
            axes.annotate(anchor.design, (anchor.microseconds, 0.985), xycoords=("data", "axes fraction"), rotation=90,
                          xytext=(-4, 0), textcoords="offset points", ha="right", va="top", fontsize=8, color=_ANCHOR)
    points = [(anchor.microseconds, lut, f"{anchor.design}\n{anchor.dsp} DSP", _ANCHOR) for anchor, lut in anchors]
    for names, row in _merged(report["cores"]):
        x, y = microseconds(row), row["xc7"]["lut"]
        axes.scatter(x, y, s=190, marker="*", color=_OURS, zorder=4)
        points.append((x, y, f"{row['module']}, {', '.join(names)}\n{row['xc7']['dsp']} DSP", _OURS))
    for x, y, text, colour in points:
        axes.annotate(text, (x, y), xytext=(9, 0), textcoords="offset points", va="center", fontsize=8.5,
                      color=_INK if colour == _ANCHOR else colour,
                      fontweight="bold" if colour == _OURS else "normal", linespacing=1.25)
    axes.set(xscale="log", yscale="log", xlabel="one update (µs), each at its own clock; ours as routed on an ECP5-6",
             ylabel="LUTs")
    # Room for the labels, which stand to the right.
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    axes.set_xlim(min(xs) / 1.6, max(xs) * 3.2)
    axes.set_ylim(min(ys) / 1.7, max(ys) * 2.2)
    plain = FuncFormatter(lambda value, _: f"{value:,.10g}")
    axes.xaxis.set_major_formatter(plain)
    axes.yaxis.set_major_formatter(plain)
    axes.set_title("Attitude cores: area against time", loc="left", fontweight="bold", pad=24)
    axes.text(0, 1.02, "blue: measured here;  grey: public cores, their authors' figures (open: before routing);  "
              "dashed: software", transform=axes.transAxes, fontsize=8.5, color=_INK)
    _finish(axes)
    _save(figure, path)


def _merged(rows):
    """Cores of equal figures as one point, with the names of all their configurations."""
    merged: dict[tuple, tuple[list, dict]] = {}
    for row in rows:
        key = row["module"], round(microseconds(row), 1), round(row["xc7"]["lut"], -2)
        merged.setdefault(key, ([], row))[0].append(row["config"])
    return merged.values()


def operator_plot(path, report):
    """LUTs and clock frequency of the pipelined operators against their latency.

    Operators with at least three latencies are drawn. ``report`` is that of ``operators.json``; speeds are
    those of what was placed and routed.
    """
    curves = _curves(report["operators"])
    figure = Figure(figsize=(3.1 * max(len(curves), 2), 5.8), dpi=150, layout="constrained")
    panels = figure.subplots(2, len(curves), sharex="col", sharey="row", squeeze=False, height_ratios=(1.15, 1))
    for (operator, policies), (area, speed) in zip(curves.items(), panels.T, strict=True):
        for policy, rows in policies.items():
            colour = _GRADUAL if policy == "gradual" else _OURS
            latency = [row["latency"] for row in rows]
            style = {"color": colour, "linewidth": 1.6, "markersize": 5, "marker": "o", "zorder": 4}
            area.plot(latency, [row["xc7"]["lut"] for row in rows], **style)
            placed = [row for row in rows if "ecp5" in row]
            if placed:
                latency, spread = ([row["latency"] for row in placed],
                                   np.array([row["ecp5"]["fmax_mhz_of_seeds"] for row in placed]))
                speed.plot(latency, np.median(spread, axis=1), **style)
                speed.fill_between(latency, spread.min(axis=1), spread.max(axis=1), color=colour, alpha=0.18,
                                   linewidth=0)
        _draw_anchors(area, operator)
        area.set_title(operator, loc="left", fontweight="bold", fontsize=10)
        area.set_ylim(bottom=0)
        speed.set_ylim(bottom=0)
        speed.set_xlabel("latency (cycles)")
        speed.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=7))
        for axes in (area, speed):
            _finish(axes)
    panels[0, 0].set_ylabel("LUTs, 7 series")
    panels[1, 0].set_ylabel("MHz, ECP5-6, routed")
    figure.align_ylabels()
    handles = [panels[0, 0].plot([], [], color=colour, marker=marker, linestyle=line, label=label)[0]
               for label, colour, marker, line in (("flushes subnormals", _OURS, "o", "-"),
                                                   ("keeps subnormals", _GRADUAL, "o", "-"),
                                                   ("public, flushes", _OURS, "D", ""),
                                                   ("public, keeps", _GRADUAL, "D", ""))]
    for handle in handles[2:]:
        handle.set(markerfacecolor="white", markersize=5)
    figure.legend(handles=handles, loc="outside upper left", ncols=4, frameon=False, fontsize=9)
    _save(figure, path)


def _curves(rows):
    """Operator to subnormal policy to rows of the pipelined ones, in the order of their latency."""
    curves: dict[str, dict[str, list]] = {}
    for row in rows:
        if row["interval"] == 1:
            curves.setdefault(row["operator"], {}).setdefault(row["subnormals"], []).append(row)
    for policies in curves.values():
        for group in policies.values():
            group.sort(key=lambda row: row["latency"])
    return {operator: policies for operator, policies in curves.items()
            if max(len(group) for group in policies.values()) >= 3}


def _draw_anchors(axes, operator):
    """Public pipelined operators, each with its name."""
    for anchor in OPERATOR_ANCHORS:
        if anchor.operator == operator and anchor.pipelined and anchor.latency is not None:
            colour = _GRADUAL if anchor.gradual else _OURS
            axes.plot(anchor.latency, anchor.lut, "D", markersize=5, markerfacecolor="white", markeredgecolor=colour,
                      zorder=3)
            axes.annotate(anchor.design, (anchor.latency, anchor.lut), xytext=(0, 6), textcoords="offset points",
                          ha="center", fontsize=7, color=_ANCHOR)


def _finish(axes):
    axes.grid(color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _save(figure, path):
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
