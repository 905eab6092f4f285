"""Functions by tables of parabolas: the coefficients, in integers, and the parts of a circuit that evaluates them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth import *
from amaranth.lib.memory import Memory

__all__ = ["SCALE", "Parabolas", "parabolas", "reciprocal_value"]

SCALE = 96
"""Fraction bits of the function values from which coefficients are computed."""


def parabolas(function: Callable[[int, int], int], first: int, length: int, intervals: int) -> Iterator[tuple]:
    """c0, c1 and c2 of each of the equal intervals from ``first`` to ``first + length``, in units of 2**-SCALE.

    Inside an interval c0 + t (c1 + t c2), with t from -1/2 to 1/2, meets the function in the middle and at t = ±0.433,
    about the zeros of the Chebyshev polynomial of degree 3. So its error is at most w**3 |f'''| / 192 for an interval
    of width w. ``function(numerator, denominator)`` gives the value at a ratio in units of 2**-SCALE. All arithmetic is
    on integers, so every machine has the same coefficients.
    """
    for interval in range(intervals):
        before, middle, after = (
            function(2000 * intervals * first + length * (2000 * interval + 1000 + side), 2000 * intervals)
            for side in (-866, 0, 866))
        yield middle, (after - before) * 1000 // 866, (after + before - 2 * middle) * 2 * 1000**2 // 866**2


def reciprocal_value(numerator: int, denominator: int) -> int:
    """The function 1/x for ``parabolas``."""
    return (denominator << SCALE) // numerator


@dataclass(frozen=True)
class Parabolas:
    """A table of parabolas, its twin, and its circuit.

    Attributes
    ----------
    rows : tuple of tuple
        c0, c1 and c2 of each interval, as integers.
    fraction_bits : tuple of int
        Their fraction bits.
    offset_bits : int
        Bits of the place in an interval. t is the place with its highest bit inverted, a signed fraction.
    """

    rows: tuple[tuple[int, int, int], ...]
    fraction_bits: tuple[int, int, int]
    offset_bits: int

    @classmethod
    def of(cls, coefficients, fraction_bits, offset_bits, result_bits):
        """The table of coefficients in units of 2**-SCALE.

        c0 contains half a unit of a result with ``result_bits`` fraction bits, so that cutting bits off rounds it.
        """
        return cls(tuple(
            tuple(value + (1 << SCALE - bits - 1) >> SCALE - bits
                  for value, bits in zip((c0 + (1 << SCALE - result_bits - 1), c1, c2), fraction_bits, strict=True))
            for c0, c1, c2 in coefficients), fraction_bits, offset_bits)

    @cached_property
    def _columns(self):
        """c0, c1 and c2 of all intervals, as arrays."""
        return tuple(np.array(column) for column in zip(*self.rows, strict=True))

    @property
    def _slope_shift(self):
        """c2 t has so many more fraction bits than c1."""
        return self.fraction_bits[2] + self.offset_bits - self.fraction_bits[1]

    @property
    def value_bits(self):
        """Fraction bits of a value."""
        return self.fraction_bits[1] + self.offset_bits

    def compute(self, index, place, result_bits):
        """The twin: values with ``result_bits`` fraction bits, for arrays of integers."""
        c0, c1, c2 = (column[index] for column in self._columns)
        t = place - (1 << self.offset_bits - 1)
        slope = (c1 << self._slope_shift) + c2 * t + (1 << self._slope_shift - 1) >> self._slope_shift
        return (c0 << self.value_bits - self.fraction_bits[0]) + slope * t >> self.value_bits - result_bits

    def read(self, m, name, address):
        """c0, c1 and c2 a cycle after the address, from a ROM that is the submodule ``name``."""
        shapes = [Shape.cast(range(min(column), max(column) + 1)) for column in zip(*self.rows, strict=True)]
        words = [sum((value & (1 << shape.width) - 1) << sum(before.width for before in shapes[:place])
                     for place, (value, shape) in enumerate(zip(row, shapes, strict=True))) for row in self.rows]
        m.submodules[name] = rom = Memory(shape=sum(shape.width for shape in shapes), depth=len(words), init=words,
                                          attrs={"rom_style": "block"})
        port = rom.read_port()
        m.d.comb += port.addr.eq(address)
        columns, low = [], 0
        for shape in shapes:
            column = port.data[low:low + shape.width]
            columns.append(column.as_signed() if shape.signed else column)
            low += shape.width
        return columns

    def t(self, place):
        """t, from the place in the interval."""
        return Cat(place[:-1], ~place[-1]).as_signed()

    def slope(self, c1, bend):
        """c1 + t c2, rounded, from ``bend`` = c2 t."""
        half = C(1 << self._slope_shift - 1, self._slope_shift)
        ends = [c1 + side * ((abs(c2) << self.offset_bits - 1 >> self._slope_shift) + 1)
                for _, c1, c2 in self.rows for side in (-1, 1)]
        shape = Shape.cast(range(min(ends), max(ends) + 1))
        slope = (bend + _extended(half, c1)) >> self._slope_shift
        return slope[:shape.width].as_signed() if shape.signed else slope[:shape.width]

    def value(self, c0, product, result_bits):
        """c0 + t (c1 + t c2) with ``result_bits`` fraction bits, from ``product`` = t (c1 + t c2)."""
        return (_extended(C(0, self.value_bits - self.fraction_bits[0]), c0) + product) >> self.value_bits - result_bits


def _extended(low, value):
    """More bits at the low end of a value, which keeps its sign."""
    extended = Cat(low, value)
    return extended.as_signed() if value.shape().signed else extended
