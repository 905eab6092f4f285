"""The command ``strapdown calibrate``."""

import math
from pathlib import Path

import click

from .common import UserError, show_table, writing
from .logs import log_options

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


@calibrate.command("sensors")
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@log_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/calibration"),
              show_default=True, help="Folder for calibration.json, set.txt and calibration.png.")
def calibrate_sensors(recording, choice, output):
    """Fit the errors of magnetometer, gyro and accelerometer to RECORDING.

    \b
    magnetometer   hard iron (bias) and soft iron (matrix), from a sensor that is
                   turned by full turns about each of its axes, far from iron
    gyro           bias, from a rest of 10 s
    accelerometer  bias and scales from rests of 6 s on six sides, a full
                   matrix with rests on three edges too

    RECORDING is a log of one of the formats of docs/recordings.md; one recording can have all of this. A sensor whose
    errors it does not tell is left out, with the reason. Results are fields of the configurations flight and
    flight_6axis, in axes of the sensor: corrected sample = matrix (sample - bias). They are printed with their standard
    deviations, and as options --set for 'strapdown replay', 'generate' and 'ip', which set.txt has too. See
    docs/calibration.md.
    """
    from strapdown_sim.extras import MissingExtraError
    from strapdown_sim.recordings import RecordingError, read_log, recording_of
    from strapdown_sim.sensor_calibration import calibrate_sensors as run
    from strapdown_sim.sensor_calibration import write_sensor_calibration
    from strapdown_sim.sensor_fits import FitError

    try:
        log = read_log(recording, **choice.reading)
        data = recording_of(log, **choice.merging)
        field = log.chosen("mag", choice.merging.get("mag"), "--mag")
        calibration = run(data, "a.u." if field is not None and field.unit == "a.u." else "µT")
    except (RecordingError, MissingExtraError) as error:
        raise UserError(str(error)) from None
    except FitError as error:
        raise UserError(f"{recording}: {error}") from None
    for note in (*data.notes, *calibration.notes):
        click.echo(f"strapdown: note: {note}", err=True)
    with writing(output):
        write_sensor_calibration(calibration, output)
    show_table([*_field_rows(calibration), *_strength_rows(calibration), ("written to", str(output))])
    click.echo("")
    click.echo(calibration.options())


def _field_rows(calibration):
    """Fitted fields with their standard deviations."""
    units = {"magnetometer": calibration.field_unit, "gyro": "deg/s", "accelerometer": "m/s²"}
    rows = []
    for sensor, own in calibration.fields.items():
        rows.append((f"{sensor}_bias", _numbers(own.bias, own.bias_deviation, units[sensor])))
        if own.matrix is not None:
            names = f"{sensor}_matrix", "", ""
            deviations = [None] * 3 if own.matrix_deviation is None else own.matrix_deviation
            rows += [(name, _numbers(row, deviation)) for name, row, deviation in zip(
                names, own.matrix, deviations, strict=True)]
    return rows


def _numbers(values, deviations, unit=""):
    """Numbers with a unit and their standard deviations, the least of which has two digits at least."""
    least = 0 if deviations is None else min(deviations)
    places = 4 if least <= 0 else max(4, 1 - math.floor(math.log10(least)))
    text = " ".join(f"{value:{5 + places}.{places}f}" for value in values) + (unit and f" {unit}")
    return text if deviations is None else f"{text} ± " + " ".join(f"{value:.{places}f}" for value in deviations)


def _strength_rows(calibration):
    """What the calibration changed of the field."""
    if calibration.magnetometer is None or calibration.before is None or calibration.after is None:
        return []
    rows = []
    for name, facts in (("field before", calibration.before), ("field after", calibration.after)):
        varied = f"{100 * facts.strength_variation:.2f} % with attitude"
        rows.append((name, f"{facts.strength:.4g} {calibration.field_unit}, dip {facts.dip_deg:.1f}°; varies by "
                     f"{varied}, headings err by about {facts.heading_error_deg:.1f}°"))
    return rows


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
