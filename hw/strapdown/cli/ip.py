"""The command that writes a core behind a bus as a package: ip."""

from pathlib import Path

import click

from strapdown.cores.registers import register_table
from strapdown.ip import write_package

from .common import DEFAULT, UserError, changed, core_of, named_configuration, writing

__all__ = ["ip"]


@click.command()
@click.argument("target", metavar="[CONFIG|FILE.py:NAME]", default=DEFAULT)
@click.option("--set", "changes", metavar="FIELD=VALUE", multiple=True,
              help="Change a field of the configuration, as in --set kp=1. May be repeated.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=None,
              help="Folder to write to.  [default: build/ip/CONFIG]")
def ip(target, changes, output):
    """Write the main core of a configuration behind AXI4-Lite and AXI4-Stream as a package.

    The package has the registers in several forms.
    """
    config = changed(named_configuration(target), changes)
    try:
        table = register_table(core_of(config), config)
    except ValueError as error:
        raise UserError(str(error)) from None
    directory = output or Path("build/ip") / config.name
    with writing(directory):
        write_package(table, directory)
    click.echo(directory)
