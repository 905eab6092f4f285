"""The commands that write Verilog: generate, operators, link."""

import re
from pathlib import Path

import click

from strapdown.cores import PORT_NAMES, SINS, TEXT_PORTS, modules_of, uart_core
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.export import write, write_core

from .common import (
    UserError,
    changed,
    command_line,
    config_options,
    configured,
    made_module,
    named_configuration,
    target_of,
    writing,
)

__all__ = ["generate", "link", "operators"]

FOLDER = click.Path(file_okay=False, path_type=Path)


@click.command()
@click.argument("target", metavar="[CONFIG|MODULE|FILE.py:NAME]", required=False)
@config_options
@click.option("--module", "modules", multiple=True, metavar="NAME",
              help="Module to generate; may be repeated.  [default: all of the configuration]")
@click.option("--ports", "names", type=click.Choice(list(PORT_NAMES)), default=TEXT_PORTS.name, show_default=True,
              help="Names of the ports. thesis-rtl: those in the RTL of the 2015 thesis, where its text has others.")
@click.option("--output", type=FOLDER, default=None,
              help="Folder to write to.  [default: build/verilog/CONFIG, for other ports build/verilog/CONFIG-PORTS]")
def generate(target, config_name, changes, modules, names, output):
    """Write <Module>.v, <Module>.json and <Module>.vlt for each module of a configuration.

    The configuration is one of 'strapdown list', or one in your own Python file. Each Verilog file is self-contained
    Verilog-2001. Two runs give equal bytes.
    """
    config, modules, options = target_of(target, config_name, changes, modules)
    folder, names = config.name, PORT_NAMES[names]
    if names is not TEXT_PORTS:
        folder, options = f"{folder}-{names.name}", (*options, "--ports", names.name)
    directory = output or Path("build/verilog") / folder
    for name in modules or modules_of(config):
        module = made_module(config, name, names)
        with writing(directory):
            path = write_core(module, config, directory, command_line("generate", *options, "--module", name))
        click.echo(f"{path}  {module.latency} cycles" if module.latency else path)


@click.command()
@click.argument("directory", type=FOLDER)
@click.option("--latency", "latencies", metavar="OPERATOR=N", multiple=True,
              help="Cycles of one operator, as in --latency add=8. May be repeated.")
def operators(directory, latencies):
    """Write the vendor operators of the thesis's RTL (add, sub, mult, ...) to the folder DIRECTORY.

    They have the module names, ports and latencies of the vendor's cores.
    """
    chosen = {}
    for change in latencies:
        if not (match := re.fullmatch(r"(\w+)=(-?\d+)", change)):
            raise UserError(f"--latency takes OPERATOR=N, as in --latency add=8, not {change!r}")
        chosen[match[1]] = int(match[2])
    try:
        made = [VendorOperator(name, latency=latency)
                for name, latency in {**dict.fromkeys(VENDOR_OPERATORS), **chosen}.items()]
    except ValueError as error:
        raise UserError(str(error)) from None
    for vendor in made:
        name, latency = vendor.kind.name, vendor.latency
        option = () if latency == vendor.kind.latency else ("--latency", f"{name}={latency}")
        with writing(directory):
            path = write(vendor, directory, command=command_line("operators", "DIRECTORY", *option))
        click.echo(f"{path}  {latency} cycles")


@click.command()
@click.argument("directory", type=FOLDER)
@click.option("--config", "config_name", metavar="NAME|FILE.py:NAME", default=SINS.name, show_default=True,
              help="A configuration of SINS_top.")
@click.option("--set", "changes", metavar="FIELD=VALUE", multiple=True,
              help="Change a field of the configuration. May be repeated.")
@click.option("--clock-hz", type=click.FloatRange(min=1, max=1e12), default=100e6, show_default=True,
              help="Frequency of clk.")
@click.option("--baud", "baud_rate", type=click.IntRange(min=1), default=921_600, show_default=True,
              help="Bits per second on the serial line.")
def link(directory, config_name, changes, clock_hz, baud_rate):
    """Write SINS_uart, which is SINS_top with a serial link, to the folder DIRECTORY."""
    config = changed(named_configuration(config_name), changes)
    try:
        linked = uart_core(config, clock_hz=clock_hz, baud_rate=baud_rate)
    except ValueError as error:
        raise UserError(str(error)) from None
    command = command_line("link", "DIRECTORY", *configured(config_name, changes),
                           "--clock-hz", f"{clock_hz:.15g}", "--baud", baud_rate)
    with writing(directory):
        path = write(linked, directory, command=command, config=config)
    click.echo(f"{path}  {linked.latency} cycles, frame {1000 * linked.component.sender.interval / clock_hz:.3g} ms")
