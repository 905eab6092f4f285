"""The command ``strapdown design``."""

import math
from pathlib import Path

import click

from strapdown.design import METHODS, smallest_order
from strapdown.files import written_together

from .common import UserError, writing

__all__ = ["design"]


@click.group()
def design():
    """Compute coefficients for the generation of a core."""


@design.command("quaternion")
@click.option("--rate-max", "rate_max_deg_s", type=click.FloatRange(min=0, min_open=True), required=True,
              metavar="DEG/S", help="Largest length of the rate vector.")
@click.option("--period", "period_s", type=click.FloatRange(min=0, min_open=True), required=True, metavar="S",
              help="Update period T.")
@click.option("--order", type=int, default=None, metavar="J",
              help="Order of the polynomials, 2 to 8.  [default: 2, or the lowest that meets --error]")
@click.option("--error", "wanted_deg_h", type=click.FloatRange(min=0, min_open=True), default=None, metavar="DEG/H",
              help="Select the lowest order whose drift at any rate is at most this.")
@click.option("--method", type=click.Choice(list(METHODS)), default="minimax", show_default=True,
              help="Smallest maximum error, or the patent's sums of squares.")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=Path("build/design/quaternion.png"),
              show_default=True, help="Picture of the errors over the rate.")
def design_quaternion(rate_max_deg_s, period_s, order, wanted_deg_h, method, output):
    """Coefficients a0, d0 of the quaternion's state transition, and their worst errors.

    Errors are those of the coefficients, rounded to a format; arithmetic in that format adds its
    own rounding.
    """
    if order is not None and wanted_deg_h is not None:
        raise UserError("--order and --error exclude each other: give only one of them")
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
    click.echo("worst errors:      angle, rad/update   drift, deg/h   norm per update")
    for name, dtype in ("binary64", "f8"), ("binary32", "f4"):
        angle, norm = chosen.rounded(dtype).worst()
        click.echo(f"  {name:<14}{angle:>20.3g}{math.degrees(angle) / period_s * 3600:>15.3g}{norm:>18.3g}")
    from strapdown.design.picture import error_picture

    others = [METHODS[name](chosen.order, largest_angle) for name in METHODS if name != method]
    with writing(output), written_together(output.parent) as folder:
        error_picture(folder / output.name, [chosen, *others], period_s=period_s, highlighted=chosen)
    click.echo(str(output))
