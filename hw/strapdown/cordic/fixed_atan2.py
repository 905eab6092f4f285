"""Angle of a vector of 16-bit numbers: unrolled vectoring CORDIC, one angle a cycle."""

import math

import numpy as np
from amaranth import *

from ..fp.pipeline import PipelinedOperator, Ranks
from ..fp.stages import normalise

__all__ = ["FixedAtan2"]


class FixedAtan2(PipelinedOperator):
    """Four-quadrant arctangent of 16-bit numbers, ``phase_out = atan2(y_in, x_in)``, one a cycle.

    Parameters
    ----------
    latency : int
        Register ranks, 1 to 20.

    Members
    -------
    x_in, y_in, start : In(signed(16)), In(signed(16)), In(1)
        Abscissa and ordinate in any common unit, all values allowed, taken while ``start`` is high.
    phase_out, done : Out(signed(16)), Out(1)
        Angle from the x axis, in units of 2**-13 rad, valid while ``done`` is high.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: within ``error_bound`` = 0.73 units of 2**-13 rad, whatever the length of (x, y).
    Multiples of pi/4 are correctly rounded.
    Special values: atan2(0, 0) is 0; atan2(0, x) is the rounded pi for negative x.
    Raises: ValueError if ``latency`` is out of range.
    Source: Volder 1959, The CORDIC trigonometric computing technique.
    """

    WIDTH, FRACTION_BITS = 16, 13
    STEPS = 16
    # Fraction bits below the operands' last bit, and below the unit of the phase.
    GUARD, PHASE_GUARD = 2, 7

    CUTS = ("magnitude", "rotate", "normalise", *(f"step_{step}" for step in range(1, STEPS + 1)), "result")
    DEFAULT_LATENCY = len(CUTS)

    def __init__(self, *, latency=None):
        super().__init__({"x_in": signed(self.WIDTH), "y_in": signed(self.WIDTH)},
                         {"phase_out": signed(self.WIDTH)}, latency=latency)
        self._places = self.FRACTION_BITS + self.PHASE_GUARD
        self._angles = [self._fixed(math.atan(math.ldexp(1, -step))) for step in range(self.STEPS + 1)]
        self._pi = self._fixed(math.pi)

    def _fixed(self, angle):
        return round(math.ldexp(angle, self._places))

    @property
    def error_bound(self):
        """Error of the phase in units of 2**-13 rad, at most, its final rounding included."""
        # After the turn by pi/4 and the shift, x >= 2**(WIDTH + GUARD) and |y| <= x. With h the
        # ordinate times 2**(i - 1) before step i, |h| <= x holds at the start and, since
        # |h'| = |2|h| - x| and x' >= x, after each step. The error is the sum of
        # - the final rounding: 1/2;
        # - what is left after n steps: |y| / x <= 2**-n;
        # - the rounding of x: less than one unit in step i, which moves the angle of a vector with
        #   |y| <= 2**-i * x by less than 2**-i / x: less than 2**-(WIDTH + GUARD) in all. Ordinates
        #   and the angle of the first turn, but for its constant, are exact;
        # - n + 2 constants, with the first turn's and pi, each good to half a unit of z.
        angle = 2.0 ** -self.STEPS + 2.0 ** -(self.WIDTH + self.GUARD)
        constants = (self.STEPS + 2) / 2 * 2.0 ** -self.PHASE_GUARD
        return 0.5 + 2.0 ** self.FRACTION_BITS * angle + constants

    def compute(self, y_in, x_in):
        """Bit-exact software twin: integer arrays of shapes that broadcast in, int64 out."""
        y_in, x_in = np.broadcast_arrays(np.asarray(y_in, dtype=np.int64), np.asarray(x_in, dtype=np.int64))
        x, h = np.abs(x_in) + np.abs(y_in), np.abs(y_in) - np.abs(x_in)
        is_zero = x == 0
        zeros = self.WIDTH + 1 - np.frexp(x.astype(np.float64))[1] + self.GUARD
        x, h = x << zeros, h << zeros
        z = np.full(x.shape, self._angles[0])
        for step in range(1, self.STEPS + 1):
            sign = np.where(h < 0, -1, 1)
            x, h = x + sign * self._turn(h, step), 2 * h - sign * x
            z = z + sign * self._angles[step]
        z = np.where(x_in < 0, self._pi - z, z)
        phase = (z + (1 << self.PHASE_GUARD - 1)) >> self.PHASE_GUARD
        return np.where(is_zero, 0, np.where(y_in < 0, -phase, phase))

    def _turn(self, h, step):
        """What a step adds to the abscissa, or takes from it: nothing where it is less than a unit."""
        places = 2 * step - 1
        return h >> places if places < self.WIDTH + self.GUARD + 2 else 0

    def ranks(self, m):
        """The register ranks, evenly spread over the cuts, the last at the output."""
        count = len(self.CUTS)
        placed = [self.CUTS[(place + 1) * count // self.latency - 1] for place in range(self.latency)]
        return Ranks(m, self.CUTS, placed, self.start)

    def elaborate(self, platform):
        m = Module()
        rank = self.ranks(m)

        # Into the first quadrant.
        magnitudes = {}
        for name, value in ("x", self.x_in), ("y", self.y_in):
            magnitudes[name] = Signal(self.WIDTH, name=f"{name}_magnitude")
            m.d.comb += magnitudes[name].eq(Mux(value < 0, -value, value))
        s = rank("magnitude", **magnitudes, x_negative=self.x_in < 0, y_negative=self.y_in < 0)

        # Turn by -pi/4 and scale by the root of two: exact, and from here on |y| <= x.
        s = rank("rotate", x=s.x + s.y, h=(s.y - s.x)[:self.WIDTH + 1].as_signed(),
                 x_negative=s.x_negative, y_negative=s.y_negative)

        # Shift short vectors left, so that they are as precise as long ones.
        x, zeros = normalise(m, s.x, "normalise")
        h = Signal(signed(self.WIDTH + 2))
        m.d.comb += h.eq(s.h << zeros)
        s = rank("normalise", x=Cat(C(0, self.GUARD), x), h=Cat(C(0, self.GUARD), h).as_signed(),
                 is_zero=s.x == 0, x_negative=s.x_negative, y_negative=s.y_negative)

        # Turn towards the x axis. x grows by less than 1.165 and |y| <= x < sqrt(2) * 2**17 before.
        s.z = C(self._angles[0], signed(self._places + 2))
        for step in range(1, self.STEPS + 1):
            x = Signal(self.WIDTH + self.GUARD + 2, name=f"x_{step}")
            h = Signal(signed(self.WIDTH + self.GUARD + 3), name=f"h_{step}")
            z = Signal(signed(self._places + 2), name=f"z_{step}")
            negative, moved, angle = s.h[-1], self._turn(s.h, step), self._angles[step]
            m.d.comb += [
                x.eq(Mux(negative, s.x - moved, s.x + moved)),
                h.eq(Mux(negative, 2 * s.h + s.x, 2 * s.h - s.x)),
                z.eq(Mux(negative, s.z - angle, s.z + angle)),
            ]
            s = rank(f"step_{step}", x=x, h=h, z=z, is_zero=s.is_zero,
                     x_negative=s.x_negative, y_negative=s.y_negative)

        # Back into the vector's quadrant, and round.
        phase, result = Signal(signed(self.WIDTH)), Signal(signed(self.WIDTH))
        half = 1 << self.PHASE_GUARD - 1
        m.d.comb += phase.eq(Mux(s.x_negative, self._pi + half - s.z, s.z + half) >> self.PHASE_GUARD)
        with m.If(~s.is_zero):
            m.d.comb += result.eq(Mux(s.y_negative, -phase, phase))
        s = rank("result", result=result)
        m.d.comb += [self.phase_out.eq(s.result), self.done.eq(rank.valid)]
        return m
