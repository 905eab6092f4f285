"""Arctangent."""

from dataclasses import dataclass

import numpy as np

from strapdown.algorithms import arctangent
from strapdown.cordic import CordicAtan2

from .base import Operation, Operator

__all__ = ["Arctangent"]


@dataclass(frozen=True, kw_only=True)
class Arctangent(Operator):
    """Iterative four-quadrant arctangent; without it, ``atan2`` is a polynomial on the other operators.

    Parameters
    ----------
    steps_per_cycle : int
        CORDIC steps in a cycle, as of ``CordicAtan2``.
    count : int
        How many there are.
    """

    name = "arctangent"
    component = CordicAtan2
    beside = "multiplier"
    operands = ("y", "x")
    operations = (Operation("atan2", twin=lambda component, y, x: component.compute(y, x), float64=np.arctan2,
                            fallback=arctangent.atan2),)

    steps_per_cycle: int = 1
    count: int = 1
