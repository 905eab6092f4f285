# amaranth: UnusedElaboratable=no
# Operators are made, and their options so checked, before the first is written.
"""The command line: list, generate, design, replay, monitor, explain, schedule."""

import io
import math
import re
import sys
from importlib.metadata import entry_points
from pathlib import Path

import click

from strapdown import __version__
from strapdown.config import CONFIGS, SINS, AttitudeConfig, ConfigError, FlightConfig, SinsConfig
from strapdown.cores import MODULES, main_module, make_core, modules_of, sins_uart, system_of
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.design import METHODS, smallest_order
from strapdown.design.picture import error_picture
from strapdown.export import explain, write_core, write_link, write_operator
from strapdown.export.stream import stream_listing
from strapdown.kernel.microprogram import Microprogram
from strapdown.kernel.schedule import Schedule

__all__ = ["UserError", "main"]


class UserError(click.ClickException):
    """A mistake of the user's: one line, exit status 2."""

    exit_code = 2

    def show(self, file=None):
        click.echo(f"strapdown: {self.format_message()}", err=True)


def core_of(config, module):
    """The core ``module`` in a configuration that has it."""
    try:
        return make_core(module, config)
    except ValueError as error:
        raise UserError(str(error)) from None


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


class Commands(click.Group):
    """The commands of this file, and those that an installed package adds under the entry point strapdown.commands."""

    def list_commands(self, context):
        return sorted({*super().list_commands(context), *entry_points(group="strapdown.commands").names})

    def get_command(self, context, name):
        if command := super().get_command(context, name):
            return command
        if added := entry_points(group="strapdown.commands", name=name):
            return next(iter(added)).load()
        if name in LAB_COMMANDS:
            raise UserError(f"'{name}' needs a checkout of the project: there, 'make setup' installs it")
        return None


LAB_COMMANDS = "accuracy", "report"
"""Commands of the laboratory, which is not in the wheel."""


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="strapdown")
def main():
    """Navigation cores for FPGAs, written once in Python.

    Generate Verilog, replay recordings through it, and trace a microprogram back to its equation.
    """
    for stream in sys.stdout, sys.stderr:
        # A degree sign must not end a replay where the terminal's encoding has none.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


@main.command("list")
def list_():
    """List configurations and modules."""
    click.echo("Configurations (--config NAME):")
    for config in CONFIGS.values():
        click.echo(f"  {config.name:<16}{config.description}")
    click.echo("\nModules (--module NAME), each with the first configuration that has it:")
    for name in MODULES:
        config = next(config for config in CONFIGS.values() if name in modules_of(config))
        click.echo(f"  {name:<12}{config.name:<16}{system_of(name, config).title}")


@main.command()
@config_options
@click.option("--module", "modules", type=click.Choice(MODULES), multiple=True,
              help="Module to generate; may be repeated. All of the configuration by default.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=None,
              help="Folder to write to.  [default: build/verilog/CONFIG]")
@click.option("--operators", type=click.Path(file_okay=False, path_type=Path), default=None, metavar="DIR",
              help="Write the thesis's vendor operators (add, sub, mult, ...) to this folder, and no module.")
@click.option("--latency", "latencies", metavar="OPERATOR=N", multiple=True,
              help="Cycles of one of the --operators, as in --latency add=8. May be repeated.")
@click.option("--link", type=click.Path(file_okay=False, path_type=Path), default=None, metavar="DIR",
              help="Write SINS_uart, which is SINS_top with a serial link, to this folder, and no other module.")
@click.option("--clock-hz", type=click.FloatRange(min=1, max=1e12), default=100e6, show_default=True,
              help="Clock of the --link.")
@click.option("--baud", "baud_rate", type=click.IntRange(min=1), default=921_600, show_default=True,
              help="Bits a second of the --link.")
