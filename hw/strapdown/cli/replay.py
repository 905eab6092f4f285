"""The command ``strapdown replay``."""

from pathlib import Path

import click

from strapdown.config import ConfigError

from .common import UserError, command_line, config_options, show_table, target_of, writing
from .logs import log_options
from .progress import progress_of_stages

__all__ = ["replay"]


@click.command()
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@config_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), required=True,
              help="Folder for the results (CSV, JSON, PNG) and the Verilog.")
@log_options
@click.option("--html", is_flag=True,
              help="Also write replay.html, one page with all curves, status bits, and an attitude that turns with the "
                   "cursor. It needs no network.")
@click.option("--bag", type=click.Choice(["mcap", "ros1"]),
              help="Also write the attitude with the samples as sensor_msgs/Imu: a folder imu with MCAP for ROS 2, or "
                   "imu.bag for ROS 1.")
@click.option("--rerun", is_flag=True,
              help="Also write replay.rrd for the Rerun viewer: attitude, curves, status bits, and the track of a "
                   "navigator.")
@click.option("--waves", metavar="FROM:TO",
              help="Also write replay.vcd, a waveform of the updates between two times, in seconds as in the column t "
                   "of the results. GTKWave and Surfer open it.")
@click.option("--external", type=click.Choice(["velocity"]),
              help="Give INS_flight the change of the log's velocity as its external acceleration.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder that keeps the compiled simulation models.")
def replay(recording, config_name, changes, output, choice, html, bag, rerun, waves, external, build):
    """Replay RECORDING through a core in Verilator, sample by sample, from reset.

    RECORDING is a log of one of the formats of docs/recordings.md; 'strapdown inspect' shows what is in it. The core is
    generated for the recording's sample rate; INS_flight gets the period of each sample. It is INS_top, INS_flight, or
    your own core, if the inputs of its kernel are called a (specific force), m (magnetic field) and g (angular rate).
    """
    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.extras import MissingExtraError
    from strapdown_sim.recordings import RecordingError, read_log, recordings_of
    from strapdown_sim.replay import refusal, replay_recordings

    config, _, options = target_of(None, config_name, changes)
    if config.channels > 1 and waves:
        raise UserError("--waves shows one sensor: replay it with --set channels=1")
    if config.channels > 1 and external:
        raise UserError("--external is for one sensor: replay it with --set channels=1")
    stretch = None if waves is None else _stretch(waves)
    try:
        recordings = recordings_of(read_log(recording, **choice.reading), config.channels, **choice.merging)
    except RecordingError as error:
        raise UserError(str(error)) from None
    for note in recordings[0].notes:
        click.echo(f"strapdown: note: {note}", err=True)
    asked = {"waves": stretch, "external": external}
    single = {name: value for name, value in asked.items() if value}
    labels = {"build": "generate and compile", "simulate": "simulate, samples", "compare": "compare"}
    with progress_of_stages(labels) as progress:
        try:
            with writing(output, build):
                result = replay_recordings(
                    recordings, config, output, build=build, html=html, bag=bag, rerun=rerun, progress=progress,
                    command=("strapdown", "generate", *options), **single)
        except (RecordingError, SimulatorMissingError, MissingExtraError, ConfigError) as error:
            raise UserError(str(error)) from None
    _print_summary(result.summary, recording, output)
    if line := refusal(result.summary):
        raise UserError(line)


def _stretch(text):
    """Ends of a stretch FROM:TO, seconds. Raises: UserError."""
    try:
        first, last = (float(word) for word in text.split(":"))
    except ValueError:
        raise UserError(f"--waves takes FROM:TO in seconds, as in --waves 2:2.5, not {text!r}") from None
    return first, last


def _print_summary(summary, recording, output):
    """The short table at the end of a replay of the file ``recording``."""
    from strapdown_sim.magnetometer import FieldFacts, field_rows

    rows = [("recording", f"{summary['recording']}, {summary['sample_rate_hz']:g} Hz"),
            ("configuration", summary["config"]),
            ("samples", f"{summary['samples']:,}"),
            ("cycles per update", str(summary["cycles_per_update"])),
            ("microseconds at 100 MHz", f"{summary['microseconds_per_update_at_100_mhz']:.2f}")]
    rows += _time_rows(summary.get("time"))
    for channel, own in summary.get("channels", {}).items():
        rows.append((f"channel {channel}: largest rotation angle to float64",
                     _figure(own["against_float64_reference_deg"]["max"], ".6f", "°") + f", {own['recording']}"))
        rows += _recorded_rows(own, f"channel {channel}: ")
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
    rows += _recorded_rows(summary)
    if exact := summary.get("against_exact_rotations_deg"):
        rows.append(("largest rotation angle to exact rotations", _figure(exact["max"], ".6f", "°")))
    for title, unit, key in ("position", " m", "position_m"), ("velocity", " m/s", "velocity_m_s"):
        if track := summary.get(f"against_recorded_{key}"):
            rows += [(f"largest {name} difference from the log's {title}", _figure(track[name]["max"], ".2f", unit))
                     for name in ("horizontal", "vertical")]
    if start := summary.get("start"):
        rows.append(("start", start))
    if facts := summary.get("field"):
        rows += field_rows(FieldFacts(**facts), command_line("calibrate", "sensors", recording))
    if waves := summary.get("waves"):
        first, last = waves["updates"]
        rows += [("waveform", f"updates {first:,} to {last:,}, t = {waves['from_s']:.6f} to {waves['to_s']:.6f} s, "
                              f"{waves['bytes'] / 1e6:.3g} MB"),
                 ("open it with", f"gtkwave {output / waves['file']}, or surfer {output / waves['file']}")]
    rows.append(("written to", str(output)))
    show_table(rows)


def _recorded_rows(summary, prefix=""):
    """How far the attitude is from that of the log."""
    recorded = summary.get("against_recorded_reference_deg")
    if recorded is None:
        return []
    known = "" if recorded["heading_known"] or recorded["constant_heading_deg"] is None else (
        f" (after turning the log's heading by {recorded['constant_heading_deg']:.2f}°; as logged RMS "
        f"{recorded['total_rms_with_constant_heading']:.2f}°)")
    angles = ", ".join(f"{name} {_figure(recorded[key], '.2f', '°')}" for name, key in (
        ("RMS", "total_rms"), ("inclination", "inclination_rms"), ("heading", "heading_rms")))
    return [(f"{prefix}rotation angle to {recorded['reference']}",
             f"{angles}{known}" if recorded["samples"] else "none: it has no valid sample")]


def _time_rows(time):
    """What was wrong with the time stamps of a recording, and what it means for the angles."""
    if time is None:
        return []
    rows = [(name, f"{count:,}") for name, count in time["faults"].items()]
    if time["bridged_s"]:
        rows.append(("longest gap bridged", f"{1000 * time['longest_gap_s']:.4g} ms; angles can be off by "
                                            f"{time['bridge_error_deg']:.2g}° after it"))
    if not time["each_sample_has_its_period"] and time["one_rate_error_deg"] >= 0.005:
        rows.append(("one rate for all samples", "its time stamps say otherwise: angles can be off by "
                                                 f"{time['one_rate_error_deg']:.2g}°"))
    return rows


def _figure(value, form, unit=""):
    """A number with its unit, or a dash if it is missing."""
    return "–" if value is None else f"{value:{form}}{unit}"
