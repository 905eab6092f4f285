"""Time stamps of a stream: what is wrong with them, and what can be done about it.

Faults are put right in this order: rows without a stamp are dropped; a counter that wrapped is continued; a clock that
was set continues after one usual step; samples are sorted; samples with one stamp share the time to the next stamp, or
are dropped if there is none to share. Gaps remain: ``gaps`` finds them.
"""

from typing import NamedTuple

import numpy as np

__all__ = ["Clock", "Gap", "Gaps", "gaps", "mended"]

WRAPS_S = *(2.0**bits * unit for unit in (1e-6, 1e-3, 1e-4, 1e-9) for bits in (32, 31, 16, 24)), 86400.0, 3600.0
"""Moduli of clocks: counters in usual units, the time of the day and that of the hour."""

DISPLACED = 50
"""Number of samples that one sample can be late in the file; a step back over more is a clock that was set."""

SET_S = 1e6
"""A step forward by more is a clock that was set: no pause is so long."""

NEIGHBOURS = 8
"""Steps on each side of a step with which it is compared."""

LONG = 1.5
"""A step is long if it is more than this in usual steps."""

AROUND = 1, 2
"""Steps on each side of a long one, added to it: nothing is missing if a sum is less than half a step too long."""


class Clock(NamedTuple):
    """Mended time stamps.

    Fields
    ------
    rows : ndarray of int, shape (N,)
        Rows of the file that are used, in order of time.
    time_s : ndarray, shape (N,)
        Their time, increasing.
    faults : dict
        Name of each fault that was found to its number.
    restart : int or None
        The row of the file at which the clock starts from the beginning again; rows from there on are not used.
    """

    rows: np.ndarray
    time_s: np.ndarray
    faults: dict[str, int]
    restart: int | None = None


class Gap(NamedTuple):
    """A step without samples: the number of the sample after it, its ends in seconds, and the samples lost in it."""

    sample: int
    start_s: float
    end_s: float
    lost: int


class Gaps(NamedTuple):
    """Gaps of a clock, and the number of samples with a late stamp: their steps are long and short in turn."""

    lost: list[Gap]
    late: int


def mended(time_s: np.ndarray) -> Clock:
    """Time stamps in any order as an increasing clock; see the head of this file.

    Parameters
    ----------
    time_s : ndarray, shape (M,)
        Seconds; not finite where a row has no stamp.

    Returns
    -------
    Clock
        With fewer than two rows if no two stamps differ.
    """
    faults: dict[str, int] = {}
    rows = np.flatnonzero(np.isfinite(time_s))
    if len(rows) < len(time_s):
        faults["samples without a time stamp, dropped"] = len(time_s) - len(rows)
    time = time_s[rows]
    step = np.diff(time)
    if not (step > 0).any():
        return Clock(rows[:1], time[:1], faults)
    if (step > 0).all() and step.max() < SET_S:
        return Clock(rows, time, faults)
    usual = float(np.median(step[step > 0]))
    time, restart = _continued(time, usual, faults)
    if restart is not None:
        return Clock(rows[:restart], time[:restart], faults, restart=int(rows[restart]))
    behind = np.maximum.accumulate(time)[:-1] > time[1:]
    if behind.any():
        faults["samples out of order, sorted"] = int(behind.sum())
        order = np.argsort(time, kind="stable")
        rows, time = rows[order], time[order]
    if (np.diff(time) == 0).any():
        keep, time = _separated(time, faults)
        rows = rows[keep]
    return Clock(rows, time, faults)


