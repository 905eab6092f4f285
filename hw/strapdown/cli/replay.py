"""The command ``strapdown replay``."""

from pathlib import Path

import click

from strapdown.config import ConfigError

from .common import UserError, config_options, target_of, writing
from .progress import progress_bars

__all__ = ["replay"]


@click.command()
@click.argument("recording", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@config_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), required=True,
              help="Folder for the results (CSV, JSON, PNG) and the Verilog.")
@click.option("--rate", "sample_rate_hz", type=click.FloatRange(min=0, min_open=True), metavar="HZ",
              help="Sample rate of an x-IMU export, which does not carry one.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder for compiled simulation models, which are kept.")
def replay(recording, config_name, changes, output, sample_rate_hz, build):
    """Replay RECORDING through a core in Verilator, sample by sample, from reset.

    RECORDING is a CSV file with units in its header, an x-IMU export, or an .npz archive; see
    docs/recordings.md. The core is generated for the recording's sample rate. It is INS_top, INS_flight, or one of
    your own whose inputs are called a (specific force), m (magnetic field) and g (angular rate) in its kernel.
    """
    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.recordings import RecordingError, read_recording
    from strapdown_sim.replay import replay as run

    config, _, options = target_of(None, config_name, changes)
    try:
        data = read_recording(recording, sample_rate_hz=sample_rate_hz)
    except RecordingError as error:
        raise UserError(str(error)) from None
    labels = {"build": "generate and compile", "simulate": "simulate, samples", "compare": "compare"}
    with progress_bars() as bars:
        tasks = {}

        def progress(stage, done, total):
            if stage not in tasks:
                tasks[stage] = bars.add_task(labels[stage], total=total)
            bars.update(tasks[stage], completed=done)

        try:
            with writing(output):
                result = run(data, config, output, build=build, progress=progress,
                             command=f"strapdown generate {options}")
        except (SimulatorMissingError, ConfigError) as error:
            raise UserError(str(error)) from None
    _print_summary(result.summary, output)


def _print_summary(summary, output):
    """The short table at the end of a replay."""
    from rich.console import Console
    from rich.table import Table

    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_row("recording", f"{summary['recording']}, {summary['sample_rate_hz']:g} Hz")
    table.add_row("configuration", summary["config"])
    table.add_row("samples", f"{summary['samples']:,}")
    table.add_row("cycles per update", str(summary["cycles_per_update"]))
    table.add_row("microseconds at 100 MHz", f"{summary['microseconds_per_update_at_100_mhz']:.2f}")
    if attitude := summary.get("against_float64_reference_deg"):
        table.add_row("largest difference from float64", f"{attitude['max']:.6f}°")
        table.add_row("RMS difference from float64", f"{attitude['rms']:.6f}°")
    for port, difference in summary.get("against_float64_kernel", {}).items():
        table.add_row(f"largest difference from float64, {port}", f"{difference['max']:.3g}")
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
