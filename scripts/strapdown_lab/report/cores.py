"""The cores of the report, alone and behind a bus, and a simulation that counts their cycles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from strapdown.cores import CONFIGS, Top, axi_core, main_module, make_module
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel

__all__ = ["BUSES", "BusEntry", "CORES", "CoreEntry", "simulated_cycles"]


@dataclass(frozen=True)
class CoreEntry:
    """A core in one configuration."""

    module: str
    config: Any
    make: Callable[[], Top]
    placed: bool = True


CORES = tuple(CoreEntry(main_module(config), config, partial(make_module, main_module(config), config))
              for config in CONFIGS.values())


@dataclass(frozen=True)
class BusEntry(CoreEntry):
    """A core behind a bus in one configuration."""

    streams: bool = True


# One core is routed: the bus is the same for all.
BUSES = tuple(BusEntry(f"{main_module(config)}_axi", config, partial(axi_core, config, streams=streams),
                       placed=config.name == "thesis", streams=streams)
              for config, streams in ((CONFIGS["thesis"], False), *((CONFIGS[name], True) for name in (
                  "thesis", "thesis_x8", "quaternion_j2"))))


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
