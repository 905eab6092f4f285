"""Slowest paths in words: from the names of registers and cells to operators and their ranks."""

import re

from strapdown.kernel.operators import KINDS

__all__ = ["path_words", "place_words"]

_CELL = re.compile(r"_(?:TRELLIS_|FD[RSCP]E|DP16KD|PDPW16KD|RAMB|RAM\d|SRL|DSP48|MULT18|ALU54|LUT\d|CARRY4|CCU2C|MUXF|"
                   r"PFUMX|L6MUX|INV|SLICE).*")
"""What Yosys and nextpnr add to the name of the signal that a cell drives."""

_PLACES = {"next_word": "microcode", "word": "microcode", "next_address": "operand addresses", "reset": "reset",
           "operands": "operand memory", "main_memory": "main memory", "side_memory": "side memory"}


def place_words(name: str) -> str:
    """The place of a register or cell in words: an operator and its rank, a part of the engine, or its name."""
    # Numbers are those of the parts of a memory.
    parts = [_CELL.sub("", part) for part in name.split(".") if not part.isdecimal()]
    signal = parts[-1]
    for part in parts[-2::-1]:
        if (kind := KINDS.get(re.sub(r"_\d+$", "", part))) is not None:
            return f"{part}, {_rank(kind, signal)}"
    if match := re.fullmatch(r"port(\d+)_([ab])(?:_\w+)?", signal):
        return f"operand register {match[2]} of read pair {match[1]}"
    if (match := re.fullmatch(r"(\w+?(?:_\d+)?)_result", signal)) and re.sub(r"_\d+$", "", match[1]) in KINDS:
        return f"result of {match[1]}"
    if match := re.fullmatch(r"(\w+)_arrives", signal):
        return f"write enable of {match[1]}"
    return _PLACES.get(signal) or f"`{'.'.join(parts)}`"


def _rank(kind, signal):
    """The register rank of an operator that a signal belongs to."""
    pipelines = (getattr(kind.component, name, None) for name in ("PIPELINE", "GRADUAL_PIPELINE"))
    cuts = {cut for pipeline in pipelines if pipeline for cut in pipeline.cuts}
    for cut in sorted(cuts, key=len, reverse=True):
        if signal == cut or signal.startswith(f"{cut}_"):
            return f"rank {cut}"
    fields = (f"{operand}_{part}" for operand in kind.operands for part in ("sign", "exponent", "fraction"))
    return "operands" if signal in (*kind.operands, *fields, "start") else f"`{signal}`"


def path_words(ends: tuple[str, str] | list[str]) -> str:
    """A path from one register to another in words."""
    first, last = map(place_words, ends)
    return f"within {first}" if first == last else f"{first} → {last}"
