"""Which modules a configuration has, and the core for one of them."""

from collections.abc import Callable
from typing import Any

from strapdown.config import CONFIGS, AttitudeConfig, FlightConfig, QuaternionConfig, SinsConfig, StreamConfig
from strapdown.kernel.stream import StreamEngine

from .attitude import ATTITUDE_CORES
from .core import Core
from .flight import FLIGHT_CORES
from .quaternion import QUATERNION_CORES
from .sins import SINS_CORES
from .stream import ins_top_stream

__all__ = ["MODULES", "main_module", "make_core", "modules_of", "system_of"]

_SYSTEMS: dict[Any, dict[str, Callable]] = {
    AttitudeConfig: ATTITUDE_CORES, FlightConfig: FLIGHT_CORES, QuaternionConfig: QUATERNION_CORES,
    SinsConfig: SINS_CORES}


def _systems(config) -> dict[str, Callable]:
    """Module name to the function that makes its System."""
    if isinstance(config, StreamConfig):
        return {f"INS_top_x{config.channels}": ins_top_stream}
    return _SYSTEMS[type(config)]


def modules_of(config):
    """Names of the modules that a configuration has."""
    return tuple(_systems(config))


def main_module(config):
    """The module that does all that a configuration is for."""
    return modules_of(config)[-1]


def system_of(module, config):
    """Equations and interface of a module. Raises: ValueError if the configuration has no such module."""
    systems = _systems(config)
    if module not in systems:
        raise ValueError(f"configuration {config.name} has {', '.join(systems)}, not {module}")
    return systems[module](config)


def make_core(module, config):
    """A Core, scheduled and ready to be elaborated. Raises: as ``system_of``."""
    system = system_of(module, config)
    if isinstance(config, StreamConfig):
        return Core(system, config.pool, engine=StreamEngine, channels=config.channels, interval=config.interval)
    return Core(system, config.pool)


MODULES = tuple(dict.fromkeys(name for config in CONFIGS.values() for name in modules_of(config)))
"""Names of all modules of the named configurations."""
