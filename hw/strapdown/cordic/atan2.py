"""Angle and length of a vector: vectoring CORDIC that keeps the relative precision of small angles."""

import operator
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from amaranth import *

from ..fp import exact
from ..fp.rounding import Rounding, bit_length, round_encoding
from ..fp.stages import NARROW, normalise, round_and_pack, round_significand, unpack
from .component import CordicComponent, blockwise
from .tables import SCALE, encode_scaled, round_shift, scaled_atan, scaled_reciprocal_gain

__all__ = ["CordicAtan2", "Polar"]

# Sources of an angle: the numbers 0 to 4 mean that many quarters of pi, correctly rounded.
_NAN, _COMPUTED = 5, 6


class Polar(NamedTuple):
    """Angles and lengths of the same vectors."""

    result: np.ndarray
    magnitude: np.ndarray


class CordicAtan2(CordicComponent):
    """Four-quadrant arctangent, ``result = atan2(y, x)``, and optionally the vector's length.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and results, of at least 3 exponent bits.
    width : int or None
        Fraction bits of the fixed-point data path, at least precision + 2, at most 59, so that the
        twin fits 64 bits; None means precision + 5, or precision + 6 with ``magnitude``.
    iterations : int or None
        CORDIC steps, at least precision + 2, rounded up to a multiple of ``steps_per_cycle``; None means
        precision + 6.
    steps_per_cycle : int or None
        CORDIC steps between two ranks of registers, at least 1; None means 2
        iterative, 1 pipelined.
    iterative : bool
        True: all steps use one set of registers. False: each step has a separate circuit, and an
        operation may start in every cycle. Both give the same bits.
    magnitude : bool
        True for an output ``magnitude``; it costs one multiplication by a constant.
    registered_addends : bool or None
        True: registers between shifter, table and adders, for a higher clock frequency; only iterative with
        one step per cycle. None means True there for formats longer than binary32.

    Members
    -------
    y, x, start : In(format), In(format), In(1)
        Ordinate and abscissa, any common unit; taken while ``start`` is high. ``start`` is ignored
        in the ``interval - 1`` cycles after that.
    result : Out(format)
        Angle from the x axis to (x, y), rad, from -pi to pi (both as rounded to the format).
    magnitude : Out(format)
        Length of (x, y), in the unit of both; only with ``magnitude=True``.
    done : Out(1)
        High for one cycle per operation; results are valid in this cycle, iterative until the next ``done``.

    Latency: ``latency`` cycles, ``start`` to ``done``, for all operands: 4 plus
    ``iterations / steps_per_cycle``, plus the normalisation of gradual subnormals: 2 iterative,
    1 pipelined, plus 2 with ``registered_addends``. One operation every ``interval`` cycles:
    ``latency - 1`` iterative, 1 pipelined.
    Accuracy: the angle within ``error_bound_ulp``, subnormal results included, binary32 and
    binary64 by default 0.69 ulp; the length within ``magnitude_error_bound_ulp``, binary32 by
    default 0.68, binary64 0.80 ulp. A flushed angle is compared after the steps, before rounding.
    Special values: the angle follows C99 for signed zeros and infinities, with every multiple of
    pi/4 correctly rounded; a NaN operand gives the format's NaN. The length follows hypot: it is
    infinite if an operand is infinite, even if the other is NaN, and exact if one operand is zero.
    Raises: TypeError if ``format`` is not a FloatFormat; ValueError for unusable numbers, and for
    ``registered_addends`` in a pipeline or with several steps per cycle.
    Source: Volder 1959, The CORDIC trigonometric computing technique; Walther 1971, A unified
    algorithm for elementary functions; ISO/IEC 9899:1999, F.9.1.4 and F.9.4.3.
    """

    # X and Y are the operands' magnitudes, exchanged so that Y does not have the larger exponent. d >= 0
    # is the difference of the exponents; x = X and y = 2**d Y start in [1, 2). Step k = 0, 1, ...
    # rotates by the angle of i = d + k, and y and the angle z are doubled in each step:
    #
    #     y' = 2 (y -+ x),    x' = x + 2**(-2i) |y|,    z' = 2 z +- 2**i atan(2**-i),
    #
    # with the upper signs if y >= 0. So z has the leading bits of 2**d atan(Y / X), however small
    # that is, and index i alone selects shift and angle. In the other octants the angle is pi/2 or pi
    # minus or plus this angle, and z is first shifted back to its place, by 2**-d.

    def __init__(self, format, *, width=None, iterations=None, steps_per_cycle=None, iterative=True, magnitude=False,
                 registered_addends=None):
        self._take(format, least_exponent_width=3, iterations=iterations, steps_per_cycle=steps_per_cycle,
                   iterative=iterative)
        self._magnitude = bool(magnitude)
        possible = self._iterative and self._steps_per_cycle == 1
        if registered_addends and not possible:
            raise ValueError("registered_addends must not be True for a pipeline, or with several steps per cycle")
        wide = format.precision > NARROW
        self._registered_addends = possible and (wide if registered_addends is None else bool(registered_addends))
        least = format.precision + 2
        self._width = least + 3 + self._magnitude if width is None else operator.index(width)
        if least > 59:
            raise ValueError(f"format must have a precision of at most 57 bits, not {format.precision!r}")
        if not least <= self._width <= 59:
            raise ValueError(f"width must be from {least} to 59, not {self._width!r}")
        super().__init__(("y", "x"), ("result", "magnitude") if magnitude else ("result",))

        # Row i holds 2**i * atan(2**-i). From row ``last`` on these are 1, and x keeps its value.
        self._last = (self._width + 1) // 2
        self._table = [*(self._fixed(scaled_atan(i)) for i in range(self._last)), 1 << self._width]
        self._reciprocal_gains = [*(self._fixed(scaled_reciprocal_gain(i)) for i in range(self._last)),
                                  1 << self._width]
        self._constants = [*(encode_scaled(format, n * scaled_atan(0)) for n in range(5)), format.nan]
        # Start angles of the other octants, in units of 2**-(width + 1).
        self._half_pi, self._pi = (self._fixed(turns * scaled_atan(0)) for turns in (4, 8))

    def _fixed(self, scaled):
        return round_shift(scaled, SCALE - self._width)

    @property
    def has_magnitude(self):
        """True if the operator has an output ``magnitude``."""
        return self._magnitude

    @property
    def registered_addends(self):
        """True if there are registers between shifter, table and adders."""
        return self._registered_addends

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: load, normalise, prepare, step, align, round."""
        return (4 + self._cycles + self._format.gradual * (2 if self._iterative else 1)
                + 2 * self._registered_addends)

    @property
    def error_bound(self):
        """Upper bound of the angle's error before the final rounding, in ulp of the result.

        A small angle times 2**d, a, lies between 0.46 and 2. Its absolute error is the sum of

        - the remaining angle: |y| <= 2x holds at the start and, since |y'| = 2||y| - x| and x' >= x,
          after each step: at most 2 * 2**-iterations;
        - the table: half a unit, 2**-width / 2, times 2**-k in step k: at most 2**-width in all;
        - the truncation of x: less than one unit in step k rotates the vector by at most 2**-k units over
          x: at most 2 * 2**-width / x, where 1 / x <= 2**d * tan(a / 2**d), which is nearly a;
        - the terms that steps from row ``last`` on leave out: r**3 / 3 * 4**-last, at most r**3 / 3
          units, for an angle whose tangent is 2**-last * r.

        The error in ulp is largest for a just below 1/2, where an ulp is 2**-(precision + 1) and r < 1/2
        makes the last term less than 1/24 unit: 2**(precision + 1) * (2 * 2**-iterations + 2.05 * 2**-width).
        For larger angles the ulp grows faster than the sum. Other octants have the same error, times
        2**-d, and at most 2**-width more from pi, from the alignment and from the ones' complement, but
        their ulps are at least twice as large.
        """
        return 2.0 ** (self._format.precision + 2) * (2.0 ** -self.iterations + 1.025 * 2.0 ** -self._width)

    @property
    def magnitude_error_bound_ulp(self):
        """Upper bound of the length's error in ulp, its final rounding included.

        The length over 2**(exponent of X), from 1 to 2.83, is x after the steps over the gain of the
        steps from d on. Its error is less than the sum, in units of 2**-width, of

        - the truncations of x: one unit in each of ``last`` steps, and the gain increases none of them;
        - the terms that steps from row ``last`` on leave out: x r**2 / 2 * 4**-last, at most 4 units, where
          r <= 2 is the tangent times 2**last;
        - the remaining y: its square, 4 * 4**-iterations, less than one unit;
        - half a unit of the factor, times x < 4.7: at most 2.4 units.

        An ulp is at least 2**(1 - precision).
        """
        return 0.5 + (self._last + 7.4) * 2.0 ** (self._format.precision - 1 - self._width)

    # The twin.

    def compute(self, y, x):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast.

        Returns the angles, or ``Polar`` with ``magnitude=True``.
        """
        y, x = np.broadcast_arrays(self._format.array(y), self._format.array(x))
        results = blockwise(self._compute, y, x)
        return Polar(*results) if self._magnitude else results[0]

    def _compute(self, y, x):
        fmt, width = self._format, self._width
        longer = np.maximum(np.abs(y), np.abs(x))
        negative_y, negative_x = np.signbit(y), np.signbit(x)
        is_nan, infinite = np.isnan(y) | np.isnan(x), np.isinf(y) | np.isinf(x)
        kind = np.select(
            [is_nan, np.isinf(y) & np.isinf(x), (y == 0) | np.isinf(x), infinite | (x == 0)],
            [_NAN, np.where(negative_x, 3, 1), np.where(negative_x, 4, 0), 2], _COMPUTED)
        computed = kind == _COMPUTED

        # Prepare. Special cases, which need no computation, use 1 and 1 as operands.
        y_exponent, y = self._normalised(y, computed)
        x_exponent, x = self._normalised(x, computed)
        swap = x_exponent < y_exponent
        y, x = np.where(swap, x, y), np.where(swap, y, x)
        distance, top_exponent = np.abs(x_exponent - y_exponent), np.maximum(x_exponent, y_exponent)
        first = np.minimum(distance, self._last)

        # Iterate. ``x ^ ones`` is -x - 1 where ones is -1. z is stored in two parts.
        table = np.array(self._table)
        low, high, mask = np.zeros_like(x), np.zeros_like(x), (1 << width + 1) - 1
        for step in range(self.iterations):
            ones, angle = y >> 63, table[-1]
            grown = x
            if step < self._last:
                index = np.minimum(first + step, self._last)
                angle, grown = table[index], x + ((y ^ ones) >> 2 * index) * (index < self._last)
            low = 2 * low + ((angle ^ ones) - ones)
            high, low = 2 * high + (low >> width + 1), low & mask
            y, x = 2 * (y - ((x ^ ones) - ones)), grown

        # Align, in units of 2**-(width + 1).
        surplus = self.iterations - 2
        z = (high << max(width + 1 - surplus, 0) >> max(surplus - width - 1, 0)) + (low >> surplus)
        small = ~(swap | negative_x)
        shift = np.where(small, np.where(fmt.gradual, np.maximum(distance - fmt.bias, 0), 0), distance)
        base = np.where(swap, self._half_pi, np.where(negative_x, self._pi, 0))
        z = base + ((z >> (shift & 1) >> 2 * np.minimum(shift >> 1, self._last)) ^ np.where(swap ^ negative_x, -1, 0))

        # Round. The angle is irrational, so no sticky bit is needed.
        exponent = np.where(small, np.maximum(-distance, -fmt.bias) if fmt.gradual else -distance, 0) - width - 1
        encoded, _ = round_encoding(fmt, np.False_, exponent, z, Rounding.NEAREST_EVEN, np.True_)
        encoded = np.where(computed, encoded, np.array([*self._constants, 0], dtype=np.uint64)[kind])
        result = fmt.from_bits(encoded | (negative_y & ~is_nan).astype(np.uint64) << np.uint64(fmt.width - 1))
        if not self._magnitude:
            return (result,)

        # Undo the gain and round the length, which is never less than 1.
        wide = np.int64 if width <= 30 else object
        length = x.astype(wide) * np.array(self._reciprocal_gains, dtype=wide)[first] >> 2 * width - fmt.precision
        length = np.maximum(length.astype(np.int64), 1 << fmt.precision)
        encoded, _ = round_encoding(fmt, np.False_, top_exponent - fmt.precision, length, Rounding.NEAREST_EVEN,
                                    np.True_)
        length = np.where(computed, fmt.from_bits(encoded), np.where(infinite, fmt.from_bits(fmt.infinity), longer))
        return result, fmt.canonical(length)

    def _normalised(self, values, computed):
        """Exponents and significands, the latter with ``width`` fraction bits."""
        number = exact.unpack(self._format, np.where(computed, values, values.dtype.type(1)))
        zeros = self._width + 1 - bit_length(number.significand)
        return number.exponent - zeros + self._width, number.significand << zeros

    # The circuit. Each stage returns a namespace with the values that later stages need.

    def elaborate(self, platform):
        m = Module()
        (self._iterate if self._iterative else self._pipeline)(m)
        return m

    def _pipeline(self, m):
        s = self._load(m)
        s.valid = self.start
        s = self._rank(m, "load", s)
        if self._format.gradual:
            s.y, s.y_exponent = self._normalise(m, "y", s.y, s.y_exponent)
            s.x, s.x_exponent = self._normalise(m, "x", s.x, s.x_exponent)
            s = self._rank(m, "normalise", s)
        s = self._rank(m, "prepare", self._prepare(m, s))
        s.z = C(0, 0)
        for step in range(self.iterations):
            s = self._step(m, f"_{step}", s, known=step)
            if (step + 1) % self._steps_per_cycle == 0:
                s = self._rank(m, f"step_{step}", s)
        s = self._begin_alignment(s)
        s = self._rank(m, "align", self._end_alignment(s, self._grow(s, s.subtract)))
        s = self._rank(m, "round", self._round(m, s))
        m.d.comb += [self.done.eq(s.valid), self.result.eq(s.result)]
        if self._magnitude:
            m.d.comb += self.magnitude.eq(s.magnitude)

    def _iterate(self, m):
        fmt, width = self._format, self._width
        # x is always below 2 * sqrt(2) * 1.65 and |y| at most 2x; z and its table are below 2.
        shapes = {"y": signed(width + 5), "x": width + 3, "z": width + self.iterations}
        loaded = self._load(m)
        r = self._registers(loaded, shapes)
        if fmt.gradual:
            # The operands are exchanged twice, so that both pass the single normaliser.
            y, y_exponent = self._normalise(m, "significand", r.y[:width + 1], r.y_exponent)
            exchange = {"y": r.x, "y_exponent": r.x_exponent, "x": y, "x_exponent": y_exponent}
        prepared = self._prepare(m, r)
        self._registers(prepared, shapes, r)
        r.z = Signal(shapes["z"], name="z", reset_less=True)

        # The adder of x in the first step also serves the alignment.
        aligning = Signal()
        ones = Mux(aligning, r.subtract, r.y[-1])
        addend, enable = None, aligning | (r.index != self._last)
        if self._registered_addends:
            # x and z lack what the previous step adds to them.
            addend = r.addend = Signal(width + 3, name="addend", reset_less=True)
            r.turn = Signal(signed(width + 2), name="turn", reset_less=True)
            m.d.sync += [r.addend.eq(self._addend(r, ones, enable=enable)),
                         r.turn.eq(Cat(self._angle(r), C(0, 1)) ^ r.y[-1].replicate(width + 2))]
        grown = Signal(width + 3)
        m.d.comb += grown.eq(self._grow(r, ones, enable=enable) if addend is None else (r.x + addend)[:width + 3])
        stepped = r
        for step in range(self._steps_per_cycle):
            stepped = self._step(m, f"_{step}", stepped, grown=grown if step == 0 else None)
        begun = self._begin_alignment(stepped)
        self._registers(begun, shapes, r)
        ended = self._end_alignment(r, grown)
        self._registers(ended, shapes, r)
        cycle = Signal(range(self._cycles), reset_less=True)

        def to(values):
            return [getattr(r, name).eq(value) for name, value in values.items() if getattr(r, name) is not value]

        def accept():
            m.d.sync += to(vars(loaded))
            m.next = "IDLE"
            with m.If(self.start):
                m.next = "NORMALISE_Y" if fmt.gradual else "PREPARE"

        m.d.sync += self.done.eq(0)
        with m.FSM() as fsm:
            with m.State("IDLE"):
                accept()
            if fmt.gradual:
                for state, following in ("NORMALISE_Y", "NORMALISE_X"), ("NORMALISE_X", "PREPARE"):
                    with m.State(state):
                        m.d.sync += to(exchange)
                        m.next = following
            with m.State("PREPARE"):
                m.d.sync += [*to(vars(prepared)), r.z.eq(0), cycle.eq(self._cycles - 1)]
                if self._registered_addends:
                    m.d.sync += [r.addend.eq(0), r.turn.eq(0)]
                m.next = "ITERATE"
            with m.State("ITERATE"):
                m.d.sync += [*to(vars(stepped)), cycle.eq(cycle - 1)]
                with m.If(cycle == 0):
                    if self._registered_addends:
                        m.next = "TURN"
                    else:
                        m.d.sync += to(vars(begun))
                        m.next = "ALIGN"
            if self._registered_addends:
                with m.State("TURN"):
                    m.d.sync += to(vars(begun))
                    m.next = "SHIFT"
                with m.State("SHIFT"):
                    m.d.comb += aligning.eq(1)
                    m.next = "ALIGN"
            with m.State("ALIGN"):
                m.d.comb += aligning.eq(1)
                m.d.sync += to(vars(ended))
                m.next = "ROUND"
            with m.State("ROUND"):
                m.d.sync += [getattr(self, name).eq(value) for name, value in vars(self._round(m, r)).items()]
                m.d.sync += self.done.eq(1)
                accept()
        self._lead_back(m, fsm)

    @staticmethod
    def _registers(values, shapes, registers=None):
        """A register for every value that does not have one."""
        registers = registers or SimpleNamespace()
        for name, value in vars(values).items():
            if not hasattr(registers, name):
                setattr(registers, name, Signal(shapes.get(name, value.shape()), name=name, reset_less=True))
        return registers

    def _carried(self, s, *names):
        """The values that a stage passes on unchanged."""
        names += ("kind", "y_sign")
        if self._magnitude:
            names += ("is_nan", "is_infinite", "is_zero")
        if hasattr(s, "valid"):
            names += ("valid",)
        return {name: getattr(s, name) for name in names}

    def _load(self, m):
        """Unpack, and find the special cases."""
        fmt = self._format
        a, b = unpack(m, fmt, self.y, "y"), unpack(m, fmt, self.x, "x")
        padding = C(0, self._width - fmt.fraction_width)
        kind = Signal(range(_COMPUTED + 1), name="case")
        with m.If(a.is_nan | b.is_nan):
            m.d.comb += kind.eq(_NAN)
        with m.Elif(a.is_infinite & b.is_infinite):
            m.d.comb += kind.eq(Mux(b.sign, 3, 1))
        with m.Elif(a.is_zero | b.is_infinite):
            m.d.comb += kind.eq(Mux(b.sign, 4, 0))
        with m.Elif(b.is_zero | a.is_infinite):
            m.d.comb += kind.eq(2)
        with m.Else():
            m.d.comb += kind.eq(_COMPUTED)
        # The least exponent of a normalised subnormal is 2 - precision; zeros have lower ones.
        lowest = 1 - fmt.precision if fmt.gradual else 0
        y_exponent, x_exponent = (Signal(range(lowest, fmt.exponent_special + 1), name=f"{name}_loaded")
                                  for name in ("y_exponent", "x_exponent"))
        m.d.comb += [y_exponent.eq(a.exponent), x_exponent.eq(b.exponent)]
        s = SimpleNamespace(
            y=Cat(padding, a.significand), y_exponent=y_exponent, y_sign=a.sign,
            x=Cat(padding, b.significand), x_exponent=x_exponent, x_sign=b.sign, kind=kind)
        if self._magnitude:
            s.is_infinite, s.is_nan = a.is_infinite | b.is_infinite, a.is_nan | b.is_nan
            s.is_zero, s.y_is_zero, s.x_is_zero = a.is_zero & b.is_zero, a.is_zero, b.is_zero
        return s

    def _normalise(self, m, name, operand, exponent):
        """An operand with its leading one on top, and its exponent."""
        padding = self._width - self._format.fraction_width
        significand, zeros = normalise(m, operand[padding:], name)
        following = Signal.like(exponent, name=f"{name}_exponent_normalised")
        m.d.comb += following.eq(exponent - zeros)
        return Cat(C(0, padding), significand), following

    def _prepare(self, m, s):
        """Exchange the operands if necessary, and compute first index, exponent and alignment."""
        fmt = self._format
        # Both differences are computed in parallel, because this is the longest path of the operator.
        difference, reverse = s.x_exponent - s.y_exponent, s.y_exponent - s.x_exponent
        swap, distance = Signal(name="exchanged"), Signal(range(fmt.exponent_special + fmt.precision))
        m.d.comb += [swap.eq(difference < 0), distance.eq(Mux(swap, reverse, difference))]
        if self._magnitude:
            m.d.comb += swap.eq((difference < 0) | s.x_is_zero)
        first = Signal(range(self._last + 1))
        near = Mux(swap, reverse < self._last, difference < self._last)
        m.d.comb += first.eq(Mux(near, distance, self._last))
        if self._magnitude:
            # The length is then x itself.
            with m.If(s.y_is_zero | s.x_is_zero):
                m.d.comb += first.eq(self._last)
        # Small angles are rounded after multiplication by 2**d, but subnormal angles at their final place.
        small = ~(swap | s.x_sign)
        low = small & (distance > fmt.bias)
        shift = Signal.like(distance)
        m.d.comb += shift.eq(Mux(small, Mux(low, distance - fmt.bias, 0) if fmt.gradual else 0, distance))
        prepared = SimpleNamespace(
            y=Cat(Mux(swap, s.x, s.y)[:self._width + 1], C(0, 1)).as_signed(),
            x=Mux(swap, s.y, s.x)[:self._width + 1], index=first,
            swap=swap, subtract=swap ^ s.x_sign, odd=shift[0],
            places=Mux(shift[1:] < self._last, shift[1:], self._last)[:len(first)],
            exponent=Mux(low, int(fmt.gradual), fmt.bias + 1 - Mux(small, distance, 0))[:fmt.exponent_width],
            **self._carried(s))
        if self._magnitude:
            prepared.first = first
            prepared.top_exponent = Mux(swap, s.y_exponent, s.x_exponent)
        return prepared

    def _grow(self, s, ones, *, enable=None, known=0):
        """The sum of x and ``_addend``."""
        return (s.x + self._addend(s, ones, enable=enable, known=known))[:self._width + 3]

    def _addend(self, s, ones, *, enable=None, known=0):
        """y, or its ones' complement, shifted right by two places for each index."""
        shifted = (s.y >> 2 * known) >> Cat(C(0, 1), s.index)
        addend = (shifted ^ ones.replicate(self._width + 3))[:self._width + 3]
        return addend if enable is None else addend & enable.replicate(len(addend))

    def _angle(self, s, known=0):
        """The row of the table that the index selects, relative to row ``known``."""
        rows = [self._table[min(known + i, self._last)] for i in range(self._last + 1)]
        return Array(C(row, self._width + 1) for row in rows)[s.index]

    def _step(self, m, name, s, *, known=None, grown=None):
        """One CORDIC step. The index is relative to row ``known``, which is static, or it is incremented.

        ``grown`` is x after the step, if another circuit computes it.
        """
        width, last = self._width, self._last
        y = Signal(signed(width + 5), name=f"y{name}")
        negative = s.y[-1]
        # The carry of a subtraction enters at the low bit, which is zero in 2z and always in y.
        turn = ~negative
        first, second = Cat(turn, s.y[1:]).as_signed(), s.x ^ turn.replicate(len(y))
        if self._registered_addends:
            # A row of full adders makes two numbers of three. The lowest carry is free for the second subtraction.
            third = s.addend ^ turn.replicate(len(y))
            first, second = first ^ second ^ third, Cat(turn, first & second | third & (first | second))
        m.d.comb += y.eq((first + second) << 1)
        values = {**vars(s), "y": y}

        if known is None or known < last:
            base = known or 0
            if grown is None:
                grown = Signal(width + 3, name=f"x{name}")
                m.d.comb += grown.eq(self._grow(s, negative, enable=s.index < last - base, known=base))
            values["x"] = grown
            z = Signal(width + self.iterations if known is None else width + 1 + known, name=f"z{name}")
            if self._registered_addends:
                m.d.comb += z.eq(Cat(s.turn[-1], s.z) + s.turn)
            else:
                m.d.comb += z.eq(Cat(negative, s.z) + (self._angle(s, base) ^ negative.replicate(len(z))))
        else:
            # The table has only ones here, so z gets a binary digit.
            z = Signal(len(s.z) + 1, name=f"z{name}")
            m.d.comb += z.eq(Cat(C(0, 1), s.z[:width - 1], s.z[width - 1:] + Mux(negative, -1, 1)))
        values["z"] = z
        if known is None:
            index = Signal.like(s.index, name=f"index{name}")
            m.d.comb += index.eq(Mux(s.index == last, last, s.index + 1))
            values["index"] = index
        return SimpleNamespace(**values)

    def _begin_alignment(self, s):
        """The angle in place of y. In place of x the value from which it is subtracted, or to which it is added."""
        angle = s.z[self.iterations - 2:]
        base = Mux(s.swap, self._half_pi, Mux(s.subtract, self._pi, 0))
        begun = SimpleNamespace(
            y=Mux(s.odd, angle >> 1, angle), x=base, index=s.places,
            **self._carried(s, "subtract", "exponent"))
        if self._magnitude:
            begun.length, begun.first, begun.top_exponent = s.x, s.first, s.top_exponent
        return begun

    def _end_alignment(self, s, angle):
        """The angle in units of 2**-(width + 1), and the length without the gain."""
        ended = SimpleNamespace(aligned=angle, **self._carried(s, "exponent"))
        if self._magnitude:
            factor = Array(C(row, self._width + 1) for row in self._reciprocal_gains)[s.first]
            ended.product = (s.length * factor)[2 * self._width - self._format.precision:2 * self._width + 2]
            ended.top_exponent = s.top_exponent
        return ended

    def _round(self, m, s):
        """Round, and insert special cases."""
        fmt = self._format
        # The top bit weighs 2**(exponent - bias). It has at most three leading zeros, unless the
        # result is subnormal, which keeps the weight of exponent 1.
        top = s.aligned[-(fmt.precision + 4):]
        stop = [top[-1 - zeros] | (s.exponent == zeros + 1 if fmt.gradual else 0) for zeros in range(3)]
        shift = Mux(stop[0], 0, Mux(stop[1], 1, Mux(stop[2], 2, 3)))
        rounded = Signal(fmt.precision + 1)
        stored = Signal(fmt.exponent_width)
        m.d.comb += [
            rounded.eq((top << shift)[3:]),
            stored.eq(Mux(rounded[-1] | (not fmt.gradual), s.exponent - shift, 0)),
        ]
        # No sticky bit is needed: the angle is irrational, and the bits below the guard bit are within its error.
        encoded = round_significand(fmt, stored, rounded[1:], rounded[0], 1)
        angle = Signal(fmt.width - 1)
        with m.Switch(s.kind):
            for number, constant in enumerate(self._constants):
                with m.Case(number):
                    m.d.comb += angle.eq(constant)
            with m.Default():
                m.d.comb += angle.eq(encoded if fmt.gradual else Mux(s.exponent > shift, encoded, 0))
        sign = s.y_sign | (s.kind == _NAN) if fmt.negative_nan else s.y_sign & (s.kind != _NAN)
        results = SimpleNamespace(result=Cat(angle, sign))

        if self._magnitude:
            # The length lies between 1 and 4; it can be less than 1 only by its error.
            double, single = s.product[-1], s.product[-2]
            extended = Mux(double, Cat(C(1, 1), s.product[1:]),
                           Mux(single, Cat(C(1, 1), s.product[:-1]), 1 << fmt.precision + 1))
            length = SimpleNamespace(
                sign=C(0, 1), is_nan=s.is_nan & ~s.is_infinite, is_infinite=s.is_infinite, is_zero=s.is_zero,
                exponent=s.top_exponent + double, extended=extended[:fmt.precision + 2])
            results.magnitude, _ = round_and_pack(m, fmt, length)
        if hasattr(s, "valid"):
            results.valid = s.valid
        return results
