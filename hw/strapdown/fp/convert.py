"""Conversion between floating-point and fixed-point numbers."""

import operator
from types import SimpleNamespace

from amaranth import *

from . import exact
from .pipeline import Pipeline, PipelinedOperator, pick
from .rounding import Rounding, flags_member
from .stages import FINE_LEVELS, normalise, round_and_pack, shift_right_sticky, unpack

__all__ = ["FpToFixed", "FixedToFp"]


class _Converter(PipelinedOperator):
    """Base of the two converters, between a floating-point format and a fixed-point format."""

    def __init__(self, operands, results, *, format, width, fraction_bits, rounding, flags, latency):
        self._format = format
        self._width = operator.index(width)
        if self._width < 2:
            raise ValueError(f"width must be at least 2, not {width!r}")
        self._fraction_bits = operator.index(fraction_bits)
        if not 0 <= self._fraction_bits < self._width:
            raise ValueError(f"fraction_bits must be from 0 to {self._width - 1}, not {fraction_bits!r}")
        self._rounding = Rounding(rounding)
        self._flags = bool(flags)
        super().__init__(operands, {**results, **flags_member(flags)}, latency=latency)

    @property
    def format(self):
        """Floating-point format."""
        return self._format

    @property
    def width(self):
        """Bits of the fixed-point number, its sign included."""
        return self._width

    @property
    def fraction_bits(self):
        """Fraction bits of the fixed-point number."""
        return self._fraction_bits

    @property
    def rounding(self):
        """Direction of rounding."""
        return self._rounding


