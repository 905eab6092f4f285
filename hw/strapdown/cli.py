# amaranth: UnusedElaboratable=no
# Operators are made, and their options so checked, before the first is written.
"""The command line: list, generate, replay, explain."""

import re
from pathlib import Path

import click

from strapdown import __version__
from strapdown.config import CONFIGS, ConfigError
from strapdown.cores import ATTITUDE_CORES, attitude_core
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.export import explain, write_core, write_operator

__all__ = ["main"]


class UserError(click.ClickException):
    """A mistake of the user's: one line, exit status 2."""

    exit_code = 2

    def show(self, file=None):
        click.echo(f"strapdown: {self.format_message()}", err=True)


def config_options(function):
    """``--config`` and ``--set``, handed on as one configuration."""
    function = click.option(
        "--set", "changes", metavar="FIELD=VALUE", multiple=True,
        help="Change a field of the configuration, as in --set kp=1. May be repeated.")(function)
    return click.option(
        "--config", "config_name", type=click.Choice(list(CONFIGS)), default="thesis", show_default=True,
        help="Named configuration; 'strapdown list' tells them apart.")(function)


def configuration(config_name, changes):
    """The configuration that the options name, and the options that name it."""
    fields = {}
    for change in changes:
        field, separator, value = change.partition("=")
        if not separator:
            raise UserError(f"--set takes FIELD=VALUE, as in --set kp=1, not {change!r}")
        fields[field.strip()] = value.strip()
    if "name" in fields or "pool" in fields:
        raise UserError("the fields name and pool cannot be changed by --set")
    try:
        config = CONFIGS[config_name].replace(**fields)
    except ConfigError as error:
        raise UserError(str(error)) from None
    return config, " ".join([f"--config {config_name}", *(f"--set {change}" for change in changes)])


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="strapdown")
def main():
    """Navigation cores for FPGAs, written once in Python.

    Generate Verilog, replay recordings through it, and trace a microprogram back to its equation.
    """


@main.command("list")
def list_():
    """List configurations and modules."""
    click.echo("Configurations (--config NAME):")
    for config in CONFIGS.values():
        click.echo(f"  {config.name:<12}{config.description}")
    click.echo("\nModules (--module NAME), with their latency in clock cycles in configuration thesis:")
    for name in ATTITUDE_CORES:
        core = attitude_core(name, CONFIGS["thesis"])
        click.echo(f"  {name:<12}{core.latency:>4}  {core.system.title}")


@main.command()
@config_options
@click.option("--module", "modules", type=click.Choice(list(ATTITUDE_CORES)), multiple=True,
              help="Module to generate; may be repeated. All by default.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=None,
              help="Folder to write to.  [default: build/verilog/CONFIG]")
@click.option("--operators", type=click.Path(file_okay=False, path_type=Path), default=None, metavar="DIR",
              help="Write the thesis's vendor operators (add, sub, mult, ...) to this folder, and no module.")
@click.option("--latency", "latencies", metavar="OPERATOR=N", multiple=True,
              help="Cycles of one of the --operators, as in --latency add=8. May be repeated.")
@click.pass_context
def generate(context, config_name, changes, modules, output, operators, latencies):
    """Write <Module>.v and <Module>.json for each module.

    Each Verilog file is self-contained Verilog-2001. Two runs give equal bytes.
    """
    if operators is not None:
        for name in ("config_name", "changes", "modules", "output"):
            if context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
                option = {"config_name": "config", "changes": "set", "modules": "module"}.get(name, name)
                raise UserError(f"--{option} does not go with --operators, which depend on --latency alone")
        return _generate_operators(operators, latencies)
    if latencies:
        raise UserError("--latency needs --operators DIR; the modules' operators belong to the configuration")
    config, options = configuration(config_name, changes)
    directory = output or Path("build/verilog") / config.name
    for name in modules or ATTITUDE_CORES:
        core = attitude_core(name, config)
        try:
            path = write_core(core, config, directory, f"strapdown generate {options} --module {name}")
        except OSError as error:
            raise UserError(f"cannot write to {directory}: {error.strerror}") from None
        click.echo(f"{path}  {core.latency} cycles")


def _generate_operators(directory, latencies):
    """Write the vendor operators, after all latencies have been found good."""
    chosen = {}
    for change in latencies:
        if not (match := re.fullmatch(r"(\w+)=(-?\d+)", change)):
            raise UserError(f"--latency takes OPERATOR=N, as in --latency add=8, not {change!r}")
        chosen[match[1]] = int(match[2])
    try:
        made = [VendorOperator(name, latency=latency)
                for name, latency in {**dict.fromkeys(VENDOR_OPERATORS), **chosen}.items()]
    except ValueError as error:
        raise UserError(str(error)) from None
    for vendor in made:
        name, latency = vendor.kind.name, vendor.latency
        option = "" if latency == vendor.kind.latency else f" --latency {name}={latency}"
        try:
            path = write_operator(vendor, directory, f"strapdown generate --operators DIR{option}")
        except OSError as error:
            raise UserError(f"cannot write to {directory}: {error.strerror}") from None
        click.echo(f"{path}  {latency} cycles")


