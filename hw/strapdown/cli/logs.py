"""Options of commands that read logs."""

from functools import wraps

import click

from .common import UserError

__all__ = ["log_options"]


def log_options(function):
    """The options that say what of a log is used: argument ``choice`` of the command, a Choice."""
    options = (
        click.option("--rate", "sample_rate_hz", type=click.FloatRange(min=0, min_open=True), metavar="HZ",
                     help="Sample rate of a file without time stamps, such as an x-IMU export."),
        click.option("--imu", metavar="NAME|NUMBER", help="Inertial sensor of several in a log.  [default: the first]"),
        click.option("--mag", metavar="NAME|NUMBER", help="Magnetometer of several in a log.  [default: the first]"),
        click.option("--log", metavar="NUMBER", help="Log of several in a file.  [default: the longest]"),
        click.option("--columns", multiple=True, metavar="QUANTITY=NAME[:UNIT]",
                     help="Column of a text file for time, gyro_x, accel_z, mag_y, ..., as in --columns time=T:ms; "
                          "gyro=:deg/s is the unit of all axes. May be repeated."),
        click.option("--from", "start_s", type=float, metavar="S", help="Leave out the first S seconds of the log."),
        click.option("--to", "stop_s", type=float, metavar="S", help="Leave out what comes after S seconds."))

    @wraps(function)
    def command(sample_rate_hz, imu, mag, log, columns, start_s, stop_s, **arguments):
        from strapdown_sim.recordings import Choice

        reading = {"sample_rate_hz": sample_rate_hz, "log": log, "columns": _pairs(columns)}
        merging = {"imu": imu, "mag": mag, "start_s": start_s, "stop_s": stop_s}
        choice = Choice(*({name: value for name, value in options.items() if value is not None}
                          for options in (reading, merging)))
        return function(choice=choice, **arguments)

    for option in reversed(options):
        command = option(command)
    return command


def _pairs(columns):
    """Quantity to column, from words QUANTITY=NAME; None without any. Raises: UserError."""
    if wrong := [pair for pair in columns if "=" not in pair]:
        raise UserError(f"--columns takes QUANTITY=NAME, as in --columns gyro_x=wx:dps, not {wrong[0]!r}")
    return dict(pair.split("=", 1) for pair in columns) or None
