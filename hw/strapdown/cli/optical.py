"""The command ``strapdown optical``."""

import json
import math
from functools import partial
from pathlib import Path

import click

from strapdown.blocks import SENSORS
from strapdown.config import ConfigError
from strapdown.cores import CONFIGS, OpticalConfig

from .common import UserError, config_options, show_table, target_of, writing
from .progress import progress_of_stages

__all__ = ["optical"]

DEFAULT = "optical_s11639"


@click.command()
@click.argument("source", default="f", metavar="[FLIGHT|FILE]")
@partial(config_options, default=DEFAULT)
@click.option("--lines", type=click.IntRange(min=2), default=None, metavar="N",
              help="Lines to run.  [default: 200, or all lines of FILE]")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), default=None, metavar="S",
              help="Time to run, in place of --lines.")
@click.option("--start", "start_s", type=click.FloatRange(min=0), default=None, metavar="S",
              help="Seconds of the flight before the run begins.  [default: 0]")
@click.option("--full-scale", type=click.IntRange(1, 65535), default=None, metavar="N",
              help="Value in a .png file that stands for the count 4095.  [default: white]")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/optical"),
              show_default=True, help="Folder for the results (PNG, CSV, JSON) and the Verilog.")
@click.option("--camera", multiple=True, metavar="FIELD=VALUE",
              help="Change the light of a flight, as in --camera fringes=0.03. May be repeated. Fields: sigma_px, "
                   "peak, offset, shot_electrons, read_counts, prnu, fringes, fringe_px, lag, transfer, ambient, "
                   "gradient, ghost, ghost_px, smear, laser.")
@click.option("--calibration", type=click.Path(exists=True, dir_okay=False, path_type=Path), default=None,
              metavar="FILE", help="calibration.json of 'strapdown calibrate optical'.  "
                                   "[default: the right words of a flight]")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the noise.")
@click.option("--show", "shown", type=click.IntRange(min=0), default=None, metavar="N",
              help="Update whose lines are drawn.  [default: the middle one]")
@click.option("--html", is_flag=True,
              help="Also write optical.html, one page with angles, errors, exposures and status bits, and the attitude "
                   "and the lines at the cursor. It needs no network.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder that keeps the compiled simulation models.")
def optical(source, config_name, changes, lines, seconds, start_s, full_scale, output, camera, calibration, seed, shown,
            html, build):
    """Run light through OPT_top in Verilator, from the pins of sensors and ADCs to the serial line.

    FLIGHT is a letter from a to g: the rotor of the gyro, rays of light and noise make each line, and the models of
    sensors and ADCs check the timing at their pins. FILE holds recorded lines: .npz with the arrays roll and pitch, a
    row for each line; or .csv or .png, whose rows have the pixels of the roll sensor and then those of the pitch
    sensor. The default is flight f. The rotor axis is vertical at the begin of a run, also with --start.

    Pictures in the folder: lines.png shows lines with threshold, run and centre of gravity; angles.png the angles and
    their errors; budget.png the parts of the error; exposure.png exposure, peak and status. angles.csv and summary.json
    have the numbers.

    The time of a run grows with its clock cycles. A slower clock with the same sensor saves time, as in
    --set clock_hz=50e6.
    """
    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.extras import MissingExtraError
    from strapdown_sim.instrument.errors import InstrumentError
    from strapdown_sim.optical import optical as run
    from strapdown_sim.recordings import RecordingError

    config, _, options = target_of(None, config_name or DEFAULT, changes)
    if not isinstance(config, OpticalConfig):
        optical_ones = [name for name, own in CONFIGS.items() if isinstance(own, OpticalConfig)]
        raise UserError(f"configuration {config.name} has no OPT_top: choose from {', '.join(optical_ones)}")
    if lines is not None and seconds is not None:
        raise UserError("--lines and --seconds exclude each other: give only one of them")
    for option, given in ("seconds", seconds), ("start", start_s):
        if given is not None and not math.isfinite(given):
            raise UserError(f"--{option} must be a finite number, not {given:g}")
    if seconds is not None:
        lines = max(2, math.ceil(seconds * config.sample_rate_hz))
    labels = {"build": "generate and compile", "simulate": "simulate, lines", "compare": "compare and draw"}
    with progress_of_stages(labels) as progress:
        try:
            light, lines = _source(source, config, lines, start_s, camera, calibration, seed, full_scale)
            with writing(output, build):
                summary = run(light, config, output, lines=lines, build=build, shown=shown, html=html,
                              progress=progress, command=("strapdown", "generate", *options, "--module", "OPT_top"))
        except (SimulatorMissingError, MissingExtraError, ConfigError, InstrumentError, RecordingError) as error:
            raise UserError(str(error)) from None
    _print_summary(summary, output)


