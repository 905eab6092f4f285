"""Stages shared by the operators: unpacking, shifting with a sticky bit, normalising, rounding, packing."""

from operator import itemgetter
from types import SimpleNamespace

from amaranth import *

from .rounding import Rounding

__all__ = ["unpack", "shift_right_sticky", "shift_right", "normalise", "normalised", "leading_zeros",
           "round_significand", "pack", "align_subnormal", "round_and_pack", "partial_products",
           "placed_products", "sum_of_partial_products"]

SLICE = 17
"""Bits of a multiplier for one DSP block: a DSP48E1 multiplies 25 x 18 signed bits."""

WIDE_SLICE = 18
"""Bits of both factors for one DSP block, if the factors are wide: an ECP5 multiplies 18 x 18 unsigned bits."""

NARROW = 24
"""Bits of the longest significand that is not wide. Operators on wide ones take more logic, for shorter paths."""

FINE_LEVELS = 3
"""Levels of a shifter (by 1, 2 and 4) after the cut inside it."""


def unpack(m, fmt, operand, name):
    """Class flags, effective exponent and significand of an encoded number.

    ``exponent`` is the biased exponent, 1 for gradual subnormals, so that ``significand``
    (fmt.precision bits, hidden bit on top) always weighs 2**(exponent - bias - fraction_width).
    With flushed subnormals a subnormal is a zero: its exponent has no meaning.
    ``nonzero`` equals the significand if the number is not zero, and needs less logic.
    ``is_signalling`` is high for a NaN whose top fraction bit is zero.
    """
    tiny = operand.exponent == 0
    special = operand.exponent == fmt.exponent_special
    empty = operand.fraction == 0
    number = SimpleNamespace(
        sign=operand.sign,
        exponent=Signal(fmt.exponent_width, name=f"{name}_exponent"),
        significand=Signal(fmt.precision, name=f"{name}_significand"),
        is_zero=Signal(name=f"{name}_is_zero"),
        is_infinite=Signal(name=f"{name}_is_infinite"),
        is_nan=Signal(name=f"{name}_is_nan"),
        is_signalling=special & ~empty & ~operand.fraction[-1],
    )
    number.nonzero = number.significand if fmt.gradual else Cat(operand.fraction, C(1, 1))
    m.d.comb += [
        number.exponent.eq(operand.exponent | (tiny & fmt.gradual)),
        number.significand.eq(Cat(operand.fraction, ~tiny)),
        number.is_zero.eq(tiny & empty if fmt.gradual else tiny),
        number.is_infinite.eq(special & empty),
        number.is_nan.eq(special & ~empty),
    ]
    if not fmt.gradual:
        with m.If(tiny):
            m.d.comb += number.significand.eq(0)
    return number


def shift_right_sticky(m, value, amount, name):
    """``value`` shifted right by ``amount``; the lowest bit is the OR of itself and all bits shifted out."""
    levels = len(value).bit_length()
    far = amount[levels:].any() if len(amount) > levels else C(0)
    for level in range(min(levels, len(amount))):
        distance = 1 << level
        shifted = Signal(len(value), name=f"{name}_by_{distance}")
        lost = value[:distance + 1].any() if distance < len(value) else value.any()
        kept = value[distance + 1:] if distance < len(value) else C(0, 0)
        m.d.comb += shifted.eq(Mux(amount[level] | far, Cat(lost, kept), value))
        value = shifted
    return value


def shift_right(m, value, moves, name):
    """``value`` shifted right, and true if a one was shifted out.

    ``moves`` are pairs of a level and a condition: for each one that is true, the value moves by 2**level.
    """
    lost = C(0)
    for level, move in moves:
        step = 1 << level
        shifted = Signal(len(value), name=f"{name}_by_{step}")
        m.d.comb += shifted.eq(Mux(move, value[step:], value))
        lost |= move & value[:step].any()
        value = shifted
    return value, lost


