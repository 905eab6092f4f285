"""Angle of a vector of 16-bit numbers: unrolled vectoring CORDIC, one angle per cycle."""

import math
from typing import ClassVar

import numpy as np
from amaranth import *

from ..fp.pipeline import Pipeline, PipelinedOperator, Ranks

__all__ = ["FixedAtan2"]


class FixedAtan2(PipelinedOperator):
    """Four-quadrant arctangent of 16-bit numbers, ``phase_out = atan2(y_in, x_in)``, one per cycle.

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
    Accuracy: within ``error_bound`` = 0.73 units of 2**-13 rad, for every length of (x, y).
    Multiples of pi/4 are correctly rounded.
    Special values: atan2(0, 0) is 0; atan2(0, x) is the rounded pi for negative x.
    Raises: ValueError if ``latency`` is out of range.
    Source: Volder 1959, The CORDIC trigonometric computing technique.
    """

    WIDTH, FRACTION_BITS = 16, 13
    # Steps that rotate the vector, and all steps. The other steps divide y by x: a small angle equals its tangent.
    TURNS, STEPS = 6, 16
    # Bits below the operands' last bit, and numbers of low bits that are dropped before a step.
    GUARD = 2
    DROPPED: ClassVar = {7: 5, 11: 4}

    PIPELINE = Pipeline(cuts=("magnitude", "rotate", "normalise", *(f"step_{step}" for step in range(1, STEPS)), "sum",
                              "result"), default_latency=STEPS + 4)

    def __init__(self, *, latency=None):
        super().__init__({"x_in": signed(self.WIDTH), "y_in": signed(self.WIDTH)},
                         {"phase_out": signed(self.WIDTH)}, latency=latency)

    @property
    def error_bound(self):
        """Upper bound of the phase error in units of 2**-13 rad, its final rounding included."""
        # After the rotation by pi/4 and the shift, x >= 2**(WIDTH + GUARD) and |y| <= x. With h the
        # ordinate times 2**(i - 1) before step i, |h| <= x holds at the start and, since
        # |h'| = |2|h| - x| and x' >= x, after each step. So |y| <= 2**(1 - i) * x before step i.
        # x and h are represented by their integer parts and count as half a unit more. The error is the sum of
        # - the final rounding: 1/2;
        # - the remaining angle after the last step: |y| / x <= 2**-STEPS;
        # - half a unit of x and of h, at the start and where bits are dropped: together one unit of |y| / x;
        # - the rounding of x: less than one unit in step i, which moves the angle of a vector with
        #   |y| <= 2**-i * x by less than 2**-i / x: less than one unit in all. Ordinates are exact;
        # - q - atan(q) for the quotient of the steps that divide, q**3 / 3 at most.
        # The truncation of the table of angles adds no error: its numbers include half a unit of the phase, and the
        # quotient is an integer in units of the table, so the truncated part could not change the phase.
        unit = 2.0 ** -(self.WIDTH + self.GUARD)
        angle = 2.0 ** -self.STEPS + 2 * unit + 2.0 ** (-3 * self.TURNS) / 3
        for step, bits in self.DROPPED.items():
            unit *= 1 << bits
            angle += 2.0 ** (1 - step) * unit
        return 0.5 + 2.0 ** self.FRACTION_BITS * angle

    def _angle(self, signs, x_negative):
        """Angle of the first rotations, in units of the last step, by the signs of their ordinates, the first on top.

        It includes all terms that do not depend on the quotient: the vector's half plane and half a unit of the phase.
        """
        negative = [signs >> self.TURNS - step & 1 for step in range(1, self.TURNS + 1)]
        angle = math.pi / 4 + sum((-1) ** sign * math.atan(2.0 ** -step) for step, sign in enumerate(negative, 1))
        # Digits of the quotient are 1 and -1: it is this number minus twice the binary number of the signs.
        angle += 2.0 ** -self.TURNS - 2.0 ** -self.STEPS
        half = 2.0 ** -(self.FRACTION_BITS + 1)
        angle = math.pi - angle if x_negative else angle
        # In the other half plane the quotient is inverted, which subtracts one unit too little.
        return math.floor(math.ldexp(angle + half, self.STEPS - 1)) - x_negative

    def compute(self, y_in, x_in):
        """Bit-exact software twin: takes integer arrays, shapes that broadcast; returns int64."""
        y_in, x_in = np.broadcast_arrays(np.asarray(y_in, dtype=np.int64), np.asarray(x_in, dtype=np.int64))
        x, h = np.abs(x_in) + np.abs(y_in), np.abs(y_in) - np.abs(x_in)
        is_zero = x == 0
        zeros = np.minimum(self.WIDTH + 1 - np.frexp(x.astype(np.float64))[1], self.WIDTH - 1) + self.GUARD
        x, h = x << zeros, h << zeros
        signs = np.zeros_like(x)
        for step in range(1, self.STEPS + 1):
            dropped = self.DROPPED.get(step, 0)
            x, h = x >> dropped, h >> dropped
            negative = -(h < 0).astype(np.int64)
            signs = signs << 1 | negative & 1
            x, h = x - ((h ^ ~negative) >> 2 * step - 1 if step <= self.TURNS else 0), 2 * h - (x ^ negative)
        divided = self.STEPS - self.TURNS
        x_negative = (x_in < 0).astype(np.int64)
        angles = np.array([[self._angle(turn, side) for turn in range(1 << self.TURNS)] for side in (0, 1)])
        quotient = signs & (1 << divided) - 1
        z = angles[x_negative, signs >> divided] - (quotient ^ -x_negative)
        phase = z >> self.STEPS - 1 - self.FRACTION_BITS
        return np.where(is_zero, 0, np.where(y_in < 0, -phase, phase))

    def ranks(self, m):
        """The register ranks, evenly distributed over the cuts, with the last one at the output."""
        cuts = self.pipeline.cuts
        count = len(cuts)
        placed = [cuts[(place + 1) * count // self.latency - 1] for place in range(self.latency)]
        return Ranks(m, cuts, placed, self.start)

    def elaborate(self, platform):
        m = Module()
        rank = self.ranks(m)

        # Into the first quadrant.
        magnitudes = {}
        for name, value in ("x", self.x_in), ("y", self.y_in):
            magnitudes[name] = Signal(self.WIDTH, name=f"{name}_magnitude")
            m.d.comb += magnitudes[name].eq((value ^ value[-1].replicate(self.WIDTH)) + value[-1])
        s = rank("magnitude", **magnitudes, x_negative=self.x_in[-1], y_negative=self.y_in[-1])

        # Rotate by -pi/4 and scale by the root of two: this is exact, and from here on |y| <= x.
        s = rank("rotate", x=s.x + s.y, h=(s.y - s.x)[:self.WIDTH + 1].as_signed(),
                 x_negative=s.x_negative, y_negative=s.y_negative)

        # Shift short vectors left, so that they are as precise as long ones: up to three times by 4, then by 1. The
        # shortest vectors, of length 1, lie on an axis; their shift may be one place too small.
        x, h = s.x, s.h
        for step in 4, 1:
            zeros = [~x[-step * times:].any() for times in (1, 2, 3)]
            number = Cat(zeros[2] | (zeros[0] & ~zeros[1]), zeros[1])
            next_x = Signal(self.WIDTH + 1, name=f"x_by_{step}")
            next_h = Signal(signed(self.WIDTH + 2), name=f"h_by_{step}")
            with m.Switch(number):
                for times in range(4):
                    with m.Case(times):
                        m.d.comb += [next_x.eq(x << step * times), next_h.eq(h << step * times)]
            x, h = next_x, next_h
        s = rank("normalise", x=Cat(C(0, self.GUARD), x, C(0, 1)), h=Cat(C(0, self.GUARD), h, h[-1]).as_signed(),
                 is_zero=~x[-2:].any(), x_negative=s.x_negative, y_negative=s.y_negative)

        # Rotate towards the x axis, then divide. x and h count as half a unit more, so that -h is the inverse of h.
        # The gain of x is less than 1.165; before, |y| <= x < sqrt(2) * 2**17.
        s.signs = C(0, 0)
        for step in range(1, self.STEPS):
            x, h = (value[self.DROPPED.get(step, 0):] for value in (s.x, s.h))
            negative = h[-1].replicate(len(h))
            signs = Cat(h[-1], s.signs)
            next_x = Signal(len(x), name=f"x_{step}")
            next_h = Signal(signed(len(h)), name=f"h_{step}")
            # Written as differences: from their order synthesis finds the operand that needs no LUT.
            less = (h ^ ~negative).as_signed() >> 2 * step - 1 if step <= self.TURNS else 0
            m.d.comb += [next_x.eq(x - less), next_h.eq(Cat(C(0, 1), h) - (Cat(x, C(0, 1)) ^ negative).as_signed())]
            s = rank(f"step_{step}", x=next_x, h=next_h, signs=signs, is_zero=s.is_zero,
                     x_negative=s.x_negative, y_negative=s.y_negative)

        # The angle of the rotations and the quotient, in the vector's half plane.
        divided = self.STEPS - self.TURNS
        signs = Cat(s.h[-1], s.signs)
        angle, z = Signal(self.STEPS + 1), Signal(self.STEPS + 1)
        with m.Switch(Cat(signs[divided:], s.x_negative)):
            for turn in range(1 << self.TURNS + 1):
                side, turns = divmod(turn, 1 << self.TURNS)
                with m.Case(turn):
                    m.d.comb += angle.eq(self._angle(turns, side))
        quotient = Cat(signs[:divided], C(0, 1)) ^ s.x_negative.replicate(divided + 1)
        m.d.comb += z.eq(angle - quotient.as_signed())
        s = rank("sum", phase=z[self.STEPS - 1 - self.FRACTION_BITS:], is_zero=s.is_zero, y_negative=s.y_negative)

        # Round, and restore the sign of the ordinate.
        result = Signal(signed(self.WIDTH))
        with m.If(~s.is_zero):
            m.d.comb += result.eq((s.phase ^ s.y_negative.replicate(self.WIDTH)) + s.y_negative)
        s = rank("result", result=result)
        m.d.comb += [self.phase_out.eq(s.result), self.done.eq(rank.valid)]
        return m
