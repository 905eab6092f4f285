"""Numeric namespaces that compute: float64 for the truth, the twin for the circuit's very bits."""

from contextlib import nullcontext

import numpy as np

from .value import Namespace, Value

__all__ = ["Float64", "Twin"]


class Float64:
    """The namespace in which a kernel computes on plain float64 scalars and arrays."""

    sqrt = staticmethod(np.sqrt)
    atan2 = staticmethod(np.arctan2)
    select = staticmethod(np.where)
    maximum = staticmethod(np.maximum)

    @staticmethod
    def section(name):
        """Sections mean nothing to arithmetic."""
        return nullcontext()


class Twin(Namespace):
    """The namespace in which a kernel computes what the circuit computes, bit for bit.

    Values hold arrays of ``pool.format.dtype``, one element per sample; every operation is the
    ``compute`` of the unit that the circuit uses for it.

    Parameters
    ----------
    pool : Pool
        The units.

    Attributes
    ----------
    finite : ndarray of bool
        Samples in which no operation so far gave NaN or infinity.
    """

    def __init__(self, pool):
        self._pool = pool
        self._format = pool.format
        self.finite = np.True_

    def lift(self, number):
        """A scalar of the kernel from an array over samples, or from a number."""
        return TwinValue(self, self._format.array(number))

    def negate(self, a):
        return TwinValue(self, -a.array)

    def add(self, a, b):
        return self._apply("add", a, b)

    def multiply(self, a, b):
        return self._apply("multiply", a, b)

    def divide(self, a, b):
        return self._apply("divide", a, b)

    def sqrt(self, a):
        return self._apply("sqrt", self.lift_value(a))

    def atan2(self, y, x):
        return self._apply("atan2", self.lift_value(y), self.lift_value(x))

    def is_negative(self, a):
        return np.signbit(a.array)

    def select(self, condition, a, b):
        a, b = self.lift_value(a), self.lift_value(b)
        return TwinValue(self, self._pool.compute("select", a.array, b.array, condition))

    def _apply(self, operation, *operands):
        result = self._pool.compute(operation, *(operand.array for operand in operands))
        self.finite = self.finite & np.isfinite(result)
        return TwinValue(self, result)


class TwinValue(Value):
    """An array over samples, in the circuit's format."""

    def __init__(self, namespace, array):
        super().__init__(namespace)
        self.array = array
