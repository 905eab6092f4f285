"""Proves the properties of the catalogue, several at a time, and tabulates them."""

import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

from strapdown.markdown import markdown_table

from .catalogue import properties
from .solver import prove

__all__ = ["chosen", "run", "summary"]


def chosen(pattern=""):
    """The properties whose subject or claim matches a regular expression."""
    return [prop for prop in properties() if re.search(pattern, f"{prop.subject}: {prop.claim}")]


def run(props, build, *, jobs=2, report=lambda prop, outcome: None):
    """Try to prove properties; returns their outcomes, and writes them to ``build/outcomes.json``."""
    def one(numbered):
        number, prop = numbered
        outcome = prove(prop, build / f"{number:03}")
        report(prop, outcome)
        return outcome

    with ThreadPoolExecutor(jobs) as pool:
        outcomes = list(pool.map(one, enumerate(props)))
    rows = [
        {"folder": f"{number:03}", "circuit": prop.subject, "property": prop.claim, "engine": prop.engine,
         "depth": prop.depth, "result": outcome.word, "seconds": round(outcome.seconds, 1)}
        for number, (prop, outcome) in enumerate(zip(props, outcomes, strict=True))]
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
