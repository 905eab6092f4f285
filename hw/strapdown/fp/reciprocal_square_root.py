"""Reciprocal square root, iterative."""

from types import SimpleNamespace

from amaranth import *

from . import exact
from .divide_square_root import CLASSES, DigitRecurrence
from .pipeline import pick
from .rounding import Rounding
from .stages import unpack

__all__ = ["FpReciprocalSquareRoot"]


class FpReciprocalSquareRoot(DigitRecurrence):
    """Reciprocal of the square root of a floating-point number, in a small iterative circuit.

    Parameters
    ----------
    format : FloatFormat
        Format of operand and result, with an ``exponent_width`` of at least 3, so that no result is
        subnormal.
    bits_per_cycle : int
        Result bits per cycle, 1 to the format's precision.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, start : In(format), In(1)
        Operand, any unit, taken while ``start`` is high and no operation is in flight.
    result, done : Out(format), Out(1)
        Result, valid from ``done`` to the next ``done``.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` = ceil(precision / bits_per_cycle) + 2 cycles, ``start`` to ``done``; one
    operation in ``interval`` = ``latency`` - 1 cycles; a ``start`` that comes earlier is ignored.
    Accuracy: correctly rounded.
    Special values: a zero gives infinity of the same sign, +infinity gives +0; other negative operands
    and NaN give the format's NaN.
    Flags: divide_by_zero for a zero; invalid for these negative operands and signalling NaNs;
    overflow and inexact as in ``Flags``.
    Raises: ValueError if ``format``, ``bits_per_cycle`` or ``rounding`` is out of range.
    Source: IEEE 754-2019, 9.2, operation *rSqrt*; N. Takagi, A hardware algorithm for computing
    reciprocal square root, ARITH-15, 2001; Ercegovac and Lang, Digital Arithmetic, 2004, chapter 6.
    """

    _operands = ("a",)
    _stepped = ("remainder", "trial", "quotient")

    def __init__(self, format, *, bits_per_cycle=2, rounding=Rounding.NEAREST_EVEN, flags=False):
        if format.exponent_width < 3:
            raise ValueError(f"exponent_width of format must be at least 3, not {format.exponent_width!r}")
        super().__init__(format, {"a": format.layout}, bits_per_cycle=bits_per_cycle, iterative=True,
                         rounding=rounding, flags=flags)

    def compute(self, a):
        """Bit-exact software twin: an array of the format's dtype, any shape."""
        return exact.reciprocal_square_root(self._format, a, self._rounding)[0]

    def compute_flags(self, a):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.reciprocal_square_root(self._format, a, self._rounding)[1]

    @property
    def _least_bits(self):
        # b_1 is known from the start.
        return self._format.precision

    # With X, the operand scaled to [1, 4), the result is 0.1 b_2 b_3 ... from 1/2 to 1. Let Q be the
    # k - 1 bits found so far, as an integer, and T = 2Q + 1. The next bit is b_k = 1 if
    # W = 4**k - X T**2 > 0. This bit and the next trial, T' = 2T + d, follow without a multiplication
    # from W and F = 4 X T + d X, where d = 1 if W > 0, else -1:
    #
    #     W' = 4W - d F,    F' = 2F + d 3X  if d' = d,  else  2F + d X.
    #
    # It starts with k = 1, T = 1, W = 4 - X > 0, so b_1 = 1 and F = 5X. ``remainder`` holds W minus
    # one unit of X's last place, so its sign bit is set if W <= 0. ``trial`` holds F. b_1 is the leading
    # one in ``quotient`` that counts the cycles.
    #
    # Widths: T differs by at most 1 from y = 2**k / sqrt(X), hence |W| <= X (2 y + 1)
    # < 2**(k+2) + 4 and 0 < F < 4 X (y + 1) + X < 2**(k+3) + 20. The last bit has k = p + 1 and needs W,
    # and F of k = p. Further bits of the last cycle are not used.

    def _unpack(self, m):
        a = unpack(m, self._format, self.a, "a")
        more = {}
        if self._flags:
            more = {"invalid": a.is_signalling | (a.sign & ~a.is_zero & ~a.is_nan), "divide_by_zero": a.is_zero}
        return SimpleNamespace(
            **more, a_significand=a.nonzero, a_exponent=a.exponent, sign=a.sign,
            is_nan=a.is_nan | (a.sign & ~a.is_zero), is_infinite=a.is_zero, is_zero=a.is_infinite)

    def _begin(self, m, o):
        fmt = self._format
        # The bias is odd, so half the exponent is an integer if the stored exponent is odd.
        x = Signal(fmt.precision + 1)
        m.d.comb += x.eq(Mux(o.a_exponent[0], o.a_significand, o.a_significand << 1))
        half = (fmt.bias - 1) // 2
        exponent = Signal(range(3 * half + fmt.precision // 2 + 2))
        m.d.comb += exponent.eq(3 * half - ((o.a_exponent - 1) >> 1))

        remainder, trial = Signal(2 * fmt.precision + 4), Signal(2 * fmt.precision + 3)
        m.d.comb += [remainder.eq(~x), trial.eq(x + (x << 2))]
        more = pick(o, self._raised)
        if self._needs_exactness:
            more["is_exact"] = o.a_exponent[0] & ~o.a_significand[:-1].any()
        return SimpleNamespace(
            **more, remainder=remainder, trial=trial, x=x, exponent=exponent, **pick(o, CLASSES))

    def _step(self, m, s, low=0):
        remainder, trial = Signal.like(s.remainder), Signal.like(s.trial)
        negative, bit = s.remainder[-1], ~remainder[-1]
        change = Mux(bit ^ negative, s.x + (s.x << 1), s.x)
        length = len(remainder)
        minuend, subtrahend = Signal(length + 1), Signal(length + 1)
        m.d.comb += [
            # The lowest bit carries into a subtraction.
            minuend.eq(Cat(~negative, C(0b11, 2), s.remainder)),
            subtrahend.eq(Cat(~negative, Mux(negative, s.trial, ~Cat(s.trial, C(0, 1))))),
            remainder.eq((minuend + subtrahend)[1:]),
            # The lowest bit of 2F is free and carries, too.
            trial.eq(Cat(negative, s.trial) + Mux(negative, ~Cat(change, C(0, length)), change)),
        ]
        return SimpleNamespace(**{**vars(s), "remainder": remainder, "trial": trial,
                                  "quotient": Cat(bit, s.quotient)})

    def _normal(self, m, s):
        # The quotient is always too small, by less than its last place. The result is never halfway between
        # two numbers: it is a dyadic fraction only for powers of four, where all bits are ones.
        exponent, extended = s.exponent, Cat(C(1, 1), s.quotient[-self._format.precision - 1:])
        if self._needs_exactness:
            exponent = exponent + s.is_exact
            extended = Mux(s.is_exact, 1 << len(extended) - 1, extended)
        return self._result_of(s, exponent=exponent, extended=extended)
