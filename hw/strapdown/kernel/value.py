"""Scalars of a kernel: Python's operators, handed on to the namespace that gives them meaning."""

from abc import ABC, abstractmethod
from contextlib import nullcontext
from numbers import Real

from strapdown.algorithms import arctangent

__all__ = ["Namespace", "Value"]


class Namespace(ABC):
    """Base of the namespaces whose values are not plain numbers.

    The circuit has no comparator: ``a < b`` is the sign of ``a - b``.

    Parameters
    ----------
    pool : Pool
        The units there are.
    """

    def __init__(self, pool):
        self.pool = pool

    @abstractmethod
    def lift(self, number):
        """A number as a value."""

    @abstractmethod
    def negate(self, a):
        """-a."""

    @abstractmethod
    def apply(self, operation, *operands):
        """What the pool's unit for ``operation`` makes of values."""

    @abstractmethod
    def is_negative(self, a):
        """The condition that the sign bit of ``a`` is set."""

    @abstractmethod
    def select(self, condition, a, b):
        """``a`` where the condition holds, else ``b``."""

    def lift_value(self, operand):
        """``operand`` as a value of this namespace; TypeError if it is no number."""
        if isinstance(operand, Value):
            if operand.namespace is not self:
                raise TypeError("a kernel must not mix values of two namespaces")
            return operand
        if isinstance(operand, Real):
            return self.lift(float(operand))
        raise TypeError(f"a kernel computes with numbers, not with {operand!r}")

    def add(self, a, b):
        """a + b."""
        return self.apply("add", a, b)

    def multiply(self, a, b):
        """a · b."""
        return self.apply("multiply", a, b)

    def divide(self, a, b):
        """a / b."""
        return self.apply("divide", a, b)

    def sqrt(self, a):
        """Square root of a value or number."""
        return self.apply("sqrt", self.lift_value(a))

    def atan2(self, y, x):
        """Angle of the point (x, y), values or numbers, in radians: a unit's, or a kernel's if the pool has none."""
        y, x = self.lift_value(y), self.lift_value(x)
        return self.apply("atan2", y, x) if "atan2" in self.pool.operations else arctangent.atan2(self, y, x)

    def subtract(self, a, b):
        """a - b: the sum with b's sign turned."""
        return self.add(a, self.negate(b))

    def maximum(self, a, b):
        """The larger of a and b; a if both are equal."""
        a, b = self.lift_value(a), self.lift_value(b)
        return self.select(a < b, b, a)

    def section(self, name):
        """Context manager: what is computed inside belongs to the stage ``name``."""
        return nullcontext()


class Value:
    """A scalar with Python's arithmetic; each operation is its namespace's."""

    # NumPy scalars and arrays must not broadcast over a Value, but hand the operation to it.
    __array_ufunc__ = None

    def __init__(self, namespace):
        self.namespace = namespace

    def _binary(self, operation, a, b):
        lift = self.namespace.lift_value
        return operation(lift(a), lift(b))

    def __add__(self, other):
        return self._binary(self.namespace.add, self, other)

    def __radd__(self, other):
        return self._binary(self.namespace.add, other, self)

    def __sub__(self, other):
        return self._binary(self.namespace.subtract, self, other)

    def __rsub__(self, other):
        return self._binary(self.namespace.subtract, other, self)

    def __mul__(self, other):
        return self._binary(self.namespace.multiply, self, other)

    def __rmul__(self, other):
        return self._binary(self.namespace.multiply, other, self)

    def __truediv__(self, other):
        return self._binary(self.namespace.divide, self, other)

    def __rtruediv__(self, other):
        return self._binary(self.namespace.divide, other, self)

    def __neg__(self):
        return self.namespace.negate(self)

    def __lt__(self, other):
        return self.namespace.is_negative(self - other)

    def __gt__(self, other):
        return self.namespace.is_negative(other - self)

    def __bool__(self):
        raise TypeError("a kernel's value is not known while the kernel runs: use xp.select")
