"""Arctangent in degrees by tables."""

import math
from dataclasses import dataclass

import numpy as np

from strapdown.cordic import TableAtan2

from .base import Operation, Operator

__all__ = ["TableArctangent"]


class DegreesAtan2(TableAtan2):
    """``TableAtan2`` in degrees.

    Members, latency, interval, accuracy, special values and errors: those of ``TableAtan2``.
    """

    def __init__(self, format, *, latency):
        super().__init__(format, degrees=True, latency=latency)


def degrees(radians):
    """An angle in degrees."""
    return 180 / math.pi * radians


@dataclass(frozen=True, kw_only=True)
class TableArctangent(Operator):
    """Pipelined four-quadrant arctangent in degrees; without it, ``xp.atan2_degrees`` is the product of ``xp.atan2``.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``TableAtan2``.
    count : int
        How many there are.
    """

    name = "table_arctangent"
    component = DegreesAtan2
    beside = "multiplier"
    operands = ("y", "x")
    operations = (Operation("atan2_degrees", twin=lambda component, y, x: component.compute(y, x),
                            float64=lambda y, x: degrees(np.arctan2(y, x)),
                            fallback=lambda xp, y, x: degrees(xp.atan2(y, x))),)

    latency: int = 17
    count: int = 1
