"""Division and square root: one digit recurrence, pipelined or iterative, for one or both."""

import operator
from types import SimpleNamespace

import numpy as np
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from .pipeline import Ranks
from .stages import normalised, round_and_pack, unpack

__all__ = ["FpDivide", "FpSquareRoot", "FpDivideSquareRoot"]


class DigitRecurrence(wiring.Component):
    """Base of the digit recurrences: one result bit in each step, pipelined or iterative.

    The one for quotients and roots is here, non-restoring; a subclass may bring another.
    With X the dividend, scaled to [B, 2B) for the divisor B in [1, 2), or the radicand, scaled to
    [1, 4), the result is Q = 1.q_1 q_2 ... and step k = 0, 1, ... makes from the remainder R

        2R - T  if R >= 0,  else  2R + T + U,    and the bit  q_k = (new R >= 0),

    from R = X/2 on, where T = B and U = 0 in division, and T = 2Q + 2**-k and U = 2**(1-k) in
    square root, Q being the bits so far. A negative R is a subtraction not undone: U makes up
    for what T has changed since. ``divisor`` holds B or 2Q, ``place`` 0 or 2**-k.

    Source: Ercegovac and Lang, Digital Arithmetic, 2004, chapters 5 and 6; for the square root
    Li and Chu, A new non-restoring square root algorithm, ICCD 1996.
    """

    # The registers that a step changes.
    _stepped: tuple[str, ...] = ("remainder", "divisor", "place", "quotient")

    def __init__(self, format, operands, *, bits_per_cycle, iterative):
        self._format = format
        self._bits_per_cycle = operator.index(bits_per_cycle)
        if not 1 <= self._bits_per_cycle <= format.precision:
            raise ValueError(f"bits_per_cycle must be from 1 to {format.precision}, not {bits_per_cycle!r}")
        self._iterative = bool(iterative)
        super().__init__({**{name: In(shape) for name, shape in operands.items()}, "start": In(1),
                          "result": Out(format.layout), "done": Out(1)})

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    @property
    def bits_per_cycle(self):
        """Result bits made in one cycle."""
        return self._bits_per_cycle

    @property
    def iterative(self):
        """Whether one set of registers is used again and again, in place of a pipeline."""
        return self._iterative

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: one to unpack, the recurrence's, and one to round."""
        return self._cycles + 2

    @property
    def interval(self):
        """Least number of cycles between two operations."""
        return self._cycles + 1 if self._iterative else 1

    @property
    def _cycles(self):
        return -(-self._format.precision // self._bits_per_cycle)

    @property
    def _registered_bits(self):
        return self._cycles * self._bits_per_cycle

    @property
    def _bits(self):
        # Significand and guard bit at least. Where the last cycle has no room for the guard bit,
        # the rounding cycle makes it, with the first step's circuit, which is idle by then.
        return max(self._registered_bits, self._format.precision + 1)

    def elaborate(self, platform):
        m = Module()
        (self._iterate if self._iterative else self._pipeline)(m, self._begin(m))
        return m

    def _pipeline(self, m, s):
        cuts = ("begin", *(f"cycle_{cycle}" for cycle in range(self._cycles)), "result")
        rank = Ranks(m, cuts, cuts, self.start)

        def keep(cut, s):
            # The place of a bit is known here: a constant needs no registers.
            place = s.__dict__.pop("place")
            return SimpleNamespace(place=place, **vars(rank(cut, **vars(s))))

        s.quotient = C(0, 0)
        s = keep("begin", s)
        for cut in cuts[1:-1]:
            s = keep(cut, self._advance(m, s)[-1])
        if self._registered_bits < self._bits:
            s = self._step(m, s)
        s = rank("result", result=self._finish(m, s))
        m.d.comb += [self.result.eq(s.result), self.done.eq(rank.valid)]

    def _iterate(self, m, begun):
        # A one runs ahead of the quotient: its arrival at the top ends the recurrence.
        begun.quotient = C(1, self._registered_bits + 1)
        s = SimpleNamespace(**{name: Signal.like(value, name=name, reset_less=True)
                               for name, value in vars(begun).items()})
        steps = self._advance(m, s)

        # The rounding cycle is the last look at the registers, so it may fill them anew.
        busy, finishing, accept = Signal(), Signal(), Signal()
        m.d.comb += [finishing.eq(busy & s.quotient[-1]), accept.eq(self.start & (~busy | finishing))]
        m.d.sync += [busy.eq(accept | (busy & ~finishing)), self.done.eq(finishing)]

        for name in self._stepped:
            m.d.sync += getattr(s, name).eq(getattr(steps[-1], name))
        with m.If(accept):
            m.d.sync += [getattr(s, name).eq(value) for name, value in vars(begun).items()]
        with m.If(finishing):
            m.d.sync += self.result.eq(self._finish(m, steps[0] if self._registered_bits < self._bits else s))

    def _begin(self, m):
        """The registers' first contents, all but ``quotient``."""
        fmt = self._format
        square_root = self._select
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self._divisor, "b")
        a_significand, a_exponent = normalised(m, fmt, self.a, a, "a")
        b_significand, b_exponent = normalised(m, fmt, self._divisor, b, "b")

        # Scale X by two if it is less than B, or if the root's exponent would not be whole: the
        # bias is odd, so that is where a_exponent is even.
        less = a_significand < b_significand
        scale = Mux(square_root, ~a_exponent[0], less)
        exponent = Signal(signed(max(fmt.exponent_width, fmt.fraction_width.bit_length()) + 2))
        m.d.comb += exponent.eq(a_exponent + fmt.bias - Mux(square_root, 0, b_exponent + less))

        # Weights: bit 0 of remainder, divisor and place is that of the last quotient bit.
        last = self._bits - 1
        half = a_significand << (last - fmt.precision)
        remainder, divisor, place = Signal(last + 3), Signal(last + 2), Signal(last + 1)
        m.d.comb += [
            remainder.eq(Mux(scale, half << 1, half)),
            divisor.eq(Mux(square_root, 0, b_significand << (last - fmt.fraction_width))),
            place.eq(Mux(square_root, 1 << last, 0)),
        ]
        return SimpleNamespace(
            square_root=square_root, remainder=remainder, divisor=divisor, place=place,
            exponent=Mux(square_root, exponent >> 1, exponent),
            sign=a.sign ^ (b.sign & ~square_root),
            is_nan=a.is_nan | Mux(square_root, a.sign & ~a.is_zero,
                                  b.is_nan | (a.is_infinite & b.is_infinite) | (a.is_zero & b.is_zero)),
            is_infinite=a.is_infinite | (b.is_zero & ~square_root),
            is_zero=a.is_zero | (b.is_infinite & ~square_root))

    def _step(self, m, s):
        """The state after one more bit."""
        trial, remainder = Signal.like(s.remainder), Signal.like(s.remainder)
        divisor, place = Signal.like(s.divisor), Signal.like(s.place)
        negative, bit = s.remainder[-1], ~remainder[-1]
        m.d.comb += [
            trial.eq(s.divisor | s.place | Mux(negative, s.place << 1, 0)),
            # 2R has room for the carry of a subtraction in its lowest bit.
            remainder.eq(Cat(~negative, s.remainder) + Mux(negative, trial, ~trial)),
            divisor.eq(s.divisor | Mux(bit, s.place << 1, 0)),
            place.eq(s.place >> 1),
        ]
        return SimpleNamespace(**{**vars(s), "remainder": remainder, "divisor": divisor, "place": place,
                                  "quotient": Cat(bit, s.quotient)})

    def _advance(self, m, s):
        """The states after each step of one cycle."""
        states = [s]
        for _ in range(self._bits_per_cycle):
            states.append(self._step(m, states[-1]))
        return states[1:]

    def _finish(self, m, s):
        fmt = self._format
        quotient = s.quotient[:self._bits]
        # A root never lies halfway between two numbers, nor a quotient between two normal ones: the
        # root's square, or the quotient's product with the divisor, would have too many bits.
        sticky = C(1)
        if fmt.gradual:
            restored = Signal.like(s.remainder)
            m.d.comb += restored.eq(s.remainder + Mux(s.remainder[-1], s.divisor, 0))
            sticky = s.square_root | restored.any() | quotient[:-fmt.precision - 1].any()
        return round_and_pack(m, fmt, SimpleNamespace(
            sign=s.sign, is_nan=s.is_nan, is_infinite=s.is_infinite, is_zero=s.is_zero,
            exponent=s.exponent, extended=Cat(sticky, quotient[-fmt.precision - 1:])))