@click.pass_context
def generate(context, config_name, changes, modules, output, operators, latencies, link, clock_hz, baud_rate):
    """Write <Module>.v and <Module>.json for each module.

    Each Verilog file is self-contained Verilog-2001. Two runs give equal bytes.
    """
    def given(name):
        return context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT

    if link is not None:
        for name in ("modules", "output", "operators", "latencies"):
            if given(name):
                option = {"modules": "module", "latencies": "latency"}.get(name, name)
                raise UserError(f"--{option} does not go with --link")
        return _generate_link(link, config_name if given("config_name") else SINS.name, changes, clock_hz, baud_rate)
    for name, option in ("clock_hz", "clock-hz"), ("baud_rate", "baud"):
        if given(name):
            raise UserError(f"--{option} needs --link DIR")
    if operators is not None:
        for name in ("config_name", "changes", "modules", "output"):
            if given(name):
                option = {"config_name": "config", "changes": "set", "modules": "module"}.get(name, name)
                raise UserError(f"--{option} does not go with --operators, which depend on --latency alone")
        return _generate_operators(operators, latencies)
    if latencies:
        raise UserError("--latency needs --operators DIR; the modules' operators belong to the configuration")
    config, options = configuration(config_name, changes)
    directory = output or Path("build/verilog") / config.name
    for name in modules or modules_of(config):
        core = core_of(config, name)
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


