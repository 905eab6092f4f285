# mypy: disable-error-code="attr-defined"
"""Sine and cosine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.algorithms import sine
from strapdown.component import Described
from strapdown.cordic import CordicSinCos

from .base import Operation, Operator

__all__ = ["SineCosine"]


class SineOrCosine(Described):
    """``CordicSinCos`` with one result, the sine or the cosine.

    Members
    -------
    angle, cosine, start : In(format), In(1), In(1)
        Angle, rad, and 1 for its cosine, 0 for its sine; taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Sine or cosine, valid while ``done`` is high.

    Latency, interval, accuracy, special values and errors: those of ``CordicSinCos``, iterative.
    """

    def __init__(self, format, *, steps_per_cycle):
        self._rotation = CordicSinCos(format, steps_per_cycle=steps_per_cycle)
        super().__init__({"angle": In(format.layout), "cosine": In(1), "start": In(1),
                          "result": Out(format.layout), "done": Out(1)})

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``."""
        return self._rotation.latency

    @property
    def interval(self):
        """Least number of cycles between two starts."""
        return self._rotation.interval

    def compute(self, angle):
        """Bit-exact software twin: sines and cosines of an array of the format's dtype."""
        return self._rotation.compute(angle)

    def elaborate(self, platform):
        m = Module()
        m.submodules.rotation = rotation = self._rotation
        # The next start may come in the cycle before ``done``, so each ``cosine`` is kept until its rotation ends.
        wanted, shown = Signal(reset_less=True), Signal(reset_less=True)
        with m.If(self.start):
            m.d.sync += wanted.eq(self.cosine)
        m.d.sync += shown.eq(wanted)
        m.d.comb += [rotation.angle.eq(self.angle), rotation.start.eq(self.start), self.done.eq(rotation.done),
                     self.result.eq(Mux(shown, rotation.cos, rotation.sin))]
        return m


@dataclass(frozen=True, kw_only=True)
class SineCosine(Operator):
    """Iterative sine and cosine of an angle in radians, below 256 in magnitude: ``xp.sin``, ``xp.cos``, ``xp.sincos``.

    Without this operator they are polynomials on the other operators, for angles from -2π to 2π.

    A rotation computes both, but an operation of a pool has one result, so ``xp.sincos`` is two rotations. A
    component that keeps the second result would save one of them. But then no other angle could come between the
    two, and a schedule could not place them freely.

    Parameters
    ----------
    steps_per_cycle : int
        CORDIC steps in a cycle, as of ``CordicSinCos``.
    count : int
        How many there are.
    """

    name = "sine_cosine"
    component = SineOrCosine
    beside = "multiplier"
    operands = ("angle",)
    operations = (
        Operation("sin", twin=lambda component, angle: component.compute(angle).sin, float64=np.sin, operands=1,
                  fallback=sine.sine),
        Operation("cos", twin=lambda component, angle: component.compute(angle).cos, float64=np.cos, operands=1,
                  fallback=sine.cosine, mode="cosine"))
    functions: ClassVar = {"sincos": lambda xp, angle: (xp.sin(angle), xp.cos(angle))}

    steps_per_cycle: int = 1
    count: int = 1
