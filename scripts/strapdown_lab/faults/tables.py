"""The tables of docs/faults.md, from the figures of campaigns."""

from strapdown.cores import CONFIGS
from strapdown.markdown import markdown_table
from strapdown_sim.drivers.faults import Outcome

__all__ = ["cores_table", "places_tables", "total"]

WORDS = {outcome: outcome.name.lower().replace("_", " ") for outcome in Outcome}


def total(report, outcome, kind="outcomes"):
    """Number of faults of an outcome in a report; ``kind`` "lasting" for those that a reset does not restore."""
    return sum(place[kind].get(outcome.name, 0) for place in report["places"])


def cores_table(reports):
    """A row for each report: shares of the outcomes that are a matter of degree, and numbers of those that are not."""
    shares = [outcome for outcome in Outcome if outcome < Outcome.STUCK]
    numbers = [outcome for outcome in Outcome if outcome >= Outcome.STUCK]
    rows = []
    for report in reports:
        config = CONFIGS[report["config"]]
        rows.append([
            f"`{report['module']}`", f"`{config.name}`", f"{report['bits']:,}", f"{report['faults']:,}",
            *(f"{100 * total(report, outcome) / report['faults']:.1f} %" for outcome in shares),
            f"{100 * total(report, Outcome.WRONG_SILENT, 'lasting') / report['faults']:.1f} %",
            *(total(report, outcome) for outcome in numbers)])
    return markdown_table(
        ["module", "configuration", "bits:", "flips:", *(f"{WORDS[outcome]}:" for outcome in shares),
         "silent, and not restored by `rst_n`:", *(f"{WORDS[outcome]}:" for outcome in numbers)], rows)


def places_tables(reports):
    """A table for each report: its registers and memories that have an outcome other than masked."""
    return "\n\n".join(f"### {report['module']}, configuration {report['config']}\n\n{_places_table(report)}"
                       for report in reports)


def _places_table(report):
    shown = [outcome for outcome in Outcome if outcome and total(report, outcome)]
    rows = [place for place in report["places"] if set(place["outcomes"]) != {Outcome.MASKED.name}]
    # The most silent bits first.
    rows.sort(key=lambda place: -place["outcomes"].get(Outcome.WRONG_SILENT.name, 0))
    return markdown_table(
        ["register or memory", "kind", "bits:", "flips:", *(f"{WORDS[outcome]}:" for outcome in shown),
         "silent, and not restored by `rst_n`:"],
        [[f"`{place['place']}`", place["kind"], f"{place['bits']:,}", f"{place['faults']:,}",
          *(place["outcomes"].get(outcome.name, 0) for outcome in shown),
          place["lasting"].get(Outcome.WRONG_SILENT.name, 0)] for place in rows])
