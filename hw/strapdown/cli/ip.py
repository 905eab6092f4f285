"""The command that writes a core behind a bus as a package: ip."""

from pathlib import Path

import click

from strapdown.bus import ERROR_RESPONSES
from strapdown.cores import axi_core

from .common import DEFAULT, UserError, changed, command_line, configured, named_configuration, writing

__all__ = ["ip"]


@click.command()
@click.argument("target", metavar="[CONFIG|FILE.py:NAME]", default=DEFAULT)
@click.option("--set", "changes", metavar="FIELD=VALUE", multiple=True,
              help="Change a field of the configuration, as in --set kp=1. May be repeated.")
@click.option("--no-streams", "streams", is_flag=True, default=True, flag_value=False,
              help="Leave out the AXI4-Streams of samples and answers.")
@click.option("--errors", type=click.Choice(list(ERROR_RESPONSES)), default="slverr", show_default=True,
              help="Answer to an access that the registers do not permit. okay: for a processor that stops at slverr.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=None,
              help="Folder to write to.  [default: build/ip/CONFIG]")
def ip(target, changes, streams, errors, output):
    """Write the main core of a configuration behind AXI4-Lite and AXI4-Stream as a package.

    The package has the Verilog, the component that Vivado's IP catalogue reads, scripts for Vivado and ISE, the
    registers in several languages, a driver, and a bench. Two runs give equal bytes.
    """
    from strapdown.ip import peakrdl, write_package

    config = changed(named_configuration(target), changes)
    try:
        top = axi_core(config, streams=streams, error_response=errors)
    except ValueError as error:
        raise UserError(str(error)) from None
    command = command_line("ip", *configured(target, changes)[1:], *([] if streams else ["--no-streams"]),
                           *([] if errors == "slverr" else ["--errors", errors]))
    directory = output or Path("build/ip") / config.name
    with writing(directory):
        write_package(top, config, directory, command=command)
    click.echo(directory)
    if not peakrdl.installed():
        click.echo(f"strapdown: without registers/*.xml, which PeakRDL makes: {peakrdl.INSTALLATION}", err=True)
