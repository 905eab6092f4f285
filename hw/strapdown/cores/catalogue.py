# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""Which modules a configuration has, and the core for one of them."""

from collections.abc import Callable
from functools import partial
from typing import Any

from strapdown.config import CONFIGS, AttitudeConfig, FlightConfig, QuaternionConfig, SinsConfig, StreamConfig
from strapdown.kernel.stream import StreamEngine

from .attitude import ATTITUDE_CORES
from .core import Core
from .flight import FLIGHT_CORES
from .quaternion import QUATERNION_CORES
from .sins import SINS_CORES
from .stream import ins_top_stream

__all__ = ["MODULES", "main_module", "make_core", "modules_of"]


def _cores(config) -> dict[str, Callable[[], Core]]:
    """Module name to what makes its core."""
    if isinstance(config, StreamConfig):
        system = ins_top_stream(config)
        return {system.name: partial(Core, system, config.pool, engine=StreamEngine, channels=config.channels,
                                     interval=config.interval)}
    systems: dict[Any, dict[str, Callable]] = {
        AttitudeConfig: ATTITUDE_CORES, FlightConfig: FLIGHT_CORES, QuaternionConfig: QUATERNION_CORES,
        SinsConfig: SINS_CORES}
    return {name: partial(_plain, system, config) for name, system in systems[type(config)].items()}


def _plain(system, config):
    return Core(system(config), config.pool)


def modules_of(config):
    """Names of the modules that a configuration has."""
    return tuple(_cores(config))


def main_module(config):
    """The module that does all that a configuration is for."""
    return modules_of(config)[-1]


def make_core(module, config):
    """A Core, ready to be elaborated. Raises: ValueError if the configuration has no such module."""
    cores = _cores(config)
    if module not in cores:
        raise ValueError(f"configuration {config.name} has {', '.join(cores)}, not {module}")
    return cores[module]()


MODULES = tuple(dict.fromkeys(name for config in CONFIGS.values() for name in modules_of(config)))
"""Names of all modules of the named configurations."""
