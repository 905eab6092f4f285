"""Minimum and maximum."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FpMinMax

from .base import Operation, Operator

__all__ = ["Extremes"]


@dataclass(frozen=True, kw_only=True)
class Extremes(Operator):
    """Pipelined minimum and maximum; without it, they are a comparison and a choice.

    The operator treats -0 as less than +0. The choice treats them as equal, and gives the first of equal numbers.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FpMinMax``.
    count : int
        How many there are.
    """

    name = "extremes"
    component = FpMinMax
    beside = "adder"
    operations = (
        Operation("minimum", twin=lambda component, a, b: component.compute(a, b, False), float64=np.minimum,
                  fallback=lambda xp, a, b: xp.select(a < b, a, b)),
        Operation("maximum", twin=lambda component, a, b: component.compute(a, b, True), float64=np.maximum,
                  fallback=lambda xp, a, b: xp.select(a < b, b, a), mode="maximum"))

    latency: int = 1
    count: int = 1
