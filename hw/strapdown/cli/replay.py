"""The command ``strapdown replay``."""

from pathlib import Path

import click

from strapdown.config import ConfigError

from .common import UserError, config_options, show_table, target_of, writing
from .progress import progress_of_stages

__all__ = ["replay"]


@click.command()
@click.argument("recording", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@config_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), required=True,
              help="Folder for the results (CSV, JSON, PNG) and the Verilog.")
@click.option("--rate", "sample_rate_hz", type=click.FloatRange(min=0, min_open=True), metavar="HZ",
              help="Sample rate of an x-IMU export, which does not contain one.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder that keeps the compiled simulation models.")
def replay(recording, config_name, changes, output, sample_rate_hz, build):
    """Replay RECORDING through a core in Verilator, sample by sample, from reset.

    RECORDING is a CSV file with units in its header, an x-IMU export, or an .npz archive; see
    docs/recordings.md. The core is generated for the recording's sample rate. It is INS_top, INS_flight, or your own
    core, if the inputs of its kernel are called a (specific force), m (magnetic field) and g (angular rate).
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
    with progress_of_stages(labels) as progress:
        try:
            with writing(output, build):
                result = run(data, config, output, build=build, progress=progress,
                             command=("strapdown", "generate", *options))
        except (SimulatorMissingError, ConfigError) as error:
            raise UserError(str(error)) from None
    _print_summary(result.summary, output)
    if result.summary["refused_updates"] == result.summary["samples"]:
        raise UserError("all updates were refused: numbers are not finite, or too large for the core's format, so "
                        "the outputs are those after reset")


def _print_summary(summary, output):
    """The short table at the end of a replay."""
    rows = [("recording", f"{summary['recording']}, {summary['sample_rate_hz']:g} Hz"),
            ("configuration", summary["config"]),
            ("samples", f"{summary['samples']:,}"),
            ("cycles per update", str(summary["cycles_per_update"])),
            ("microseconds at 100 MHz", f"{summary['microseconds_per_update_at_100_mhz']:.2f}")]
    if attitude := summary.get("against_float64_reference_deg"):
        rows += [("largest rotation angle to float64", _figure(attitude["max"], ".6f", "°")),
                 ("RMS rotation angle to float64", _figure(attitude["rms"], ".6f", "°"))]
    for port, difference in summary.get("against_float64_kernel", {}).items():
        rows.append((f"largest difference from float64, {port}", _figure(difference["max"], ".3g")))
        if unusable := difference.get("not_finite"):
            rows.append((f"samples without a finite difference, {port}", f"{unusable:,}"))
    rows.append(("bits that differ from the twin", str(summary["bits_differing_from_twin"])))
    for name, count in summary["updates_by_status"].items():
        if count:
            rows.append((f"updates with status: {name.replace('_', ' ')}", f"{count:,}"))
    if recorded := summary.get("against_recorded_reference_deg"):
        known = "" if recorded["heading_known"] else " (heading up to a constant)"
        angles = ", ".join(f"{name} {_figure(recorded[key], '.2f', '°')}" for name, key in (
            ("RMS", "total_rms"), ("inclination", "inclination_rms"), ("heading", "heading_rms")))
        rows.append((f"rotation angle to {recorded['reference']}",
                     f"{angles}{known}" if recorded["samples"] else "none: it has no valid sample"))
    rows.append(("written to", str(output)))
    show_table(rows)


def _figure(value, form, unit=""):
    """A number with its unit, or a dash if it is missing."""
    return "–" if value is None else f"{value:{form}}{unit}"
