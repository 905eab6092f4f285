"""Clock frequency on a 7-series part by an openXC7 toolchain that the user has installed: nextpnr-xilinx.

The netlist is that of the Yosys of this project, in the wrapper of ``placement``. nextpnr-xilinx takes no hierarchy and
no ``$scopeinfo``: the hierarchy is dissolved after the synthesis, so the module is not merged with the wrapper.
"""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from strapdown.tools import ToolError
from strapdown_sim.cache import Cache

from .ecp5 import ECP5_SEEDS
from .placement import INSTANCE, Placement, clock_of_seeds, wrapped_netlist
from .tools import ToolMissingError
from .xc7 import XC7_OPTIONS

__all__ = ["OpenXc7", "OpenXc7Placement", "PathReportError", "place_openxc7", "read_path"]

PROGRAM = "nextpnr-xilinx"

PINS = "".join(f"set_property LOC {site} [get_ports {port}]\nset_property IOSTANDARD LVCMOS33 [get_ports {port}]\n"
               for port, site in (("clk", "L16"), ("serial_in", "G15"), ("serial_out", "M14")))
"""Constraints of the wrapper's pins for an xc7z010clg400, as on a Zybo: clock, switch, light."""

OPTIONS = "--freq 100 --timing-allow-fail"
"""Options of ``nextpnr-xilinx``."""


class PathReportError(RuntimeError):
    """The log of nextpnr has no clock frequency, or no critical path. The message is one line."""


@dataclass(frozen=True)
class OpenXc7:
    """An installed toolchain.

    Attributes
    ----------
    program, chipdb : Path
        nextpnr-xilinx, and its chip database.
    pins : str
        Constraints of the pins clk, serial_in and serial_out.
    version : str
        What the program says of itself.
    """

    program: Path
    chipdb: Path
    pins: str
    version: str

    @classmethod
    def found(cls, folder: Path) -> "OpenXc7":
        """The toolchain in a folder.

        It holds nextpnr-xilinx, in itself or in bin; a chip database xc7*.bin, in itself or in chipdb; and pins.xdc,
        unless the database is that of an xc7z010. Raises: ToolMissingError that says what is missing.
        """
        program = next((path for path in (folder / PROGRAM, folder / "bin" / PROGRAM) if os.access(path, os.X_OK)
                        and path.is_file()), None)
        if program is None:
            raise ToolMissingError(f"{folder} has no program {PROGRAM}, nor has its folder bin: docs/report.md says "
                                   "what it must hold")
        databases = [*folder.glob("xc7*.bin"), *(folder / "chipdb").glob("xc7*.bin")]
        if not databases:
            raise ToolMissingError(f"{folder} has no chip database xc7*.bin, nor has its folder chipdb: docs/report.md "
                                   "says how to make one")
        if len(databases) > 1:
            names = ", ".join(sorted(path.name for path in databases))
            raise ToolMissingError(f"{folder} must have one chip database, not {names}")
        constraints = folder / "pins.xdc"
        if not constraints.is_file() and not databases[0].name.startswith("xc7z010"):
            raise ToolMissingError(f"{folder} needs a file pins.xdc with pins of {databases[0].stem} for clk, "
                                   "serial_in and serial_out")
        pins = constraints.read_text(encoding="utf-8") if constraints.is_file() else PINS
        program = program.absolute()
        return cls(program, databases[0].absolute(), pins, _output([program, "--version"], folder).strip())

    @property
    def command(self) -> str:
        """The command in a report."""
        return f"synth_xilinx {XC7_OPTIONS}; {PROGRAM} --chipdb {self.chipdb.name} {OPTIONS}"


def _output(words, folder):
    """Both outputs of a program. Raises: ToolMissingError if it does not start, ToolError if it fails."""
    try:
        done = subprocess.run(list(map(os.fspath, words)), cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace", check=False)
    except OSError as error:
        raise ToolMissingError(f"{words[0]} does not start: {error.strerror}") from None
    if done.returncode:
        raise ToolError(PROGRAM, done.returncode, done.stdout)
    return done.stdout


@dataclass(frozen=True)
class OpenXc7Placement(Placement):
    """Clock frequency of a module by an openXC7 toolchain.

    Attributes
    ----------
    fmax_mhz : tuple of float
        Routed clock frequency for each seed.
    critical : tuple of str
        Cells where the slowest path starts and ends, for the median seed.
    """

    fmax_mhz: tuple[float, ...]
    critical: tuple[str, str]


def place_openxc7(toolchain: OpenXc7, verilog: str, top: str, cache: Cache, *, clock: str = "clk",
                  seeds: tuple[int, ...] = ECP5_SEEDS) -> OpenXc7Placement:
    """Synthesise, place and route a module, once for each of ``seeds``; other parameters are those of ``place_ecp5``.

    Raises: ToolMissingError; ToolError if a tool fails; PathReportError for a log without a frequency.
    """
    netlist = wrapped_netlist(verilog, top, f"synth_xilinx {XC7_OPTIONS}", cache, clock=clock,
                              finish="setattr -mod -unset keep_hierarchy *; flatten; delete t:$scopeinfo; "
                                     "opt_clean -purge")

    def log(seed):
        def make(path):
            with TemporaryDirectory() as scratch:
                shutil.copyfile(netlist, Path(scratch, "netlist.json"))
                Path(scratch, "pins.xdc").write_text(toolchain.pins, encoding="utf-8")
                text = _output([toolchain.program, "--chipdb", toolchain.chipdb, "--xdc", "pins.xdc", "--json",
                                "netlist.json", "--seed", str(seed), *OPTIONS.split()], scratch)
            path.write_text(text, encoding="utf-8")

        size = toolchain.chipdb.stat().st_size
        inputs = {"netlist": netlist.name, "options": OPTIONS, "seed": seed, "pins": toolchain.pins,
                  "version": toolchain.version, "chipdb": [toolchain.chipdb.name, size]}
        return cache.file(inputs, ".openxc7.log", make).read_text(encoding="utf-8")

    return OpenXc7Placement(**clock_of_seeds([read_path(log(seed)) for seed in seeds]))


def read_path(log: str) -> tuple[float, tuple[str, str]]:
    """Clock frequency in MHz, and the cells at the ends of the slowest path, in a log of nextpnr-xilinx.

    The log has both twice, estimated after the placement and again after the routing: the last counts.

    Raises: PathReportError.
    """
    frequencies = re.findall(r"Max frequency for clock\s+'[^']*':\s+([\d.]+) MHz", log)
    if not frequencies:
        raise PathReportError(f"the log of {PROGRAM} has no clock frequency")
    blocks = re.split(r"Critical path report for (?=clock )", log)
    ends = re.findall(r"^Info:.*?(Source|Setup)\s+(\S+)\.[\w\[\]]+\s*$", blocks[-1].partition("\n\n")[0],
                      re.MULTILINE)
    if len(blocks) < 2 or len(ends) < 2:
        raise PathReportError(f"the log of {PROGRAM} has no critical path")
    setup = next((cell for kind, cell in ends if kind == "Setup"), ends[-1][1])
    return float(frequencies[-1]), (ends[0][1].removeprefix(f"{INSTANCE}."), setup.removeprefix(f"{INSTANCE}."))
