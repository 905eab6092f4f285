"""The command ``strapdown calibrate``."""

import math
from pathlib import Path

import click

from .common import UserError, writing

__all__ = ["calibrate"]


@click.group()
def calibrate():
    """Find the constants of one unit of a sensor."""


@calibrate.command("optical")
@click.argument("table", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--rest", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="Points of a rest with a tilted rotor axis, for k: TABLE's columns and time_s.")
@click.option("--hold", "held", metavar="NAME=VALUE", multiple=True,
              help="Do not fit a constant, as in --hold c3_r=0. May be repeated.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/calibration"),
              show_default=True, help="Folder for calibration.json and calibration.png.")
def calibrate_optical(table, rest, held, output):
    """Fit n0, scale, tilt and c3 of both CCDs of the optical attitude sensor, and h, to known attitudes.

    TABLE is a CSV file with the columns roll_deg, pitch_deg, roll_px and pitch_px: attitudes of the body against the
    rotor axis, and positions of the lines. The results are the words of the core's input ports; see docs/optical.md.
    """
    from strapdown_sim.calibrate import CalibrationError, fit_attitudes, fit_rest, write_calibration
    from strapdown_sim.recordings import RecordingError

    try:
        fit = fit_attitudes(table, _held(held))
        if rest is not None:
            fit = fit_rest(rest, fit)
    except (CalibrationError, RecordingError) as error:
        raise UserError(str(error)) from None
    with writing(output):
        result = write_calibration(fit, output)
    for port, word in result["words"].items():
        spread = result["standard_deviation"].get(port.removeprefix("in_"))
        click.echo(f"{port:<12}{word['value']:>15.8g}  {word['word']}" + (f"  ± {spread:.2g}" if spread else ""))
    for ccd, errors in result["errors"].items():
        click.echo(f"{ccd}: largest error {errors['largest_deg']:.4f}°, rms {errors['rms_deg']:.4f}°, "
                   f"{errors['rms_px']:.3f} px")
    click.echo(str(output))


def _held(changes):
    """The constants of ``--hold``, by name. Raises: UserError."""
    from strapdown_sim.calibrate import CONSTANTS

    held = {}
    for change in changes:
        name, _, value = change.partition("=")
        if name.strip() not in CONSTANTS:
            raise UserError(f"--hold: no constant is called {name.strip()!r}: choose from {', '.join(CONSTANTS)}")
        try:
            number = float(value)
        except ValueError:
            raise UserError(f"--hold takes NAME=VALUE, as in --hold c3_r=0, not {change!r}") from None
        if not math.isfinite(number):
            raise UserError(f"--hold: {name.strip()} must be a finite number, not {number:g}")
        held[name.strip()] = number
    return held
