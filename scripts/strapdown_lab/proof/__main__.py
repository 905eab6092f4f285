"""`python -m strapdown_lab.proof`: formal, exhaustive, spots, mutants and the generated parts of docs/proof.md."""

import json
import re

import click
from rich.console import Console
from rich.table import Table

from strapdown.blocks import SENSORS
from strapdown.cli.jobs import job_options
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.jobs import JobsError

from ..checkout import ROOT, write_blocks
from . import exhaustive, formal, mutation, spots
from .mutants import MUTANTS
from .solver import SolverMissingError

console = Console(width=160)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def main():
    """Proofs of circuits, runs of many operands, and faults that tests must detect: docs/proof.md."""


@main.command("formal")
@click.option("--only", default="", metavar="REGEX", help="Only properties whose circuit or claim matches.")
@job_options
def formal_command(only, **where):
    """Prove the properties of all operators and engines. The table is also written to build/formal/outcomes.json."""
    props = formal.chosen(only)
    if not props:
        raise click.BadParameter(f"no property matches {only!r}", param_hint="--only")
    table = Table("circuit", "property", "engine", "edges", "result", "s")

    def report(prop, outcome):
        console.print(f"{outcome.word:7} {prop.subject}: {prop.claim}", highlight=False)
        if outcome.report:
            console.print(outcome.report, highlight=False, markup=False)

    try:
        outcomes = formal.run(props, ROOT / "build" / "formal", report=report, **where)
    except (JobsError, SolverMissingError) as error:
        raise click.ClickException(str(error)) from None
    for prop, outcome in zip(props, outcomes, strict=True):
        table.add_row(prop.subject, prop.claim, prop.engine, str(prop.depth), outcome.word, f"{outcome.seconds:.1f}")
    console.print(table)
    failed = sum(not outcome.passed for outcome in outcomes)
    console.print(f"{len(outcomes) - failed} of {len(outcomes)} properties proved")
    if failed:
        raise SystemExit(1)


@main.command("exhaustive")
@click.option("--only", multiple=True, type=click.Choice(list(exhaustive.RUNS)), help="May be repeated.")
@click.option("--fraction", "part", default="1", show_default=True, metavar="PART",
              help="Part of all operands, evenly spread, as in 1/256.")
@job_options
def exhaustive_command(only, part, **where):
    """Run all 2**32 operands through Verilated operators. An interrupted run continues where it stopped."""
    try:
        part = exhaustive.fraction(part)
    except (ValueError, ZeroDivisionError):
        raise click.BadParameter(f"must be above 0 and at most 1, not {part!r}", param_hint="--fraction") from None
    try:
        runs = exhaustive.check(only or list(exhaustive.RUNS), part, ROOT, **where)
    except (JobsError, SimulatorMissingError) as error:
        raise click.ClickException(str(error)) from None
    except KeyboardInterrupt:
        raise click.ClickException("interrupted; the same command continues from here") from None
    for run in runs:
        state = run.state
        operands = len(state["shards"]) * exhaustive.SHARD
        console.print(f"{run.name}: {operands:,} operands, {state['mismatches']} mismatches")
        for row in state["examples"]:
            operand, got, wanted = row.split()
            console.print(f"  {operand} gives {got}, not {wanted}", highlight=False)
    if any(run.state["mismatches"] for run in runs):
        raise SystemExit(1)


@main.command("spots")
@click.option("--only", multiple=True, type=click.Choice(list(SENSORS)), help="May be repeated.")
@click.option("--lines", type=click.IntRange(1), default=1_000_000, show_default=True, help="Random lines of a sensor.")
@job_options
def spots_command(only, lines, **where):
    """Run random lines through the Verilated spot finder."""
    try:
        entries, examples = spots.check(only or list(SENSORS), lines, ROOT, **where)
    except (JobsError, SimulatorMissingError) as error:
        raise click.ClickException(str(error)) from None
    spots.record(entries, ROOT)
    for sensor, entry in entries.items():
        console.print(f"{sensor}: {lines:,} lines, {entry['mismatches']} mismatches", highlight=False)
    for row in examples:
        console.print(f"  {row}", highlight=False)
    if examples:
        raise SystemExit(1)


@main.command("mutants")
@click.option("--only", default="", metavar="REGEX", help="Only faults whose file matches.")
@click.option("--baseline/--no-baseline", default=True, show_default=True,
              help="Run the tests without a fault first; not needed after `make test` has passed.")
@job_options
def mutants_command(only, baseline, **where):
    """Put single faults into copies of the package; tests must detect each of them."""
    for mutant, count in mutation.misplaced(ROOT / "hw" / "strapdown"):
        raise click.ClickException(f"{mutant.file} contains this {count} times, not once: {mutant.fragment}")
    mutants = [mutant for mutant in MUTANTS if re.search(only, mutant.file)]
    if not mutants:
        raise click.BadParameter(f"no file matches {only!r}", param_hint="--only")

    def report(verdict):
        word = "killed" if verdict.killed else "SURVIVED"
        console.print(f"{word:8} {verdict.mutant.file}: {verdict.mutant.breaks}  {verdict.by}", highlight=False)

    try:
        verdicts = mutation.run(mutants, ROOT, baseline=baseline, report=report, **where)
    except RuntimeError as error:
        raise click.ClickException(str(error)) from None
    survivors = [verdict.mutant for verdict in verdicts if not verdict.killed]
    console.print(f"{len(verdicts) - len(survivors)} of {len(verdicts)} faults detected")
    if survivors:
        raise SystemExit(1)


@main.command("document")
def document():
    """Write the generated parts of docs/proof.md."""
    write_blocks(ROOT / "docs" / "proof.md", blocks())


def blocks():
    """Generated parts of docs/proof.md, by the name of their block."""
    exhaustive_runs, spot_runs = (json.loads(record.read_text(encoding="utf-8")) if record.exists() else {}
                                  for record in (ROOT / "docs" / "exhaustive.json", ROOT / "docs" / "spots.json"))
    return {"properties": formal.summary(), "exhaustive": exhaustive.table(exhaustive_runs),
            "spots": spots.table(spot_runs), "faults": mutation.table()}


if __name__ == "__main__":
    main()
