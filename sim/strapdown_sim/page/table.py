"""Writes the page of many runs: a figure over all, and a table that can be sorted; the page needs no network."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, NamedTuple
from urllib.parse import quote

from .html import COLOURS, ROW, require_plotly

__all__ = ["Column", "TablePage", "write_table_page"]


class Column(NamedTuple):
    """A column of a table: its key in the rows, its title, and the format of its numbers, empty for words."""

    key: str
    title: str
    form: str = ""

    def text(self, value: Any) -> str:
        """A value as it is shown; empty for None."""
        return "" if value is None else format(value, self.form)


@dataclass(frozen=True, eq=False)
class TablePage:
    """Contents of a page.

    Fields
    ------
    title : str
        Headline.
    columns : sequence of Column
        The first one names the rows.
    rows : sequence of dict
        Values by the keys of columns, None where there is none.
    links : dict
        Maps the names of rows to folders, as paths from the page.
    panels : dict
        Maps the title of each panel of the figure, which has the unit, to the keys of its columns of numbers. Those
        without a value are left out.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]
    links: Mapping[str, str]
    panels: Mapping[str, Sequence[str]]


def write_table_page(path: Path, page: TablePage) -> None:
    """Write the page. Raises: MissingPlotlyError."""
    require_plotly()
    source = files(__package__)
    name = page.columns[0].key
    head = "".join(f'<th scope="col"><button data-numbers="{int(bool(column.form))}">{html.escape(column.title)}'
                   "</button></th>" for column in page.columns)
    lines = []
    for number, row in enumerate(page.rows):
        first, *others = page.columns
        cell = html.escape(first.text(row[name]))
        if link := page.links.get(row[name]):
            cell = f'<a href="{html.escape(quote(link))}/">{cell}</a>'
        lines.append(f'<tr id="row-{number}"><th scope="row">{cell}</th>' + "".join(
            f'<td class="{"number" if column.form else "words"}" data-value="{_value(row[column.key])}">'
            f"{html.escape(column.text(row[column.key]))}</td>" for column in others) + "</tr>")
    text = Template((source / "table.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(page.title), head=head, rows="\n".join(lines),
        script=(source / "table.js").read_text(encoding="utf-8"),
        figure=_figure(page).to_html(full_html=False, include_plotlyjs=True, div_id="curves",
                                     config={"responsive": True, "displaylogo": False}))
    path.write_text(text, encoding="utf-8")


def _value(value):
    """What a cell is sorted by."""
    return "" if value is None else html.escape(str(value))


def _figure(page):
    """The numbers of the panels as points over the rows."""
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    titles = {column.key: column.title for column in page.columns}
    name = page.columns[0].key
    panels = {title: found for title, keys in page.panels.items() if (found := [key for key in keys if key in titles])}
    figure = make_subplots(rows=max(len(panels), 1), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    colours = iter(COLOURS)
    for place, (title, keys) in enumerate(panels.items(), 1):
        for key in keys:
            figure.add_trace(Scatter(
                x=list(range(len(page.rows))), y=[row[key] for row in page.rows], name=titles[key], mode="markers",
                marker={"size": 7, "color": next(colours)}, text=[row[name] for row in page.rows],
                hovertemplate="%{text}: %{y}<extra>%{fullData.name}</extra>"), row=place, col=1)
        figure.update_yaxes(title_text=title, type="log", exponentformat="power", row=place, col=1)
    figure.update_xaxes(title_text="row of the table, before it is sorted", showticklabels=True,
                        row=max(len(panels), 1), col=1)
    figure.update_layout(height=ROW * max(len(panels), 1) * 1.3 + 120, template="plotly_white",
                         margin={"l": 90, "r": 40, "t": 60, "b": 50},
                         legend={"orientation": "h", "yanchor": "bottom", "y": 1.0, "x": 0})
    return figure
