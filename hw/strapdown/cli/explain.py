"""The commands that show the inside of a core: explain, schedule."""

import re
from pathlib import Path

import click

from strapdown.cores import main_module
from strapdown.export import explain as explanations
from strapdown.files import written_together

from .common import UserError, config_options, core_of, target_of, writing

__all__ = ["explain", "schedule"]

TARGET = "MODULE|CONFIG|FILE.py:NAME"


def _core_and_module(target, config_name, changes, module=None):
    """The core that a command shows, and its configuration and module."""
    config, modules, _ = target_of(target, config_name, changes, () if module is None else (module,))
    module = modules[0] if modules else main_module(config)
    return core_of(config, module), config, module


@click.command()
@click.argument("target", metavar=f"[{TARGET}]", required=False)
@config_options
@click.option("--module", metavar="NAME", default=None,
              help="Module whose schedule is shown.  [default: the configuration's main module]")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=None, metavar="FILE",
              help="Picture to write, .png or .svg.  [default: build/schedule/CONFIG_MODULE.png]")
def schedule(target, config_name, changes, module, output):
    """Draw the schedule of a module, unit against cycle, and list its critical path with kernel lines."""
    from strapdown.export.gantt import schedule_picture, schedule_summary

    core, config, module = _core_and_module(target, config_name, changes, module)
    plan = core.engine.program.schedule
    path = output or Path("build/schedule") / f"{config.name}_{module}.png"
    if path.suffix not in (".png", ".svg"):
        raise UserError(f"--output takes a .png or .svg file, not {path}")
    for line in schedule_summary(plan, core.latency):
        click.echo(line)
    with writing(path), written_together(path.parent) as folder:
        schedule_picture(plan, core.latency, f"{module}, configuration {config.name}", folder / path.name)
    click.echo(f"picture: {path}")


@click.command()
@click.argument("target", metavar=TARGET)
@config_options
@click.option("--module", metavar="NAME", default=None,
              help="Module that is explained.  [default: the configuration's main module]")
@click.option("--cycle", type=click.IntRange(min=0), help="Show only this cycle, with the whole chain of kernel lines.")
@click.option("--line", "place", metavar="FILE:LINE|FILE:FUNCTION",
              help="Show the operations of a kernel line or function, as in attitude.py:47.")
def explain(target, config_name, changes, module, cycle, place):
    """Lead from a ROM line of a module to the line of the kernel, or from the kernel to the ROM.

    Without options, print the whole microprogram.
    """
    core, _, module = _core_and_module(target, config_name, changes, module)
    program = core.engine.program
    if cycle is not None and cycle >= program.length:
        raise UserError(f"{module} has cycles 0 to {program.length - 1}, not {cycle}")
    if place is None:
        lines = explanations.program_listing(program) if cycle is None else \
            explanations.explain_cycle(program, cycle)
    else:
        if not (match := re.fullmatch(r"(?:.*/)?(\w+\.py):(?:(\d+)|(\w+))", place)):
            raise UserError(f"--line takes FILE:LINE or FILE:FUNCTION, as in --line attitude.py:47, not {place!r}")
        lines = list(explanations.explain_line(program, match[1], int(match[2]) if match[2] else match[3]))
        if not lines:
            raise UserError(f"no operation of {module} comes from {place}")
    for line in lines:
        click.echo(line)
