"""Reciprocal and reciprocal square root by a table."""

from dataclasses import dataclass, replace

from strapdown.fp import FpTableReciprocal

from .base import Operation, Operator
from .reciprocal_root import ReciprocalRoot

__all__ = ["TableReciprocal"]


@dataclass(frozen=True, kw_only=True)
class TableReciprocal(Operator):
    """Pipelined reciprocal and reciprocal square root by a table, within 0.88 units in the last place.

    Without it, ``xp.reciprocal`` is a division, rounded once.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FpTableReciprocal``.
    count : int
        How many there are.
    """

    name = "table_reciprocal"
    component = FpTableReciprocal
    beside = "multiplier"
    can_be_quiet = True
    operands = ("a",)
    operations = (
        Operation("reciprocal", twin=lambda component, a: component.compute(a, False), float64=lambda a: 1 / a,
                  operands=1, fallback=lambda xp, a: 1 / a, rounded=False),
        replace(ReciprocalRoot.operations[0], twin=lambda component, a: component.compute(a, True),
                mode="square_root", rounded=False))

    latency: int = 5
    count: int = 1