def normalise(m, value, name, *, limit=None, levels=None, fill=0):
    """``value`` shifted left until its top bit is one, but by no more than ``limit``, if given.

    ``levels`` are the binary places of the distance to apply, the lowest first; all, if not given. ``fill`` is the bit
    that comes in from the right. Returns (shifted value, distance). The distance is meaningless for a value of zero.
    """
    distance: list[Signal] = []
    for level in reversed(range((len(value) - 1).bit_length()) if levels is None else levels):
        step = 1 << level
        shifted = Signal(len(value), name=f"{name}_by_{step}")
        moves = Signal(name=f"{name}_moves_{step}")
        allowed = C(1) if limit is None else limit[level:].any()
        m.d.comb += moves.eq(allowed & ~value[-step:].any())
        if limit is not None:
            limit = Cat(limit[:level], (limit[level:] - moves)[:len(limit[level:])])
        m.d.comb += shifted.eq(Mux(moves, Cat(Value.cast(fill).replicate(step), value[:-step]), value))
        distance.insert(0, moves)
        value = shifted
    return value, Cat(*distance)


def normalised(m, fmt, significand, exponent, name, levels=None):
    """Exponent, and significand shifted left until its top bit is one, of a number that is not zero or special.

    ``levels`` are those of ``normalise``.
    """
    if not fmt.gradual:
        return significand, exponent
    significand, zeros = normalise(m, significand, f"{name}_normalise", levels=levels)
    return significand, exponent - (Cat(C(0, levels[0]), zeros) if levels else zeros)


def leading_zeros(value):
    """Whether ``value`` is zero, and the number of its leading zeros, by a tree; without a meaning for zero."""
    if len(value) == 1:
        return ~value, C(0, 0)
    high = 1 << (len(value) - 1).bit_length() - 1
    is_zero, zeros = leading_zeros(value[-high:])
    rest_is_zero, more = leading_zeros(value[:-high])
    lower = (Mux(is_zero, more[place] if place < len(more) else 0, zeros[place]) for place in range(len(zeros)))
    return is_zero & rest_is_zero, Cat(*lower, is_zero)


def round_significand(fmt, exponent, significand, guard, sticky, *, sign=0, rounding=Rounding.NEAREST_EVEN):
    """Encoding (without sign) of a normalised significand, rounded.

    ``significand`` has fmt.precision bits; ``exponent`` is its stored exponent, 0 where the top
    bit is zero (subnormal). The carry of the increment continues into the exponent, so the next
    binade, the least normal number and infinity need no extra logic.
    """
    up = rounding.increments(sign, significand[0], guard, sticky)
    return (Cat(significand[:-1], exponent) + up)[:fmt.width - 1]


def pack(m, fmt, sign, encoded, *, is_nan, is_infinite, is_zero):
    """The result: NaN, infinity or zero if flagged, in this order; else ``encoded``."""
    packed = Signal(fmt.layout)
    with m.If(is_nan):
        m.d.comb += packed.eq(fmt.nan)
    with m.Elif(is_infinite):
        m.d.comb += packed.eq(Cat(C(fmt.infinity, fmt.width - 1), sign))
    with m.Elif(is_zero):
        m.d.comb += packed.eq(Cat(C(0, fmt.width - 1), sign))
    with m.Else():
        m.d.comb += packed.eq(Cat(encoded, sign))
    return packed


def align_subnormal(m, extended, below):
    """``extended`` of a number, not zero, shifted right by ``below``, the distance of its exponent below 1."""
    levels = len(extended).bit_length()
    aligned = shift_right_sticky(m, extended, below[:levels], "subnormal")
    return Mux(below[levels:].any(), 1, aligned)


