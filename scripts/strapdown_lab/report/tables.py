"""Measured figures as Markdown tables, with the best public operators and cores for comparison."""

from itertools import groupby

from strapdown.markdown import markdown_table

from .anchors import CORE_ANCHORS, best_known
from .path_words import path_words

__all__ = ["anchor_table", "bus_table", "core_table", "flow_lines", "operator_tables", "path_table"]


def operator_tables(report, operators=None):
    """A table for each operator of ``operators.json``, with a heading; all operators, or the named ones."""
    parts = []
    for name, group in groupby(report["operators"], key=lambda row: row["operator"]):
        if operators is None or name in operators:
            parts += [f"### {name[0].upper()}{name[1:]}", _operator_table(list(group))]
    return "\n\n".join(parts)


def _operator_table(rows):
    return markdown_table(
        ["component", "parameters", "latency:", "interval:", "LUT:", "FF:", "DSP:", "MHz, ECP5:",
         "public, no slower: LUT / FF / DSP"],
        [[f"`{row['component']}`", _parameters(row), row["latency"], row["interval"], row["xc7"]["lut"],
          row["xc7"]["ff"], row["xc7"]["dsp"], _frequency(row), _best(row)] for row in rows])


def _parameters(row):
    """Formats, subnormals and parameters, without the latency, which has a column."""
    words = [" to ".join(row["formats"])] if row["formats"] else []
    if row["subnormals"]:
        words.append(row["subnormals"])
    for name, value in row["parameters"].items():
        if name == "latency":
            continue
        text = name.replace("_", " ")
        if value is not False:
            words.append(text if value is True else f"{value} {text}")
        elif name == "iterative":
            words.append("pipelined")
    return ", ".join(words)


def _frequency(row):
    return f"{row['ecp5']['fmax_mhz']:.0f}" if "ecp5" in row else "–"


def _best(row):
    best = best_known(row["operator"], latency=row["latency"], interval=row["interval"],
                      gradual=row["subnormals"] == "gradual")
    if best is None:
        return "–"
    return f"{best.lut} / {best.ff} / {best.dsp}; {best.design}, {best.latency} cycles"


def core_table(report):
    """The table of ``cores.json``."""
    head = ["module", "configuration", "cycles:", "LUT:", "of these memory:", "FF:", "DSP:", "BRAM:", "MHz, ECP5:"]
    rows = [[f"`{row['module']}`", f"`{row['config']}`", _cycles(row), f"{row['xc7']['lut']:,}",
             row["xc7"]["memory_lut"], f"{row['xc7']['ff']:,}", row["xc7"]["dsp"], f"{row['xc7']['bram']:g}",
             _frequency(row)] for row in report["cores"]]
    if any("ecp5" in row for row in report["cores"]):
        head.append("µs per update:")
        for cells, row in zip(rows, report["cores"], strict=True):
            cells.append(f"{microseconds(row):.2f}" if "ecp5" in row else "–")
    if any("asynchronous_paths" in row for row in report["cores"]):
        head.append("asynchronous paths:")
        for cells, row in zip(rows, report["cores"], strict=True):
            cells.append(row.get("asynchronous_paths", "–"))
    return markdown_table(head, rows)


TARGETS = {"ecp5": "ECP5", "openxc7": "openXC7"}
"""Flows that place and route, with their names in tables."""


def path_table(rows):
    """The clock frequency of cores, and their slowest path in words, for each flow that placed and routed them."""
    return markdown_table(["module", "configuration", "target", "MHz:", "slowest path"], [
        [f"`{row['module']}`", f"`{row['config']}`", name, f"{row[flow]['fmax_mhz']:.0f}",
         path_words(row[flow]["critical"])]
        for row in rows for flow, name in TARGETS.items() if flow in row])


def bus_table(report, cores):
    """The table of ``buses.json``: what a bus adds to the cores of ``cores.json``, and their clock frequency."""
    alone = {row["config"]: row for row in cores["cores"]}
    rows = []
    for row in report["buses"]:
        core = alone.get(row["config"], {})
        added = [f"{row['xc7'][name] - core['xc7'][name]:+,}" if core else "–" for name in ("lut", "ff")]
        share = f"{row['ecp5']['fmax_mhz'] / core['ecp5']['fmax_mhz']:.2f}" if "ecp5" in row and "ecp5" in core else "–"
        rows.append([f"`{row['module']}`", f"`{row['config']}`", "yes" if row["streams"] else "no",
                     f"{row['xc7']['lut']:,}", added[0], f"{row['xc7']['ff']:,}", added[1], _frequency(row), share])
    return markdown_table(["module", "configuration", "streams", "LUT:", "LUT added:", "FF:", "FF added:",
                           "MHz, ECP5:", "of the core's:"], rows)


def _cycles(row):
    """Cycles from one update to the next, and the latency if several updates are in flight."""
    return row["cycles"] if row["cycles"] == row["latency"] else f"{row['cycles']}, latency {row['latency']}"


def microseconds(row):
    """Time of an update at the core's frequency on the ECP5."""
    return row["cycles"] / row["ecp5"]["fmax_mhz"]


def anchor_table():
    """The public attitude cores."""
    def count(value):
        return "–" if value is None else f"{value:,}"

    return markdown_table(["design", "what it computes", "LUT:", "FF:", "DSP:", "µs per update:", "figures"],
                  [[anchor.design, anchor.algorithm, count(anchor.lut), count(anchor.ff), count(anchor.dsp),
                    f"{anchor.microseconds:g}", anchor.basis] for anchor in CORE_ANCHORS])


def flow_lines(report):
    """Description of the measurement, with a list item for each flow and one for the versions."""
    lines = [f"- LUT, FF, DSP, BRAM: `{report['xc7']['command']}` (Xilinx 7 series)"]
    if "ecp5" in report:
        lines.append(f"- MHz: `{report['ecp5']['command']}`, median of seeds "
                     + ", ".join(map(str, report["ecp5"]["seeds"])))
    if "openxc7" in report:
        lines.append(f"- MHz, openXC7: `{report['openxc7']['command']}`, median of seeds "
                     + ", ".join(map(str, report["openxc7"]["seeds"])) + f"; {report['openxc7']['version']}")
    lines.append("- " + ", ".join(f"{name} {version}" for name, version in report["versions"].items()))
    return "\n".join(lines)
