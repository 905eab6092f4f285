"""Addition and subtraction."""

from functools import reduce
from operator import or_
from types import SimpleNamespace

import numpy as np
from amaranth import *

from . import exact
from .pipeline import Pipeline, RoundedOperator, pick
from .rounding import Rounding
from .stages import NARROW, SLICE, pack, partial_products, placed_products, shift_right, unpack

__all__ = ["FpAdd"]


class FpAdd(RoundedOperator):
    """Sum of two floating-point numbers, ``result = a + b`` or ``a - b``.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    latency : int
        Register ranks, 1 to 8, with ``dsp_shifts`` 1 to 10, with ``two_paths`` 1 to 7.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.
    quiet : bool
        True for outputs that are zero while ``done`` is low.
    dsp_shifts : bool
        True to shift by multiplications with powers of two, which tools put into DSP blocks; for a format that flushes
        subnormals.
    two_paths : bool
        True for a path of its own for differences of close numbers: it takes more logic, but fewer ranks for the same
        clock rate; for a format that flushes subnormals, without ``dsp_shifts``.

    Members
    -------
    a, b, subtract, start : In(format), In(format), In(1), In(1)
        Operands, any unit; 1 subtracts ``b``, 0 adds it. Taken while ``start`` is high.
    result, done : Out(format), Out(1)
        Result, valid while ``done`` is high.
    flags : Out(FLAGS)
        Exceptions of this result, valid with it; only with ``flags=True``.

    Latency: ``latency`` cycles, ``start`` to ``done``; one operation per cycle; no back-pressure.
    Accuracy: correctly rounded.
    Special values: x - x is +0, or -0 if rounded downward; infinity - infinity and NaN operands
    give the format's NaN.
    Flags: invalid for infinity - infinity and signalling NaNs; overflow, inexact and, where
    subnormals are flushed, underflow, as in ``Flags``.
    Raises: ValueError if ``latency`` or ``rounding`` is out of range, for ``dsp_shifts`` or ``two_paths`` with gradual
    subnormals, or for both.
    Source: IEEE 754-2019, 5.4.1, operations *addition* and *subtraction*.
    """

    # The priority follows the longest paths of placed and routed circuits on an ECP5.
    PIPELINE = Pipeline(cuts=("distance", "shift", "align", "sum", "coarse", "normalise", "round", "result"),
                        priority=("result", "align", "normalise", "coarse", "shift", "round", "sum", "distance"),
                        default_latency=5)
    # A multiplication needs ranks before and after it.
    DSP_PIPELINE = Pipeline(
        cuts=("distance", "shift", "product", "align", "sum", "coarse", "power", "normalise", "round", "result"),
        priority=("result", "normalise", "power", "product", "shift", "sum", "coarse", "round", "distance", "align"),
        default_latency=6)
    TWO_PATHS_PIPELINE = Pipeline(
        cuts=("distance", "shift", "sum", "coarse", "normalise", "round", "result"),
        priority=("result", "shift", "coarse", "normalise", "sum", "round", "distance"), default_latency=3)

    def __init__(self, format, *, latency=None, rounding=Rounding.NEAREST_EVEN, flags=False, quiet=False,
                 dsp_shifts=False, two_paths=False):
        if dsp_shifts and two_paths:
            raise ValueError("dsp_shifts and two_paths must not both be true")
        for name, chosen in (("dsp_shifts", dsp_shifts), ("two_paths", two_paths)):
            if chosen and format.gradual:
                raise ValueError(f"format must flush subnormals with {name}, not {format!r}")
        self._dsp_shifts, self._two_paths = bool(dsp_shifts), bool(two_paths)
        pipeline = self.DSP_PIPELINE if dsp_shifts else self.TWO_PATHS_PIPELINE if two_paths else None
        super().__init__(format, {"a": format.layout, "b": format.layout, "subtract": 1}, latency=latency,
                         rounding=rounding, flags=flags, pipeline=pipeline, quiet=quiet)

    @property
    def dsp_shifts(self):
        """True if it shifts by multiplications."""
        return self._dsp_shifts

    @property
    def two_paths(self):
        """True if differences of close numbers have a path of their own."""
        return self._two_paths

    def compute(self, a, b, subtract=False):
        """Bit-exact software twin: arrays of the format's dtype, any shapes that broadcast."""
        return exact.by_numpy(self._format, self._rounding, np.add, exact.add, a,
                              exact.negated(self._format, b, subtract))

    def compute_flags(self, a, b, subtract=False):
        """The twin's ``Flags`` as uint8; operands as in ``compute``."""
        return exact.add(self._format, a, exact.negated(self._format, b, subtract), self._rounding)[1]

    def elaborate(self, platform):
        m = Module()
        fmt = self._format
        rank = self.ranks(m)
        width = fmt.exponent_width

        # Unpack, and subtract the exponents. Flushing does not need the hidden bit: a zero that is
        # the smaller operand is shifted out, and the class flags select the result of two zeros.
        a, b = unpack(m, fmt, self.a, "a"), unpack(m, fmt, self.b, "b")
        b_sign = self.b.sign ^ self.subtract
        opposite = a.sign ^ b_sign
        cancels = a.is_infinite & b.is_infinite & opposite
        difference = Signal(width + 1)
        m.d.comb += difference.eq(b.exponent - a.exponent)
        classes = {
            "opposite": opposite, "is_nan": a.is_nan | b.is_nan | cancels, "is_infinite": a.is_infinite | b.is_infinite,
            "zero_sign": a.sign | b_sign if self._rounding is Rounding.DOWNWARD else a.sign & b_sign}
        if self._flags:
            classes["invalid"] = a.is_signalling | b.is_signalling | cancels
        s = rank(
            "distance", **classes, difference=difference, a_sign=a.sign, b_sign=b_sign,
            a_exponent=a.exponent, b_exponent=b.exponent, a_is_zero=a.is_zero, b_is_zero=b.is_zero,
            a_significand=a.significand if fmt.gradual else Cat(self.a.fraction, C(1, 1)),
            b_significand=b.significand if fmt.gradual else Cat(self.b.fraction, C(1, 1)))

        s = (self._two_ways if self._two_paths else self._one_way)(m, rank, s, tuple(classes))

        # Round, and compute the exponent in the same addition. A subnormal has the exponent 0.
        significand, guard, sticky = s.magnitude[4:], s.magnitude[3], s.magnitude[:3].any()
        if self._two_paths:
            change = Cat(s.change, s.change[-1].replicate(max(width + 1 - len(s.change), 0)))[:width + 1]
        else:
            # It is 1 - zeros, and all its bits but the lowest are those of -(zeros >> 1).
            levels = len(s.zeros)
            change = Cat(~s.zeros[0], *(s.zeros[bit] ^ s.zeros[1:bit].any() for bit in range(1, levels)),
                         s.zeros[1:].any().replicate(max(width + 1 - levels, 0)))[:width + 1]
        exponent = s.exponent
        if fmt.gradual:
            is_zero = ~s.magnitude.any()
            change, exponent = (value & significand[-1].replicate(len(value)) for value in (change, exponent))
        else:
            is_zero = ~significand[-1] | s.both_are_zero
        # Close numbers are exact: they need no test for an odd one.
        is_odd = s.is_odd if self._two_paths else significand[0]
        up = self._rounding.increments(s.sign, is_odd, guard, sticky)
        if not self._rounding.is_nearest:
            up = Mux(s.lacks_unit, 1, up)
        rounded = Signal(fmt.fraction_width + width + 1)
        m.d.comb += rounded.eq(Cat(significand[:-1], exponent) + Cat(up, C(0, fmt.fraction_width - 1), change))
        outcome = {"is_nan": s.is_nan, "is_infinite": s.is_infinite, "overflow": s.overflow, "is_zero": is_zero,
                   "sign": Mux(is_zero, s.zero_sign, s.sign)}
        if self._flags:
            outcome |= {"invalid": s.invalid, "inexact": (guard | sticky) & ~s.lacks_unit}
        s = rank("round", **outcome, rounded=rounded)

        # Pack. A result below the least normal number is exact, so rounding did not increase it.
        encoded, exponent = s.rounded[:-1], s.rounded[fmt.fraction_width:]
        tiny = (exponent[-1] | ~exponent[:-1].any()) & (not fmt.gradual)
        away = self._rounding.increments(s.sign, C(1), C(1), C(1))
        outputs = {"result": pack(
            m, fmt, s.sign, Mux(s.overflow & ~away, fmt.infinity - 1, encoded), is_nan=s.is_nan,
            is_infinite=s.is_infinite | (s.overflow & away), is_zero=s.is_zero | tiny)}
        if self._flags:
            is_finite = ~(s.is_nan | s.is_infinite | s.is_zero)
            underflow = tiny & ~s.overflow
            outputs["flags"] = Cat(
                is_finite & (s.inexact | s.overflow | underflow), is_finite & underflow,
                is_finite & (s.overflow | (exponent[:-1].all() & ~exponent[-1])), C(0, 1), s.invalid)
        s = rank("result", **outputs)
        m.d.comb += [getattr(self, name).eq(value) for name, value in vars(s).items()]
        m.d.comb += self.done.eq(rank.valid)
        return m

    def _one_way(self, m, rank, s, classes):
        """Ranks from "distance" to "normalise", all numbers on one path; ``classes`` are names of flags."""
        fmt = self._format
        move = _alignment(m, fmt, s)
        swap, levels, larger = move.swap, move.levels, move.larger
        if self._dsp_shifts:
            # The farthest of the shifts leaves the top bit at the round bit, and is a product with 1.
            shifts = fmt.precision + 2
            at = [move.distance[:levels] == place for place in range(shifts)]
            power = reversed([Mux(swap, *pair) for pair in zip(at, (C(0), *at), strict=False)])
            shift = {"near": Mux(swap, s.a_significand, s.b_significand), "power": Mux(move.far, 0, Cat(*power)),
                     "beyond": move.far | (move.distance[:levels] >= Mux(swap, shifts, shifts - 1))}
            larger ^= s.opposite.replicate(fmt.precision)
        else:
            shift, fine = _shifted_a_little(m, move)
        s = rank("shift", **pick(s, classes), **move.numbers, larger=larger, **shift,
                 smaller_is_zero=move.smaller_is_zero, both_are_zero=s.a_is_zero & s.b_is_zero)
        numbers = ("sign", "exponent", "both_are_zero")
        if self._dsp_shifts:
            s = rank("product", **pick(s, classes, numbers, ("larger", "smaller_is_zero", "beyond")),
                     **partial_products(s.near, s.power))
            # Partial products have no common ones. Their OR takes no time: it is part of the adder.
            product = Signal(fmt.precision + shifts - 1)
            m.d.comb += product.eq(reduce(or_, (Cat(C(0, place), value) for place, value in placed_products(s))))
            aligned, sticky = product[shifts - 3:], product[:shifts - 3].any() | s.beyond
            sticky &= ~(s.smaller_is_zero & (not fmt.gradual))
        else:
            aligned, sticky = _shifted_fully(m, fmt, s, fine)
        s = rank("align", **pick(s, classes, numbers), larger=s.larger, smaller=Cat(sticky, aligned))

        # Add. A difference is computed as smaller + ~larger = -(larger - smaller) - 1. Its inverse is
        # larger - smaller. If that is negative, which needs equal exponents, the sum is not inverted. It is
        # then one unit of the lowest bit too small, but the low bits are ones, so rounding corrects it.
        total = Signal(fmt.precision + 4)
        if self._dsp_shifts:
            m.d.comb += total.eq(Cat(s.opposite.replicate(3), s.larger, s.opposite) + s.smaller)
            s = rank("sum", **pick(s, classes, numbers), total=total)
            total = s.total
        else:
            larger = Cat(C(0, 3), s.larger, C(0, 1))
            m.d.comb += total.eq(s.smaller + (larger ^ s.opposite.replicate(len(total))))
        magnitude = Signal.like(total)
        m.d.comb += magnitude.eq(total ^ (s.opposite & total[-1]).replicate(len(total)))
        lacks_unit = s.opposite & ~total[-1]
        classes = tuple(name for name in classes if name != "opposite")
        if not self._dsp_shifts:
            s = rank("sum", **pick(s, classes, numbers), magnitude=magnitude, lacks_unit=lacks_unit)
            magnitude, lacks_unit = s.magnitude, s.lacks_unit
        # The top bit weighs twice the larger operand's hidden one.
        overflow = magnitude[-1] & (s.exponent == fmt.exponent_special - 1)
        classes = {**pick(s, classes), "overflow": overflow, **self._needed(lacks_unit)}

        # Normalise. The lowest bit is the sticky bit, or a one that is a unit too small, so it is repeated
        # from the right. A subnormal keeps the weight of exponent 1: no shift by more than ``exponent``.
        room = s.exponent[levels:].any() if fmt.gradual else C(1)
        fine = levels - 1 if self._dsp_shifts else min(4, levels - 1)
        shifted, moved, room = _move_left(m, magnitude, range(fine, levels), s.exponent, room)
        found = {}
        if fmt.precision > NARROW and not self._dsp_shifts:
            # The first level after the cut finds its zeros before it, in parallel for all distances.
            found = {"empty": Array(~magnitude[-(1 << fine - 1) - distance:][:1 << fine - 1].any() for distance in
                                    range(0, 1 << levels, 1 << fine))[moved]}
        s = rank("coarse", **classes, sign=s.sign ^ lacks_unit, exponent=s.exponent, both_are_zero=s.both_are_zero,
                 magnitude=shifted, moved=moved, room=room, **found)
        if self._dsp_shifts:
            power, zeros, freed = _leading_one(s.magnitude, 1 << fine)
            s = rank("power", **pick(s, classes, numbers), magnitude=s.magnitude, power=power,
                     zeros=Cat(zeros, s.moved), filled=Mux(s.magnitude[0], freed, 0))
            magnitude, zeros = _product(m, s.power, s.magnitude)[:len(total)] | s.filled, s.zeros
        else:
            magnitude, moved, _ = _move_left(m, s.magnitude, range(fine), s.exponent, s.room, **pick(s, found))
            zeros = Cat(moved, s.moved)
        return rank("normalise", **pick(s, classes, numbers), magnitude=magnitude, zeros=zeros)

    def _two_ways(self, m, rank, s, classes):
        """Ranks from "distance" to "normalise", close numbers on a path of their own; ``classes`` are names of flags.

        Only the difference of numbers whose exponents differ by one at most can have many leading zeros. Such numbers
        need no long shift before the subtraction, and all others none after it.
        """
        fmt = self._format
        move = _alignment(m, fmt, s)
        shift, fine = _shifted_a_little(m, move)
        # The lowest two bits of the exponents tell by how many places a close number is ahead.
        ahead = (s.a_exponent[:2] - s.b_exponent[:2])[:2]
        smaller, larger = ahead == 1, ahead == 3
        difference, b = Signal(fmt.precision + 3), Signal(fmt.precision + 2)
        m.d.comb += [b.eq(Mux(larger, s.b_significand << 2, Mux(smaller, s.b_significand, s.b_significand << 1))),
                     difference.eq(Cat(C(0, 1), s.a_significand, C(0, 2)) + ~Cat(b, C(0, 1)))]
        # It is a - b - 1. If it is negative, its inverse is b - a; else it lacks a unit, and ones are below it, so
        # rounding corrects it. A difference without a zero on top comes from the sum of others.
        lacks_unit = ~difference[-1]
        aligned = Mux(larger, difference[1:-1], difference[:-2])
        magnitude = Cat(lacks_unit, aligned ^ difference[-1].replicate(fmt.precision + 1))
        close = s.opposite & ~move.distance[1:].any() & ~(move.distance[0] & ~move.swap) & ~move.smaller_is_zero
        s = rank("shift", **pick(s, classes), **move.numbers, larger=move.larger, **shift,
                 smaller_is_zero=move.smaller_is_zero, both_are_zero=s.a_is_zero & s.b_is_zero,
                 swap=move.swap, close=close, lacks_unit=lacks_unit, magnitude=magnitude)

        # The sum of others is never negative. The lowest bit of the larger number takes the carry of a subtraction.
        aligned, sticky = _shifted_fully(m, fmt, s, fine)
        total = Signal(fmt.precision + 4)
        smaller = Cat(sticky, aligned, C(0, 1))
        m.d.comb += total.eq(Cat(s.opposite, C(0, 2), s.larger) + (smaller ^ s.opposite.replicate(len(total))))
        close = s.close & ~s.magnitude[-1]
        lacks_unit = s.lacks_unit & close
        classes = tuple(name for name in classes if name != "opposite")
        numbers = "exponent", "both_are_zero"
        s = rank("sum", **pick(s, classes, numbers), sign=s.sign ^ (lacks_unit & s.swap), close=close,
                 lacks_unit=lacks_unit, is_largest=s.exponent == fmt.exponent_special - 1, total=total,
                 magnitude=s.magnitude[:-1])

        # Normalise: close numbers by a long shift, all others by a place to the right or to the left.
        levels = range(fmt.precision.bit_length())
        magnitude, coarse, _ = _move_left(m, s.magnitude, levels[1:], C(0, 0), C(1))
        total = Signal.like(s.total, name="normalised_total")
        m.d.comb += total.eq(Mux(s.total[-1], s.total, Mux(s.total[-2], s.total << 1, s.total << 2)))
        guard, sticky = Mux(s.close, s.lacks_unit, total[3]), Mux(s.close, s.lacks_unit, total[:3].any())
        increases = s.total[-1] & ~s.close
        s = rank("coarse", **pick(s, classes, numbers, ("sign", "close", "lacks_unit")), magnitude=magnitude,
                 coarse=coarse, total=total[4:], guard=guard, sticky=sticky, increases=increases,
                 decreases=~s.total[-2:].any() & ~s.close, overflow=increases & s.is_largest)
        magnitude, moved, _ = _move_left(m, s.magnitude, levels[:1], C(0, 0), C(1))
        # The exponent changes by -1 - zeros, or by 1, 0 or -1.
        zeros = ~Cat(moved, s.coarse)
        change = Cat(Mux(s.close, zeros, Cat(s.increases, C(0, len(zeros) - 1)) | s.decreases.replicate(len(zeros))),
                     s.close | s.decreases)
        return rank("normalise", **pick(s, classes), exponent=s.exponent, both_are_zero=s.both_are_zero, sign=s.sign,
                    overflow=s.overflow, change=change, is_odd=s.total[0], **self._needed(s.lacks_unit),
                    magnitude=Cat(s.sticky, C(0, 2), s.guard, Mux(s.close, magnitude[1:], s.total)))

    def _needed(self, lacks_unit):
        """``lacks_unit`` by its name, if rounding needs it."""
        return {"lacks_unit": lacks_unit} if self._flags or not self._rounding.is_nearest else {}