class FpToFixed(_Converter):
    """Fixed-point form of a floating-point number, ``result = a * 2**fraction_bits``.

    Parameters
    ----------
    format : FloatFormat
        Format of the operand.
    width, fraction_bits : int
        Bits of the result in two's complement, at least 2, and its fraction bits, less than
        ``width``.
    latency : int
        Register ranks, 1 to 4.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    a, start : In(format), In(1)
        Operand, any unit, taken while ``start`` is high.
    result, done : Out(signed(width)), Out(1)
        Result in units of 2**-fraction_bits, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded.
    Special values: a number out of range, infinities included, becomes the nearest end of the range;
    NaN becomes the largest number, as in the RISC-V instruction FCVT.W.S. If the NaN of the format is
    negative, it becomes the least number, as in the x86 instruction CVTSS2SI.
    Flags: invalid for NaN, and for a number that is out of range after rounding; else inexact.
    Raises: ValueError if ``width``, ``fraction_bits``, ``rounding`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1 and 5.8, operation *convertToIntegerExactTiesToEven* and similar ones.
    """

    PIPELINE = Pipeline(cuts=("distance", "coarse", "align", "result"),
                        priority=("result", "align", "distance", "coarse"), default_latency=4)

    def __init__(self, format, *, width, fraction_bits, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__({"a": format.layout}, {"result": signed(width)}, format=format, width=width,
                         fraction_bits=fraction_bits, latency=latency, rounding=rounding, flags=flags)

    def compute(self, a):
        """Bit-exact software twin: an array of the format's dtype, any shape.

        Returns int64, or Python integers in an array of objects if ``width`` is above 64.
        """
        return exact.to_fixed(self._format, a, self._width, self._fraction_bits, self._rounding)[0]

    def compute_flags(self, a):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.to_fixed(self._format, a, self._width, self._fraction_bits, self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        # The top bit of the significand starts at the place of the result's sign, then moves right. A number
        # whose top bit stays there is out of range, except the least number, which is an end of the range.
        a = unpack(m, fmt, self.a, "a")
        length = max(self._width + 2, fmt.precision)
        levels = length.bit_length()
        distance = Signal(signed(max(fmt.exponent_width, levels) + 2))
        m.d.comb += distance.eq(self._width - 1 - self._fraction_bits + fmt.bias - a.exponent)
        special = a.is_infinite | a.is_nan
        sign = a.sign | a.is_nan if fmt.negative_nan else a.sign & ~a.is_nan
        s = rank("distance", sign=sign, significand=a.significand,
                 distance=distance[:levels] | distance[levels:].any().replicate(levels),
                 saturates=((distance <= 0) & a.significand[-1]) | special,
                 **({"is_beyond": (distance < 0) | special} if self._flags else {}))

        start, fine = Cat(C(0, length - fmt.precision), s.significand), s.distance[:FINE_LEVELS]
        coarse = shift_right_sticky(m, start, Cat(C(0, len(fine)), s.distance[len(fine):]), "coarse")
        s = rank("coarse", **pick(s, ("sign", "saturates"), self._flagged), distance=fine, shifted=coarse)
        aligned = shift_right_sticky(m, s.shifted, s.distance, "align")
        s = rank("align", **pick(s, ("sign", "saturates"), self._flagged), aligned=aligned)

        # Round and negate in one addition: -(x + up) = ~x + 1 - up. The ends of the range do not need it.
        magnitude, guard = s.aligned[-self._width:-1], s.aligned[-self._width - 1]
        sticky = s.aligned[:-self._width - 1].any()
        up = self._rounding.increments(s.sign, magnitude[0], guard, sticky)
        stays = s.saturates | (magnitude.all() & ~s.sign)
        rounded = Signal(self._width)
        m.d.comb += rounded.eq((Cat(magnitude | s.saturates.replicate(self._width - 1), C(0, 1))
                                ^ s.sign.replicate(self._width)) + ((up ^ s.sign) & ~stays))
        outputs = {"result": rounded}
        if self._flags:
            is_least = s.sign & ~magnitude.any() & ~up
            invalid = s.is_beyond | (s.aligned[-1] & ~is_least) | (magnitude.all() & up & ~s.sign)
            outputs["flags"] = Cat((guard | sticky) & ~invalid, C(0, 3), invalid)
        s = rank("result", **outputs)
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m

    @property
    def _flagged(self):
        """Values that only the flags need."""
        return ("is_beyond",) if self._flags else ()


class FixedToFp(_Converter):
    """Floating-point form of a fixed-point number, ``result = operand / 2**fraction_bits``.

    Parameters
    ----------
    format : FloatFormat
        Format of the result.
    width, fraction_bits : int
        Bits of the operand in two's complement, at least 2, and its fraction bits, less than
        ``width``.
    latency : int
        Register ranks, 1 to 4.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.

    Members
    -------
    operand, start : In(signed(width)), In(1)
        Operand in units of 2**-fraction_bits, taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, any unit, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded.
    Special values: 0 becomes +0.
    Flags: inexact, and for formats with a small range overflow and underflow, as in ``Flags``.
    Raises: ValueError if ``width``, ``fraction_bits``, ``rounding`` or ``latency`` is out of range.
    Source: IEEE 754-2019, 5.4.1, operation *convertFromInt*.
    """

    PIPELINE = Pipeline(cuts=("magnitude", "coarse", "normalise", "result"),
                        priority=("result", "normalise", "magnitude", "coarse"), default_latency=4)

    def __init__(self, format, *, width, fraction_bits, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False):
        super().__init__({"operand": signed(width)}, {"result": format.layout}, format=format, width=width,
                         fraction_bits=fraction_bits, latency=latency, rounding=rounding, flags=flags)

    def compute(self, operand):
        """Bit-exact software twin: an array of integers in, the format's dtype out, same shape."""
        return exact.from_fixed(self._format, operand, self._fraction_bits, self._rounding)[0]

    def compute_flags(self, operand):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.from_fixed(self._format, operand, self._fraction_bits, self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)

        magnitude = Signal(self._width)
        m.d.comb += magnitude.eq(Mux(self.operand < 0, -self.operand, self.operand))
        s = rank("magnitude", sign=self.operand < 0, magnitude=magnitude)

        # Normalise. The top bit weighs 2**(width - 1 - fraction_bits).
        levels = range((self._width - 1).bit_length())
        shifted, coarse = normalise(m, s.magnitude, "coarse", levels=levels[FINE_LEVELS:])
        s = rank("coarse", sign=s.sign, shifted=shifted, coarse=coarse)
        normalised, fine = normalise(m, s.shifted, "normalise", levels=levels[:FINE_LEVELS])
        zeros = Cat(fine, s.coarse)
        greatest = fmt.bias + self._width - 1 - self._fraction_bits
        least = greatest - self._width + 1
        exponent = Signal(range(least, greatest + 1) if least > 0 else range(least - 1, greatest + 1))
        m.d.comb += exponent.eq(greatest - zeros)
        padded = Cat(C(0, fmt.precision), normalised)
        s = rank(
            "normalise", sign=s.sign, is_zero=~normalised[-1], exponent=exponent,
            extended=Cat(padded[:-fmt.precision - 1].any(), padded[-fmt.precision - 1:]))

        number = SimpleNamespace(is_nan=C(0), is_infinite=C(0), **vars(s))
        result, raised = round_and_pack(m, fmt, number, self._rounding)
        s = rank("result", result=result, **({"flags": raised} if self._flags else {}))
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m
