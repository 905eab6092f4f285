"""Reports of Vivado: the resources and the timing of an implemented design."""

import re
from pathlib import Path

__all__ = ["VivadoReportError", "read_timing", "read_utilization"]

RESOURCES = {
    "LUT": ("Slice LUTs", "CLB LUTs"),
    "LUT as memory": ("LUT as Memory",),
    "register": ("Slice Registers", "CLB Registers"),
    "block RAM": ("Block RAM Tile",),
    "DSP": ("DSPs",),
}
"""Maps each resource to its names in the reports of the families."""


class VivadoReportError(ValueError):
    """A file is not the report that it should be. The message is one line that names file and remedy."""


def read_utilization(path: Path) -> dict[str, tuple[float, float]]:
    """What a report of ``report_utilization`` says: resource to number used and number available.

    Raises: VivadoReportError, also for a report by hierarchy; OSError.
    """
    rows: dict[str, tuple[float, float]] = {}
    for line in _text(path).splitlines():
        if line.startswith("|"):
            name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            # The titles of the columns have no number. Versions differ in the columns between Used and Available.
            if len(cells) >= 4 and all(re.fullmatch(r"<?\d+(\.\d+)?", cell) for cell in cells):
                rows.setdefault(name.rstrip("*"), (float(cells[0]), float(cells[-2])))
    found = {resource: rows[name] for resource, names in RESOURCES.items() for name in names if name in rows}
    if missing := [resource for resource in RESOURCES if resource not in found]:
        raise VivadoReportError(f"{path} does not say how many {missing[0]} the design takes: name the file that "
                                "report_utilization -file has written")
    return found


def read_timing(path: Path) -> dict[str, tuple[float, float]]:
    """What a report of ``report_timing_summary`` says: clock to its period and its worst slack of setup, in ns.

    Raises: VivadoReportError, also if no clock has a path from register to register; OSError.
    """
    text = _text(path)
    periods = {name: float(period) for name, period in re.findall(
        r"^ *(\S+) +\{[\d. ]+\} +([\d.]+) +[\d.]+ *$", text, re.MULTILINE)}
    table = text.partition("| Intra Clock Table")[2].partition("\n| ")[2].partition("\n| ")[0]
    slacks = {name: float(slack) for name, slack in re.findall(r"^ *(\S+) +(-?\d+\.\d+) ", table, re.MULTILINE)}
    found = {name: (periods[name], slack) for name, slack in slacks.items() if name in periods}
    if not found:
        raise VivadoReportError(f"{path} has no clock with a slack: name the file that report_timing_summary -file has "
                                "written")
    return found


def _text(path):
    return path.read_text(encoding="utf-8", errors="replace")
