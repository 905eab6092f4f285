"""Boxes, wires and arrows of block diagrams, as SVG."""

from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

__all__ = ["Block", "arrow", "box", "sheet", "wire", "write_svg"]


class Block:
    """A drawn box: its edges and its centre."""

    def __init__(self, corner, size):
        (self.left, self.bottom), (width, height) = corner, size
        self.right, self.top = self.left + width, self.bottom + height
        self.centre = self.left + width / 2, self.bottom + height / 2


def sheet(width: float, height: float, bottom: float = 0.0) -> tuple[Figure, Axes]:
    """A figure and its axes, on which a unit is a tenth of an inch."""
    figure = Figure(figsize=(width / 10, height / 10))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, width)
    axes.set_ylim(bottom, bottom + height)
    axes.set_axis_off()
    return figure, axes


def box(axes, corner, size, text, colour):
    """A box with a text in its middle. Returns the Block."""
    axes.add_patch(FancyBboxPatch(corner, size[0], size[1], boxstyle="round,pad=0,rounding_size=0.8", facecolor=colour,
                                  edgecolor="black", lw=1))
    block = Block(corner, size)
    axes.text(*block.centre, text, ha="center", va="center", size=10)
    return block


def wire(axes, *points):
    """A line with an arrow at its last point."""
    axes.plot(*zip(*points, strict=True), color="black", lw=1.2)
    arrow(axes, points[-2], points[-1], "")


def arrow(axes, start, end, text, *, both=False):
    """An arrow, or one with two heads, with a text above it."""
    axes.annotate("", xy=end, xytext=start,
                  arrowprops={"arrowstyle": "<|-|>" if both else "-|>", "color": "black", "lw": 1.2,
                              "shrinkA": 0, "shrinkB": 0})
    if text:
        axes.text((start[0] + end[0]) / 2, start[1] + 0.6, text, ha="center", va="bottom", size=9, family="monospace")


def write_svg(figure: Figure, path: Path) -> None:
    """Write a figure. Two runs give equal bytes."""
    with rc_context({"svg.hashsalt": "strapdown", "svg.fonttype": "none"}):
        FigureCanvasSVG(figure).print_svg(path, metadata={"Date": None, "Creator": None})
