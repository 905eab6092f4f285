"""Division and square root: one digit recurrence, pipelined or iterative, for one or both."""

import operator
from types import SimpleNamespace

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from . import exact
from .pipeline import Ranks, pick
from .rounding import Rounded, Rounding, flags_member
from .stages import FINE_LEVELS, NARROW, align_subnormal, normalised, round_and_pack, unpack

__all__ = ["FpDivide", "FpSquareRoot", "FpDivideSquareRoot"]

CLASSES = "sign", "is_nan", "is_infinite", "is_zero"
RAISED = "invalid", "divide_by_zero"


class DigitRecurrence(Rounded, Described):
    """Base of the digit recurrences: one result bit in each step, pipelined or iterative.

    This class has the non-restoring recurrence for quotients and roots; a subclass may have another.
    X is the dividend, scaled to [B, 2B) for the divisor B in [1, 2), or the radicand, scaled to
    [1, 4). The result is Q = 1.q_1 q_2 ... Step k = 0, 1, ... computes from the remainder R

        2R - T  if R >= 0,  else  2R + T + U,    and the bit  q_k = (new R >= 0),

    beginning with R = X/2. In division T = B and U = 0; in square root T = 2Q + 2**-k and
    U = 2**(1-k), where Q has the bits so far. A negative R means that a subtraction has to be undone; U
    corrects for the change of T since then. ``divisor`` holds B, or 2Q without the latest bit. The sign of
    R gives this bit, so it is not written in the cycle that finds it. ``place`` holds 0 or 2**-k.

    Source: Ercegovac and Lang, Digital Arithmetic, 2004, chapters 5 and 6; for the square root
    Li and Chu, A new non-restoring square root algorithm, ICCD 1996.
    """

    # True if results may lie below the least normal number.
    _may_be_subnormal = True
    _operands: tuple[str, ...] = ("a", "b")
    # The registers that a step changes.
    _stepped: tuple[str, ...] = ("remainder", "divisor", "place", "quotient")

    def __init__(self, format, operands, *, bits_per_cycle, iterative, rounding, flags, looks_ahead=False):
        self._format = format
        self._rounding = Rounding(rounding)
        self._flags = bool(flags)
        self._bits_per_cycle = operator.index(bits_per_cycle)
        if not 1 <= self._bits_per_cycle <= self._least_bits:
            raise ValueError(f"bits_per_cycle must be from 1 to {self._least_bits}, not {bits_per_cycle!r}")
        self._iterative = bool(iterative)
        self._looks_ahead = format.precision > NARROW if looks_ahead is None else bool(looks_ahead)
        super().__init__({**{name: In(shape) for name, shape in operands.items()}, "start": In(1),
                          "result": Out(format.layout), "done": Out(1),
                          **{name: Out(shape) for name, shape in flags_member(flags).items()}})

    @property
    def bits_per_cycle(self):
        """Result bits per cycle."""
        return self._bits_per_cycle

    @property
    def iterative(self):
        """True if one set of registers serves all cycles of an operation, in place of a pipeline."""
        return self._iterative

    @property
    def looks_ahead(self):
        """True if every other bit of a cycle does not wait for the one before it."""
        return self._looks_ahead

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: in general one to unpack, those of the recurrence, and one to round."""
        return self._cycles + 2 if self._iterative else len(self._cuts)

    @property
    def interval(self):
        """Least number of cycles between two operations."""
        return self.latency - 1 if self._iterative else 1

    @property
    def _cycles(self):
        return -(-self._least_bits // self._bits_per_cycle)

    @property
    def _bits(self):
        return self._cycles * self._bits_per_cycle

    @property
    def _least_bits(self):
        """Result bits that the steps compute: significand and guard bit."""
        return self._format.precision + 1

    @property
    def _cuts(self):
        """The ranks of a pipeline; subnormal operands and results have additional ranks."""
        gradual = self._format.gradual
        return (*(("coarse", "normalise") if gradual else ()), "begin", *self._recurrence,
                *(("align",) if gradual and self._may_be_subnormal else ()), "result")

    @property
    def _recurrence(self):
        return [f"cycle_{cycle}" for cycle in range(self._cycles)]

    def elaborate(self, platform):
        m = Module()
        (self._iterate if self._iterative else self._pipeline)(m)
        return m

    def _pipeline(self, m):
        fmt, cuts = self._format, self._cuts
        rank = Ranks(m, cuts, cuts, self.start)

        def keep(cut, s):
            # The place of a bit is a constant here and needs no registers.
            place = s.__dict__.pop("place")
            return SimpleNamespace(place=place, **vars(rank(cut, **vars(s))))

        o = self._unpack(m)
        if fmt.gradual:
            levels = range((fmt.precision - 1).bit_length())
            o = rank("coarse", **vars(self._normalise(m, o, levels[FINE_LEVELS:])))
            o = rank("normalise", **vars(self._normalise(m, o, levels[:FINE_LEVELS])))
        s = self._begin(m, o)
        s.quotient = C(0, 0)
        s = keep("begin", s)
        for cycle, cut in enumerate(self._recurrence):
            s = self._advance(m, s, cycle * self._bits_per_cycle)[-1]
            if "align" in cuts and cycle == self._cycles - 1:
                s.below = (1 - s.exponent).as_unsigned()
            s = keep(cut, s)
        number = self._normal(m, s)
        if "align" in cuts:
            number.aligned = align_subnormal(m, number.extended, s.below)
            number = rank("align", **vars(number))
        s = rank("result", **self._outputs(m, number))
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)

    def _iterate(self, m):
        begun = self._begin(m, self._normalise(m, self._unpack(m)))
        # A leading one is shifted in front of the quotient; when it reaches the top, the recurrence ends. If an upset
        # clears it, the next one takes its place. That one may skip the topmost bit, so the bits of a whole step are
        # examined. If all bits are 0, the recurrence ends without a result.
        begun.quotient = C(1, self._bits + 1)
        s = SimpleNamespace(**{name: Signal.like(value, name=name, reset_less=True)
                               for name, value in vars(begun).items()})
        steps = self._advance(m, s)

        # The rounding cycle is the last to read the registers, so a new operation may load them in it.
        busy, finishing, accept = (Signal(name=name) for name in ("busy", "finishing", "accept"))
        m.d.comb += [finishing.eq(busy & s.quotient[-self._bits_per_cycle:].any()),
                     accept.eq(self.start & (~busy | finishing))]
        m.d.sync += [busy.eq(accept | (busy & ~finishing & s.quotient.any())), self.done.eq(finishing)]

        for name in self._stepped:
            m.d.sync += getattr(s, name).eq(getattr(steps[-1], name))
        with m.If(accept):
            m.d.sync += [getattr(s, name).eq(value) for name, value in vars(begun).items()]
        with m.If(finishing):
            m.d.sync += [getattr(self, name).eq(value) for name, value in self._outputs(m, self._normal(m, s)).items()]

    def _unpack(self, m):
        """The operands: significands, exponents, and values that the recurrence passes on unchanged."""
        fmt = self._format
        square_root = self._select
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self._divisor, "b")
        raised = {}
        if self._flags:
            negative = a.sign & ~a.is_zero & ~a.is_nan
            undefined = (a.is_infinite & b.is_infinite) | (a.is_zero & b.is_zero) | b.is_signalling
            raised = {"invalid": a.is_signalling | Mux(square_root, negative, undefined),
                      "divide_by_zero": b.is_zero & ~(square_root | a.is_zero | a.is_infinite | a.is_nan)}
        return SimpleNamespace(
            **raised, square_root=square_root, a_significand=a.nonzero, a_exponent=a.exponent,
            b_significand=b.nonzero, b_exponent=b.exponent,
            sign=a.sign ^ (b.sign & ~square_root),
            is_nan=a.is_nan | Mux(square_root, a.sign & ~a.is_zero,
                                  b.is_nan | (a.is_infinite & b.is_infinite) | (a.is_zero & b.is_zero)),
            is_infinite=a.is_infinite | (b.is_zero & ~square_root),
            is_zero=a.is_zero | (b.is_infinite & ~square_root))

    def _normalise(self, m, o, levels=None):
        """The operands with normalised significands; ``levels`` as in ``stages.normalise``."""
        values = dict(vars(o))
        for name in self._operands:
            of_significand, of_exponent = f"{name}_significand", f"{name}_exponent"
            values[of_significand], values[of_exponent] = normalised(
                m, self._format, values[of_significand], values[of_exponent], name, levels)
        return SimpleNamespace(**values)

    def _begin(self, m, o):
        """First contents of all registers but ``quotient``, from the operands."""
        fmt = self._format
        square_root = o.square_root

        # Scale X by two if it is less than B, or if the root's exponent would not be an integer; the
        # bias is odd, so this is the case for an even a_exponent. One subtraction compares the significands,
        # and its borrow corrects the difference of the exponents.
        exponent = Signal(signed(max(fmt.exponent_width, fmt.fraction_width.bit_length()) + 2))
        biased, taken_off = Signal.like(exponent), Signal.like(exponent)
        subtrahend = Cat(o.b_significand[:-1], taken_off)
        # One exponent serves both, unless the choice before the subtraction would make the longest path longer.
        root_exponent = biased if self._looks_ahead else exponent
        difference = Signal(fmt.fraction_width + len(exponent))
        m.d.comb += [
            biased.eq(o.a_exponent + fmt.bias),
            taken_off.eq(o.b_exponent),
            difference.eq(Cat(o.a_significand[:-1], biased)
                          - (subtrahend if self._looks_ahead else Mux(square_root, 0, subtrahend))),
            exponent.eq(difference[fmt.fraction_width:]),
        ]
        less = exponent[0] ^ biased[0] ^ taken_off[0]
        scale = Mux(square_root, ~o.a_exponent[0], less)

        # Weights: bit 0 of remainder, divisor and place has the weight of the last quotient bit.
        last = self._bits - 1
        half = o.a_significand << (last - fmt.precision)
        remainder, divisor, place = Signal(last + 3), Signal(last + 2), Signal(last + 1)
        m.d.comb += [
            remainder.eq(Mux(scale, half << 1, half)),
            divisor.eq(Mux(square_root, 0, o.b_significand << (last - fmt.fraction_width))),
            place.eq(Mux(square_root, 1 << last, 0)),
        ]
        return SimpleNamespace(
            **pick(o, self._raised), square_root=square_root,
            remainder=remainder, divisor=divisor, place=place,
            exponent=Mux(square_root, root_exponent >> 1, exponent), **pick(o, CLASSES))

    def _step(self, m, s, low=0):
        """The state after one more bit; ``low`` bits of T are known to be zero."""
        trial, remainder = Signal.like(s.remainder), Signal.like(s.remainder)
        divisor, place = Signal.like(s.divisor), Signal.like(s.place)
        negative, bit = s.remainder[-1], ~remainder[-1]
        latest = (s.place << 2)[:len(s.divisor)]
        high = Mux(negative, trial[low:], ~trial[low:])
        if low:
            # Where T is zero, 2R does not change. A bit below the others makes the carry of a subtraction.
            kept = Cat(C(0, 1), s.remainder[:low - 1])
            total = Cat(kept, (Cat(~negative, s.remainder[low - 1:]) + Cat(~negative, high))[1:])
        else:
            # 2R has room for that carry in its lowest bit.
            total = Cat(~negative, s.remainder) + high
        m.d.comb += [
            trial.eq(s.divisor | s.place | Mux(negative, s.place << 1, latest)),
            remainder.eq(total),
            divisor.eq(s.divisor | Mux(negative, 0, latest)),
            place.eq(s.place >> 1),
        ]
        return SimpleNamespace(**{**vars(s), "remainder": remainder, "divisor": divisor, "place": place,
                                  "quotient": Cat(bit, s.quotient)})

    def _advance(self, m, s, first=None):
        """The states after each step of one cycle; ``first`` is the number of its first step, if known."""
        states = [s]
        for index in range(self._bits_per_cycle):
            if index % 2 and self._looks_ahead:
                states.append(self._step_ahead(m, *states[-2:]))
            else:
                low = 0 if first is None else self._low_zeros(first + index)
                states.append(self._step(m, states[-1], low))
        return states[1:]

    def _step_ahead(self, m, s, t):
        """The state after two more bits; ``t`` is the state after one of them.

        With A = 2R and H, whose sum is the remainder of ``t``, the next one is 2A + 2H - T or 2A + 2H + T + U. A row of
        full adders makes two numbers of these three, so one carry chain is enough. The remainder of ``t`` selects.
        """
        subtracted, added = self._addends(s)
        doubled = (Cat(C(0, 1), ~s.remainder[-1], s.remainder), Cat(C(0, 1), Mux(s.remainder[-1], added, subtracted)))
        totals = []
        for name, one, addend in zip(("ahead_subtracted", "ahead_added"), (1, 0), self._addends(t), strict=True):
            x, y, z = (value[:len(t.remainder)] for value in (*doubled, addend))
            total = Signal.like(t.remainder, name=name)
            m.d.comb += total.eq((x ^ y ^ z) + Cat(C(one, 1), x & y | z & (x | y)))
            totals.append(total)
        negative = t.remainder[-1]
        remainder, divisor, place = Signal.like(t.remainder), Signal.like(t.divisor), Signal.like(t.place)
        m.d.comb += [remainder.eq(Mux(negative, totals[1], totals[0])),
                     divisor.eq(t.divisor | Mux(negative, 0, t.place << 2)), place.eq(t.place >> 1)]
        return SimpleNamespace(**{**vars(t), "remainder": remainder, "divisor": divisor, "place": place,
                                  "quotient": Cat(~remainder[-1], t.quotient)})

    @staticmethod
    def _addends(s):
        """-T - 1 and T + U, of the width of R."""
        known = s.divisor | s.place
        return Cat(~(known | (s.place << 2)[:len(known)]), C(1, 1)), Cat(known | s.place << 1, C(0, 1))

    def _low_zeros(self, step):
        """Number of low bits of T that are zero in a step for all operands; 0 if omitting them saves no logic."""
        return 0

    @property
    def _raised(self):
        """Exceptions that depend on the operands alone."""
        return RAISED if self._flags else ()

    @property
    def _needs_exactness(self):
        """True if an exact result must be distinguished from a near value."""
        return self._flags or not self._rounding.is_nearest

    def _normal(self, m, s):
        """The result in the form of ``round_and_pack``, from the last state."""
        fmt = self._format
        quotient = s.quotient[:self._bits]
        # A root never lies halfway between two numbers, and a quotient never halfway between two normal
        # numbers: the root's square, or the quotient times the divisor, would have too many bits.
        sticky = C(1)
        if fmt.gradual or self._needs_exactness:
            # Undo the subtraction that made R negative: that of B, or of 2Q and its last place.
            undone = s.divisor | s.square_root if self._needs_exactness else s.divisor
            restored = Signal.like(s.remainder)
            m.d.comb += restored.eq(s.remainder + Mux(s.remainder[-1], undone, 0))
            sticky = restored.any() | quotient[:-fmt.precision - 1].any()
            if not self._needs_exactness:
                sticky |= s.square_root
        return self._result_of(s, exponent=s.exponent, extended=Cat(sticky, quotient[-fmt.precision - 1:]))

    def _result_of(self, s, *, exponent, extended):
        """A normalised result, with the values that the recurrence passed on."""
        if not self._may_be_subnormal:
            exponent = exponent[:self._format.exponent_width]
        return SimpleNamespace(**pick(s, CLASSES, self._raised), exponent=exponent, extended=extended)

    def _outputs(self, m, number):
        """``result``, and ``flags`` if the operator has them, from a normalised result."""
        result, raised = round_and_pack(m, self._format, number, self._rounding)
        flags = {"flags": Cat(raised, number.divide_by_zero, number.invalid)} if self._flags else {}
        return {"result": result, **flags}


class FpDivide(DigitRecurrence):
    """Quotient of two floating-point numbers, ``result = a / b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    bits_per_cycle : int
        Result bits per cycle, 1 to the format's precision plus one.
    iterative : bool
        False: a pipeline, one operation per cycle. True: one operation at a time, small.
    looks_ahead : bool or None
        True: every other bit of a cycle does not wait for the one before it, for a higher clock frequency. It takes two
        more adders for each pair of bits; with one bit per cycle only the path of the exponent is shorter. None means
        True for formats longer than binary32.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, start : In(format), In(format), In(1)
        Operands, any unit, taken while ``start`` is high; iterative: if no operation is in flight.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high; iterative: until the next ``done``.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` = ceil((precision + 1) / bits_per_cycle) + 2 cycles, ``start`` to ``done``, 3 more
    for a pipeline with gradual subnormals; one operation in ``interval`` cycles: pipelined 1, iterative
    ``latency`` - 1. A ``start`` that comes earlier is ignored. No back-pressure.
    Accuracy: correctly rounded.
    Special values: x / 0 is infinity; 0 / 0, infinity / infinity and NaN operands give the
    format's NaN.
    Flags: divide_by_zero if a number other than zero is divided by zero; invalid for 0 / 0,
    infinity / infinity and signalling NaNs; overflow, underflow and inexact as in ``Flags``.
    Raises: ValueError if ``bits_per_cycle`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *division*.
    """

    _select = C(0)

    def __init__(self, format, *, bits_per_cycle=2, iterative=False, looks_ahead=None,
                 rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__(format, {"a": format.layout, "b": format.layout}, bits_per_cycle=bits_per_cycle,
                         iterative=iterative, looks_ahead=looks_ahead, rounding=rounding, flags=flags)

    @property
    def _divisor(self):
        return self.b

    def compute(self, a, b):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return exact.by_numpy(self._format, self._rounding, np.divide, exact.divide, a, b)

    def compute_flags(self, a, b):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.divide(self._format, a, b, self._rounding)[1]


class FpSquareRoot(DigitRecurrence):
    """Square root of a floating-point number.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and result.
    bits_per_cycle : int
        Result bits per cycle, 1 to the format's precision plus one.
    iterative : bool
        False: a pipeline, one operation per cycle. True: one operation at a time, small.
    looks_ahead : bool or None
        True: every other bit of a cycle does not wait for the one before it, for a higher clock frequency. It takes two
        more adders for each pair of bits; with one bit per cycle only the path of the exponent is shorter. None means
        True for formats longer than binary32.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, start : In(format), In(1)
        Operand, any unit, taken while ``start`` is high; iterative: if no operation is in flight.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high; iterative: until the next ``done``.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` = ceil((precision + 1) / bits_per_cycle) + 2 cycles, ``start`` to ``done``, 2 more
    for a pipeline with gradual subnormals; one operation in ``interval`` cycles: pipelined 1, iterative
    ``latency`` - 1. A ``start`` that comes earlier is ignored. No back-pressure.
    Accuracy: correctly rounded.
    Special values: the root of -0 is -0; other negative operands and NaN give the format's NaN.
    Flags: invalid for these negative operands and signalling NaNs; inexact and underflow as in
    ``Flags``.
    Raises: ValueError if ``bits_per_cycle`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *squareRoot*.
    """

    _select = C(1)
    _may_be_subnormal = False

    def _low_zeros(self, step):
        # T ends with the place of the bit.
        return self._bits - 1 - step

    def __init__(self, format, *, bits_per_cycle=2, iterative=False, looks_ahead=None,
                 rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__(format, {"a": format.layout}, bits_per_cycle=bits_per_cycle, iterative=iterative,
                         looks_ahead=looks_ahead, rounding=rounding, flags=flags)

    @property
    def _divisor(self):
        return self._format.layout(C(0, self._format.width))

    def compute(self, a):
        """Bit-exact software twin: an array of the format's dtype, any shape."""
        return exact.by_numpy(self._format, self._rounding, np.sqrt, exact.square_root, a)

    def compute_flags(self, a):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.square_root(self._format, a, self._rounding)[1]