def round_and_pack(m, fmt, number, rounding=Rounding.NEAREST_EVEN):
    """The result for a normalised number of unbounded exponent, and the exceptions that it raises.

    ``number`` has the operation's ``sign``, ``is_nan``, ``is_infinite`` and ``is_zero``. If none of
    these three is set, ``exponent`` (biased; signed if it may be less than 1) and ``extended`` are
    valid. ``extended`` has, from the low end, sticky bit, guard bit and significand, whose top bit is
    one. ``number`` may also have ``aligned``, if ``align_subnormal`` has a separate rank.

    Returns (encoding, the three low bits of ``FLAGS``); unused flags make no circuit.
    """
    may_be_tiny = number.exponent.shape().signed
    tiny = number.exponent < 1 if may_be_tiny else C(0)
    exponent, extended = Signal(fmt.exponent_width, name="stored_exponent"), number.extended
    m.d.comb += exponent.eq(number.exponent)
    if fmt.gradual and may_be_tiny:
        # A subnormal keeps the weight of exponent 1.
        if hasattr(number, "aligned"):
            aligned = number.aligned
        else:
            aligned = align_subnormal(m, extended, (1 - number.exponent).as_unsigned())
        exponent, extended = Mux(tiny, 0, exponent), Mux(tiny, aligned, extended)
    encoded = round_significand(fmt, exponent, extended[2:], extended[1], extended[0],
                                sign=number.sign, rounding=rounding)
    overflow = (number.exponent >= fmt.exponent_special) & ~number.is_zero

    is_finite = ~(number.is_nan | number.is_infinite | number.is_zero)
    overflows = is_finite & ~tiny & (overflow | encoded[fmt.fraction_width:].all())
    inexact = overflow | extended[:2].any()
    if fmt.gradual:
        # Tininess after rounding: just below the least normal number, where exponents end at 0,
        # the significand may carry although its subnormal form has to be rounded at a higher bit.
        up = rounding.increments(number.sign, number.extended[2], number.extended[1], number.extended[0])
        underflow = tiny & extended[:2].any() & ~((number.exponent == 0) & number.extended[2:].all() & up)
    else:
        underflow = tiny
        inexact = inexact | tiny
    flags = Cat(is_finite & inexact, is_finite & underflow, overflows)

    is_infinite = number.is_infinite
    if rounding.is_nearest:
        is_infinite |= overflow
    else:
        # A number beyond the largest one becomes the largest one if it is not rounded away from zero.
        up = rounding.increments(number.sign, C(1), C(1), C(1))
        encoded = Mux(overflow, Mux(up, fmt.infinity, fmt.infinity - 1), encoded)
    packed = pack(m, fmt, number.sign, encoded, is_nan=number.is_nan, is_infinite=is_infinite,
                  is_zero=number.is_zero | (tiny & (not fmt.gradual)))
    return packed, flags


def partial_products(multiplicand, multiplier, name="partial"):
    """The products of the slices of two factors, by names for ``sum_of_partial_products``.

    A name ends with the places of the slice of the multiplier and, if it is not 0, of that of the multiplicand.
    """
    size, step = (len(multiplicand), SLICE) if len(multiplicand) <= NARROW else (WIDE_SLICE, WIDE_SLICE)
    return {f"{name}_{low}{f'_{first}' if first else ''}": multiplicand[first:first + size] * multiplier[low:low + step]
            for low in range(0, len(multiplier), step) for first in range(0, len(multiplicand), size)}


def placed_products(values, name="partial"):
    """The ``partial_products`` of this name that a namespace has, each with the place of its lowest bit."""
    return [(sum(map(int, member.removeprefix(f"{name}_").split("_"))), value)
            for member, value in vars(values).items() if member.startswith(f"{name}_")]


def sum_of_partial_products(values, name="partial"):
    """The product of which a namespace has the ``partial_products`` of this name: their sum, by a tree."""
    # Products that do not overlap share an addend: its place, and its parts from the lowest on.
    addends: list[tuple[int, list[Value]]] = []
    for place, product in sorted(placed_products(values, name), key=itemgetter(0)):
        for start, parts in addends:
            if (gap := place - start - len(Cat(parts))) >= 0:
                parts.extend((C(0, gap), product))
                break
        else:
            addends.append((place, [product]))
    terms = [Cat(parts) << start for start, parts in addends]
    while len(terms) > 1:
        terms = [sum(terms[index:index + 2]) for index in range(0, len(terms), 2)]
    return terms[0]
