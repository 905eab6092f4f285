"""The cores of the report, and a simulation that counts their cycles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from strapdown.cores import CONFIGS, Top, main_module, make_module
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel

__all__ = ["CORES", "CoreEntry", "simulated_cycles"]


@dataclass(frozen=True)
class CoreEntry:
    """A core in one configuration."""

    module: str
    config: Any
    make: Callable[[], Top]
    placed: bool = True


# In binary64 a core takes a quarter of an hour to route, and has no target frequency.
UNPLACED = {"sins", "sins_damped"}

CORES = tuple(CoreEntry(main_module(config), config, partial(make_module, main_module(config), config),
                        placed=config.name not in UNPLACED) for config in CONFIGS.values())


def simulated_cycles(core, verilog, build):
    """(latency, cycles from one update to the next), counted in Verilator: random numbers, zeros and NaN as inputs.

    Parameters
    ----------
    core : Core
    verilog : Path
        Its Verilog file.
    build : Path
        Folder for compiled models.

    Raises: RuntimeError if they depend on the data.
    """
    numbers = np.random.default_rng(20150601).standard_normal((16, len(core.system.input_ports)))
    numbers[8], numbers[12] = 0, np.nan
    inputs = dict(zip(core.system.input_ports, numbers.T, strict=True))
    engine: Any = core.engine
    if engine.channels > 1:
        result = StreamModel(core, verilog, build).update(np.arange(16) % engine.program.channels, inputs)
        counts = {*zip(result["finished"][1:] - result["taken"][1:], np.diff(result["taken"]), strict=True)}
    else:
        cycles = CoreModel(core, verilog, build).update(inputs)["cycles"]
        counts = {*zip(cycles, cycles, strict=True)}
    if len(counts) != 1:
        raise RuntimeError(f"the number of cycles of {core.system.name} depends on its inputs: {sorted(counts)}")
    return tuple(int(count) for count in counts.pop())
