"""Addition."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FpAdd

from .base import Operation, Operator

__all__ = ["Adder"]


@dataclass(frozen=True, kw_only=True)
class Adder(Operator):
    """Pipelined adder: ``a + b``, and ``a - b`` by the sign of an operand.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FpAdd``.
    dsp_shifts : bool
        True for shifts by multiplications, as of ``FpAdd``.
    two_paths : bool
        True for a path of its own for differences of close numbers, as of ``FpAdd``.
    count : int
        How many there are.
    """

    name = "adder"
    component = FpAdd
    direct = True
    can_be_quiet = True
    operations = (Operation("add", twin=lambda component, a, b: component.compute(a, b), float64=np.add,
                            spreads=True),)

    latency: int = 5
    dsp_shifts: bool = False
    two_paths: bool = False
    count: int = 1
