"""Rounding directions, exception flags, and the rounding function of the software twins."""

import enum

import numpy as np
from amaranth.lib import data

__all__ = ["Rounded", "Rounding", "Flags", "FLAGS"]


class Rounding(enum.Enum):
    """The rounding-direction attributes of IEEE 754-2019, 4.3."""

    NEAREST_EVEN = "nearest_even"
    """To nearest, ties to even: roundTiesToEven."""
    NEAREST_AWAY = "nearest_away"
    """To nearest, ties away from zero: roundTiesToAway."""
    TOWARD_ZERO = "toward_zero"
    """roundTowardZero."""
    UPWARD = "upward"
    """Toward +infinity: roundTowardPositive."""
    DOWNWARD = "downward"
    """Toward -infinity: roundTowardNegative."""

    @property
    def is_nearest(self):
        """True if the nearest number is taken, so that only ties need a rule."""
        return self in (Rounding.NEAREST_EVEN, Rounding.NEAREST_AWAY)

    def increments(self, sign, odd, guard, sticky):
        """True if a magnitude is increased by one unit: one-bit Values or arrays of bool.

        ``odd`` is the unit's bit, ``guard`` the bit below it; ``sticky`` is set if any lower bit is set.
        """
        match self:
            case Rounding.NEAREST_EVEN:
                return guard & (sticky | odd)
            case Rounding.NEAREST_AWAY:
                return guard
            case Rounding.TOWARD_ZERO:
                return guard & False
            case Rounding.UPWARD:
                return (guard | sticky) & ~sign
            case Rounding.DOWNWARD:
                return (guard | sticky) & sign


class Rounded:
    """An operator with rounded results in the format of its operands; it sets ``_format`` and ``_rounding``."""

    @property
    def format(self):
        """Format of operands and result."""
        return self._format

    @property
    def rounding(self):
        """Direction of rounding."""
        return self._rounding


class Flags(enum.IntFlag):
    """The exceptions of IEEE 754-2019, 7, as in ``compute_flags`` and in ``FLAGS``.

    Tininess is detected after rounding, as on x86 and RISC-V, and underflow is raised if the
    result is inexact as well. Where subnormals are flushed, a flushed result raises underflow and
    inexact, and a flushed operand raises nothing: it counts as an exact zero.
    """

    INEXACT = 1
    UNDERFLOW = 2
    OVERFLOW = 4
    DIVIDE_BY_ZERO = 8
    INVALID = 16


FLAGS = data.StructLayout({flag.name.lower(): 1 for flag in Flags})  # type: ignore[union-attr]
"""Layout of an operator's output ``flags``: inexact (lowest bit), underflow, overflow,
divide_by_zero, invalid (highest bit). They belong to one result and are not accumulated."""


def flags_member(wanted):
    """The output member ``flags`` as a dict; empty if ``flags`` is false."""
    return {"flags": FLAGS} if wanted else {}


def bit_length(values):
    """``int.bit_length`` of an array of int64, 0 to 2**62, or of Python integers."""
    if values.dtype == object:
        return np.frompyfunc(int.bit_length, 1, 1)(values).astype(np.int64)
    length = np.frexp(values.astype(np.float64))[1].astype(np.int64)
    # The conversion may have rounded up to the next power of two.
    return length - ((length > 0) & (values >> np.maximum(length - 1, 0) == 0))


def round_integer(sign, significand, shift, rounding, sticky=False):
    """``significand / 2**shift`` rounded to an integer.

    ``significand`` is at least 0 and less than 2**62. ``sticky`` means that lower bits were cut off; it
    needs a ``shift`` of at least 1. Returns (magnitude, true if it is inexact).
    """
    left, right = np.maximum(-shift, 0), np.clip(shift, 0, 63)
    below = np.maximum(right - 1, 0)
    guard = (right > 0) & (significand >> below & 1 == 1)
    sticky = sticky | (significand & (np.ones_like(significand) << below) - 1 != 0)
    kept = significand >> right << left
    return kept + rounding.increments(sign, kept & 1 == 1, guard, sticky), guard | sticky


def round_encoding(fmt, sign, exponent, significand, rounding, sticky=False):
    """Encoding of a number in a format, and the flags that this rounding raises.

    Parameters
    ----------
    fmt : FloatFormat
        Format of the result, no wider than binary64; its policy holds for tiny numbers.
    sign, exponent, significand, sticky : ndarray of bool, int64, int64 or object, bool
        The number is ``significand * 2**exponent``; with ``sticky``, slightly more. A significand
        that was cut off needs at least fmt.precision + 2 bits.
    rounding : Rounding
        Direction.

    Returns
    -------
    (ndarray of uint64, ndarray of uint8)
        Encodings and ``Flags``.
    """
    length = bit_length(significand)
    if significand.dtype == object:
        excess = np.maximum(length - 62, 0)
        sticky = sticky | (significand & (np.ones_like(significand) << excess) - 1 != 0)
        significand, exponent, length = (significand >> excess).astype(np.int64), exponent + excess, length - excess

    # The stored exponent without bounds; a subnormal keeps the weight of exponent 1.
    stored = np.where(length > 0, exponent + length - 1 + fmt.bias, 0)
    last = length - fmt.precision
    shift = last + np.maximum(1 - stored, 0)
    magnitude, inexact = round_integer(sign, significand, shift, rounding, sticky)
    # The magnitude is added to the first encoding of the binade, so a carry leads into the next binade.
    encoded = (np.clip(stored, 1, fmt.exponent_special) - 1 << fmt.fraction_width) + magnitude

    overflow = encoded >= fmt.infinity
    certain = np.ones_like(overflow)
    encoded = np.where(overflow, fmt.infinity - 1 + rounding.increments(sign, certain, certain, certain), encoded)
    inexact = inexact | overflow
    if fmt.gradual:
        unbounded, _ = round_integer(sign, significand, last, rounding, sticky)
        underflow = inexact & ((stored < 0) | ((stored == 0) & (unbounded >> fmt.precision == 0)))
    else:
        underflow = (stored < 1) & (significand > 0)
        encoded, inexact = np.where(underflow, 0, encoded), inexact | underflow

    flags = inexact * Flags.INEXACT | underflow * Flags.UNDERFLOW | overflow * Flags.OVERFLOW
    signed = encoded.astype(np.uint64) | np.asarray(sign).astype(np.uint64) << np.uint64(fmt.width - 1)
    return signed, flags.astype(np.uint8)