def _alignment(m, fmt, s):
    """How the operand of the smaller exponent moves right, into a guard bit, a round bit and a sticky bit.

    The sum needs no more bits. If b is this operand, the distance is the negated difference: its complement, and one
    place more, which is fixed wiring. A distant operand, and one that is flushed, leaves only the sticky bit.
    """
    swap = ~s.difference[-1]
    width = len(s.difference) - 1
    levels = (fmt.precision + 3).bit_length()
    distance = Cat(s.difference[:-1] ^ s.difference[-1].replicate(width), C(0, max(levels - width, 0)))
    smaller_is_zero = Mux(swap, s.a_is_zero, s.b_is_zero)
    far = Signal()
    m.d.comb += far.eq(distance[levels:].any() | (smaller_is_zero & (not fmt.gradual)))
    return SimpleNamespace(
        swap=swap, levels=levels, distance=distance, smaller_is_zero=smaller_is_zero, far=far,
        larger=Mux(swap, s.b_significand, s.a_significand),
        near=Mux(swap, Cat(C(0, 2), s.a_significand), Cat(C(0, 1), s.b_significand, C(0, 1))),
        numbers={"sign": Mux(swap, s.b_sign, s.a_sign), "exponent": Mux(swap, s.b_exponent, s.a_exponent)})


