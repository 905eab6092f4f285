"""Multiplication."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FpMultiply

from .base import Operation, Operator

__all__ = ["Multiplier"]


@dataclass(frozen=True, kw_only=True)
class Multiplier(Operator):
    """Pipelined multiplier.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FpMultiply``.
    count : int
        How many there are.
    """

    name = "multiplier"
    component = FpMultiply
    direct = True
    can_be_quiet = True
    operations = (Operation("multiply", twin=lambda component, a, b: component.compute(a, b), float64=np.multiply,
                            spreads=True),)

    latency: int = 2
    count: int = 1