class FpDivideSquareRoot(DigitRecurrence):
    """Quotient ``a / b`` or square root of ``a``, from one small iterative circuit.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    bits_per_cycle : int
        Result bits per cycle, 1 to the format's precision plus one.
    looks_ahead : bool or None
        True: every other bit of a cycle does not wait for the one before it, for a higher clock frequency. It takes two
        more adders for each pair of bits; with one bit per cycle only the path of the exponent is shorter. None means
        True for formats longer than binary32.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, b, square_root, start : In(format), In(format), In(1), In(1)
        Operands, any unit; 1 takes the square root of ``a`` and ignores ``b``, 0 divides. Taken
        while ``start`` is high and no operation is in flight.
    result, done : Out(format), Out(1)
        Result, valid from ``done`` to the next ``done``.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` = ceil((precision + 1) / bits_per_cycle) + 2 cycles, ``start`` to ``done``; one
    operation in ``interval`` = ``latency`` - 1 cycles; a ``start`` that comes earlier is ignored.
    Accuracy: correctly rounded.
    Special values and flags: as in ``FpDivide`` and ``FpSquareRoot``.
    Raises: ValueError if ``bits_per_cycle`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operations *division* and *squareRoot*.
    """

    def __init__(self, format, *, bits_per_cycle=2, looks_ahead=None, rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__(format, {"a": format.layout, "b": format.layout, "square_root": 1},
                         bits_per_cycle=bits_per_cycle, iterative=True, looks_ahead=looks_ahead, rounding=rounding,
                         flags=flags)

    @property
    def _select(self):
        return self.square_root

    @property
    def _divisor(self):
        return self.b

    def compute(self, a, b, square_root):
        """Bit-exact software twin: arrays of the format's dtype and of bool, shapes that broadcast."""
        fmt, rounding = self._format, self._rounding
        return np.where(square_root, exact.by_numpy(fmt, rounding, np.sqrt, exact.square_root, a),
                        exact.by_numpy(fmt, rounding, np.divide, exact.divide, a, b))

    def compute_flags(self, a, b, square_root):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        fmt, rounding = self._format, self._rounding
        return np.where(square_root, exact.square_root(fmt, a, rounding)[1], exact.divide(fmt, a, b, rounding)[1])
