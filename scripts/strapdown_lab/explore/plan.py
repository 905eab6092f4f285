"""The schedule of a pool, as figures; results are kept."""

import json
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import strapdown
from strapdown.config import Config
from strapdown.cores import make_core, system_of
from strapdown.kernel.machine import reads
from strapdown_lab.report.measure import core_circuit, cycles_of
from strapdown_sim.cache import Cache, digest
from strapdown_sim.jobs import remade

__all__ = ["circuit", "planned"]


def planned(configured: Callable[[], Config], module: str, settings: Mapping[str, str], cache: Cache) -> dict[str, Any]:
    """Figures of the schedule that a pool gives, as JSON values.

    Parameters
    ----------
    configured : callable
        Makes the configuration, also in a worker.
    module : str
        The module of the configuration.
    settings : dict
        Changes of the configuration that make the pool.
    cache : Cache
        Stores the figures. They depend on the kernel's operations, the pool's timing and this package.

    Returns
    -------
    dict
        ``cycles`` of an update, ``latency``, and the figures of the engine that ``estimate`` takes; or ``refused``, the
        reason in one line, for a pool that the engine refuses.
    """
    config = remade(configured).replace(**settings)

    def make(path):
        path.write_text(json.dumps(_figures(module, config)) + "\n", encoding="utf-8")

    try:
        inputs = _inputs(module, config)
    except ValueError as error:
        return {"refused": str(error)}
    return json.loads(cache.file(inputs, ".plan.json", make).read_text(encoding="utf-8"))


def _figures(module, config):
    try:
        core = make_core(module, config)
    except ValueError as error:
        return {"refused": str(error)}
    program = core.engine.program
    pool = program.schedule.pool
    number = program.format.width
    # With horizontal microcode the results meet in an OR, and nothing selects them.
    selected = {bus: names for bus, names in program.sources.items() if not pool.horizontal}
    forwarded = getattr(program, "operand_sources", ())
    return {
        "cycles": cycles_of(core), "latency": core.latency,
        "units": [unit.kind for unit in program.units], "width": number, "pairs": len(program.read_ports),
        "operand_sources": len(forwarded) or 1 + len(program.side_depths),
        "bus_sources": [len(names) for names in selected.values() if names],
        "other_sources": 0 if pool.horizontal else len(getattr(program, "other_sources", ())),
        "met_sources": len(program.units) + len(program.graph.inputs) + 1 if pool.horizontal else 0,
        "memory": pool.operand_memory.value, "depth": program.depth,
        "side": pool.side_memory.value if program.side_depths else None,
        "side_depths": [*program.side_depths.values()],
        "microcode": pool.microcode.value, "words": program.length, "word_bits": program.layout.size}


def _inputs(module, config):
    """All that the figures depend on."""
    system, pool = system_of(module, config), config.engine_pool
    graph = system.trace(pool)
    number = {node: index for index, node in enumerate(graph.nodes)}
    return {
        "nodes": [[node.operation, node.label, str(node.value), node.section,
                   [[number[read.node], read.operand.negated, read.condition] for read in reads(node)]]
                  for node in graph.nodes],
        "outputs": {name: number[node] for name, node in graph.outputs.items()},
        "next_state": {name: number[node] for name, node in graph.next_state.items()},
        "status": {name: [number[operand.node], operand.negated] for name, operand in graph.status.items()},
        "units": [[unit.name, unit.kind, unit.latency, unit.interval, unit.read_port, unit.direct, sorted(unit.modes)]
                  for unit in pool.units],
        "pool": {name: str(value) for name, value in pool.parameters.items()}, "format": str(pool.format),
        "channels": config.channels, "interval": config.interval, "sources": _sources()}


@cache
def _sources():
    """Digest of the generator."""
    root = Path(strapdown.__file__).parent
    return digest(*(path.read_text(encoding="utf-8") for path in sorted(root.rglob("*.py"))))


def circuit(configured: Callable[[], Config], module: str, settings: Mapping[str, str]) -> str:
    """Verilog of the module with a pool, without comments."""
    config = remade(configured).replace(**settings)
    return core_circuit(make_core(module, config), config)