def _quotient(fmt, a, b):
    a, b = fmt.array(a), fmt.array(b)
    with np.errstate(all="ignore"):
        result = a / b
        if not fmt.gradual:
            # The least normal number may be the rounded form of something below it.
            doubtful = np.abs(result) == fmt.from_bits(fmt.least_normal)
            if doubtful.any():
                (x, x_exponent), (y, y_exponent) = np.frexp(np.abs(a)), np.frexp(np.abs(b))
                below = x < np.ldexp(y, 1 - fmt.bias - x_exponent + y_exponent)
                result = np.where(doubtful & below, np.copysign(fmt.dtype.type(0), result), result)
        return fmt.canonical(fmt.flush(result))


def _square_root(fmt, a):
    with np.errstate(all="ignore"):
        return fmt.canonical(fmt.flush(np.sqrt(fmt.array(a))))


class FpDivide(DigitRecurrence):
    """Quotient of two floating-point numbers, ``result = a / b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    bits_per_cycle : int
        Result bits made in one cycle, 1 to the format's precision.
    iterative : bool
        False: a pipeline, one operation per cycle. True: one operation at a time, small.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high; iterative: if no operation is on.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high; iterative: until the next ``done``.

    Latency: ``latency`` = ceil(precision / bits_per_cycle) + 2 cycles, ``start`` to ``done``; one
    operation in ``interval`` cycles: pipelined 1, iterative ``latency`` - 1. A ``start`` that comes
    earlier is ignored. No back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: x / 0 is infinity; 0 / 0, infinity / infinity and NaN operands give the
    format's NaN.
    Raises: ValueError if ``bits_per_cycle`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *division*.
    """

    _select = C(0)

    def __init__(self, format, *, bits_per_cycle=2, iterative=False):
        super().__init__(format, {"a": format.layout, "b": format.layout},
                         bits_per_cycle=bits_per_cycle, iterative=iterative)

    @property
    def _divisor(self):
        return self.b

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return _quotient(self._format, a, b)


