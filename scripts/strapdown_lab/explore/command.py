"""The command ``strapdown explore``."""

from functools import partial
from pathlib import Path

import click

from strapdown.cli import UserError
from strapdown.cli.common import command_line, config_options, configuration, target_of, writing
from strapdown.cli.jobs import job_options
from strapdown.cli.progress import progress_of_stages
from strapdown.config import ConfigError
from strapdown.cores import modules_of, system_of
from strapdown.files import written_together
from strapdown_lab.report.measure import provenance
from strapdown_lab.report.report import write_json
from strapdown_lab.report.tables import flow_lines
from strapdown_lab.synthesis import ToolMissingError
from strapdown_sim.cache import Cache
from strapdown_sim.jobs import JobsError, workers

from .front import Wish, measured, pick
from .grid import grid_of
from .page import explore_picture, page
from .search import Limits, Search

__all__ = ["explore"]

STAGES = {"schedules": "schedules", "operators": "operators", "synthesis": "synthesis",
          "place and route": "place and route"}


def _wish_option(name, kind, text):
    return click.option(f"--{name}", type=kind, help=text)


@click.command()
@click.argument("target", metavar="[CONFIG|FILE.py:NAME]", required=False)
@config_options
@click.option("--module", metavar="NAME", default=None, help="Module that is explored.  [default: the last that has "
              "equations]")
@_wish_option("us", click.FloatRange(min=0, min_open=True), "Pick a pool whose update takes at most so many µs.")
@_wish_option("cycles", click.IntRange(min=1), "Pick one whose update takes at most so many cycles.")
@_wish_option("mhz", click.FloatRange(min=0, min_open=True), "Pick one with at least this clock frequency.")
@_wish_option("lut", click.IntRange(min=1), "Pick one with at most so many LUTs.")
@_wish_option("ff", click.IntRange(min=1), "Pick one with at most so many flip-flops.")
@_wish_option("dsp", click.IntRange(min=0), "Pick one with at most so many DSP blocks.")
@_wish_option("bram", click.FloatRange(min=0), "Pick one with at most so many block RAMs of 36 Kbit.")
@click.option("--vary", "varied", metavar="FIELD[=VALUE,...]", multiple=True,
              help="Vary only this field of the pool, as in --vary adders=1,2. May be repeated.  [default: all]")
@click.option("--pools", type=click.IntRange(min=1), default=Limits.pools, show_default=True,
              help="Most pools that are scheduled.")
@click.option("--syntheses", type=click.IntRange(min=0), default=Limits.syntheses, show_default=True,
              help="Most pools that are synthesised; the named configurations always are.")
@click.option("--routes", type=click.IntRange(min=0), default=Limits.routes, show_default=True,
              help="Most pools that are placed and routed; the named configurations always are.")
@click.option("--seeds", type=click.IntRange(min=1), default=len(Limits.seeds), show_default=True,
              help="Number of seeds of the placer; the frequency is their median.")
@click.option("--place/--no-place", default=True, show_default=True,
              help="Place and route. Without it there is no clock frequency, so operators keep their timing, and the "
                   "time of an update is in cycles.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=None,
              help="Folder for explore.json, explore.md and explore.png.  [default: build/explore/CONFIG]")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder that keeps the results of scheduler and tools.")
@job_options
def explore(target, config_name, changes, module, varied, pools, syntheses, routes, seeds, place, output, build, jobs,
            scheduler, **limits):
    """Find pools of operators for a kernel, and pick one.

    Many pools are scheduled. Those that may be among the best in time, LUTs, DSP blocks and block RAMs are synthesised,
    and the best of these are placed and routed. Results are kept: an interrupted run continues where it stopped.
    """
    config, modules, options = target_of(target, config_name, changes, () if module is None else (module,))
    with_equations = [name for name in modules_of(config) if name not in config.assemblies()]
    module = modules[0] if modules else with_equations[-1]
    wish = Wish(**limits)
    if not place and (wish.us or wish.mhz):
        raise UserError("--us and --mhz need the clock frequency: omit --no-place")
    configured = partial(configuration, _name(target, config_name, config), changes)
    try:
        grid = grid_of(config, system_of(module, config), timing=place, vary=_varied(varied))
        source = provenance(place=place)
        with (progress_of_stages(STAGES) as progress, workers(jobs, scheduler) as schedulers,
              workers(jobs, scheduler, threads=True) as tools):
            search = Search(configured, config, module, grid, Cache(build / "report" / "cache"), schedulers, tools,
                            Limits(pools, syntheses, routes, tuple(range(1, seeds + 1))), wish, place, progress)
            search.run()
    except (ConfigError, JobsError, ToolMissingError, ValueError) as error:
        raise UserError(str(error)) from None
    if not search.complete:
        raise UserError("no pool went through the tools: " + next(
            (row["failed"] for row in search.rows if "failed" in row), "the engine refuses all"))
    if place:
        source["ecp5"]["seeds"] = list(range(1, seeds + 1))
    result = _result(search, source, wish, options)
    directory = output or Path("build/explore") / config.name
    with writing(directory), written_together(directory) as folder:
        write_json(folder / "explore.json", result)
        explore_picture(folder / "explore.png", result)
        (folder / "explore.md").write_text(page(result), encoding="utf-8")
    for note in result["notes"][:4]:
        click.echo(note)
    chosen = result["pick"]
    if chosen is None:
        raise UserError(f"no pool has {result['wish']}: {_nearest(result)}; {directory / 'explore.md'} has all")
    click.echo(f"picked: no. {chosen['number']}, {result['rule']}: {chosen['figures']}")
    click.echo(chosen["command"])
    click.echo(directory / "explore.md")