def _generate_link(directory, config_name, changes, clock_hz, baud_rate):
    """Write SINS_uart."""
    config, options = configuration(config_name, changes)
    if not isinstance(config, SinsConfig):
        raise UserError(f"--link needs a configuration of SINS_top, and {config_name} is of {main_module(config)}")
    try:
        linked = sins_uart(config, clock_hz=clock_hz, baud_rate=baud_rate)
    except ValueError as error:
        raise UserError(str(error)) from None
    command = f"strapdown generate --link DIR {options} --clock-hz {clock_hz:.15g} --baud {baud_rate}"
    try:
        path = write_link(linked, config, directory, command)
    except OSError as error:
        raise UserError(f"cannot write to {directory}: {error.strerror}") from None
    click.echo(f"{path}  {linked.core.latency} cycles, frame {1000 * linked.sender.interval / clock_hz:.3g} ms")


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
    """Replay RECORDING through INS_top or INS_flight in Verilator, sample by sample, from reset.

    RECORDING is a CSV file with units in its header, an x-IMU export, or an .npz archive; see
    docs/recordings.md. The core is generated for the recording's sample rate.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.recordings import RecordingError, read_recording
    from strapdown_sim.replay import replay as run

    config, options = configuration(config_name, changes)
    if not isinstance(config, AttitudeConfig | FlightConfig):
        raise UserError(f"recordings go through INS_top or INS_flight, and {config_name} is of {main_module(config)}")
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
                         command=f"strapdown generate {options}")
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


@main.command("monitor")
@click.argument("port")
@click.option("--baud", "baud_rate", type=click.IntRange(min=1), metavar="N",
              help="Open PORT as a serial port at this rate (needs pyserial). Without: read it as it is.")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=Path("nav.csv"), show_default=True,
              help="CSV file to write.")
@click.option("--plot", type=click.Path(dir_okay=False, path_type=Path), default=None, metavar="FILE",
              help="PNG file to draw at the end.")
@click.option("--live", is_flag=True, help="Draw in a window while frames come in.")
def monitor_(port, baud_rate, output, plot, live):
    """Decode frames of SINS_uart from PORT: a serial port, a pseudo-terminal, or a recorded file.

    Ends with the file, or with Ctrl-C.
    """
    from strapdown_sim.monitor import MonitorError, monitor, read_port

    if output.exists() and Path(port).exists() and output.samefile(port):
        raise UserError(f"--output would overwrite {port}, which is read")
    try:
        counts = monitor(read_port(port, baud_rate), output, plot=plot, live=live)
    except MonitorError as error:
        raise UserError(str(error)) from None
    except OSError as error:
        raise UserError(f"cannot write {error.filename or output}: {error.strerror}") from None
    click.echo(f"{output}  {counts.frames} frames, {counts.lost} lost, {counts.crc_errors} CRC errors, "
               f"{counts.restarts} restarts, {counts.skipped_bytes} bytes skipped")


@main.command("schedule")
@config_options
@click.option("--module", type=click.Choice(MODULES), default=None,
              help="Module whose schedule is shown.  [default: the configuration's top]")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=None, metavar="FILE",
              help="Picture to write, .png or .svg.  [default: build/schedule/CONFIG_MODULE.png]")
def schedule_(config_name, changes, module, output):
    """Draw the schedule of a module, unit against cycle, and list its critical path with kernel lines."""
    from strapdown.export.gantt import schedule_picture, schedule_summary

    config, _ = configuration(config_name, changes)
    module = module or main_module(config)
    result = core_of(config, module).engine.program.schedule
    if not isinstance(result, Schedule):
        raise UserError(f"{module} has several updates under way at once: 'strapdown explain {module}' shows its words")
    for line in schedule_summary(result):
        click.echo(line)
    path = output or Path("build/schedule") / f"{config.name}_{module}.png"
    if path.suffix not in (".png", ".svg"):
        raise UserError(f"--output takes a .png or .svg file, not {path}")
    try:
        schedule_picture(result, f"{module}, configuration {config.name}", path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None
    click.echo(f"picture: {path}")


@main.group()
def design():
    """Find the numbers that a core is generated with."""


@design.command("quaternion")
@click.option("--rate-max", "rate_max_deg_s", type=click.FloatRange(min=0, min_open=True), required=True,
              metavar="DEG/S", help="Largest length of the rate vector.")
@click.option("--period", "period_s", type=click.FloatRange(min=0, min_open=True), required=True, metavar="S",
              help="Update period T.")
@click.option("--order", type=int, default=None, metavar="J",
              help="Order of the polynomials, 2 to 8.  [default: 2, or the least that --error allows]")
@click.option("--error", "wanted_deg_h", type=click.FloatRange(min=0, min_open=True), default=None, metavar="DEG/H",
              help="Take the least order that drifts no faster than this at any rate.")
@click.option("--method", type=click.Choice(list(METHODS)), default="minimax", show_default=True,
              help="Least largest error, or the patent's sums of squares.")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=Path("build/design/quaternion.png"),
              show_default=True, help="Picture of the errors over the rate.")
def design_quaternion(rate_max_deg_s, period_s, order, wanted_deg_h, method, output):
    """Coefficients a0, d0 of the quaternion's state transition, and their worst errors.

    Errors are those of the coefficients, rounded to a format; arithmetic in that format adds its
    own rounding.
    """
    if order is not None and wanted_deg_h is not None:
        raise UserError("--order and --error exclude each other: one of them fixes the order")
    largest_angle = math.radians(rate_max_deg_s) * period_s
    try:
        if wanted_deg_h is None:
            chosen = METHODS[method](2 if order is None else order, largest_angle)
        else:
            chosen = smallest_order(method, largest_angle, wanted=math.radians(wanted_deg_h / 3600) * period_s)
    except ValueError as error:
        raise UserError(str(error)) from None
    click.echo(f"order {chosen.order}, {method}, for |omega|*T up to {largest_angle:.6g} rad")
    for name, coefficients in ("a0", chosen.a0), ("d0", chosen.d0):
        for power, coefficient in enumerate(coefficients):
            click.echo(f"  {name}[{power}] = {coefficient!r}")
    click.echo("worst errors:   angle, rad an update   drift, deg/h   norm, an update")
    for name, dtype in ("binary64", "f8"), ("binary32", "f4"):
        angle, norm = chosen.rounded(dtype).worst()
        click.echo(f"  {name:<14}{angle:>20.3g}{math.degrees(angle) / period_s * 3600:>15.3g}{norm:>18.3g}")
    others = [METHODS[name](chosen.order, largest_angle) for name in METHODS if name != method]
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        error_picture(output, [chosen, *others], period_s=period_s, highlighted=chosen)
    except OSError as error:
        raise UserError(f"cannot write to {output}: {error.strerror}") from None
    click.echo(str(output))


@main.command("explain")
@click.argument("module", type=click.Choice(MODULES))
@config_options
@click.option("--cycle", type=click.IntRange(min=0), help="Show this cycle only, with the whole chain of kernel lines.")
@click.option("--line", "place", metavar="FILE:LINE", help="Show what a kernel line became, as in attitude.py:47.")
def explain_(module, config_name, changes, cycle, place):
    """Lead from a ROM line of MODULE back to the line of the kernel, or the other way.

    Without options: the whole microprogram.
    """
    config, _ = configuration(config_name, changes)
    program = core_of(config, module).engine.program
    if not isinstance(program, Microprogram):
        if cycle is not None or place is not None:
            raise UserError(f"{module} has several updates under way at once: it is explained as a whole only")
        for line in stream_listing(program):
            click.echo(line)
        return
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