def _continued(time, usual, faults):
    """Stamps without the steps of a counter that wrapped, and of a clock that was set."""
    step = np.diff(time)
    added, restart = np.zeros(len(time)), None
    for index in np.flatnonzero((step < 0) | (step > SET_S)):
        recent = slice(max(index + 1 - 10 * DISPLACED, 0), index + 1)
        here = time[index + 1] + added[index + 1]
        forward = step[index] > SET_S
        wrapped = [modulus for modulus in WRAPS_S
                   if modulus > 2 * DISPLACED * usual and 0 < step[index] + modulus <= 5 * usual]
        if not forward and not wrapped and np.count_nonzero(time[recent] + added[recent] > here) <= DISPLACED:
            continue
        if wrapped and not forward:
            kind, change = "wraps of the clock, continued", wrapped[0]
        elif not forward and time[index + 1] <= time[0] + 2 * usual:
            restart = index + 1
            break
        else:
            kind, change = "steps of the clock, replaced by one usual step", usual - step[index]
        faults[kind] = faults.get(kind, 0) + 1
        added[index + 1:] += change
    return time + added, restart


def _separated(time, faults):
    """Rows to keep and their stamps, where several have one stamp."""
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    step = np.diff(stamps)
    usual = float(np.median(np.repeat(step / counts[:-1], counts[:-1])))
    # In the last group as many as usual fit; there is no next stamp.
    room = np.append(step, usual * counts[-1] if (counts[:-1] > 1).mean() > 0.5 else usual)
    shared = room >= 0.5 * usual * counts
    place = np.arange(len(time)) - np.repeat(first, counts)
    spread = np.repeat(shared, counts)
    keep = np.flatnonzero(spread | (place == 0))
    times = np.repeat(stamps, counts) + np.where(spread, place * np.repeat(room / counts, counts), 0.0)
    if moved := int((spread & (place > 0)).sum()):
        faults["samples with the stamp of the one before, spread"] = moved
    if dropped := len(time) - len(keep):
        faults["doubled samples, dropped"] = dropped
    return keep, times[keep]


def gaps(time_s: np.ndarray) -> Gaps:
    """Gaps of an increasing clock.

    Notes
    -----
    A step is compared with the medians of the eight steps before and after it, of which the longer one counts: a rate
    that changes is no gap. A long step with short ones around it is a late stamp, and no sample is
    missing.
    """
    step = np.diff(time_s)
    usual = _usual(step)
    long = step > LONG * usual
    late = np.zeros(len(step), bool)
    for count in AROUND:
        padded = np.concatenate([usual[:1].repeat(count), step, usual[-1:].repeat(count)])
        around = np.lib.stride_tricks.sliding_window_view(padded, 2 * count + 1).sum(axis=1)
        late |= long & (around < (2 * count + 1.5) * usual)
    lost = []
    for index in np.flatnonzero(long & ~late):
        number = max(round(float(step[index] / usual[index])) - 1, 0)
        if number:
            lost.append(Gap(int(index) + 1, float(time_s[index]), float(time_s[index + 1]), number))
    return Gaps(lost, int(late.sum()))


def _usual(step):
    """The usual step around each step: the longer one of the medians before and after it."""
    usual = np.array([_usual_at(step, index) for index in range(min(len(step), NEIGHBOURS))])
    if len(step) <= 2 * NEIGHBOURS:
        return np.array([_usual_at(step, index) for index in range(len(step))])
    windows = np.median(np.lib.stride_tricks.sliding_window_view(step, NEIGHBOURS), axis=1)
    middle = np.maximum(windows[:-NEIGHBOURS - 1], windows[NEIGHBOURS + 1:])
    end = np.array([_usual_at(step, index) for index in range(len(step) - NEIGHBOURS, len(step))])
    return np.concatenate([usual, middle, end])


def _usual_at(step, index):
    sides = step[max(index - NEIGHBOURS, 0):index], step[index + 1:index + 1 + NEIGHBOURS]
    medians = [np.median(side) for side in sides if len(side)]
    # At an end the step beside it stands for the other side.
    nearest = [side[end] for side, end in zip(sides, (-1, 0), strict=True) if len(medians) == 1 and len(side)]
    return max([*medians, *nearest], default=step[index])