def _source(source, config, lines, start_s, camera, calibration, seed, full_scale):
    """The Source, and the number of lines to run. Raises: UserError, InstrumentError, RecordingError."""
    from strapdown_sim.instrument.flights import FLIGHTS
    from strapdown_sim.instrument.scene import camera_options
    from strapdown_sim.optical import flight_scene, recorded_source, scene_source
    from strapdown_sim.recordings.lines import read_lines

    words = None if calibration is None else _calibration(calibration)
    if source in FLIGHTS:
        if full_scale is not None:
            raise UserError("--full-scale is that of a picture, and a flight has none")
        flight, lines = FLIGHTS[source], lines or 200
        scene = flight_scene(flight, config, lines, start_s=start_s or 0.0, camera=camera_options(camera), seed=seed)
        begin = f" from {start_s:g} s on" if start_s else ""
        return scene_source(f"flight {source}{begin}, {flight.title}", scene, words), lines
    path = Path(source)
    if not path.is_file():
        raise UserError(f"there is no flight and no file {source!r}: flights are {', '.join(FLIGHTS)}")
    if camera:
        raise UserError("--camera changes the light of a flight, and recorded lines have their own")
    if start_s is not None:
        raise UserError("--start is a time of a flight, and recorded lines begin with the first")
    sensor = SENSORS[config.sensor]
    recorded = read_lines(path, sensor.pixels, full_scale)
    return recorded_source(path.name, recorded, sensor, words), lines or recorded.shape[1]


def _calibration(path):
    """The Calibration in a JSON file. Raises: UserError."""
    from strapdown_sim.instrument.calibration import Calibration

    try:
        words = json.loads(path.read_text(encoding="utf-8"))["words"]
        return Calibration(**{port.removeprefix("in_"): float(word["value"]) for port, word in words.items()})
    except (AttributeError, KeyError, TypeError, ValueError):
        raise UserError(f"{path} is not a calibration.json of 'strapdown calibrate optical'") from None


def _print_summary(summary, output):
    """The short table at the end of a run."""
    frames, status = summary["frames"], summary["updates_by_status"]
    rows = [("source", summary["source"]),
            ("configuration", f"{summary['config']}, {summary['sensor']}, {summary['line_rate_hz']:g} Hz"),
            ("updates", f"{summary['updates']:,}"),
            ("cycles from last pixel to angles", f"{summary['cycles_from_last_pixel_to_angles']:,}"),
            ("bits that differ from the twin", str(summary["bits_differing_from_twin"])),
            ("frames received", f"{frames['received']:,}, {frames['lost']} lost, {frames['crc_errors']} CRC errors, "
                                f"{frames['differing_from_twin']} different from the twin"),
            ("violations of the sensors' timing", str(len(summary["timing_violations"])))]
    rows += [(f"updates with status: {name.replace('_', ' ')}", f"{count:,}")
             for name, count in status.items() if count]
    if counts := summary["counts"]:
        rows.append(("counts of the pixels", f"{counts['least']} to {counts['largest']:,}"))
    for axis, error in summary.get("position_error_px", {}).items():
        rows.append((f"error of the position, {axis}", _figures(error, " px", ".3f")))
    for name, label in ("total", "error of the angles"), ("arithmetic", "of this, arithmetic"):
        for axis, error in summary["error_deg"].get(name, {}).items():
            rows.append((f"{label}, {axis}", _figures(error, "°", ".6f")))
    rows.append(("written to", str(output)))
    show_table(rows)


def _figures(error, unit, form):
    """RMS and largest value, or a dash."""
    if error["max"] is None:
        return "–"
    return f"{error['rms']:{form}}{unit} RMS, {error['max']:{form}}{unit} at most"
