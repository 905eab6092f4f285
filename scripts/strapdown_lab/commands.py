"""Commands that the laboratory adds to ``strapdown``: report, families, compare and accuracy."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import click

from strapdown.cli import UserError
from strapdown.cli.common import show_table, writing
from strapdown.cli.jobs import job_options
from strapdown.cli.progress import progress_bars
from strapdown.cores import CONFIGS
from strapdown.files import written_together
from strapdown_sim.cache import Cache
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.jobs import JobsError
from strapdown_sim.recordings import RecordingError

from .report.compare import CommitError, comparison_table, earlier_circuits, present_circuits
from .report.compare import compare as compare_circuits
from .report.cores import BUSES, CORES
from .report.families import measure_families, variants
from .report.measure import bus_design, core_design, measure, operator_design, provenance
from .report.operators import MEASURED
from .report.report import write_buses, write_cores, write_families, write_json, write_operators, write_page
from .report.vivado import VivadoReportError, read_timing, read_utilization
from .studies.accuracy import measure as measure_accuracy
from .studies.accuracy import write_accuracy
from .synthesis import FAMILIES, OpenXc7, PathReportError, ToolMissingError

__all__ = ["accuracy", "compare", "families", "report"]


@click.command()
@click.option("--operators", is_flag=True, help="Report operators, and nothing else without its option.")
@click.option("--cores", is_flag=True, help="Report cores, and nothing else without its option.")
@click.option("--buses", is_flag=True, help="Report cores behind a bus, and nothing else without its option.")
@click.option("--only", metavar="OPERATOR", multiple=True,
              help="Report only the operators of this name, as in --only add. May be repeated.")
@click.option("--config", "config_names", type=click.Choice(list(CONFIGS)), multiple=True,
              help="Report only the core of this configuration. May be repeated.")
@click.option("--place/--no-place", default=True, show_default=True,
              help="Place and route, which takes most of the time and gives the clock frequency.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/report"),
              show_default=True, help="Folder for JSON, tables and pictures.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder that keeps the results of the tools and the simulation models.")
@click.option("--xilinx", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="DIR",
              help="Also place and route for a 7-series part, by the openXC7 toolchain in this folder: nextpnr-xilinx "
                   "and a chip database.")
@click.option("--vivado", type=click.Path(exists=True, dir_okay=False, path_type=Path), nargs=2, default=None,
              metavar="UTILIZATION TIMING",
              help="Measure nothing, but print what Vivado's reports of a design say: the files of report_utilization "
                   "and report_timing_summary.")
@job_options
def report(operators, cores, buses, only, config_names, place, output, build, xilinx, vivado, **where):
    """Synthesise operators, cores, and cores behind a bus, place and route them, and compare them with public ones.

    Results are kept: an interrupted run continues where it stopped.
    """
    if vivado:
        print_vivado(*vivado)
        return
    if xilinx and not place:
        raise UserError("--xilinx needs place and route: omit --no-place")
    names = list(dict.fromkeys(entry.operator for entry in MEASURED))
    if unknown := [name for name in only if name not in names]:
        raise UserError(f"no operator is called {unknown[0]!r}: choose from {', '.join(names)}")
    wanted = {"cores": cores or (config_names and not buses), "buses": buses, "operators": operators or only}
    entries_of: dict[str, list] = {
        "cores": [entry for entry in CORES if not config_names or entry.config.name in config_names],
        "buses": [entry for entry in BUSES if not config_names or entry.config.name in config_names],
        "operators": [entry for entry in MEASURED if not only or entry.operator in only]}
    chosen = {kind: entries for kind, entries in entries_of.items() if wanted[kind] or not any(wanted.values())}
    designs: dict[str, Callable] = {"cores": partial(core_design, build=build), "buses": bus_design,
                                    "operators": operator_design}
    cache = Cache(build / "report" / "cache")
    reports = {}
    try:
        toolchain = OpenXc7.found(xilinx) if xilinx else None
        source = provenance(place=place, xilinx=toolchain)
        with progress_bars() as bars:
            for kind, entries in chosen.items():
                if entries:
                    task = bars.add_task(kind, total=sum(
                        1 + (place and entry.placed) * (1 + (toolchain is not None)) for entry in entries))
                    rows = measure(map(designs[kind], entries), cache, place=place,
                                   progress=partial(bars.advance, task), xilinx=toolchain, **where)
                    reports[kind] = {**source, kind: rows}
    except (JobsError, PathReportError, SimulatorMissingError, ToolMissingError) as error:
        raise UserError(str(error)) from None
    with writing(output), written_together(output) as folder:
        if "cores" in reports:
            write_cores(folder, reports["cores"])
        if "buses" in reports:
            write_buses(folder, reports["buses"])
        if "operators" in reports:
            write_operators(folder, reports["operators"])
        path = write_page(folder, **reports)
    click.echo(output / path.name)


def print_vivado(utilization, timing):
    """Print resources and clocks of a design that Vivado has reported. Raises: UserError."""
    try:
        resources, clocks = read_utilization(utilization), read_timing(timing)
    except VivadoReportError as error:
        raise UserError(str(error)) from None
    rows = [(resource, f"{used:,g} of {available:,g}") for resource, (used, available) in resources.items()]
    for clock, (period, slack) in clocks.items():
        met = "met" if slack >= 0 else f"missed by {-slack:g} ns"
        rows.append((clock, f"{1000 / (period - slack):.3g} MHz; the constraint of {1000 / period:.3g} MHz is {met}"))
    show_table(rows)


@click.command()
@click.option("--config", "config_names", type=click.Choice(list(CONFIGS)),
              multiple=True, help="Measure only this configuration. May be repeated.")
@click.option("--family", "family_names", type=click.Choice([family.name for family in FAMILIES]), multiple=True,
              help="Measure only in this family. May be repeated.")
@click.option("--place/--no-place", default=True, show_default=True, help="Place and route, for the clock frequency.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/families"),
              show_default=True, help="Folder for families.json and families.md.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder that keeps the results of the tools.")
@job_options
def families(config_names, family_names, place, output, build, **where):
    """Synthesise the configurations for several FPGA families, and place and route them where a free router exists.

    Results are kept: an interrupted run continues where it stopped.
    """
    measured = [variant for variant in variants() if not config_names or variant.config.name in config_names]
    chosen = [family for family in FAMILIES if not family_names or family.name in family_names]
    try:
        with progress_bars() as bars:
            task = bars.add_task("families", total=sum(len(variant.families(chosen)) for variant in measured))
            result = measure_families(measured, chosen, Cache(build / "report" / "cache"), place=place,
                                      progress=partial(bars.advance, task), **where)
    except (JobsError, ToolMissingError) as error:
        raise UserError(str(error)) from None
    with writing(output), written_together(output) as folder:
        path = write_families(folder, result)
    click.echo(output / path.name)


@click.command()
@click.argument("commit")
@click.option("--config", "config_names", type=click.Choice(list(CONFIGS)), multiple=True,
              help="Compare only the core of this configuration. May be repeated.")
@click.option("--place/--no-place", default=True, show_default=True, help="Place and route, for the clock frequency.")
@click.option("--seeds", type=click.IntRange(min=1), default=5, show_default=True,
              help="Number of seeds of the placer; the frequency is their median.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/compare"),
              show_default=True, help="Folder for compare.json and compare.md.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder that keeps the results of the tools.")
@job_options
def compare(commit, config_names, place, seeds, output, build, **where):
    """Compare cycles, resources and clock frequency of the cores with those of an earlier COMMIT.

    Both are generated and measured by the same tools in one run. Results are kept: an interrupted run continues where
    it stopped.
    """
    entries = [entry for entry in CORES if not config_names or entry.config.name in config_names]
    placed = [entry.config.name for entry in entries if place and entry.placed]
    try:
        with writing(output), progress_bars() as bars:
            before = earlier_circuits(commit, entries, build / "compare" / "before")
            after = present_circuits(entries, build / "compare" / "after")
            tools = sum(1 + (circuit.config in placed) for circuit in (*before, *after))
            task = bars.add_task("circuits", total=tools)
            rows = compare_circuits(before, after, placed, tuple(range(1, seeds + 1)),
                                    Cache(build / "report" / "cache"), partial(bars.advance, task), **where)
    except (CommitError, JobsError, ToolMissingError) as error:
        raise UserError(str(error)) from None
    with writing(output), written_together(output) as folder:
        write_json(folder / "compare.json", {"commit": commit, "seeds": seeds, "cores": rows})
        (folder / "compare.md").write_text(comparison_table(rows) + "\n", encoding="utf-8")
    click.echo(output / "compare.md")


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/accuracy"),
              show_default=True, help="Folder for accuracy.json, accuracy.md and accuracy.png.")
@job_options
def accuracy(recordings, output, **where):
    """Run the filters of this project and published filters on all .npz files of the folders RECORDINGS.

    Needs the packages vqf, imufusion and ahrs, which 'make accuracy' installs.
    """

    with progress_bars() as bars:
        task = bars.add_task("filters on recordings", total=None)
        try:
            result = measure_accuracy(
                *recordings, progress=lambda done, total: bars.update(task, completed=done, total=total), **where)
        except (JobsError, RecordingError) as error:
            raise UserError(str(error)) from None
        except ModuleNotFoundError as error:
            raise UserError(f"the package {error.name} is not installed: 'make accuracy' installs it") from None
    if not result["recordings"]:
        raise UserError(f"{', '.join(map(str, recordings))}: no .npz recording with a reference orientation")
    with writing(output), written_together(output) as folder:
        path = write_accuracy(result, folder)
    click.echo(output / path.name)
