"""Resources and clock frequency of a core before its synthesis: those of its operators, measured alone, and of the
engine around them, counted."""

from typing import Any

__all__ = ["estimate"]

FIXED_LUT = 120
"""LUTs of sequencer and handshake."""

OF_MUX = 3
"""A LUT of six inputs takes this number of sources more than one."""

OF_OR = 5
"""A LUT of six inputs takes this number of inputs of an OR more than one."""

RAM_LUT = {16: 0.67, 32: 0.67, 64: 1.34}
"""LUTs of a bit of LUT RAM with one read port, by its depth: UG474, RAM32M and RAM64M."""

BLOCK_BITS, BLOCK_WORDS, BLOCK = 36, 512, 0.5
"""Width, depth and amount of half a block RAM: UG473."""


def estimate(plan: dict[str, Any], units: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Estimated resources of a core.

    Parameters
    ----------
    plan : dict
        Figures of ``planned``.
    units : dict
        Maps each kind of operator to the resources of one: ``lut``, ``dsp``, ``bram`` and, if it was routed, ``mhz``.

    Returns: dict with ``lut``, ``dsp``, ``bram``; ``mhz`` is that of the slowest operator alone, which a core does not
    exceed by much, or None.
    """
    taken = [units[kind] for kind in plan["units"]]
    copies, width = 2 * plan["pairs"], plan["width"]
    lut = FIXED_LUT + sum(unit["lut"] for unit in taken)
    lut += width * (copies * _mux(plan["operand_sources"]) + sum(map(_mux, plan["bus_sources"]))
                    + _mux(plan["other_sources"]) + -(-max(plan["met_sources"] - 1, 0) // OF_OR))
    bram = sum(unit["bram"] for unit in taken)
    for style, depth in (plan["memory"], plan["depth"]), *((plan["side"], depth) for depth in plan["side_depths"]):
        if style == "block":
            bram += copies * _blocks(width, depth)
        elif style:
            lut += copies * width * RAM_LUT.get(depth, depth / 32)
    if plan["microcode"] == "distributed":
        lut += plan["word_bits"] * plan["words"] / 64
    else:
        bram += _blocks(plan["word_bits"], plan["words"])
    clocks = [unit["mhz"] for unit in taken if unit.get("mhz") is not None]
    return {"lut": round(lut), "dsp": sum(unit["dsp"] for unit in taken), "bram": bram,
            "mhz": min(clocks) if clocks else None}


def _mux(sources):
    """LUTs of a bit of a multiplexer."""
    return -(-max(sources - 1, 0) // OF_MUX)


def _blocks(width, depth):
    return BLOCK * -(-width // BLOCK_BITS) * -(-depth // BLOCK_WORDS)
