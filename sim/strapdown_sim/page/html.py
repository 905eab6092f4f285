"""Writes the page: curves by plotly, and views at the cursor on canvases; the page needs no network."""

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template

import numpy as np

from ..curves import few, span, without_jumps
from ..extras import MissingExtraError

__all__ = ["COLOURS", "TO_ENU", "Curve", "LineView", "MissingPlotlyError", "Panel", "require_plotly", "write_page"]

POINTS = 4000
"""Most points of a curve. In a longer run each of half as many groups keeps its smallest and its largest value."""

COLOURS = ("#10243e", "#cc6633", "#3d85c6", "#448855", "#8e5ea2", "#b8860b")
"""Colours of curves that have none of their own, in their order."""
ROW, STATUS_ROW, SPACE = 200, 16, 22
"""Height of a panel, and of a status bit, and space between panels, pixels."""

TO_ENU = {"NWU": ((0, -1, 0), (1, 0, 0), (0, 0, 1)), "ENU": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
          "NED": ((0, 1, 0), (1, 0, 0), (0, 0, -1)), "level": ((0, 1, 0), (1, 0, 0), (0, 0, -1))}
"""Rows: east, north and up in the axes of each navigation frame; of "level", which is forward, right, down without the
heading: right, forward and up."""

LETTERS = {"level": ("right", "forward", "up")}
"""Names of these rows in the view, where they are not E, N and up."""


class MissingPlotlyError(MissingExtraError):
    """plotly is not installed."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve: its name for the legend, and its values, shape (N,); NaN where there is none."""

    name: str
    values: np.ndarray
    points: bool = False
    """Whether to draw points without lines between them."""
    turns: bool = False
    """Whether a jump by more than half a turn is a gap: angles in degrees."""
    colour: str | None = None
    width: float = 1.3
    """Width of the line, pixels."""


@dataclass(frozen=True)
class Panel:
    """Curves on one vertical axis with its title, which has the unit; later curves are drawn over earlier ones."""

    title: str
    curves: Sequence[Curve]
    logarithmic: bool = False
    note: str = ""
    """A line of text above the panel."""


@dataclass(frozen=True, eq=False)
class LineView:
    """Lines of one sensor near their spots, one for each time, of which the one at the cursor is drawn.

    Fields
    ------
    name : str
    first : ndarray of int, shape (N,)
        Pixel of the first count.
    counts : ndarray of int, shape (N, W)
    levels : dict
        Maps names to levels in counts, shape (N,).
    begin, width : ndarray of int, shape (N,)
        First pixel and number of pixels of the run; its width is zero where there is none.
    centre : ndarray, shape (N,)
        Centre of gravity of the run, pixels.
    """

    name: str
    first: np.ndarray
    counts: np.ndarray
    levels: Mapping[str, np.ndarray]
    begin: np.ndarray
    width: np.ndarray
    centre: np.ndarray

    def data(self, kept: np.ndarray) -> dict:
        """The view at some of its times, as JSON values."""
        arrays = {"first": self.first, "counts": self.counts, "begin": self.begin, "width": self.width,
                  "centre": np.round(self.centre, 3)}
        return {"name": self.name, "most": int(self.counts.max()),
                "levels": {name: values[kept].tolist() for name, values in self.levels.items()},
                **{name: values[kept].tolist() for name, values in arrays.items()}}