def _name(target, config_name, config):
    """The name of the configuration, as on the command line."""
    named = config_name or target
    return named if named and (named == config.name or ".py:" in named) else config.name


def _varied(words):
    found = {}
    for word in words:
        name, _, values = word.partition("=")
        found[name.strip()] = tuple(value.strip() for value in values.split(",") if value.strip())
    return found


def _result(search, source, wish, options):
    """The figures of a search, with the pick and notes."""
    result = source | search.result()
    measured_rows = [row for row in result["pools"] if "xc7" in row]
    for number, row in enumerate((row for row in result["pools"] if "xc7" in row or "failed" in row), 1):
        row["number"] = number
    complete = [row for row in measured_rows if not search.place or "ecp5" in row]
    chosen = pick(complete, wish, measured)
    for row in result["pools"]:
        row["picked"] = row is chosen
    result["rule"], result["pick"] = wish.rule, None
    result["wish"] = wish.rule.partition(" with ")[2]
    if chosen is not None:
        words = [word for name, value in chosen["settings"].items() for word in ("--set", f"{name}={value}")]
        result["pick"] = {"number": chosen["number"], "settings": chosen["settings"], "figures": _figures(chosen),
                          "command": command_line("generate", *options, *words, "--module", search.module)}
    result["notes"] = _notes(result, len(measured_rows), len(complete), search)
    return result


def _figures(row):
    own = measured(row)
    time = f"{own['us']:.2f} µs, {own['mhz']:.0f} MHz, " if own["us"] else ""
    return f"{time}{own['cycles']} cycles, {own['lut']:,} LUT, {own['dsp']} DSP, {own['bram']:g} BRAM"


def _nearest(result):
    rows = [row for row in result["pools"] if "ecp5" in row or ("ecp5" not in result and "xc7" in row)]
    quick = min(rows, key=lambda row: measured(row)["time"])
    small = min(rows, key=lambda row: measured(row)["lut"])
    return f"the fastest has {_figures(quick)}, the smallest {_figures(small)}"


def _notes(result, synthesised, complete, search):
    """What was measured, what was estimated, and how."""
    among = ("those of the named configurations among them" if result["grid"] <= search.limits.pools else
             "those of the named configurations, and those beside the front of the estimates")
    lines = [f"the grid has {result['grid']:,} pools; {result['scheduled']:,} were scheduled, {among}; "
             f"the engine refused {result['refused']:,}",
             f"{synthesised} were synthesised{f', and {complete} of these placed and routed' if search.place else ''}"]
    if result["left"]:
        lines.append(f"{result['left']} more are on the front of the estimates, but were not measured: raise "
                     f"--syntheses{' and --routes' if search.place else ''}")
    if failed := [row["failed"] for row in result["pools"] if "failed" in row]:
        lines.append(f"{len(failed)} failed in a tool: {failed[0]}")
    for name, words in (("lut", "LUTs, estimated from the operators alone and the parts of the engine"),
                        ("mhz", "MHz, estimated as that of the slowest operator alone")):
        if name in result["errors"]:
            error = result["errors"][name]
            lines.append(f"{words}: error to the measured value {error['median']:+.1%} in the median, "
                         f"{error['largest']:+.1%} at most")
    lines += ["cycles are those of the schedule, without simulation; FF, LUT, DSP and BRAM of the table are by Yosys; "
              + ("MHz without ≤ are after place and route" if search.place else "there is no clock frequency"),
              "axes of the grid: " + "; ".join(f"{name} {', '.join(map(str, values))}"
                                               for name, values in result["axes"].items())]
    return [*lines, *(line.removeprefix("- ") for line in flow_lines(result).splitlines())]
