"""A report on disk: figures as JSON, tables as a Markdown page, pictures."""

import json

from .families import family_lines, family_table
from .plots import core_plot, operator_plot
from .tables import anchor_table, bus_table, core_table, flow_lines, operator_tables, path_table

__all__ = ["write_buses", "write_cores", "write_families", "write_json", "write_operators", "write_page"]

CORES_FILE, FAMILIES_FILE, OPERATORS_FILE, PAGE = "cores.json", "families.json", "operators.json", "report.md"
BUSES_FILE = "buses.json"
CORE_PICTURE, OPERATOR_PICTURE = "cores.png", "operators.png"


def write_operators(directory, report):
    """Write operators.json and, if they were placed and routed, operators.png."""
    write_json(directory / OPERATORS_FILE, report)
    if "ecp5" in report:
        operator_plot(directory / OPERATOR_PICTURE, report)


def write_cores(directory, report):
    """Write cores.json and, if they were placed and routed, cores.png."""
    write_json(directory / CORES_FILE, report)
    if "ecp5" in report:
        core_plot(directory / CORE_PICTURE, report)


def write_buses(directory, report):
    """Write buses.json."""
    write_json(directory / BUSES_FILE, report)


def write_families(directory, report):
    """Write families.json and a page with its table; returns the page's path."""
    write_json(directory / FAMILIES_FILE, report)
    path = directory / "families.md"
    path.write_text(f"# FPGA families\n\n{family_table(report)}\n\n{family_lines(report)}\n", encoding="utf-8")
    return path


def write_json(path, report):
    """Write a report as JSON, and its folder if there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def write_page(directory, *, cores=None, buses=None, operators=None):
    """Write the page with the tables of the existing reports; returns its path."""
    parts = ["# Report"]
    if cores:
        parts += ["## Cores", core_table(cores)]
        if any("ecp5" in row for row in cores["cores"]):
            parts += ["Slowest paths:", path_table(cores["cores"])]
        parts += ["Public cores, for comparison:", anchor_table(), flow_lines(cores)]
    if buses:
        parts += ["## Cores behind a bus", bus_table(buses, cores or {"cores": []}), flow_lines(buses)]
    if operators:
        parts += ["## Operators", operator_tables(operators), flow_lines(operators)]
    path = directory / PAGE
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path
