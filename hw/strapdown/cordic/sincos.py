"""Sine and cosine: rotating CORDIC that keeps the relative precision of small results."""

import operator
from typing import NamedTuple

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from ..fp.stages import normalise, round_nearest_even, unpack
from .iterative import IterativeCordic
from .tables import SCALE, least_remainder, round_shift, scaled_atan, scaled_reciprocal_gain

__all__ = ["CordicSinCos", "SinCos"]

# Binary digits of the quotient by pi/2: operands stay below 2**_REDUCTIONS.
_REDUCTIONS = 8


class SinCos(NamedTuple):
    """Sine and cosine of the same angles."""

    sin: np.ndarray
    cos: np.ndarray


class CordicSinCos(IterativeCordic):
    """Sine and cosine of an angle, by one rotation.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and results, of at least 5 exponent bits.
    width : int or None
        Fraction bits of the fixed-point data path, at least precision + 3; None means precision + 7,
        or 61 - ``iterations`` if that is less.
    iterations : int or None
        CORDIC steps, at least precision + 2, rounded up to fill the last cycle; None means
        precision + 6. ``width + iterations`` is at most 61, so that the twin fits 64 bits.
    steps_per_cycle : int
        Steps of the reduction and of CORDIC done in one clock cycle, 1 to 8.

    Members
    -------
    angle, start : In(format), In(1)
        Angle, rad, below ``limit`` = 256 rad in magnitude; taken while ``start`` is high, which is
        ignored in the ``interval - 1`` cycles after that.
    sin, cos : Out(format), Out(format)
        Its sine and cosine; hold until the next results.
    done : Out(1)
        High for one cycle, from which on ``sin`` and ``cos`` are valid.

    Latency: ``latency`` cycles, ``start`` to ``done``, whatever the operand: 3 plus
    ``8 / steps_per_cycle``, rounded up, plus ``iterations / steps_per_cycle``; one angle every
    ``interval`` = ``latency - 1`` cycles. Binary32 by default: 22 cycles.
    Accuracy: within 0.5 + ``error_bound`` ulp of either result, for every operand below ``limit``,
    close to multiples of pi/2 too, and with subnormal results included; binary32 by default
    0.74 ulp. A flushed result is compared after the steps, before rounding.
    Special values: sin(-0) is -0; angles below 2**-n, n half the precision (rounded up), give
    themselves and 1; NaN, infinities and finite angles from ``limit`` on give the format's NaN twice.
    Raises: TypeError if ``format`` is no FloatFormat; ValueError for unusable numbers.
    Source: Volder 1959, The CORDIC trigonometric computing technique; Walther 1971, A unified
    algorithm for elementary functions.
    """

    def __init__(self, format, *, width=None, iterations=None, steps_per_cycle=2):
        self._take(format, least_exponent_width=5, iterations=iterations, steps_per_cycle=steps_per_cycle,
                   most_steps_per_cycle=_REDUCTIONS)
        precision = format.precision
        least = precision + 3
        self._width = max(least, min(least + 4, 61 - self.iterations)) if width is None else operator.index(width)
        if self._width < least:
            raise ValueError(f"width must be at least {least}, not {width!r}")
        if self._width + self.iterations > 61:
            raise ValueError(f"width + iterations must be at most 61, not {self._width + self.iterations!r}")

        # The reduction counts units of 2**-reduced, so small that what is left of the angle, however
        # close to a multiple of pi/2 it was, still has ``width`` good bits.
        half_pi = 2 * scaled_atan(0)
        remainders = [least_remainder(precision, exponent) for exponent in range(_REDUCTIONS)]
        zeros = SCALE - min(remainders).bit_length()
        self._reduced = zeros + self._width + 3
        if self._reduced > 62:
            raise ValueError(f"width must be at most {59 - zeros}, not {self._width!r}")
        super().__init__({"angle": In(format.layout), "start": In(1),
                          "sin": Out(format.layout), "cos": Out(format.layout), "done": Out(1)})

        self._half_pi = round_shift(half_pi, SCALE - self._reduced)
        # Greatest quotient times the error of pi/2, relative to the least angle left.
        offset = abs((self._half_pi << SCALE - self._reduced) - half_pi)
        self._reduction_error = max(((2 << exponent) + 1) / 1.57 * offset / remainder
                                    for exponent, remainder in enumerate(remainders))
        # An angle left is normalised so far that its sine, if normal, is too.
        self._most_zeros = min(format.bias - 2, zeros)
        # Angles below 2**-tiny are their own sines.
        self._tiny = (precision + 1) // 2

        # From this step on x keeps its value and the angle of a step rounds to 2**-i.
        self._last = (self._width + self.iterations + 2) // 2
        # Row i of the tables holds 2**i * atan(2**-i) and the reciprocal gain of the steps from i on.
        shift = SCALE - self._width
        self._table = [round_shift(scaled_atan(i), shift) for i in range(self._last + 1)]
        self._presets = [round_shift(scaled_reciprocal_gain(i), shift) for i in range(self._last + 1)]

    @property
    def limit(self):
        """Magnitude, rad, that operands must stay below."""
        return 1 << _REDUCTIONS

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: load, reduce, normalise, iterate, round."""
        return 3 + self._reduce_cycles + self._cycles

    @property
    def error_bound(self):
        """Error of a result before the final rounding, in ulp of the result, at most."""
        # Let a = 2**i0 * angle, 0.5 <= |a| < 1, for the first step i0. The angle turned differs from a by
        # - what is left after the steps: 2**(1 - iterations);
        # - the table: half a unit, 2**-width / 2, times 2**-k in step k: at most one unit;
        # - the cut of a to width - 1 bits: less than 2.2 units, with the ones' complement;
        # and by the error of the reduction, relative to a. To that 2**i0 * sin adds
        # - the rounding of x: half a unit in step k weighs at most 2**-k after it, and half a
        #   unit of the preset weighs |sin|: at most one unit.
        # Since 2**i0 * |sin| > 0.479, an ulp of it is at least 2**-(precision + 1); a subnormal sine
        # is less than that, but not its ulp.
        # The cosine, from 0.54 to 1, has ulps of 2**-precision. The angle's error, times 0.85, and
        # that of sin, which is less than 2 units, change it, as do half a unit of each step and
        # of the preset. A tiny angle's results are off by at most 1/6 and 1/2 ulp in all.
        ulp, unit, left = 2.0**-self._format.precision, 2.0**-self._width, 2.0 ** (1 - self.iterations)
        return max(2 * (left + 4.5 * unit), 0.85 * left + (self.iterations / 2 + 5) * unit) / ulp \
            + self._reduction_error / ulp

    @property
    def _reduce_cycles(self):
        return -(-_REDUCTIONS // self._steps_per_cycle)

    def compute(self, angle):
        """Bit-exact software twin: array of the format's dtype, any shape, to ``SinCos`` of such arrays."""
        fmt, width = self._format, self._width
        angle = fmt.array(angle)
        bits = fmt.to_bits(angle).astype(np.int64)
        exponent = bits >> fmt.fraction_width & fmt.exponent_special
        tiny = exponent < fmt.bias - self._tiny
        lost = exponent >= fmt.bias + _REDUCTIONS

        # Reduce.
        significand = bits & ((1 << fmt.fraction_width) - 1) | 1 << fmt.fraction_width
        v = significand << self._reduced - fmt.precision
        quotient = np.zeros_like(v)
        for step in range(_REDUCTIONS):
            active = step <= exponent - fmt.bias
            digit = np.where(active & (v >> self._reduced - 1 != v >> self._reduced), np.where(v < 0, -1, 1), 0)
            quotient = (quotient << active) + digit
            v = (v << active) - digit * self._half_pi

        # Normalise.
        ones = np.where(v < 0, -1, 0)
        magnitude = v ^ ones
        zeros = np.zeros_like(v)
        for step in reversed(range(self._most_zeros.bit_length())):
            moves = (magnitude >> self._reduced - (1 << step) == 0) & (zeros + (1 << step) <= self._most_zeros)
            magnitude, zeros = magnitude << (moves << step), zeros + (moves << step)
        z = (magnitude ^ ones) >> self._reduced - width + 1
        index = np.maximum(zeros, np.clip(fmt.bias - 1 - exponent, 0, self._tiny - 1))
        sine_exponent = fmt.bias - index

        # Iterate.
        table, presets = np.array(self._table), np.array(self._presets)
        x = presets[index]
        v = np.zeros_like(x)
        for _ in range(self.iterations):
            turn = np.where(z < 0, 0, -1)
            # ``value ^ ones`` is -value - 1 where ones is -1.
            z = 2 * z + (table[index] ^ turn) - turn
            x, v = (x + ((((v << 2) >> 2 * index) ^ turn) + 1 >> 1),
                    2 * v + (x ^ ~turn) - ~turn)
            index = np.minimum(index + 1, self._last)

        # Round.
        turned = v < 0
        top = (v ^ np.where(turned, -1, 0)) >> width + self.iterations - fmt.precision - 3
        shift = np.where(top >> fmt.precision + 2, 0,
                         np.where((top >> fmt.precision + 1) | (sine_exponent == 2), 1, 2))
        sine = self._encode(sine_exponent - shift, (top << shift) >> 2)
        top = x >> width - fmt.precision - 1
        shift = 1 - (top >> fmt.precision + 1)
        cosine = self._encode(fmt.bias - shift, (top << shift) >> 1)

        # Pack.
        swap, negative = quotient & 1, quotient >> 1 & 1
        sign = bits >> fmt.width - 1
        results = (np.where(swap, cosine, sine) | (sign ^ negative ^ (turned & (1 - swap))) << fmt.width - 1,
                   np.where(swap, sine, cosine) | (swap ^ negative ^ (turned & swap)) << fmt.width - 1)
        return SinCos(*(fmt.from_bits(np.select([lost, tiny], [fmt.nan, own], result))
                        for own, result in zip((bits, fmt.bias << fmt.fraction_width), results, strict=True)))

    def _encode(self, exponent, extended):
        """Encodings, rounded, of significands with a guard bit; ``exponent`` is 1 for subnormal ones."""
        fmt = self._format
        normal = extended >> fmt.precision
        encoded = (exponent * normal << fmt.fraction_width) + \
            (extended >> 1 & ((1 << fmt.fraction_width) - 1)) + (extended & 1)
        return encoded if fmt.gradual else encoded * normal

    def elaborate(self, platform):
        m = Module()
        fmt, width, precision = self._format, self._width, self._format.precision

        # v holds the angle, in units of 2**-reduced, then the sine; z and x count units of 2**-width.
        # |z| stays within 1 and x between 0.19 and 1, nearly.
        v = Signal(signed(max(self._reduced, width + self.iterations) + 1), reset_less=True)
        x = Signal(width + 1, reset_less=True)
        z = Signal(signed(width + 2), reset_less=True)
        quotient = Signal(2, reset_less=True)
        index = Signal(range(self._last + 1), reset_less=True)
        exponent = Signal(range(fmt.bias + 1), reset_less=True)
        operand = Signal(fmt.layout, reset_less=True)
        tiny, lost = Signal(reset_less=True), Signal(reset_less=True)
        active_cycles = Signal(range(self._reduce_cycles + 1), reset_less=True)
        cycle = Signal(range(max(self._reduce_cycles, self._cycles)), reset_less=True)

        # Load. An angle of exponent e takes e + 1 reduction steps, in the last cycles of these; the
        # right shift makes up for what else their first one does.
        a = unpack(m, fmt, self.angle, "angle")
        digits = Signal(range(_REDUCTIONS + 1))
        fraction_zeros = Signal(range(self._tiny))
        with m.If(self.angle.exponent >= fmt.bias):
            m.d.comb += digits.eq(self.angle.exponent - (fmt.bias - 1))
        with m.Else():
            m.d.comb += fraction_zeros.eq(fmt.bias - 1 - self.angle.exponent)
        filled = Signal.like(active_cycles)
        aligned = Signal(self._reduced)
        with m.Switch(digits):
            for number in range(_REDUCTIONS + 1):
                with m.Case(number):
                    cycles = -(-number // self._steps_per_cycle)
                    spare = cycles * self._steps_per_cycle - number
                    m.d.comb += [filled.eq(cycles),
                                 aligned.eq(a.significand << self._reduced - precision - spare)]
        load = [
            operand.eq(Cat(a.significand[:-1], self.angle.exponent, a.sign)),
            tiny.eq(self.angle.exponent < fmt.bias - self._tiny),
            lost.eq(self.angle.exponent >= fmt.bias + _REDUCTIONS),
            v.eq(aligned), index.eq(fraction_zeros), active_cycles.eq(filled), quotient.eq(0),
            cycle.eq(self._reduce_cycles - 1),
        ]

        # Reduce and iterate share the additions to v.
        reducing = Signal()
        next_v, next_quotient, next_x, next_z, next_index = v, quotient, x, z, index
        for step in range(self._steps_per_cycle):
            next_v, next_quotient, next_x, next_z, next_index = self._step(
                m, step, reducing, next_v, next_quotient, next_x, next_z, next_index)

        # Normalise. An angle of less than 0.5 at the start was not reduced and has no zeros here. A
        # limit of all ones is none to angles whose sines are normal, and costs nothing.
        limit = self._most_zeros
        if limit < fmt.bias - 2:
            limit = (1 << limit.bit_length()) - 1
        sign = v[self._reduced]
        magnitude, zeros = normalise(m, v[:self._reduced] ^ sign.replicate(self._reduced), "magnitude",
                                     limit=C(limit, self._reduced.bit_length()))
        first = Signal.like(index)
        m.d.comb += first.eq(index | zeros)
        prepare = [
            z.eq(Cat(magnitude[-(width - 1):] ^ sign.replicate(width - 1), sign).as_signed()),
            x.eq(Array(C(row, width + 1) for row in self._presets)[first]),
            v.eq(0), index.eq(first), exponent.eq(fmt.bias - first), cycle.eq(self._cycles - 1),
        ]

        # Round. No sticky bits: the results are irrational, and what lies below the guard bits is
        # within their errors. The sine's top bit weighs 2**(exponent - bias); one or two zeros lead it,
        # or more if it is subnormal.
        turned = v[-1]
        top = v[:width + self.iterations][-(precision + 3):] ^ turned.replicate(precision + 3)
        shift = Mux(top[-1], 0, Mux(top[-2] | (exponent == 2), 1, 2))
        rounded = Signal(precision + 1)
        m.d.comb += rounded.eq((top << shift)[2:])
        stored = Signal(fmt.exponent_width)
        m.d.comb += stored.eq(Mux(rounded[-1], exponent - shift, 0))
        sine = round_nearest_even(fmt, stored, rounded[1:], rounded[0], 1)
        if not fmt.gradual:
            sine = Mux(rounded[-1], sine, 0)
        # The cosine is 1 or has one leading zero.
        one = x[-1]
        rounded = Mux(one, x[-(precision + 1):], x[-(precision + 2):-1])
        cosine = round_nearest_even(fmt, Mux(one, fmt.bias, fmt.bias - 1), rounded[1:], rounded[0], 1)

        # Pack.
        swap, negative = quotient[0], quotient[1]
        results = [
            self.sin.eq(Cat(Mux(swap, cosine, sine), operand.sign ^ negative ^ (turned & ~swap))),
            self.cos.eq(Cat(Mux(swap, sine, cosine), swap ^ negative ^ (turned & swap))),
        ]

        def accept():
            m.d.sync += load
            m.next = "IDLE"
            with m.If(self.start):
                m.next = "REDUCE"

        m.d.sync += self.done.eq(0)
        with m.FSM():
            with m.State("IDLE"):
                accept()
            with m.State("REDUCE"):
                m.d.comb += reducing.eq(1)
                m.d.sync += cycle.eq(cycle - 1)
                with m.If(cycle < active_cycles):
                    m.d.sync += [v.eq(next_v), quotient.eq(next_quotient)]
                with m.If(cycle == 0):
                    m.next = "NORMALISE"
            with m.State("NORMALISE"):
                m.d.sync += prepare
                m.next = "ITERATE"
            with m.State("ITERATE"):
                m.d.sync += [v.eq(next_v), x.eq(next_x), z.eq(next_z), index.eq(next_index), cycle.eq(cycle - 1)]
                with m.If(cycle == 0):
                    m.next = "ROUND"
            with m.State("ROUND"):
                m.d.sync += [*results, self.done.eq(1)]
                with m.If(lost):
                    m.d.sync += [self.sin.eq(fmt.nan), self.cos.eq(fmt.nan)]
                with m.Elif(tiny):
                    m.d.sync += [self.sin.eq(operand), self.cos.eq(fmt.bias << fmt.fraction_width)]
                accept()
        return m

    def _step(self, m, step, reducing, v, quotient, x, z, index):
        """One step, number ``step`` of its cycle: the values that follow the given ones."""
        after_v, after_quotient, after_x, after_z, after_index = (
            Signal.like(value, name=f"{name}_{step}")
            for name, value in (("v", v), ("quotient", quotient), ("x", x), ("z", z), ("index", index)))
        # Reducing, v doubles and, if it was at least 0.5 in magnitude, loses pi/2 of its sign: it
        # stays within 1, by any quotient digits.
        negative = v[self._reduced]
        digit = negative ^ v[self._reduced - 1]
        subtract = Signal(name=f"subtract_{step}")
        addend = Signal(len(v), name=f"addend_{step}")
        # Iterating, z turns towards zero. v, half of 2**i times the sine, doubles and takes x up.
        backward = z[-1]
        m.d.comb += [
            subtract.eq(Mux(reducing, digit & ~negative, backward)),
            addend.eq(Mux(reducing, self._half_pi & digit.replicate(len(v)), x)),
        ]
        # x falls by v >> 2 * i - 1, rounded to nearest. The carries of subtractions enter at the low
        # bits, zero in doubled numbers.
        forward = ~backward
        change = Cat(C(0, 2), v).as_signed() >> Cat(C(0, 1), index)
        angle = Array(C(row, self._width + 1) for row in self._table)[index]
        m.d.comb += [
            after_v.eq(Cat(subtract, v) + (addend ^ subtract.replicate(len(v)))),
            after_quotient.eq(Cat(digit, quotient[0] ^ (digit & negative))),
            after_x.eq((Cat(1, x) + (change[:len(x) + 1] ^ forward.replicate(len(x) + 1)))[1:]),
            after_z.eq(Cat(forward, z) + (angle ^ forward.replicate(len(z)))),
            after_index.eq(Mux(index == self._last, index, index + 1)),
        ]
        return after_v, after_quotient, after_x, after_z, after_index
