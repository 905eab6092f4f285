"""Reciprocal square root."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FpReciprocalSquareRoot

from .base import Operation, Operator

__all__ = ["ReciprocalRoot"]


@dataclass(frozen=True, kw_only=True)
class ReciprocalRoot(Operator):
    """Iterative reciprocal square root, rounded once; without it, it is a root and a division.

    Parameters
    ----------
    bits_per_cycle : int
        Result bits per cycle, as in ``FpReciprocalSquareRoot``.
    count : int
        How many there are.
    """

    name = "reciprocal_root"
    component = FpReciprocalSquareRoot
    beside = "multiplier"
    operands = ("a",)
    operations = (Operation("rsqrt", twin=lambda component, a: component.compute(a),
                            float64=lambda a: 1 / np.sqrt(a), operands=1, fallback=lambda xp, a: 1 / xp.sqrt(a)),)

    bits_per_cycle: int = 1
    count: int = 1
