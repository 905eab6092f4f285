"""What curves in pictures and pages have in common: colours, gaps at jumps, and marks where there are few points."""

import numpy as np

__all__ = ["ESTIMATE", "FEW", "GRID", "HARDWARE", "REFERENCE", "few", "span", "without_jumps"]

HARDWARE, REFERENCE, ESTIMATE, GRID = "#10243e", "#8fc1ea", "#e0a458", "#e4e4e4"
"""Colours of the circuit, of what it is compared with, of a third curve, and of the grid."""

FEW = 40
"""Most points of a curve that are marked: fewer than that a line shows badly, and one or two not at all."""


def few(values):
    """Whether so few values are finite that the points must be marked."""
    return int(np.isfinite(values).sum()) <= FEW


def span(time_s):
    """Ends of the axis of time, with room for the marks of the first and of the last of few samples."""
    room = 0.02 * (time_s[-1] - time_s[0]) if few(time_s) else 0.0
    return float(time_s[0] - room), float(time_s[-1] + room)


def without_jumps(angle):
    """Angle in degrees with a gap where it jumps by more than half a turn, so that no line joins the two sides."""
    broken = np.array(angle, dtype=float)
    broken[1:][np.abs(np.diff(angle)) > 180.0] = np.nan
    return broken
