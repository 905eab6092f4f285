"""Conversion from integers."""

from dataclasses import dataclass

import numpy as np

from strapdown.fp import FixedToFp

from .base import Operation, Operator

__all__ = ["Converter", "integer_bits", "integer_word"]


def integer_bits(format):
    """Width of the integer that a memory word of a format can hold in place of a number.

    The two bits above it stay zero, so that no integer looks like infinity or NaN.
    """
    return format.width - 2


def integer_word(format, integers):
    """Memory words that hold integers, as an array of the format's dtype; its values as numbers have no meaning."""
    bits = np.asarray(integers, np.int64) & ((1 << integer_bits(format)) - 1)
    return format.from_bits(bits.astype(format.bits_dtype))


class IntegerToFp(FixedToFp):
    """Floating-point form of an integer in the lowest bits of a number's word.

    Members, latency, accuracy and errors are those of ``FixedToFp`` with a width of ``integer_bits``.
    """

    def __init__(self, format, *, latency):
        super().__init__(format, width=integer_bits(format), fraction_bits=0, latency=latency)

    def compute(self, operand):
        """Bit-exact software twin: an array of the format's dtype that holds integers in its bits."""
        unused = 64 - self.width
        bits = self.format.to_bits(operand).astype(np.uint64)
        return super().compute((bits << np.uint64(unused)).view(np.int64) >> unused)


@dataclass(frozen=True, kw_only=True)
class Converter(Operator):
    """Pipelined conversion of the integers of an input port to numbers, rounded to nearest.

    Kernels do not call it: the equations of a ``System`` get the numbers of its integer ports.

    Parameters
    ----------
    latency : int
        Register ranks, as of ``FixedToFp``.
    count : int
        How many there are.
    """

    name = "converter"
    component = IntegerToFp
    beside = "adder"
    operands = ("operand",)
    operations = (Operation("from_integer", twin=lambda component, word: component.compute(word),
                            float64=lambda integer: np.asarray(integer, np.float64), operands=1),)

    latency: int = 2
    count: int = 1