@main.command()
@click.argument("recording", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@config_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), required=True,
              help="Folder for attitude.csv, summary.json, attitude.png and the Verilog.")
@click.option("--rate", "sample_rate_hz", type=click.FloatRange(min=0, min_open=True), metavar="HZ",
              help="Sample rate of an x-IMU export, which does not carry one.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder for compiled simulation models, which are kept.")
def replay(recording, config_name, changes, output, sample_rate_hz, build):
    """Replay RECORDING through INS_top in Verilator, sample by sample, from reset.

    RECORDING is a CSV file with units in its header, an x-IMU export, or an .npz archive; see
    docs/recordings.md. The core is generated for the recording's sample rate.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.recordings import RecordingError, read_recording
    from strapdown_sim.replay import replay as run

    config, options = configuration(config_name, changes)
    try:
        data = read_recording(recording, sample_rate_hz=sample_rate_hz)
    except RecordingError as error:
        raise UserError(str(error)) from None
    console = Console(stderr=True)
    columns = (TextColumn("{task.description:<22}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    labels = {"build": "generate and compile", "simulate": "simulate, samples", "compare": "compare"}
    with Progress(*columns, console=console) as bars:
        tasks = {}

        def progress(stage, done, total):
            if stage not in tasks:
                tasks[stage] = bars.add_task(labels[stage], total=total)
            bars.update(tasks[stage], completed=done)

        try:
            result = run(data, config, output, build=build, progress=progress,
                         command=f"strapdown generate {options} --module INS_top")
        except (SimulatorMissingError, ConfigError) as error:
            raise UserError(str(error)) from None
        except OSError as error:
            raise UserError(f"cannot write to {output}: {error.strerror}") from None
    _print_summary(result.summary, output)


def _print_summary(summary, output):
    """The short table at the end of a replay."""
    from rich.console import Console
    from rich.table import Table

    difference = summary["against_float64_reference_deg"]
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_row("recording", f"{summary['recording']}, {summary['sample_rate_hz']:g} Hz")
    table.add_row("configuration", summary["config"])
    table.add_row("samples", f"{summary['samples']:,}")
    table.add_row("cycles per update", str(summary["cycles_per_update"]))
    table.add_row("microseconds at 100 MHz", f"{summary['microseconds_per_update_at_100_mhz']:.2f}")
    table.add_row("largest difference from float64", f"{difference['max']:.6f}°")
    table.add_row("RMS difference from float64", f"{difference['rms']:.6f}°")
    table.add_row("bits that differ from the twin", str(summary["bits_differing_from_twin"]))
    if summary["refused_updates"]:
        table.add_row("refused updates", str(summary["refused_updates"]))
    if recorded := summary.get("against_recorded_reference_deg"):
        known = "" if recorded["heading_known"] else " (heading up to a constant)"
        table.add_row("against the recorded reference",
                      f"RMS {recorded['total_rms']:.2f}°, inclination {recorded['inclination_rms']:.2f}°, "
                      f"heading {recorded['heading_rms']:.2f}°{known}")
    table.add_row("written to", str(output))
    Console().print(table)


@main.command("explain")
@click.argument("module", type=click.Choice(list(ATTITUDE_CORES)))
@config_options
@click.option("--cycle", type=click.IntRange(min=0), help="Show this cycle only, with the whole chain of kernel lines.")
@click.option("--line", "place", metavar="FILE:LINE", help="Show what a kernel line became, as in attitude.py:47.")
def explain_(module, config_name, changes, cycle, place):
    """Lead from a ROM line of MODULE back to the line of the kernel, or the other way.

    Without options: the whole microprogram.
    """
    config, _ = configuration(config_name, changes)
    program = attitude_core(module, config).engine.program
    if cycle is not None and cycle >= program.length:
        raise UserError(f"{module} has cycles 0 to {program.length - 1}, not {cycle}")
    if place is None:
        lines = explain.microprogram_listing(program) if cycle is None else explain.explain_cycle(program, cycle)
    else:
        if not (match := re.fullmatch(r"(?:.*/)?(\w+\.py):(\d+)", place)):
            raise UserError(f"--line takes FILE:LINE, as in --line attitude.py:47, not {place!r}")
        lines = list(explain.explain_line(program, match[1], int(match[2])))
        if not lines:
            raise UserError(f"no operation of {module} comes from {place}")
    for line in lines:
        click.echo(line)
