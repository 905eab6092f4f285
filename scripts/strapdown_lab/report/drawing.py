"""Common parts of pictures: colours, labels at their points, axes, files."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

__all__ = ["INK", "OURS", "around", "finish", "labelled_figure", "place_labels", "save"]

INK, OURS, _GRID = "#10243e", "#1f6fb4", "#e4e4e4"

# Possible places of a label at its point, the best first: offset in points, alignment.
_PLACES = (((9, 0), "left", "center"), ((-9, 0), "right", "center"), ((0, 9), "center", "bottom"),
           ((0, -9), "center", "top"), ((7, 5), "left", "bottom"), ((7, -5), "left", "top"),
           ((-7, 5), "right", "bottom"), ((-7, -5), "right", "top"))
_MARKER = 11
"""Half the side of the box around a marker, in pixels."""


def labelled_figure(width, height):
    """A figure for ``place_labels``, in inches. Its canvas keeps the renderer that measures the labels. The canvas that
    a figure has by itself would make a renderer, with all pixels of the figure, for each measurement."""
    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def place_labels(axes, labels, obstacles, **style):
    """Write labels (point, text, style) at their points, where they cover the least and are not ambiguous.

    ``axes`` are those of a ``labelled_figure``. ``obstacles`` are boxes in pixels; the points themselves join them.
    """
    taken = [*obstacles, *(around(axes, point) for point, _, _ in labels)]
    for point, text, own_style in labels:
        own, tried = around(axes, point), []
        others = [around(axes, other) for other, _, _ in labels if other != point]
        for place, (offset, horizontal, vertical) in enumerate(_PLACES):
            label = axes.annotate(text, point, xytext=offset, textcoords="offset points", ha=horizontal, va=vertical,
                                  linespacing=1.2, zorder=5, **style, **own_style,
                                  path_effects=[withStroke(linewidth=2.5, foreground="white")])
            label.set_in_layout(False)
            box = label.get_window_extent()
            label.set_visible(False)
            outside = box.width * box.height - _overlap(box, axes.bbox)
            nearer = sum(max(0, _distance(box, own) + _MARKER - _distance(box, other)) for other in others)
            # Covering another object is bad; a place outside the axes or at another point is worse.
            tried.append((sum(_overlap(box, other) for other in taken) + 4 * outside + 50 * nearer, place, label, box))
        *_, label, box = min(tried, key=lambda trial: trial[:2])
        label.set_visible(True)
        taken.append(box)


def around(axes, point):
    """Box around the marker of a point."""
    x, y = axes.transData.transform(point)
    return Bbox.from_extents(x - _MARKER, y - _MARKER, x + _MARKER, y + _MARKER)


def _distance(a, b):
    """Distance of two boxes."""
    return np.hypot(max(0, a.x0 - b.x1, b.x0 - a.x1), max(0, a.y0 - b.y1, b.y0 - a.y1))


def _overlap(a, b):
    common = Bbox.intersection(a, b)
    return 0 if common is None else common.width * common.height


def finish(axes):
    """Give axes a grid, and no frame at top and right."""
    axes.grid(color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def save(figure, path):
    """Write a figure as PNG; equal figures give equal bytes."""
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
