"""Timing diagrams in text, drawn from an operator's latency and interval."""

from typing import NamedTuple

__all__ = ["Timing", "diagram", "iterative_timing", "pipelined_timing"]

_GAP = None


class Timing(NamedTuple):
    """Contents of a diagram, one value per cycle. Operations are single letters; "" means none.

    Attributes
    ----------
    operands : list of str
        Operation whose operands are offered, with ``start`` high.
    results : list of str
        Operation whose results are valid.
    done, busy : list of bool
        Levels; ``busy`` is empty for a pipeline.
    """

    operands: list[str]
    results: list[str]
    done: list[bool]
    busy: list[bool]


def pipelined_timing(latency):
    """Operations A and B in consecutive cycles, and C after a cycle without a start."""
    operands = ["A", "B", "", "C", *[""] * (latency + 1)]
    results = [*[""] * latency, *operands[:5]]
    return Timing(operands, results, [bool(operation) for operation in results], [])


def iterative_timing(latency, interval):
    """A, then X, which is too early and ignored, then B as early as possible."""
    cycles = interval + latency + 2
    operands, results = [""] * cycles, [""] * cycles
    operands[0], operands[2], operands[interval] = "A", "X", "B"
    for cycle in range(latency, cycles):
        results[cycle] = "A" if cycle < interval + latency else "B"
    done = [cycle in (latency, interval + latency) for cycle in range(cycles)]
    return Timing(operands, results, done, [0 < cycle <= 2 * interval for cycle in range(cycles)])


def diagram(timing, operands, results):
    """The lines of a diagram; ``operands`` and ``results`` are the names of their rows."""
    start = [bool(operation) for operation in timing.operands]
    rows = [timing.operands, timing.results, timing.done, timing.busy or start]
    columns = _columns(rows, len(start))
    lines = [("clk", "".join(" .. " if cycle is _GAP else "/‾\\_" for cycle in columns)),
             ("cycle", "".join(f"{'' if cycle is _GAP else cycle:<4}" for cycle in columns)),
             ("start", _levels(start, columns)), (operands, _labels(timing.operands, columns))]
    if timing.busy:
        lines.append(("(busy)", _levels(timing.busy, columns)))
    lines += [("done", _levels(timing.done, columns)), (results, _labels(timing.results, columns))]
    width = max(len(name) for name, _ in lines) + 2
    return "\n".join(f"{name:{width}}{wave}".rstrip() for name, wave in lines)


def _columns(rows, cycles):
    """The cycles to draw: those near a change in any row, with a gap where two or more are omitted."""
    changes = {0, *(cycle for row in rows for cycle in range(1, cycles) if row[cycle] != row[cycle - 1])}
    drawn = {cycle + near for cycle in changes for near in (-1, 0)} | {cycles - 1}
    columns: list[int | None] = []
    for cycle in range(cycles):
        alone = cycle - 1 in drawn and cycle + 1 in drawn
        if cycle in drawn or alone:
            columns.append(cycle)
        elif columns[-1] is not _GAP:
            columns.append(_GAP)
    return columns


def _levels(levels, columns):
    wave, before = "", False
    for cycle in columns:
        level = before if cycle is _GAP else levels[cycle]
        line = "‾" if level else "_"
        first = line if level == before else "/" if level else "\\"
        wave += f"{line}..{line}" if cycle is _GAP else first + 3 * line
        before = level
    return wave


def _labels(labels, columns):
    """Each run of one label in brackets; invalid values are blank."""
    runs: list[list] = []
    for cycle in columns:
        label = runs[-1][0] if cycle is _GAP else labels[cycle]
        if runs and runs[-1][0] == label:
            runs[-1][1] += 4
        else:
            runs.append([label, 4])
    return "".join(f"‹{label:^{length - 2}}›" if label else " " * length for label, length in runs)
