"""Angle of a vector: vectoring CORDIC that keeps the relative precision of small angles."""

import operator

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from ..fp.stages import normalise, round_nearest_even, unpack
from .iterative import IterativeCordic
from .tables import SCALE, round_shift, scaled_atan

__all__ = ["CordicAtan2"]

# How a result comes about: 0 to 4 stand for so many quarters of pi, exactly rounded.
_NAN, _COMPUTED = 5, 6


class CordicAtan2(IterativeCordic):
    """Four-quadrant arctangent, ``result = atan2(y, x)``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result, of at least 3 exponent bits.
    width : int or None
        Fraction bits of the fixed-point data path, at least precision + 2; None means precision + 5.
    iterations : int or None
        CORDIC steps, at least precision + 2, rounded up to fill the last cycle; None means
        precision + 6. ``width + iterations`` is at most 62, so that the twin fits 64 bits.
    steps_per_cycle : int
        CORDIC steps done in one clock cycle, at least 1.

    Members
    -------
    y, x, start : In(format), In(format), In(1)
        Ordinate and abscissa, any common unit; taken while ``start`` is high, which is ignored
        in the ``interval - 1`` cycles after that.
    result : Out(format)
        Angle from the x axis to (x, y), rad, from -pi to pi (both as rounded to the format);
        holds until the next result.
    done : Out(1)
        High for one cycle, from which on ``result`` is valid.

    Latency: ``latency`` cycles, ``start`` to ``done``, whatever the operands: 3 plus
    ``iterations / steps_per_cycle``, plus 2 if subnormals are gradual; one angle every
    ``interval`` = ``latency - 1`` cycles.
    Accuracy: within 0.5 + ``error_bound`` ulp of the result, subnormal results included;
    binary32 by default 0.69 ulp. A flushed result is compared after the steps, before rounding.
    Special values: those of C99 for signed zeros and infinities, every multiple of pi/4 among
    them correctly rounded; a NaN operand gives the format's NaN.
    Raises: TypeError if ``format`` is no FloatFormat; ValueError for unusable numbers.
    Source: Volder 1959, The CORDIC trigonometric computing technique; Walther 1971, A unified
    algorithm for elementary functions; ISO/IEC 9899:1999, F.9.1.4.
    """

    def __init__(self, format, *, width=None, iterations=None, steps_per_cycle=2):
        self._take(format, least_exponent_width=3, iterations=iterations, steps_per_cycle=steps_per_cycle)
        self._width = format.precision + 5 if width is None else operator.index(width)
        if self._width < format.precision + 2:
            raise ValueError(f"width must be at least {format.precision + 2}, not {width!r}")
        if self._width + self.iterations > 62:
            raise ValueError(f"width + iterations must be at most 62, not {self._width + self.iterations!r}")
        super().__init__({"y": In(format.layout), "x": In(format.layout), "start": In(1),
                          "result": Out(format.layout), "done": Out(1)})

        # Row i holds 2**i * atan(2**-i). Row ``last`` does for all after it: their angles round to
        # 1, and x grows by no more than about a unit.
        self._last = (self._width + 2) // 2
        self._table = [*(round_shift(scaled_atan(i), SCALE - self._width) for i in range(self._last)),
                       1 << self._width]
        self._half_pi = round_shift(2 * scaled_atan(0), SCALE - self._width)
        self._constants = [*(_encode_quarters(format, n) for n in range(5)), format.nan]

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: load, normalise twice, prepare, iterate, round."""
        return 3 + self._cycles + (2 if self._format.gradual else 0)

    @property
    def error_bound(self):
        """Error of the angle before the final rounding, in ulp of the result, at most."""
        # A small angle times 2**i0, a, lies between 0.46 and 2. Its absolute error is the sum of
        # - what is left: |y| <= 2x holds at the start and, since |y'| = 2||y| - x| and x' >= x,
        #   after each step: at most 2 * 2**-iterations;
        # - the table: half a unit, 2**-width / 2, times 2**-k in step k: at most 2**-width in all;
        # - the rounding of x: one unit in step k turns the vector by at most 2**-k units over x:
        #   at most 2 * 2**-width / x, where 1 / x <= 2**i0 * tan(a / 2**i0), which is a, nearly.
        #   From row ``last`` on it may be two units, but there the table is all but exact.
        # This weighs most for a just below 1/2, where an ulp is 2**-(precision + 1). Other angles
        # inherit the error, times 2**-i0, and that of pi, and have ulps at least twice as large.
        return 2.0 ** (self._format.precision + 2) * (2.0 ** -self.iterations + 2.0 ** -self._width)

    def compute(self, y, x):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        fmt, width = self._format, self._width
        y, x = np.broadcast_arrays(fmt.array(y), fmt.array(x))
        negative_y, negative_x = np.signbit(y), np.signbit(x)
        kind = np.select(
            [np.isnan(y) | np.isnan(x), np.isinf(y) & np.isinf(x), (y == 0) | np.isinf(x),
             (x == 0) | np.isinf(y)],
            [_NAN, np.where(negative_x, 3, 1), np.where(negative_x, 4, 0), 2], _COMPUTED)

        # Prepare.
        y_exponent, y = self._unpack(y)
        x_exponent, x = self._unpack(x)
        swap = x_exponent < y_exponent
        y, x = np.where(swap, x, y), np.where(swap, y, x)
        distance = np.abs(x_exponent - y_exponent)
        small = ~(swap | negative_x)
        subtract = swap ^ negative_x
        z = np.where(swap, self._table[0], np.where(negative_x, self._half_pi, 0))
        low = small & (distance > fmt.bias)
        exponent = np.where(low, fmt.gradual, fmt.bias + 1 - np.where(small, distance, 0))
        wait = np.where(small, np.where(low & fmt.gradual, distance - fmt.bias, 0), distance)

        # Iterate. ``x ^ ones`` is -x - 1 where ones is -1.
        table = np.array(self._table)
        index = np.minimum(distance, self._last)
        for step in range(self.iterations):
            active = wait <= step
            ones = np.where(y < 0, -1, 0)
            angle = np.where(active, table[index], 0)
            z = 2 * z + np.where((y < 0) ^ subtract, -angle, angle)
            y, x = (np.where(active, 2 * (y - ((x ^ ones) - ones)), y),
                    np.where(active, x - ((y ^ ~ones) >> 2 * index), x))
            index = np.minimum(index + active, self._last)

        # Round.
        top = z >> (width + self.iterations - fmt.precision - 3)
        shift = sum((top >> (fmt.precision + 1)) < bound for bound in (4, 2, 1))
        if fmt.gradual:
            shift = np.minimum(shift, exponent - 1)
        top = (top << shift) >> 3
        exponent = exponent - shift
        subnormal = top >> fmt.precision == 0
        encoded = (np.where(subnormal, 0, exponent) << fmt.fraction_width) + \
            ((top >> 1) & ((1 << fmt.fraction_width) - 1)) + (top & 1)
        if not fmt.gradual:
            encoded = np.where(exponent < 1, 0, encoded)
        encoded = np.array([*self._constants, 0])[kind] + np.where(kind == _COMPUTED, encoded, 0)
        return fmt.from_bits(encoded | (negative_y & (kind != _NAN)) << (fmt.width - 1))

    def _unpack(self, values):
        """Exponents and normalised significands, the latter with ``width`` fraction bits."""
        fmt = self._format
        bits = fmt.to_bits(values).astype(np.int64)
        exponent = bits >> fmt.fraction_width & fmt.exponent_special
        significand = bits & ((1 << fmt.fraction_width) - 1) | (exponent > 0) << fmt.fraction_width
        exponent = np.maximum(exponent, 1)
        if fmt.gradual:
            zeros = fmt.precision - np.frexp(significand.astype(np.float64))[1]
            exponent, significand = exponent - zeros, significand << zeros
        return exponent, significand << (self._width - fmt.fraction_width)

    def elaborate(self, platform):
        m = Module()
        fmt, width = self._format, self._width

        # Significands count units of 2**-width. x stays below 2 * sqrt(2) * 1.65 and |y| within 2x.
        # Exponents of normalised subnormals go down to 2 - precision.
        y = Signal(signed(width + 5), reset_less=True)
        x = Signal(width + 3, reset_less=True)
        z = Signal(width + self.iterations + 1, reset_less=True)
        y_sign, x_sign, subtract = (Signal(name=name, reset_less=True)
                                    for name in ("y_sign", "x_sign", "subtract"))
        y_exponent = Signal(range(2 - fmt.precision if fmt.gradual else 0, fmt.exponent_special + 1),
                            reset_less=True)
        x_exponent = Signal.like(y_exponent)
        exponent = Signal(range(fmt.bias + 2), reset_less=True)
        kind = Signal(range(_COMPUTED + 1), reset_less=True)
        index = Signal(range(self._last + 1), reset_less=True)
        wait = Signal(self.iterations.bit_length(), reset_less=True)
        cycle = Signal(range(self._cycles), reset_less=True)

        # Load, and find the special cases.
        a, b = unpack(m, fmt, self.y, "y"), unpack(m, fmt, self.x, "x")
        padding = C(0, width - fmt.fraction_width)
        load = [y.eq(Cat(padding, a.significand)), y_exponent.eq(a.exponent), y_sign.eq(a.sign),
                x.eq(Cat(padding, b.significand)), x_exponent.eq(b.exponent), x_sign.eq(b.sign)]
        case = Signal.like(kind)
        with m.If(a.is_nan | b.is_nan):
            m.d.comb += case.eq(_NAN)
        with m.Elif(a.is_infinite & b.is_infinite):
            m.d.comb += case.eq(Mux(b.sign, 3, 1))
        with m.Elif(a.is_zero | b.is_infinite):
            m.d.comb += case.eq(Mux(b.sign, 4, 0))
        with m.Elif(b.is_zero | a.is_infinite):
            m.d.comb += case.eq(2)
        with m.Else():
            m.d.comb += case.eq(_COMPUTED)

        # Normalise: the operands change places twice and pass the one normaliser on the way.
        if fmt.gradual:
            significand, zeros = normalise(m, y[len(padding):width + 1], "significand")
            exchange = [y.eq(x), y_exponent.eq(x_exponent),
                        x.eq(Cat(padding, significand)), x_exponent.eq(y_exponent - zeros)]

        # Prepare. Y / X = 2**-distance * y / x and y < 2x, so step i0 = distance comes first.
        difference = x_exponent - y_exponent
        swap = difference < 0
        distance = Signal(range(fmt.exponent_special + fmt.precision))
        m.d.comb += distance.eq(Mux(swap, -difference, difference))
        # Small angles are computed as 2**i0 times themselves and keep their precision. In the other
        # octants z starts at pi/4 or pi/2 and doubles i0 + 1 times until the first digit counts;
        # a subnormal waits likewise for its place.
        small = ~(swap | x_sign)
        low = small & (distance > fmt.bias)
        delay = Mux(small, Mux(low, distance - fmt.bias, 0) if fmt.gradual else 0, distance)
        prepare = [
            subtract.eq(swap ^ x_sign),
            z.eq(Mux(swap, self._table[0], Mux(x_sign, self._half_pi, 0))),
            exponent.eq(Mux(low, int(fmt.gradual), fmt.bias + 1 - Mux(small, distance, 0))),
            index.eq(Mux(distance < self._last, distance, self._last)),
            wait.eq(delay | delay[len(wait):].any().replicate(len(wait))),
            cycle.eq(self._cycles - 1),
        ]

        # Iterate.
        registers = state = y, x, z, index, wait
        for step in range(self._steps_per_cycle):
            state = self._step(m, step, subtract, *state)
        iterate = [register.eq(value) for register, value in zip(registers, state, strict=True)]

        # Round. The top bit of z weighs 2**(exponent - bias). At most three zeros lead it, unless the
        # result is subnormal, which keeps the weight of exponent 1.
        top = z[-(fmt.precision + 4):]
        stop = [top[-1 - zeros] | (exponent == zeros + 1 if fmt.gradual else 0) for zeros in range(3)]
        shift = Mux(stop[0], 0, Mux(stop[1], 1, Mux(stop[2], 2, 3)))
        rounded = Signal(fmt.precision + 1)
        stored = Signal(fmt.exponent_width)
        m.d.comb += [
            rounded.eq((top << shift)[3:]),
            stored.eq(Mux(rounded[-1] | (not fmt.gradual), exponent - shift, 0)),
        ]
        # No sticky bit: the angle is irrational, and what z has below the guard bit is within its error.
        encoded = round_nearest_even(fmt, stored, rounded[1:], rounded[0], 1)
        magnitude = Signal(fmt.width - 1)
        with m.Switch(kind):
            for number, constant in enumerate(self._constants):
                with m.Case(number):
                    m.d.comb += magnitude.eq(constant)
            with m.Default():
                m.d.comb += magnitude.eq(encoded if fmt.gradual else Mux(exponent > shift, encoded, 0))

        def accept():
            m.d.sync += [*load, kind.eq(case)]
            m.next = "IDLE"
            with m.If(self.start):
                m.next = "NORMALISE_Y" if fmt.gradual else "PREPARE"

        m.d.sync += self.done.eq(0)
        with m.FSM():
            with m.State("IDLE"):
                accept()
            if fmt.gradual:
                with m.State("NORMALISE_Y"):
                    m.d.sync += exchange
                    m.next = "NORMALISE_X"
                with m.State("NORMALISE_X"):
                    m.d.sync += exchange
                    m.next = "PREPARE"
            with m.State("PREPARE"):
                m.d.sync += prepare
                with m.If(swap):
                    m.d.sync += [y.eq(x), x.eq(y)]
                m.next = "ITERATE"
            with m.State("ITERATE"):
                m.d.sync += [*iterate, cycle.eq(cycle - 1)]
                with m.If(cycle == 0):
                    m.next = "ROUND"
            with m.State("ROUND"):
                m.d.sync += [self.result.eq(Cat(magnitude, y_sign & (kind != _NAN))), self.done.eq(1)]
                accept()
        return m

    def _step(self, m, step, subtract, y, x, z, index, wait):
        """One CORDIC step, number ``step`` of its cycle: the values that follow the given ones."""
        after_y, after_x, after_z, after_index, after_wait = (
            Signal.like(value, name=f"{name}_{step}")
            for name, value in (("y", y), ("x", x), ("z", z), ("index", index), ("wait", wait)))
        active = wait == 0
        negative = y[-1]
        turn = ~negative.replicate(len(y))
        reverse = negative ^ subtract
        # While waiting, the row of 1 stands for 0: only its leading bit needs a gate.
        ratio = Array(C(row, self._width + 1) for row in self._table)[Mux(active, index, self._last)]
        angle = Cat(ratio[:-1], ratio[-1] & active)
        m.d.comb += [
            # y turns towards zero and doubles, and x grows by |y| >> 2 * index, rounded up. The
            # carry of a subtraction enters at the low bit, which is zero in 2z and, always, in y.
            after_y.eq(Mux(active, ((Cat(~negative, y[1:]) + (x ^ turn)) << 1)[:len(y)], y)),
            after_x.eq(Mux(active, x - ((y >> Cat(C(0, 1), index)) ^ turn)[:len(x)], x)),
            after_z.eq(Cat(reverse, z) + (angle ^ reverse.replicate(len(z)))),
            after_index.eq(index + (active & (index != self._last))),
            after_wait.eq(Mux(active, 0, wait - 1)),
        ]
        return after_y, after_x, after_z, after_index, after_wait


def _encode_quarters(fmt, count):
    """Encoding of ``count`` quarters of pi, correctly rounded."""
    if not count:
        return 0
    value = count * scaled_atan(0)
    exponent = value.bit_length() - 1 - SCALE
    significand = round_shift(value, value.bit_length() - fmt.precision)
    return (fmt.bias + exponent - 1 << fmt.fraction_width) + significand
