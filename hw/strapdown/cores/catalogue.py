"""The named configurations, their modules, and the core of a module."""

from dataclasses import replace
from typing import Any

from strapdown.config import Config
from strapdown.kernel.stream import StreamEngine
from strapdown.kernel.system import System

from .attitude import MAHONY, THESIS, THESIS_COMPACT, THESIS_FAST, THESIS_FAST_X16, THESIS_X8, THESIS_X64
from .core import Core
from .flight import FLIGHT, FLIGHT_6AXIS
from .optical import OPTICAL_ERECTED, OPTICAL_S11639, OPTICAL_TCD1304
from .port_names import TEXT_PORTS, PortNames
from .quaternion import QUATERNION_J2, QUATERNION_J3
from .sins import SINS, SINS_DAMPED
from .top import CORE_CONTROL, ENABLED_CORE_CONTROL, Control, Top

__all__ = ["CONFIGS", "MODULES", "control_of", "main_module", "make_core", "make_module", "modules_of", "system_of",
           "title_of"]

CONFIGS = {config.name: config for config in (
    THESIS, THESIS_COMPACT, THESIS_FAST, THESIS_X8, THESIS_X64, THESIS_FAST_X16, MAHONY, FLIGHT, FLIGHT_6AXIS,
    QUATERNION_J2, QUATERNION_J3, SINS, SINS_DAMPED, OPTICAL_TCD1304, OPTICAL_S11639, OPTICAL_ERECTED)}
"""All named configurations, by name."""


def modules_of(config):
    """Names of the modules of a configuration; with several channels, only the main module."""
    modules = (*config.systems(), *config.assemblies())
    return modules if config.channels == 1 else (f"{modules[-1]}_x{config.channels}",)


def main_module(config):
    """The module that has all the functions of a configuration."""
    return modules_of(config)[-1]


def system_of(module: str, config: Config) -> System:
    """Equations and interface of a module. Raises: ValueError if the configuration has no such module."""
    if module not in (modules := modules_of(config)):
        raise ValueError(f"configuration {config.name} has {', '.join(modules)}, not {module}")
    if module in config.assemblies():
        raise ValueError(f"{module} has no equations of its own: choose {', '.join(config.systems())}")
    system = config.systems()[module.removesuffix(f"_x{config.channels}")](config).restarting(config.restart_after)
    if config.channels == 1:
        return system
    return replace(system, name=module, title=f"{system.title}, {config.channels} channels")


def title_of(module: str, config: Config) -> str:
    """The function of a module in one line. Raises: ValueError if the configuration has no such module."""
    assembly = config.assemblies().get(module)
    return assembly.title if assembly else system_of(module, config).title


def control_of(config: Config) -> Control:
    """Ports of clock and reset of the cores of a configuration."""
    return ENABLED_CORE_CONTROL if config.clock_enable else CORE_CONTROL


def make_core(module: str, config: Config, names: PortNames = TEXT_PORTS) -> Core:
    """A Core, scheduled and ready to be elaborated.

    Parameters
    ----------
    module : str
    config : Config
        A configuration that has this module.
    names : PortNames
        Names of the ports.

    Raises: ValueError as ``system_of``, and for a module or a configuration without such ports.
    """
    original = system_of(module, config)
    names.check(module, config)
    system = names.system(original)
    options: dict[str, Any] = {} if config.channels == 1 else {
        "engine": StreamEngine, "channels": config.channels, "interval": config.interval}
    return Core(system, config.engine_pool, control=names.control(control_of(config)), hidden=names.hidden(system),
                constants=names.parameters(module, config), **options)


def make_module(module: str, config: Config, names: PortNames = TEXT_PORTS) -> Top:
    """Any module of a configuration as a Top, ready to be elaborated: a Core, or an assembly.

    Parameters and errors are those of ``make_core``.
    """
    assembly = config.assemblies().get(module)
    if assembly is None:
        return make_core(module, config, names)
    names.check(module, config)
    return Top(assembly.make(config), control=names.control(control_of(config)))


MODULES = {name: tuple(config for config in CONFIGS.values() if name in modules_of(config))
           for name in dict.fromkeys(name for config in CONFIGS.values() for name in modules_of(config))}
"""Maps each module name to the named configurations that have the module."""
