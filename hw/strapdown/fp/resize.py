"""Conversion between two floating-point formats."""

from amaranth import *

from . import exact
from .pipeline import Pipeline, PipelinedOperator, pick
from .rounding import Rounding, flags_member
from .stages import FINE_LEVELS, align_subnormal, normalise, round_and_pack, unpack

__all__ = ["FpToFp"]


class FpToFp(PipelinedOperator):
    """The same number in another floating-point format.

    Parameters
    ----------
    from_format, to_format : FloatFormat
        Format of the operand and of the result, any two.
    latency : int
        Register ranks, 1 to 4.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, start : In(from_format), In(1)
        Operand, any unit, taken while ``start`` is high.
    result, done : Out(to_format), Out(1)
        Result, in the unit of ``a``, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded; exact if ``to_format`` contains all numbers of ``from_format``. The
    subnormal policy of each format applies: to the operand that of ``from_format``, to the result
    that of ``to_format``.
    Special values: a number out of range is rounded as in IEEE 754, to nearest it becomes infinity;
    NaN becomes the format's NaN.
    Flags: invalid for signalling NaNs; overflow, underflow and inexact as in ``Flags``.
    Raises: ValueError if ``rounding`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.2, operation *convertFormat*.
    """

    PIPELINE = Pipeline(cuts=("coarse", "normalise", "align", "result"),
                        priority=("result", "normalise", "align", "coarse"), default_latency=4)

    def __init__(self, from_format, to_format, *, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False):
        self._from_format = from_format
        self._to_format = to_format
        self._rounding = Rounding(rounding)
        self._flags = bool(flags)
        super().__init__({"a": from_format.layout}, {"result": to_format.layout, **flags_member(flags)},
                         latency=latency)

    @property
    def from_format(self):
        """Format of the operand."""
        return self._from_format

    @property
    def to_format(self):
        """Format of the result."""
        return self._to_format

    @property
    def rounding(self):
        """Direction of rounding."""
        return self._rounding

    def compute(self, a):
        """Bit-exact software twin: takes an array of one dtype, returns one of the other, same shape."""
        return exact.resize(self._from_format, self._to_format, a, self._rounding)[0]

    def compute_flags(self, a):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.resize(self._from_format, self._to_format, a, self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        source, fmt = self._from_format, self._to_format
        rank = self.ranks(m)

        a = unpack(m, source, self.a, "a")
        classes = {"sign": a.sign, "is_nan": a.is_nan, "is_infinite": a.is_infinite, "is_zero": a.is_zero}
        if self._flags:
            classes["invalid"] = a.is_signalling
        # If subnormals lie far below the other format's least number, they need not be normalised: they are lost.
        offset = fmt.bias - source.bias
        normalises = source.gradual and -offset < fmt.precision + 2
        significand, zeros = a.significand, C(0)
        levels = range((source.precision - 1).bit_length())
        if normalises:
            significand, zeros = normalise(m, significand, "coarse", levels=levels[FINE_LEVELS:])
        s = rank("coarse", **classes, zeros=zeros, exponent=a.exponent, significand=significand)

        # From the range of the exponent the rounding stage can tell if results can be subnormal.
        least, greatest = 1 + offset, source.exponent_special + offset
        significand, zeros = s.significand, s.zeros
        if normalises:
            significand, fine = normalise(m, significand, "normalise", levels=levels[:FINE_LEVELS])
            zeros = Cat(fine, zeros)
            least -= source.fraction_width
        exponent = Signal(range(least, greatest + 1) if least > 0 else range(min(least, -1), greatest + 1))
        m.d.comb += exponent.eq(s.exponent + offset - zeros)
        padded = Cat(C(0, fmt.precision), significand)
        below = {"below": (1 - offset - s.exponent + zeros).as_unsigned()} if least <= 0 and fmt.gradual else {}
        s = rank("normalise", **pick(s, classes), **below, exponent=exponent,
                 extended=Cat(padded[:-fmt.precision - 1].any(), padded[-fmt.precision - 1:]))

        aligned = {"aligned": align_subnormal(m, s.extended, s.below)} if below else {}
        s = rank("align", **pick(s, classes, ("exponent", "extended")), **aligned)
        result, raised = round_and_pack(m, fmt, s, self._rounding)
        s = rank("result", result=result, **({"flags": Cat(raised, C(0), s.invalid)} if self._flags else {}))
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m
