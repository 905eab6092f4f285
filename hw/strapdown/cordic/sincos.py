"""Sine and cosine: rotating CORDIC that keeps the relative precision of small results."""

import operator
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from amaranth import *

from ..fp.stages import normalise, round_significand, unpack
from .component import CordicComponent, blockwise
from .tables import SCALE, least_remainder, round_shift, scaled_atan, scaled_reciprocal_gain

__all__ = ["CordicSinCos", "SinCos"]

# Binary digits of the quotient by pi/2: operands are below 2**_REDUCTIONS.
_REDUCTIONS = 8


class SinCos(NamedTuple):
    """Sine and cosine of the same angles."""

    sin: np.ndarray
    cos: np.ndarray


class CordicSinCos(CordicComponent):
    """Sine and cosine of an angle, by one rotation.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and results, of at least 5 exponent bits.
    width : int or None
        Fraction bits of the fixed-point data path, at least precision + 3, at most 60; None means
        precision + 7.
    iterations : int or None
        CORDIC steps, at least precision + 2, rounded up to a multiple of ``steps_per_cycle``; None means
        precision + 6.
    steps_per_cycle : int or None
        Steps of the reduction and of CORDIC between two ranks of registers, 1 to 8; None means 2
        iterative, 1 pipelined.
    iterative : bool
        True: all steps use one set of registers. False: each step has a separate circuit, and an
        operation may start in every cycle. Both give the same bits.

    Members
    -------
    angle, start : In(format), In(1)
        Angle, rad, below ``limit`` = 256 rad in magnitude; taken while ``start`` is high. ``start`` is
        ignored in the ``interval - 1`` cycles after that.
    sin, cos : Out(format), Out(format)
        Its sine and cosine.
    done : Out(1)
        High for one cycle per operation; results are valid in this cycle, iterative until the next ``done``.

    Latency: ``latency`` cycles, ``start`` to ``done``, for all operands: 3 plus
    ``8 / steps_per_cycle``, rounded up, plus ``iterations / steps_per_cycle``; binary32 by default
    22 cycles iterative, 41 pipelined. One angle every ``interval`` cycles: ``latency - 1`` iterative, 1 pipelined.
    Accuracy: each result within ``error_bound_ulp``, for every operand below ``limit``, also close
    to multiples of pi/2 and for subnormal results; by default binary32 0.74 ulp, binary64 0.80 ulp.
    A flushed result is compared after the steps, before rounding.
    Special values: sin(-0) is -0; angles below 2**-n, where n is half the precision (rounded up), give
    sin = angle and cos = 1; NaN, infinities and angles of ``limit`` and above give the format's NaN for both.
    Raises: TypeError if ``format`` is not a FloatFormat; ValueError for unusable numbers.
    Source: Volder 1959, The CORDIC trigonometric computing technique; Walther 1971, A unified
    algorithm for elementary functions.
    """

    def __init__(self, format, *, width=None, iterations=None, steps_per_cycle=None, iterative=True):
        self._take(format, least_exponent_width=5, iterations=iterations, steps_per_cycle=steps_per_cycle,
                   iterative=iterative, most_steps_per_cycle=_REDUCTIONS)
        precision = format.precision
        least = precision + 3
        self._width = least + 4 if width is None else operator.index(width)
        if least > 60:
            raise ValueError(f"format must have a precision of at most 57 bits, not {precision!r}")
        if not least <= self._width <= 60:
            raise ValueError(f"width must be from {least} to 60, not {self._width!r}")
        super().__init__(("angle",), ("sin", "cos"))

        # The reduction uses units of 2**-reduced. They are so small that the remaining angle has ``width``
        # correct bits, even if the operand is very close to a multiple of pi/2.
        half_pi = 2 * scaled_atan(0)
        remainders = [least_remainder(precision, exponent) for exponent in range(_REDUCTIONS)]
        zeros = SCALE - min(remainders).bit_length()
        self._reduced = zeros + self._width + 3

        self._half_pi = round_shift(half_pi, SCALE - self._reduced)
        # Greatest quotient times the error of pi/2, relative to the least remaining angle.
        offset = abs((self._half_pi << SCALE - self._reduced) - half_pi)
        self._reduction_error = max(((2 << exponent) + 1) / 1.57 * offset / remainder
                                    for exponent, remainder in enumerate(remainders))
        # A remaining angle is normalised so far that its sine is normalised, too, if it is a normal number.
        self._most_zeros = min(format.bias - 2, zeros)
        # Angles below 2**-tiny equal their sines.
        self._tiny = (precision + 1) // 2

        # From this step on, which may be the first, x keeps its value and the angle of a step rounds to 2**-i.
        self._last = max((self._width + self.iterations + 2) // 2, self._most_zeros)
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
        """Upper bound of a result's error before the final rounding, in ulp of the result.

        Let a = 2**i0 * angle, 0.5 <= |a| < 1, for the first step i0. The total rotation differs from a by

        - the remaining angle after the steps: 2**(1 - iterations);
        - the table: half a unit, 2**-width / 2, times 2**-k in step k: at most one unit;
        - the truncation of a to width - 1 bits: less than 2.2 units, with the ones' complement;

        and by the error of the reduction, relative to a. The error of 2**i0 * sin also contains

        - the rounding of x: half a unit in step k weighs at most 2**-k after it, and half a
          unit of the initial value weighs |sin|: at most one unit.

        Since 2**i0 * |sin| > 0.479, an ulp of it is at least 2**-(precision + 1). A subnormal sine
        is smaller than that, but its ulp is not. The cosine, from 0.54 to 1, has ulps of 2**-precision.
        Its error contains the angle's error, times 0.85, the error of sin, which is less than 2 units, and
        half a unit for each step and for the initial value. The errors of a tiny angle's results are at most
        1/6 and 1/2 ulp in all.
        """
        ulp, unit, left = 2.0**-self._format.precision, 2.0**-self._width, 2.0 ** (1 - self.iterations)
        return max(2 * (left + 4.5 * unit), 0.85 * left + (self.iterations / 2 + 5) * unit) / ulp \
            + self._reduction_error / ulp

    @property
    def _reduce_cycles(self):
        return -(-_REDUCTIONS // self._steps_per_cycle)

    def compute(self, angle):
        """Bit-exact software twin: takes an array of the format's dtype, any shape; returns a ``SinCos`` of arrays."""
        return SinCos(*blockwise(self._compute, self._format.array(angle)))

    def _compute(self, angle):
        fmt, width = self._format, self._width
        bits = fmt.to_bits(angle)
        sign, bits = (bits >> fmt.width - 1).astype(np.int64), (bits & ((1 << fmt.width - 1) - 1)).astype(np.int64)
        exponent = bits >> fmt.fraction_width
        tiny = exponent < fmt.bias - self._tiny
        lost = exponent >= fmt.bias + _REDUCTIONS

        # Reduce.
        significand = bits & ((1 << fmt.fraction_width) - 1) | 1 << fmt.fraction_width
        if max(self._reduced, width + self.iterations) > 62:
            significand = significand.astype(object)  # Python's integers
        v = significand << self._reduced - fmt.precision
        quotient = np.zeros_like(exponent)
        for step in range(_REDUCTIONS):
            active = step <= exponent - fmt.bias
            digit = np.where(active & (v >> self._reduced - 1 != v >> self._reduced), np.where(v < 0, -1, 1), 0)
            quotient = (quotient << active) + digit
            v = (v << active) - digit.astype(v.dtype) * self._half_pi

        # Normalise.
        ones = np.where(v < 0, -1, 0)
        magnitude = v ^ ones
        zeros = np.zeros_like(exponent)
        for step in reversed(range(self._most_zeros.bit_length())):
            moves = (magnitude >> self._reduced - (1 << step) == 0) & (zeros + (1 << step) <= self._most_zeros)
            magnitude, zeros = magnitude << (moves << step), zeros + (moves << step)
        z = ((magnitude ^ ones) >> self._reduced - width + 1).astype(np.int64)
        index = np.maximum(zeros, np.clip(fmt.bias - 1 - exponent, 0, self._tiny - 1))
        sine_exponent = fmt.bias - index

        # Iterate.
        table, presets = np.array(self._table), np.array(self._presets)
        x = presets[index]
        v = np.zeros_like(v)
        for _ in range(self.iterations):
            turn = np.where(z < 0, 0, -1)
            # ``value ^ ones`` is -value - 1 where ones is -1.
            z = 2 * z + (table[index] ^ turn) - turn
            x, v = (x + ((((v << 2) >> 2 * index).astype(np.int64) ^ turn) + 1 >> 1),
                    2 * v + (x ^ ~turn) - ~turn)
            index = np.minimum(index + 1, self._last)

        # Round.
        turned = v < 0
        top = ((v ^ np.where(turned, -1, 0)) >> width + self.iterations - fmt.precision - 3).astype(np.int64)
        shift = np.where(top >> fmt.precision + 2, 0,
                         np.where((top >> fmt.precision + 1) | (sine_exponent == 2), 1, 2))
        sine = self._encode(sine_exponent - shift, (top << shift) >> 2)
        top = x >> width - fmt.precision - 1
        shift = 1 - (top >> fmt.precision + 1)
        cosine = self._encode(fmt.bias - shift, (top << shift) >> 1)

        # Pack.
        swap, negative = quotient & 1, quotient >> 1 & 1
        results = (np.where(swap, cosine, sine), sign ^ negative ^ (turned & (1 - swap))), \
            (np.where(swap, sine, cosine), swap ^ negative ^ (turned & swap))
        own = (bits, sign), (np.full_like(bits, fmt.bias << fmt.fraction_width), np.zeros_like(sign))
        return tuple(
            fmt.from_bits(np.select([lost, tiny], [fmt.nan, small], large).astype(np.uint64)
                          | np.select([lost, tiny], [0, small_sign], large_sign).astype(np.uint64)
                          << np.uint64(fmt.width - 1))
            for (small, small_sign), (large, large_sign) in zip(own, results, strict=True))

    def _encode(self, exponent, extended):
        """Rounded encodings of significands with a guard bit; ``exponent`` is 1 for subnormal numbers."""
        fmt = self._format
        normal = extended >> fmt.precision
        encoded = (exponent * normal << fmt.fraction_width) + \
            (extended >> 1 & ((1 << fmt.fraction_width) - 1)) + (extended & 1)
        return encoded if fmt.gradual else encoded * normal

    # The circuit. Each stage returns a namespace with the values that later stages need.

    def elaborate(self, platform):
        m = Module()
        (self._iterate if self._iterative else self._pipeline)(m)
        return m

    def _pipeline(self, m):
        s = self._load(m)
        s.valid = self.start
        # Angles below 1 need no reduction step; for greater ones the exponent gives the number of steps.
        s = self._rank(m, "load", s)
        for step in range(_REDUCTIONS):
            s = self._reduce(m, f"_{step}", s, step)
            if (step + 1) % self._steps_per_cycle == 0 or step + 1 == _REDUCTIONS:
                s = self._rank(m, f"reduce_{step}", s)
        s = self._rank(m, "prepare", self._prepare(m, s))
        s.v = C(0, signed(1))
        for step in range(self.iterations):
            turn = self._turn(m, f"_{step}", s, known=step)
            v = Signal(signed(self._width + step + 2), name=f"v_{step}")
            m.d.comb += v.eq(_double(s.v, turn.backward, s.x))
            s = SimpleNamespace(**{**vars(s), "v": v, "x": turn.x, "z": turn.z})
            if (step + 1) % self._steps_per_cycle == 0:
                s = self._rank(m, f"step_{step}", s)
        s = self._rank(m, "round", self._round(m, s))
        m.d.comb += [self.done.eq(s.valid), self.sin.eq(s.sin), self.cos.eq(s.cos)]

    def _iterate(self, m):
        width = self._width
        # v holds the angle, in units of 2**-reduced, then the sine; z and x count units of 2**-width.
        # |z| is at most 1, and x is between about 0.19 and 1.
        loaded = self._load(m)
        r = SimpleNamespace(**{name: Signal(value.shape(), name=name, reset_less=True)
                               for name, value in vars(loaded).items()})
        r.v = Signal(signed(max(self._reduced, width + self.iterations) + 1), name="v", reset_less=True)
        prepared = self._prepare(m, r)
        for name, value in vars(prepared).items():
            if not hasattr(r, name):
                setattr(r, name, Signal(value.shape(), name=name, reset_less=True))
        cycle = Signal(range(max(self._reduce_cycles, self._cycles)), reset_less=True)

        # Reduction and rotation share the additions to v. An angle with fewer reduction steps uses the last ones.
        reducing = Signal()
        reduced = turned = r
        for step in range(self._steps_per_cycle):
            digit, turn = self._digit(reduced.v), self._turn(m, f"_{step}", turned)
            v = Signal.like(r.v, name=f"v_{step}")
            m.d.comb += v.eq(_double(reduced.v, Mux(reducing, digit.subtract, turn.backward),
                                     Mux(reducing, digit.addend, turned.x)))
            reduced = SimpleNamespace(v=v, quotient=digit.after(reduced.quotient))
            turned = SimpleNamespace(v=v, x=turn.x, z=turn.z, index=turn.index)

        def to(values):
            return [getattr(r, name).eq(value) for name, value in vars(values).items()
                    if getattr(r, name) is not value]

        def accept():
            m.d.sync += [*to(loaded), cycle.eq(self._reduce_cycles - 1)]
            m.next = "IDLE"
            with m.If(self.start):
                m.next = "REDUCE"

        m.d.sync += self.done.eq(0)
        with m.FSM() as fsm:
            with m.State("IDLE"):
                accept()
            with m.State("REDUCE"):
                m.d.comb += reducing.eq(1)
                m.d.sync += cycle.eq(cycle - 1)
                with m.If(cycle < r.active_cycles):
                    m.d.sync += to(reduced)
                with m.If(cycle == 0):
                    m.next = "NORMALISE"
            with m.State("NORMALISE"):
                m.d.sync += [*to(prepared), r.v.eq(0), cycle.eq(self._cycles - 1)]
                m.next = "ITERATE"
            with m.State("ITERATE"):
                m.d.sync += [*to(turned), cycle.eq(cycle - 1)]
                with m.If(cycle == 0):
                    m.next = "ROUND"
            with m.State("ROUND"):
                m.d.sync += [getattr(self, name).eq(value) for name, value in vars(self._round(m, r)).items()]
                m.d.sync += self.done.eq(1)
                accept()
        self._lead_back(m, fsm)

    @staticmethod
    def _carried(s, *names):
        """The values that a stage passes on unchanged."""
        names += ("quotient", "operand", "tiny", "lost")
        if hasattr(s, "valid"):
            names += ("valid",)
        return {name: getattr(s, name) for name in names}

    def _load(self, m):
        """Unpack, and align the angle for ``digits`` reduction steps."""
        fmt, precision = self._format, self._format.precision
        a = unpack(m, fmt, self.angle, "angle")
        digits = Signal(range(_REDUCTIONS + 1))
        fraction_zeros = Signal(range(self._tiny))
        with m.If(self.angle.exponent >= fmt.bias):
            m.d.comb += digits.eq(self.angle.exponent - (fmt.bias - 1))
        with m.Else():
            m.d.comb += fraction_zeros.eq(fmt.bias - 1 - self.angle.exponent)
        s = SimpleNamespace(
            v=Cat(C(0, self._reduced - precision), a.significand, C(0, 1)).as_signed(), quotient=C(0, 2),
            fraction_zeros=fraction_zeros,
            operand=Cat(a.significand[:-1], self.angle.exponent, a.sign),
            tiny=self.angle.exponent < fmt.bias - self._tiny, lost=self.angle.exponent >= fmt.bias + _REDUCTIONS)
        if not self._iterative:
            s.digits = digits
            return s
        # The last cycles make the steps; the right shift compensates for extra steps in the first of them.
        s.active_cycles = Signal(range(self._reduce_cycles + 1), name="filled_cycles")
        aligned = Signal(self._reduced)
        with m.Switch(digits):
            for number in range(_REDUCTIONS + 1):
                with m.Case(number):
                    cycles = -(-number // self._steps_per_cycle)
                    spare = cycles * self._steps_per_cycle - number
                    m.d.comb += [s.active_cycles.eq(cycles),
                                 aligned.eq(a.significand << self._reduced - precision - spare)]
        s.v = aligned
        return s

    def _digit(self, v):
        """One quotient digit: the new angle and the new quotient."""
        # The angle is doubled. If its magnitude was at least 0.5, pi/2 of its sign is subtracted. So its
        # magnitude stays within 1, for all quotient digits.
        negative = v[self._reduced]
        digit = negative ^ v[self._reduced - 1]
        return SimpleNamespace(
            subtract=digit & ~negative, addend=self._half_pi & digit.replicate(self._reduced + 1),
            after=lambda quotient: Cat(digit, quotient[0] ^ (digit & negative)))

    def _reduce(self, m, name, s, step):
        """Reduction step number ``step`` of a pipeline, for the angles that need it."""
        digit, active = self._digit(s.v), s.digits > step
        v = Signal.like(s.v, name=f"reduced{name}")
        m.d.comb += v.eq(Mux(active, _double(s.v, digit.subtract, digit.addend)[:len(v)].as_signed(), s.v))
        return SimpleNamespace(**{**vars(s), "v": v,
                                  "quotient": Mux(active, digit.after(s.quotient), s.quotient)})

    def _prepare(self, m, s):
        """Normalise the angle and select the reciprocal gain, both for the first step."""
        width, fmt = self._width, self._format
        # An angle below 0.5 was not reduced and has no leading zeros here. A limit of all ones does not
        # affect angles whose sines are normal, and needs no logic.
        limit = self._most_zeros
        if limit < fmt.bias - 2:
            limit = (1 << limit.bit_length()) - 1
        sign = s.v[self._reduced]
        magnitude, zeros = normalise(m, s.v[:self._reduced] ^ sign.replicate(self._reduced), "magnitude",
                                     limit=C(limit, self._reduced.bit_length()))
        first = Signal(range(self._last + 1))
        m.d.comb += first.eq(s.fraction_zeros | zeros)
        return SimpleNamespace(
            z=Cat(magnitude[-(width - 1):] ^ sign.replicate(width - 1), sign.replicate(3)).as_signed(),
            x=Array(C(row, width + 1) for row in self._presets)[first], index=first,
            exponent=(fmt.bias - first)[:fmt.exponent_width], **self._carried(s))

    def _turn(self, m, name, s, known=None):
        """One CORDIC step without v. The index is relative to row ``known``, or it is incremented."""
        # z is rotated towards zero. v, half of 2**i times the sine, is doubled and x is added; v >> 2 * i - 1,
        # rounded to nearest, is subtracted from x. The carries of subtractions enter at the low bits, which are
        # zero in doubled numbers.
        base, last, width = known or 0, self._last, self._width
        turn = SimpleNamespace(backward=s.z[-1], z=Signal(signed(width + 2), name=f"z{name}"))
        forward = ~turn.backward
        angle = Array(C(self._table[min(base + i, last)], width + 1) for i in range(last + 1))[s.index]
        m.d.comb += turn.z.eq(Cat(forward, s.z) + (angle ^ forward.replicate(width + 2)))
        if base < last:
            change = (Cat(C(0, 2), s.v).as_signed() >> 2 * base) >> Cat(C(0, 1), s.index)
            turn.x = Signal(width + 1, name=f"x{name}")
            forwards = forward.replicate(width + 2)
            m.d.comb += turn.x.eq((Cat(1, s.x) + (change ^ forwards)[:width + 2])[1:])
        else:
            turn.x = s.x
        if known is None:
            turn.index = Signal.like(s.index, name=f"index{name}")
            m.d.comb += turn.index.eq(Mux(s.index == last, last, s.index + 1))
        return turn

    def _round(self, m, s):
        """Round both results, and select them or the special cases."""
        fmt, precision = self._format, self._format.precision
        # No sticky bits are needed: the results are irrational, and the bits below the guard bits are
        # within their errors. The sine's top bit weighs 2**(exponent - bias); it has one or two leading zeros,
        # or more if it is subnormal.
        turned = s.v[-1]
        top = s.v[:self._width + self.iterations][-(precision + 3):] ^ turned.replicate(precision + 3)
        shift = Mux(top[-1], 0, Mux(top[-2] | (s.exponent == 2), 1, 2))
        rounded = Signal(precision + 1)
        stored = Signal(fmt.exponent_width)
        m.d.comb += [rounded.eq((top << shift)[2:]), stored.eq(Mux(rounded[-1], s.exponent - shift, 0))]
        sine = round_significand(fmt, stored, rounded[1:], rounded[0], 1)
        if not fmt.gradual:
            sine = Mux(rounded[-1], sine, 0)
        # The cosine is 1 or has one leading zero.
        one = s.x[-1]
        rounded = Mux(one, s.x[-(precision + 1):], s.x[-(precision + 2):-1])
        cosine = round_significand(fmt, Mux(one, fmt.bias, fmt.bias - 1), rounded[1:], rounded[0], 1)

        swap, negative = s.quotient[0], s.quotient[1]
        results = SimpleNamespace(sin=Signal(fmt.width, name="packed_sin"), cos=Signal(fmt.width, name="packed_cos"))
        with m.If(s.lost):
            m.d.comb += [results.sin.eq(fmt.nan), results.cos.eq(fmt.nan)]
        with m.Elif(s.tiny):
            m.d.comb += [results.sin.eq(s.operand), results.cos.eq(fmt.bias << fmt.fraction_width)]
        with m.Else():
            m.d.comb += [
                results.sin.eq(Cat(Mux(swap, cosine, sine), s.operand[-1] ^ negative ^ (turned & ~swap))),
                results.cos.eq(Cat(Mux(swap, sine, cosine), swap ^ negative ^ (turned & swap))),
            ]
        if hasattr(s, "valid"):
            results.valid = s.valid
        return results


def _double(v, subtract, addend):
    """2v plus or minus the addend; the carry of a subtraction enters at the low bit."""
    return Cat(subtract, v).as_signed() + (addend ^ subtract.replicate(max(len(v), len(addend)) + 2))
