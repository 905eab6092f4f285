"""Choice between two numbers, and copies."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FpSelect

from .base import Operation, Operator

__all__ = ["Selector"]


@dataclass(frozen=True, kw_only=True)
class Selector(Operator):
    """Choice by a condition, ``xp.select(condition, a, b)``, and copies of numbers, from one place to another.

    A pool has one selector, because a program fetches one condition per cycle.
    """

    name = "selector"
    component = FpSelect
    beside = "adder"
    can_be_quiet = True
    operations = (
        Operation("select", twin=lambda component, a, b, condition: component.compute(a, b, condition),
                  float64=lambda a, b, condition: np.where(condition, a, b), takes_condition=True),
        # A choice between a number and itself.
        Operation("copy", twin=lambda component, a: a, float64=lambda a: a, operands=1))
