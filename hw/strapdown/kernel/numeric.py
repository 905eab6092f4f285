"""Numeric namespaces that compute: float64 for the truth, the twin for the bits of the circuit."""

from contextlib import nullcontext
from functools import partial

import numpy as np

from .operators import Operation, integer_word, meaning
from .value import Namespace, Value

__all__ = ["Float64", "Twin"]


class Float64:
    """The namespace in which a kernel computes on plain float64 scalars and arrays."""

    @staticmethod
    def select(condition, a, b):
        """``a`` where the condition holds, else ``b``."""
        return np.where(condition, a, b)

    def __getattr__(self, name):
        known = meaning(name)
        return partial(_exact, known) if isinstance(known, Operation) else partial(known, self)

    @staticmethod
    def given_integer(array):
        """The operand of ``from_integer`` for the integers at an input port."""
        return np.asarray(array)

    @staticmethod
    def section(name):
        """Sections have no effect on arithmetic."""
        return nullcontext()


def _exact(operation, *operands):
    operation.check(operands)
    return operation.float64(*operands)


class Twin(Namespace):
    """The namespace in which a kernel computes the same bits as the circuit.

    Values hold arrays of ``pool.format.dtype``, one element per sample; every operation is the
    ``compute`` of the unit that the circuit uses for it.

    Parameters
    ----------
    pool : Pool
        The units.

    Attributes
    ----------
    finite : ndarray of bool
        Samples in which no operation has given NaN or infinity so far.
    """

    def __init__(self, pool):
        super().__init__(pool)
        self.finite = np.True_

    def lift(self, number):
        """A scalar of the kernel from an array over samples, or from a number."""
        return TwinValue(self, self.pool.format.array(number))

    def given(self, array):
        """A scalar of the kernel from the values of an input port or a state word.

        It is rounded to the format; subnormals are not flushed.
        """
        fmt = self.pool.format
        return TwinValue(self, fmt.from_bits(fmt.to_bits(array)))

    def given_integer(self, array):
        """The operand of ``from_integer`` for the integers at an input port."""
        return TwinValue(self, integer_word(self.pool.format, array))

    def negate(self, a):
        return TwinValue(self, -a.array)

    def apply(self, operation, *operands):
        result = self.pool.compute(operation, *(operand.array for operand in operands))
        self.finite = self.finite & np.isfinite(result)
        return TwinValue(self, result)

    def is_negative(self, a):
        return np.signbit(a.array)

    def select(self, condition, a, b):
        a, b = self.lift_value(a), self.lift_value(b)
        return TwinValue(self, self.pool.compute("select", a.array, b.array, condition))


class TwinValue(Value):
    """An array over samples, in the circuit's format."""

    def __init__(self, namespace, array):
        super().__init__(namespace)
        self.array = array
