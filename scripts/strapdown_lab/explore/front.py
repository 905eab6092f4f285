"""The pools that no other beats, and the one that a wish picks. A pool is a row, a dict of JSON values."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any

__all__ = ["Wish", "expected", "front", "measured", "pick", "spread", "staircase"]

Row = dict[str, Any]


def measured(row: Row) -> dict[str, Any]:
    """Figures of a row by the tools: ``time`` is microseconds if the core was routed, else cycles."""
    mhz = row["ecp5"]["fmax_mhz"] if "ecp5" in row else None
    return {"cycles": row["cycles"], "mhz": mhz, "us": row["cycles"] / mhz if mhz else None,
            "time": row["cycles"] / mhz if mhz else row["cycles"],
            **{name: row["xc7"][name] for name in ("lut", "ff", "dsp", "bram")}}


def expected(row: Row) -> dict[str, Any]:
    """Figures of a row as far as they are known: resources by the synthesis tool, else estimated; the clock frequency
    estimated, so that all rows are treated alike."""
    known, mhz = row.get("xc7") or row["estimate"], row["estimate"]["mhz"]
    return {"cycles": row["cycles"], "mhz": mhz, "us": row["cycles"] / mhz if mhz else None,
            "time": row["cycles"] / mhz if mhz else row["cycles"],
            **{name: known.get(name) for name in ("lut", "ff", "dsp", "bram")}}


OBJECTIVES = "time", "lut", "dsp", "bram"
"""What a better pool has less of."""


def front(rows: Iterable[Row], figures: Callable[[Row], dict], margin: float = 0.0) -> list[Row]:
    """The rows that no other beats: with at most as much of each objective, and less of one.

    With a margin a row also stays if it would stay with this share fewer LUTs. Of rows with equal figures the first
    stays.
    """
    kept: list[tuple[tuple, Row]] = []
    ranked = sorted(((tuple(figures(row)[name] for name in OBJECTIVES), index, row) for index, row in enumerate(rows)),
                    key=lambda entry: entry[:2])
    for own, _, row in ranked:
        bar = (own[0], own[1] * (1 - margin), *own[2:])
        if not any(all(mine >= theirs for mine, theirs in zip(bar, other, strict=True)) for other, _ in kept):
            kept.append((own, row))
    return [row for _, row in kept]


def staircase(rows: Iterable[Row], figures: Callable[[Row], dict]) -> list[Row]:
    """The rows that no other beats in time and LUTs alone, the fastest first."""
    found: list[Row] = []
    for row in sorted(rows, key=lambda row: (figures(row)["time"], figures(row)["lut"])):
        if not found or figures(row)["lut"] < figures(found[-1])["lut"]:
            found.append(row)
    return found


def spread(rows: list[Row], number: int, figures: Callable[[Row], dict], first: Iterable[Row] = ()) -> list[Row]:
    """Rows far from each other in time and LUTs, of which any number is a good sample: the fastest, the smallest, then
    the one that is farthest from those before. Those of ``first`` are taken before all."""
    def place(row):
        return math.log(figures(row)["time"]), math.log(figures(row)["lut"])

    chosen = list(first)
    waiting = [row for row in rows if not any(row is other for other in chosen)]
    for least in (lambda row: place(row), lambda row: place(row)[::-1]):
        if waiting and len(chosen) < number:
            chosen.append(row := min(waiting, key=least))
            waiting = [other for other in waiting if other is not row]
    while waiting and len(chosen) < number:
        chosen.append(row := max(waiting, key=lambda row: min(math.dist(place(row), place(other)) for other in chosen)))
        waiting = [other for other in waiting if other is not row]
    return chosen


@dataclass(frozen=True)
class Wish:
    """Limits of a pool; None for no limit.

    Attributes
    ----------
    us, cycles : float or None
        Longest update, in microseconds at the core's own clock frequency, and in cycles.
    mhz : float or None
        Least clock frequency.
    lut, ff, dsp, bram : float or None
        Most resources.
    """

    us: float | None = None
    cycles: float | None = None
    mhz: float | None = None
    lut: float | None = None
    ff: float | None = None
    dsp: float | None = None
    bram: float | None = None

    @property
    def limits(self) -> dict[str, float]:
        """The limits that there are."""
        return {each.name: getattr(self, each.name) for each in fields(self) if getattr(self, each.name) is not None}

    def met(self, figures: dict[str, Any], slack: float = 0.0) -> bool:
        """Whether figures are within all limits, or beyond them by a share of ``slack`` at most; a figure that is not
        known is not."""
        return all(figures[name] is not None and
                   (figures[name] >= limit * (1 - slack) if name == "mhz" else figures[name] <= limit * (1 + slack))
                   for name, limit in self.limits.items())

    @property
    def rule(self) -> str:
        """How ``pick`` chooses, in words."""
        words = " and ".join(_LIMIT_WORDS[name].format(f"{limit:,g}") for name, limit in self.limits.items())
        if not words:
            return "the least product of time and LUTs"
        kind = "the fewest LUTs" if self.us is not None or self.cycles is not None else "the shortest update"
        return f"{kind} with {words}"


_LIMIT_WORDS = {"us": "at most {} µs", "cycles": "at most {} cycles", "mhz": "at least {} MHz", "lut": "at most {} LUT",
                "ff": "at most {} FF", "dsp": "at most {} DSP", "bram": "at most {} BRAM"}


def pick(rows: Iterable[Row], wish: Wish, figures: Callable[[Row], dict]) -> Row | None:
    """The row that meets a wish; None if none does.

    If the wish limits the time, it is that of the fewest LUTs; if it has other limits, the fastest; else that with the
    least product of both.
    """
    def rank(row):
        own = figures(row)
        if wish.us is not None or wish.cycles is not None:
            return own["lut"], own["time"]
        return (own["time"], own["lut"]) if wish.limits else (own["time"] * own["lut"], own["time"])

    return min((row for row in rows if wish.met(figures(row))), key=rank, default=None)
