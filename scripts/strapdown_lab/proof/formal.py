"""Proves the properties of the catalogue, several at a time, and tabulates them."""

import json
import re
from collections import Counter
from concurrent.futures import as_completed

from strapdown.markdown import markdown_table
from strapdown_sim.jobs import outcome, workers

from .catalogue import properties
from .solver import prove

__all__ = ["chosen", "run", "summary"]


def chosen(pattern=""):
    """The properties whose subject or claim matches a regular expression."""
    return [prop for prop in properties() if re.search(pattern, f"{prop.subject}: {prop.claim}")]


def run(props, build, *, jobs=2, scheduler=None, report=lambda prop, found: None):
    """Try to prove properties; returns their outcomes, and writes them to ``build/outcomes.json``.

    ``jobs`` and ``scheduler`` are those of ``strapdown_sim.jobs.workers``. The files of a proof stay where it ran.
    """
    build.mkdir(parents=True, exist_ok=True)
    with workers(jobs, scheduler, threads=True) as pool:
        proofs = {pool.executor.submit(prove, prop, build / f"{number:03}"): prop for number, prop in enumerate(props)}
        for proof in as_completed(proofs):
            report(proofs[proof], outcome(proof))
    outcomes = [proof.result() for proof in proofs]
    rows = [
        {"folder": f"{number:03}", "circuit": prop.subject, "property": prop.claim, "engine": prop.engine,
         "depth": prop.depth, "result": found.word, "seconds": round(found.seconds, 1)}
        for number, (prop, found) in enumerate(zip(props, outcomes, strict=True))]
    (build / "outcomes.json").write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    return outcomes


def summary():
    """The catalogue as a Markdown table: property, circuit, number of variants, depths."""
    counts: Counter[tuple[str, str]] = Counter()
    depths: dict[tuple[str, str], set[int]] = {}
    for prop in properties():
        # One row for the idle cycles, and no parameters.
        circuit = "the ten vendor operators" if prop.subject.startswith("vendor ") else prop.subject.split(",")[0]
        key = re.sub(r", \d idle cycles between,", "", prop.claim), circuit
        counts[key] += 1
        depths.setdefault(key, set()).add(prop.depth)
    rows = []
    for (claim, circuit), count in counts.items():
        least, most = min(depths[claim, circuit]), max(depths[claim, circuit])
        rows.append([claim, circuit, count, least if least == most else f"{least} to {most}"])
    return markdown_table(["property", "circuit", "variants:", "clock edges:"],
                          [*rows, ["all", "", counts.total(), ""]])
