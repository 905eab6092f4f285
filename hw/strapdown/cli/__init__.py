"""The command line: one file for each group of commands."""

import errno
import io
import sys
from importlib.metadata import entry_points

import click

from strapdown import __version__
from strapdown.export import CircuitError
from strapdown.tools import ToolError

from .batch import batch
from .calibrate import calibrate
from .catalogue import list_configurations
from .common import InterruptedByUserError, UserError, own_line
from .design import design
from .explain import explain, schedule
from .generate import generate, link, operators
from .inspect import inspect
from .ip import ip
from .monitor import monitor
from .optical import optical
from .replay import replay

__all__ = ["UserError", "main"]

PLUGINS = "strapdown.commands"
"""Entry points under which an installed package adds commands."""

LAB_COMMANDS = "accuracy", "explore", "report"
"""Commands of the laboratory, which is not in the wheel."""


class Commands(click.Group):
    """The commands of this package, and those that other installed packages add."""

    def list_commands(self, context):
        return sorted({*super().list_commands(context), *entry_points(group=PLUGINS).names})

    def get_command(self, context, name):
        if command := super().get_command(context, name):
            return command
        if added := entry_points(group=PLUGINS, name=name):
            return next(iter(added)).load()
        if name in LAB_COMMANDS:
            raise UserError(f"'{name}' needs a checkout of the project: there, 'make setup' installs it")
        return None

    def invoke(self, context):
        """Run a command; Ctrl-C, a tool that fails and what the operating system refuses end in one line."""
        try:
            return super().invoke(context)
        except KeyboardInterrupt:
            raise InterruptedByUserError from None
        except OSError as error:
            if error.errno == errno.EPIPE:
                # The reader of the output has seen enough: click ends in silence.
                raise
            place = f"{error.filename}: " if error.filename else ""
            raise UserError(f"{place}{error.strerror or error}") from None
        except ToolError as error:
            raise UserError(error.line) from None
        except CircuitError as error:
            raise UserError(str(error)) from None
        except Exception as error:
            if place := own_line(error):
                raise UserError(f"{place}: {type(error).__name__}: {error}") from None
            raise


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="strapdown")
def main():
    """Navigation cores for FPGAs, written once in Python.

    Generate Verilog, replay recordings through it, and trace a microprogram back to its equation.
    """
    for stream in sys.stdout, sys.stderr:
        # A degree sign must not end a replay where the terminal's encoding has none.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


for command in (list_configurations, generate, operators, link, ip, replay, batch, inspect, optical, monitor, design,
                calibrate, schedule, explain):
    main.add_command(command)