def write_page(path: Path, *, title: str, time_s: np.ndarray, panels: Sequence[Panel],
               status: Mapping[str, np.ndarray], gaps: Sequence[tuple[float, float]] = (),
               quaternion: np.ndarray | None = None, frame: str = "NWU", lines: Sequence[LineView] = (),
               facts: Sequence[tuple[str, str]] = ()) -> None:
    """Write the page of a run.

    Parameters
    ----------
    path : Path
        HTML file to write.
    title : str
        Headline.
    time_s : ndarray, shape (N,)
        Time, seconds.
    panels : sequence of Panel
        Curves, one panel above the other.
    status : dict
        Maps the name of each status bit to bools of shape (N,); drawn as bands. Bits that are never set are left out.
    gaps : sequence of (float, float)
        Ends of the gaps of the recording, seconds.
    quaternion : ndarray, shape (N, 4), or None
        Body to navigation frame, scalar first, NaN where it is not known; None for no attitude view.
    frame : str
        Navigation frame: a key of ``TO_ENU``. The body axes are forward, left, up, or forward, right, down if the frame
        has its third axis down.
    lines : sequence of LineView
        Views of line sensors.
    facts : sequence of (str, str)
        Rows of the table of the run.

    Raises: MissingPlotlyError.
    """
    require_plotly()
    figure = _figure(time_s, panels, {name: bits for name, bits in status.items() if bits.any()}, gaps)
    kept = np.unique(np.linspace(0, len(time_s) - 1, min(POINTS, len(time_s))).astype(int))
    run: dict = {"time": np.round(time_s[kept], 6).tolist(), "attitude": None,
                 "lines": [view.data(kept) for view in lines]}
    if quaternion is not None:
        run["attitude"] = {
            "quaternion": [None if np.isnan(q[0]) else np.round(q, 4).tolist() for q in quaternion[kept]],
            "enu": TO_ENU[frame], "names": LETTERS.get(frame, ("E", "N", "up")), "up": TO_ENU[frame][2][2]}
    rows = "".join(f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in facts)
    source = files(__package__)
    text = Template((source / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(title), facts=rows, script=(source / "page.js").read_text(encoding="utf-8"),
        # The text of a script must not contain the end of the script.
        run=json.dumps(run, allow_nan=False).replace("</", "<\\/"),
        figure=figure.to_html(full_html=False, include_plotlyjs=True, div_id="curves",
                              config={"responsive": True, "displaylogo": False}))
    path.write_text(text, encoding="utf-8")


def require_plotly() -> None:
    """Raises: MissingPlotlyError if plotly is not installed."""
    if find_spec("plotly") is None:
        raise MissingPlotlyError("a page in HTML needs plotly: pip install 'strapdown[html]'")


def _figure(time_s, panels, status, gaps):
    """The curves, and the status bits below them, as a figure of plotly."""
    # It takes a second to import, and is an extra.
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    heights = [ROW] * len(panels) + ([40 + STATUS_ROW * len(status)] if status else [])
    figure = make_subplots(rows=len(heights), cols=1, shared_xaxes=True, row_heights=heights,
                           vertical_spacing=SPACE / sum(heights),
                           subplot_titles=[*(panel.note for panel in panels), *([""] if status else [])])
    figure.update_annotations(font={"size": 11, "color": "#666666"}, x=0, xanchor="left")
    for row, panel in enumerate(panels, 1):
        for place, curve in enumerate(panel.curves):
            time, values = _reduced(time_s, curve)
            colour = curve.colour or COLOURS[place % len(COLOURS)]
            figure.add_trace(Scatter(
                x=time, y=values, name=curve.name, hovertemplate="%{y}", legendgroup=curve.name, connectgaps=False,
                showlegend=all(curve.name != other.name for above in panels[:row - 1] for other in above.curves),
                mode="markers" if curve.points else "lines+markers" if few(values) else "lines",
                marker={"size": 5 + curve.width if few(values) else 3, "color": colour},
                line={"width": curve.width, "color": colour}), row=row, col=1)
        figure.update_yaxes(title_text=panel.title, type="log" if panel.logarithmic else "linear",
                            exponentformat="power", row=row, col=1)
    for name, bits in status.items():
        time, level = _spans(time_s, bits)
        # The marks show spans that are narrower than a pixel.
        figure.add_trace(Scatter(
            x=time, y=[name if set else None for set in level], name=name, mode="lines+markers", showlegend=False,
            connectgaps=False, line={"width": 10, "color": COLOURS[1]},
            marker={"symbol": "line-ns-open", "size": 6, "line": {"width": 1.5, "color": COLOURS[1]}}),
            row=len(heights), col=1)
    if status:
        figure.update_yaxes(type="category", row=len(heights), col=1)
    # All at once: a figure looks through its shapes for each one that is added.
    figure.update_layout(shapes=[
        {"type": "rect", "x0": start, "x1": end, "y0": 0, "y1": 1, "xref": f"x{row}", "yref": f"y{row} domain",
         "fillcolor": "#e06666", "opacity": 0.35, "line": {"width": 0.5}, "layer": "below"}
        for start, end in gaps for row in ("", *range(2, len(heights) + 1))])
    figure.update_xaxes(title_text="time (s)", row=len(heights), col=1)
    figure.update_xaxes(range=span(time_s), showspikes=True, spikemode="across",
                        spikethickness=1, spikecolor="#888888")
    figure.update_layout(height=sum(heights) + 140, hovermode="x unified", hoverlabel={"namelength": -1},
                         template="plotly_white", margin={"l": 90, "r": 40, "t": 60, "b": 50},
                         modebar={"orientation": "v"},
                         legend={"orientation": "h", "yanchor": "bottom", "x": 0,
                                 "y": 1.0 + (SPACE / sum(heights) if any(panel.note for panel in panels[:1]) else 0)})
    return figure


def _reduced(time_s, curve):
    """Time and values of at most about ``POINTS`` points: all of a short curve, the extremes of each group of a long
    one."""
    values = np.array(curve.values, float)
    kept = np.arange(len(values))
    if len(values) > POINTS:
        groups = np.array_split(values, POINTS // 2)
        starts = np.cumsum([0, *(len(group) for group in groups[:-1])])
        extremes = [start + place for start, group in zip(starts, groups, strict=True) if not np.isnan(group).all()
                    for place in (np.nanargmin(group), np.nanargmax(group))]
        kept = np.unique(np.array(extremes, int))
    time, values = time_s[kept], values[kept]
    if curve.turns and not curve.points:
        values = without_jumps(values)
    return time, values


def _spans(time_s, bits):
    """Times and levels at both ends of each span in which a bit is set, and a gap after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(int)))
    time, level = [], []
    for start, end in edges.reshape(-1, 2):
        last = time_s[min(end, len(time_s) - 1)]
        time += [float(time_s[start]), float(last), float(last)]
        level += [True, True, False]
    return time, level
