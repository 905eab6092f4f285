# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""Which modules a configuration has, and the core for one of them."""

from collections.abc import Callable
from typing import Any

from strapdown.config import AttitudeConfig, FlightConfig, QuaternionConfig, SinsConfig

from .attitude import ATTITUDE_CORES
from .core import Core
from .flight import FLIGHT_CORES
from .quaternion import QUATERNION_CORES
from .sins import SINS_CORES

__all__ = ["MODULES", "main_module", "make_core", "modules_of"]

_CORES: dict[Any, dict[str, Callable]] = {
    AttitudeConfig: ATTITUDE_CORES, FlightConfig: FLIGHT_CORES, QuaternionConfig: QUATERNION_CORES,
    SinsConfig: SINS_CORES}

MODULES = tuple(name for cores in _CORES.values() for name in cores)
"""Names of all modules."""


def modules_of(config):
    """Names of the modules that a configuration has."""
    return tuple(_CORES[type(config)])


def main_module(config):
    """The module that does all that a configuration is for."""
    return modules_of(config)[-1]


def make_core(module, config):
    """A Core, ready to be elaborated. Raises: ValueError if the configuration has no such module."""
    try:
        system = _CORES[type(config)][module]
    except KeyError:
        raise ValueError(f"configuration {config.name} has {', '.join(modules_of(config))}, not {module}") from None
    return Core(system(config), config.pool)
