"""Stages shared by the operators: unpacking, shifting with a sticky bit, counting zeros, rounding."""

from types import SimpleNamespace

from amaranth import *

__all__ = ["unpack", "shift_right_sticky", "normalise", "round_nearest_even"]


def unpack(m, fmt, operand, name):
    """Class flags, effective exponent and significand of an encoded number.

    ``exponent`` is the biased exponent, 1 for subnormals, so that ``significand`` (fmt.precision
    bits, hidden bit on top) always weighs 2**(exponent - bias - fraction_width).
    With flushed subnormals a subnormal is a zero.
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
    )
    m.d.comb += [
        number.exponent.eq(operand.exponent | tiny),
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
    """``value`` shifted right by ``amount``; every bit shifted out is or-ed into the lowest bit."""
    for level in range(len(amount)):
        distance = 1 << level
        shifted = Signal(len(value), name=f"{name}_by_{distance}")
        lost = value[:distance + 1].any() if distance < len(value) else value.any()
        kept = value[distance + 1:] if distance < len(value) else C(0, 0)
        m.d.comb += shifted.eq(Mux(amount[level], Cat(lost, kept), value))
        value = shifted
    return value


def normalise(m, value, name):
    """``value`` shifted left until its top bit is one, and the count of leading zeros.

    Returns (shifted value, count). The count is meaningless for a value of zero.
    """
    count = []
    for level in reversed(range((len(value) - 1).bit_length())):
        distance = 1 << level
        if distance >= len(value):
            continue
        shifted = Signal(len(value), name=f"{name}_by_{distance}")
        empty = Signal(name=f"{name}_empty_{distance}")
        m.d.comb += [
            empty.eq(~value[-distance:].any()),
            shifted.eq(Mux(empty, Cat(C(0, distance), value[:-distance]), value)),
        ]
        count.insert(0, empty)
        value = shifted
    return value, Cat(*count)


def round_nearest_even(fmt, exponent, significand, guard, sticky):
    """Encoding (without sign) of a normalised significand, rounded to nearest, ties to even.

    ``significand`` has fmt.precision bits; ``exponent`` is its stored exponent, 0 where the top
    bit is zero (subnormal). The carry of the increment runs on into the exponent, which makes
    the next binade, the least normal number and infinity come out right by themselves.
    """
    up = guard & (sticky | significand[0])
    return (Cat(significand[:-1], exponent) + up)[:fmt.width - 1]
