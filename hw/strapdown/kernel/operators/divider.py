"""Division and square root."""

from dataclasses import dataclass

import numpy as np

from strapdown.algorithms.vector import root
from strapdown.fp import FpDivideSquareRoot

from .base import Operation, Operator

__all__ = ["Divider"]


@dataclass(frozen=True, kw_only=True)
class Divider(Operator):
    """Iterative division and square root in one circuit; without it, a quotient is a product with a reciprocal, and a
    root one with a reciprocal root.

    Parameters
    ----------
    bits_per_cycle : int
        Result bits per cycle, as in ``FpDivideSquareRoot``.
    count : int
        How many there are.
    """

    name = "divider"
    component = FpDivideSquareRoot
    beside = "multiplier"
    operations = (
        Operation("divide", twin=lambda component, a, b: component.compute(a, b, False), float64=np.divide,
                  fallback=lambda xp, a, b: a * xp.reciprocal(b)),
        Operation("sqrt", twin=lambda component, a: component.compute(a, a, True), float64=np.sqrt,
                  operands=1, mode="square_root", fallback=root))

    bits_per_cycle: int = 1
    count: int = 1