def _shifted_a_little(m, move):
    """The first levels of the shift of the smaller operand: values for ``_shifted_fully``, and how many levels."""
    moves = Cat(move.distance[0], move.distance[1:move.levels] | move.far.replicate(move.levels - 1))
    # Each level of wider numbers moves more bits, so there are fewer before the cut.
    fine = min(3, move.levels, max(8 - move.levels, 1))
    aligned, sticky = shift_right(m, move.near, enumerate(moves[:fine]), "align")
    return {"aligned": aligned, "sticky": sticky, "moves": moves[fine:]}, fine


def _shifted_fully(m, fmt, s, fine):
    """The smaller operand and its sticky bit, after all levels of the shift."""
    aligned, lost = shift_right(m, s.aligned, enumerate(s.moves, fine), "align")
    return aligned, (s.sticky | lost) & ~(s.smaller_is_zero & (not fmt.gradual))


def _move_left(m, value, levels, limit, room, empty=None):
    """``value`` shifted left by 2**level, its lowest bit repeated, at each of ``levels`` that has so many zeros on top.

    The shift of all levels is at most ``limit``. ``room`` is true if the higher bits of ``limit``, minus the shifts of
    higher levels, are not zero. ``empty`` is true if the highest of ``levels`` has its zeros; None: it looks for them.
    Returns (shifted value, the levels that shifted, ``room`` for lower levels).
    """
    distance: list[Signal] = []
    for level in reversed(levels):
        step = 1 << level
        here = limit[level] if level < len(limit) else C(0)
        moves = Signal(name=f"normalise_moves_{step}")
        shifted = Signal(len(value), name=f"normalise_by_{step}")
        found, empty = ~value[-step:].any() if empty is None else empty, None
        m.d.comb += [moves.eq(found & (room | here)),
                     shifted.eq(Mux(moves, Cat(value[0].replicate(step), value[:-step]), value))]
        distance.insert(0, moves)
        value, room = shifted, room | (here & ~moves)
    return value, Cat(distance), room


def _leading_one(value, count):
    """The power of two that shifts the highest one of a value to its top, if that is one of ``count`` bits.

    Returns (power, number of zeros above the one, the bits that the shift makes free).
    """
    power, freed, above = [], [], C(0)
    for bit in reversed(value[-count:]):
        power.append(bit & ~above)
        above |= bit
        freed.append(~above)
    zeros = [Cat(one for place, one in enumerate(power) if place >> level & 1).any()
             for level in range((count - 1).bit_length())]
    return Cat(*power), Cat(*zeros), Cat(*freed[:-1])


def _product(m, a, b):
    """a * b, by slices of b; each DSP block adds the higher bits of the product before it."""
    done, carried = [], C(0, 0)
    for low in range(0, len(b), SLICE):
        part = b[low:low + SLICE]
        product = Signal(len(a) + len(part), name=f"normalised_{low}")
        m.d.comb += product.eq(a * part + carried)
        done.append(product[:SLICE] if low + SLICE < len(b) else product)
        carried = product[SLICE:]
    return Cat(*done)