class FpSquareRoot(DigitRecurrence):
    """Square root of a floating-point number.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and result.
    bits_per_cycle : int
        Result bits made in one cycle, 1 to the format's precision.
    iterative : bool
        False: a pipeline, one operation per cycle. True: one operation at a time, small.

    Members
    -------
    a, start : In(format), In(1)
        Operand, any unit, taken while ``start`` is high; iterative: if no operation is on.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high; iterative: until the next ``done``.

    Latency: ``latency`` = ceil(precision / bits_per_cycle) + 2 cycles, ``start`` to ``done``; one
    operation in ``interval`` cycles: pipelined 1, iterative ``latency`` - 1. A ``start`` that comes
    earlier is ignored. No back-pressure.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: the root of -0 is -0; other negative operands and NaN give the format's NaN.
    Raises: ValueError if ``bits_per_cycle`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *squareRoot*.
    """

    _select = C(1)

    def __init__(self, format, *, bits_per_cycle=2, iterative=False):
        super().__init__(format, {"a": format.layout}, bits_per_cycle=bits_per_cycle, iterative=iterative)

    @property
    def _divisor(self):
        return self._format.layout(C(0, self._format.width))

    def compute(self, a):
        """Bit-exact software twin: an array of the format's dtype, any shape."""
        return _square_root(self._format, a)


class FpDivideSquareRoot(DigitRecurrence):
    """Quotient ``a / b`` or square root of ``a``, from one small iterative circuit.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    bits_per_cycle : int
        Result bits made in one cycle, 1 to the format's precision.

    Members
    -------
    a, b, square_root, start : In(format), In(format), In(1), In(1)
        Operands, any unit, and whether the square root of ``a`` is taken, ``b`` being ignored;
        taken while ``start`` is high and no operation is on.
    result, done : Out(format), Out(1)
        Result, valid from ``done`` to the next ``done``.

    Latency: ``latency`` = ceil(precision / bits_per_cycle) + 2 cycles, ``start`` to ``done``; one
    operation in ``interval`` = ``latency`` - 1 cycles; a ``start`` that comes earlier is ignored.
    Accuracy: correctly rounded, to nearest, ties to even.
    Special values: as in ``FpDivide`` and ``FpSquareRoot``.
    Raises: ValueError if ``bits_per_cycle`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operations *division* and *squareRoot*.
    """

    def __init__(self, format, *, bits_per_cycle=2):
        super().__init__(format, {"a": format.layout, "b": format.layout, "square_root": 1},
                         bits_per_cycle=bits_per_cycle, iterative=True)

    @property
    def _select(self):
        return self.square_root

    @property
    def _divisor(self):
        return self.b

    def compute(self, a, b, square_root):
        """Bit-exact software twin: arrays of the format's dtype and of bool, shapes that broadcast."""
        return np.where(square_root, _square_root(self._format, a), _quotient(self._format, a, b))
