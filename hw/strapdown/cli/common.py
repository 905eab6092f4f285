"""Common parts of the commands: errors in one line, and the names of configurations and modules."""

import importlib.util
import re
import shlex
import sys
import traceback
from contextlib import contextmanager
from pathlib import Path

import click

from strapdown.config import Config, ConfigError
from strapdown.cores import CONFIGS, main_module, make_core, make_module, modules_of

__all__ = ["UserError", "changed", "command_line", "config_options", "configuration", "configured", "core_of",
           "made_module", "named_configuration", "own_line", "show_table", "target_of", "with_changes", "writing"]

DEFAULT = "thesis"

OWN = "own_"
"""Prefix of the module names of users' files; no other module has such a name."""


class UserError(click.ClickException):
    """An error of the user: one line, exit status 2."""

    exit_code = 2

    def show(self, file=None):
        click.echo(f"strapdown: {self.format_message()}", err=True)


class InterruptedByUserError(UserError):
    """Ctrl-C: one line, and the exit status that shells use."""

    exit_code = 130

    def __init__(self):
        super().__init__("interrupted")


@contextmanager
def writing(*places):
    """Context manager: a file that cannot be written ends in a UserError that names its place.

    Parameters
    ----------
    *places : Path
        Files or folders that are written. The message names the one in the system's error, else the first.
    """
    try:
        yield
    except OSError as error:
        failed = Path(error.filename or places[0]).absolute()
        named = [place for place in places if failed.is_relative_to(place.absolute())]
        raise UserError(f"cannot write to {[*named, *places][0]}: {error.strerror or error}") from None


def config_options(function, default="the first that contains the module, else thesis"):
    """The options ``--config`` and ``--set``: arguments ``config_name`` and ``changes`` of the command.

    ``default`` says in the help which configuration the command takes without ``--config``.
    """
    function = click.option(
        "--set", "changes", metavar="FIELD=VALUE", multiple=True,
        help="Change a field of the configuration, as in --set kp=1. May be repeated.")(function)
    return click.option(
        "--config", "config_name", metavar="NAME|FILE.py:NAME", default=None,
        help="A configuration of 'strapdown list', or one in your own Python file.  "
             f"[default: {default}]")(function)


def named_configuration(name):
    """The configuration called ``name``, or ``FILE.py:NAME`` for one in a Python file. Raises: UserError."""
    file, separator, variable = name.rpartition(":")
    if separator and file.endswith(".py"):
        found = getattr(_module_of(Path(file)), variable, None)
        if not isinstance(found, Config):
            raise UserError(f"{file} has no configuration {variable!r}: docs/kernels.md shows how to write one")
        return found
    if name not in CONFIGS:
        raise UserError(f"no configuration is called {name!r}: choose from {', '.join(CONFIGS)}, or name one in a "
                        "Python file as FILE.py:NAME")
    return CONFIGS[name]


def _module_of(path):
    """A Python file as a module. Raises: UserError if it does not exist, or cannot be imported."""
    if not path.is_file():
        raise UserError(f"there is no file {path}")
    if not path.stem.isidentifier():
        raise UserError(f"{path} must have a name that Python can import: letters, digits and underscores")
    name = f"{OWN}{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # inspect and pydantic look for the module of a class here.
    sys.modules[name] = module
    # A file may import files in the same folder, like a script.
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise UserError(f"{path} cannot be imported: {type(error).__name__}: {error}") from None
    finally:
        sys.path.pop(0)
    return module


def own_line(error):
    """User's file and line in which an exception was raised, or an empty string."""
    frames = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)
              if frame.f_globals.get("__name__", "").startswith(OWN)]
    return f"{Path(frames[-1][0]).name}, line {frames[-1][1]}" if frames else ""


def changed(config, changes):
    """The configuration with the ``FIELD=VALUE`` of ``--set`` applied; its warnings are shown. Raises: UserError."""
    config = with_changes(config, changes)
    for warning in config.warnings:
        click.echo(f"strapdown: warning: {warning}", err=True)
    return config


def with_changes(config, changes):
    """The configuration with the ``FIELD=VALUE`` of ``--set`` applied. Raises: UserError."""
    fields = {}
    for change in changes:
        field, separator, value = change.partition("=")
        if not separator:
            raise UserError(f"--set takes FIELD=VALUE, as in --set kp=1, not {change!r}")
        fields[field.strip()] = value.strip()
    if "name" in fields or "pool" in fields:
        raise UserError("the fields name and pool cannot be changed by --set")
    try:
        return config.replace(**fields)
    except ConfigError as error:
        raise UserError(str(error)) from None


def configuration(name, changes):
    """The configuration called ``name`` with the ``FIELD=VALUE`` of ``--set``, also in a worker. Raises: UserError."""
    return with_changes(named_configuration(name), changes)


def target_of(target, config_name, changes, modules=()):
    """The configuration and modules that a command works on.

    Parameters
    ----------
    target : str or None
        A module, a configuration, or ``FILE.py:NAME``.
    config_name : str or None
        Value of ``--config``.
    changes : tuple of str
        Values of ``--set``.
    modules : tuple of str
        Values of ``--module``.

    Returns
    -------
    config : Config
    modules : tuple of str
        Requested modules; empty if none was requested.
    options : tuple of str
        Words that name the configuration on a command line.

    Raises: UserError.
    """
    if target is not None:
        if re.fullmatch(r".*\.py:\w*", target) or target in CONFIGS:
            if config_name is not None:
                raise UserError(f"{target} already names a configuration: omit --config")
            config_name = target
        elif modules:
            raise UserError(f"{target} is not a configuration: choose from {', '.join(CONFIGS)}")
        else:
            modules = (target,)
    if config_name is None:
        config_name = _first_with(modules)
    config = changed(named_configuration(config_name), changes)
    if missing := [module for module in modules if module not in modules_of(config)]:
        raise UserError(f"configuration {config.name} has {', '.join(modules_of(config))}, not {missing[0]}")
    return config, tuple(modules), configured(config_name, changes)


def configured(config_name, changes):
    """The words of a command line that name a configuration and its changes.

    Generated files contain the command that makes them again, without paths of this machine.
    """
    return ("--config", Path(config_name).name, *(word for change in changes for word in ("--set", change)))


def command_line(*words):
    """A command of this program as one line, quoted for a shell."""
    return shlex.join(["strapdown", *map(str, words)])


def show_table(rows):
    """Print pairs of name and value, the values below each other."""
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        click.echo(f"{name:<{width}}  {value}")


def _first_with(modules):
    """Name of the first configuration that has all modules. Raises: UserError."""
    for config in (CONFIGS[DEFAULT], *CONFIGS.values()):
        if set(modules) <= set(modules_of(config)):
            return config.name
    known = {module for config in CONFIGS.values() for module in modules_of(config)}
    if unknown := [module for module in modules if module not in known]:
        raise UserError(f"no module or configuration is called {unknown[0]!r}: 'strapdown list' shows all")
    raise UserError(f"no configuration has all of {', '.join(modules)}: name one with --config")


def core_of(config, module=None):
    """The core ``module``, or the main core, of a configuration. Raises: UserError, also for another module."""
    return _made(make_core, module or main_module(config), config)


def made_module(config, module, names):
    """Any module of a configuration, with ports of some names. Raises: UserError."""
    return _made(make_module, module, config, names)


def _made(make, *arguments):
    try:
        return make(*arguments)
    except ValueError as error:
        raise UserError(str(error)) from None
