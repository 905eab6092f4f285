# amaranth: UnusedElaboratable=no
# Operators are made for their latency, and elaborated when their turn comes.
"""Which operators are reported: a list of names, components and parameters."""

from dataclasses import dataclass
from itertools import product
from typing import Any

from strapdown.cordic import CordicAtan2, CordicSinCos, FixedAtan2
from strapdown.fp import (
    BINARY16,
    BINARY32,
    BINARY64,
    FixedToFp,
    FpAdd,
    FpCompare,
    FpDivide,
    FpDivideSquareRoot,
    FpMinMax,
    FpMultiply,
    FpReciprocalSquareRoot,
    FpRelation,
    FpSquareRoot,
    FpToFixed,
    FpToFp,
    Subnormals,
)

__all__ = ["OPERATORS", "OperatorEntry"]

FLUSH = BINARY32.with_subnormals(Subnormals.FLUSH)
BOTH = FLUSH, BINARY32


@dataclass(frozen=True)
class OperatorEntry:
    """An operator with one set of parameters.

    Attributes
    ----------
    operator : str
        What it computes, as tables call it.
    component : type
        Its class.
    formats : tuple of FloatFormat
        Positional parameters of the class, none for fixed point.
    parameters : dict
        Keyword parameters of the class.
    placed : bool
        Whether it is placed and routed too, which takes minutes.
    """

    operator: str
    component: Any
    formats: tuple
    parameters: dict
    placed: bool

    def make(self):
        """A fresh component."""
        return self.component(*self.formats, **self.parameters)


def _each(operator, component, formats, **choices):
    """An entry for each format and each combination of choices, a choice being a list of values.

    Placed and routed are pipelines of default depth, the adder and the multiplier of other depths too, and, flushed,
    what the engines iterate.
    """
    entries = []
    for chosen in formats:
        chosen = chosen if isinstance(chosen, tuple) else (chosen,)
        for values in product(*choices.values()):
            parameters = dict(zip(choices, values, strict=True))
            default = component(*chosen, **{**parameters, "latency": None}).latency if "latency" in choices else None
            wanted = _is_placed(component, chosen, default, **parameters)
            entries.append(OperatorEntry(operator, component, chosen, parameters, wanted))
    return entries


def _is_placed(component, formats, default, *, latency=None, bits_per_cycle=None, iterative=True, **_):
    if latency is not None:
        is_curve = component in (FpAdd, FpMultiply) and FLUSH in formats and latency >= default - 1
        return latency == default or is_curve or (component is FixedAtan2 and latency == 10)
    if component in (FpDivide, FpSquareRoot):
        return not iterative and bits_per_cycle == 2
    return FLUSH in formats and component is not CordicSinCos


def _depths(cuts):
    return range(1, len(cuts) + 1)


OPERATORS = (
    *_each("add", FpAdd, BOTH, latency=_depths(FpAdd.CUTS)),
    *_each("multiply", FpMultiply, [FLUSH], latency=_depths(FpMultiply.CUTS)),
    *_each("multiply", FpMultiply, [BINARY32], latency=_depths(FpMultiply.GRADUAL_CUTS)),
    *_each("divide", FpDivide, BOTH, bits_per_cycle=(1, 2, 3), iterative=(False,)),
    *_each("divide", FpDivide, BOTH, bits_per_cycle=(1, 2, 3), iterative=(True,)),
    *_each("square root", FpSquareRoot, BOTH, bits_per_cycle=(1, 2, 3), iterative=(False,)),
    *_each("square root", FpSquareRoot, BOTH, bits_per_cycle=(1, 2, 3), iterative=(True,)),
    *_each("divide and square root", FpDivideSquareRoot, BOTH, bits_per_cycle=(1, 2, 3)),
    *_each("reciprocal square root", FpReciprocalSquareRoot, BOTH, bits_per_cycle=(1, 2)),
    *_each("compare", FpCompare, BOTH, latency=_depths(FpCompare.CUTS)),
    *_each("less", FpRelation, [(FLUSH, "<"), (BINARY32, "<")], latency=_depths(FpRelation.CUTS)),
    *_each("minimum and maximum", FpMinMax, BOTH, latency=_depths(FpMinMax.CUTS)),
    *_each("to fixed, 16 bits", FpToFixed, [FLUSH], width=(16,), fraction_bits=(14,), latency=_depths(FpToFixed.CUTS)),
    *_each("to fixed, 32 bits", FpToFixed, [FLUSH], width=(32,), fraction_bits=(0,), latency=_depths(FpToFixed.CUTS)),
    *_each("from fixed, 16 bits", FixedToFp, [FLUSH], width=(16,), fraction_bits=(13,),
           latency=_depths(FixedToFp.CUTS)),
    *_each("from fixed, 32 bits", FixedToFp, [FLUSH], width=(32,), fraction_bits=(0,), latency=_depths(FixedToFp.CUTS)),
    *_each("to another format", FpToFp, [(BINARY32, BINARY16), (BINARY16, BINARY32), (BINARY32, BINARY64),
                                         (BINARY64, BINARY32)], latency=_depths(FpToFp.CUTS)),
    *_each("arctangent", CordicAtan2, BOTH, steps_per_cycle=(1, 2), iterative=(True,)),
    *_each("arctangent", CordicAtan2, [FLUSH], steps_per_cycle=(1,), iterative=(False,)),
    *_each("sine and cosine", CordicSinCos, BOTH, steps_per_cycle=(1, 2), iterative=(True,)),
    *_each("sine and cosine", CordicSinCos, [FLUSH], steps_per_cycle=(1,), iterative=(False,)),
    *_each("arctangent, 16 bits", FixedAtan2, [()], latency=(5, 10, 15, len(FixedAtan2.CUTS))),
)
