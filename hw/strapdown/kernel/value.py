"""Scalars of a kernel. Python's operators call the namespace, which gives them their meaning."""

from abc import ABC, abstractmethod
from contextlib import nullcontext
from functools import partial
from numbers import Real

from .operators import OPERATIONS, Operation, meaning

__all__ = ["Namespace", "Value"]


class Namespace(ABC):
    """Base of the namespaces whose values are not plain numbers.

    Every operation of ``OPERATIONS`` is a method that takes values and numbers. The pool's unit for it computes it;
    if the pool has no such unit, other units do, where that is possible.

    Parameters
    ----------
    pool : Pool
        The available units.

    Raises: AttributeError for an unknown operation; ValueError for one that the pool cannot compute; TypeError for a
    wrong number of operands.
    """

    def __init__(self, pool):
        self.pool = pool
        self._replaced: list[str] = []  # Operations whose fallbacks are being computed, outermost first.

    @abstractmethod
    def lift(self, number):
        """A number as a value."""

    @abstractmethod
    def negate(self, a):
        """-a."""

    @abstractmethod
    def apply(self, operation, *operands):
        """Result of the pool's unit for ``operation``, a name; the operands are values."""

    @abstractmethod
    def is_negative(self, a):
        """Condition: the sign bit of ``a`` is set."""

    @abstractmethod
    def select(self, condition, a, b):
        """``a`` where the condition holds, else ``b``."""

    def lift_value(self, operand):
        """``operand`` as a value of this namespace; TypeError if it is not a number."""
        if isinstance(operand, Value):
            if operand.namespace is not self:
                raise TypeError("a kernel must not mix values of two namespaces")
            return operand
        if isinstance(operand, Real):
            return self.lift(float(operand))
        raise TypeError(f"a kernel computes with numbers, not with {operand!r}")

    def __getattr__(self, name):
        known = meaning(name)
        return partial(self.call, known) if isinstance(known, Operation) else partial(known, self)

    def call(self, operation, *operands):
        """Result of an Operation on values or numbers: a value, or a condition if the operation gives one.

        Raises: TypeError for a wrong number of operands; ValueError if the pool cannot compute it.
        """
        operation.check(operands)
        values = [self.lift_value(operand) for operand in operands]
        if operation.name in self.pool.operations:
            result = self.apply(operation.name, *values)
            return self.is_negative(result) if operation.gives_condition else result
        if operation.fallback is None or operation.name in self._replaced:
            wanted, *_ = *self._replaced, operation.name
            raise ValueError(f"the pool has no operator for {wanted}: add one to its operators")
        # A quotient and a reciprocal replace each other.
        self._replaced.append(operation.name)
        try:
            return operation.fallback(self, *values)
        finally:
            self._replaced.pop()

    def add(self, a, b):
        """a + b."""
        return self.call(OPERATIONS["add"], a, b)

    def subtract(self, a, b):
        """a - b: the sum of a and -b."""
        return self.add(a, self.negate(b))

    def section(self, name):
        """Context manager: operations inside belong to the stage ``name``."""
        return nullcontext()


class Value:
    """A scalar with Python's arithmetic; its namespace performs each operation."""

    # NumPy scalars and arrays must not broadcast over a Value; the Value performs the operation.
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
        return self.namespace.less(self, other)

    def __gt__(self, other):
        return self.namespace.less(other, self)

    def __bool__(self):
        raise TypeError("a kernel's value is not known while the kernel runs: use xp.select")
