"""Operators of a pool: the operations that they offer to kernels, and the components that compute them."""

import operator
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

__all__ = ["FUNCTIONS", "KINDS", "OPERATIONS", "Operation", "Operator", "meaning"]


@dataclass(frozen=True)
class Operation:
    """An operation that an operator offers to kernels as ``xp.<name>``.

    Operators may offer the same operation, each with its own twin and mode.

    Attributes
    ----------
    name : str
        Name in kernels, graphs and listings.
    twin : callable
        Bit-exact function of the operator's component and of arrays of the format's dtype; returns the array of
        results.
    float64 : callable
        Function of float64 arrays; returns the array of results.
    operands : int
        Number of operands, 1 or 2, without the condition.
    fallback : callable
        Function of ``xp`` and values; returns the result from other operators, for a pool without this one. None: other
        operators cannot compute it.
    mode : str
        Member of the component that is high for this operation, if the component has several operations.
    spreads : bool
        True if an operand that is infinite or NaN always gives a result that is infinite or NaN.
    takes_condition : bool
        True if the last operand is a condition: only its sign counts.
    gives_condition : bool
        True if the result is a condition of the kernel: only its sign counts.
    rounded : bool
        False if the results of the operator are often not those of ``float64``, rounded.
    """

    name: str
    twin: Callable = field(compare=False)
    float64: Callable
    operands: int = 2
    fallback: Callable | None = None
    mode: str = field(default="", compare=False)
    spreads: bool = False
    takes_condition: bool = False
    gives_condition: bool = False
    rounded: bool = field(default=True, compare=False)

    def check(self, given):
        """Raise TypeError unless ``given``, the operands of a call, are as many as the operation takes."""
        wanted = self.operands + self.takes_condition
        if len(given) != wanted:
            raise TypeError(f"xp.{self.name} takes {wanted} operand{'s' * (wanted > 1)}, not {len(given)}")


OPERATIONS: dict[str, Operation] = {}
"""All operations by name; the definition of an operator adds its operations."""

FUNCTIONS: dict[str, Callable] = {}
"""Further names for kernels. Each maps to a function of ``xp`` and operands that consists of operations."""

KINDS: dict[str, type["Operator"]] = {}
"""All kinds of operators by name; the definition of an operator adds it."""

_DEFINED_BY: dict[str, tuple[str, str]] = {}
"""Name of an operation or a function to the module and the qualified name of the operator that defines it."""

_OTHER_MEANINGS = {"input", "state", "constant", "apply", "call", "is_negative", "lift", "lift_value",
                   "negate", "pool", "section", "subtract"}
"""Names that mean something else in graphs and in the namespaces of kernels: no operation can have them."""


def meaning(name):
    """The Operation, or the function of FUNCTIONS, that is ``xp.<name>``. Raises: AttributeError if it is unknown."""
    known = OPERATIONS | FUNCTIONS
    if name not in known:
        raise AttributeError(f"kernels have no operation {name!r}: choose from {', '.join(sorted(known))}")
    return known[name]


@dataclass(frozen=True)
class Operator:
    """Base of the kinds of operators: frozen dataclasses whose fields are count and timing parameters.

    Defining a subclass makes its operations known to kernels, wherever its file is. A class of the same module and
    name replaces the one before it, as after a reload.

    Attributes
    ----------
    name : str
        Name of the instance in the Verilog; several instances are numbered.
    component : type
        The circuit, a ``Described``. It takes the format of the numbers and the timing parameters by name. It has the
        members ``start`` and ``result``, those of ``operands``, the modes of the operations, and ``condition`` if an
        operation takes one. It also has ``latency`` and ``interval``.
    operations : tuple of Operation
        The operations that the component computes.
    functions : dict
        Further names for kernels. Each maps to a function of ``xp`` and operands that consists of operations.
    operands : tuple of str
        Members of the component that take the operands, the condition excluded: one or two.
        An operation of one operand gets it at both.
    direct : bool
        True if results go directly to the result bus, and can be operands in the cycle in which they come out. The
        results of operators that are seldom used are registered once more on the way.
    beside : str
        Name of the operator whose pairs of read ports this one shares; empty if it has its own.
    can_be_quiet : bool
        True if the component has the parameter ``quiet``, for results that are zero while ``done`` is low.
    count : int
        Number of instances.

    Raises: ValueError for a class that gives an operation of another operator another meaning, or defines a name with
    another meaning in kernels, and for operands that are not one or two members.
    """

    name: ClassVar[str]
    component: ClassVar[Callable[..., Any]]
    operations: ClassVar[tuple[Operation, ...]]
    functions: ClassVar[dict[str, Callable]] = {}
    operands: ClassVar[tuple[str, ...]] = ("a", "b")
    direct: ClassVar[bool] = False
    beside: ClassVar[str] = ""
    can_be_quiet: ClassVar[bool] = False
    count = 1

    def __init_subclass__(cls, **arguments):
        super().__init_subclass__(**arguments)
        cls._check_operands()
        owner = cls.__module__, cls.__qualname__
        known, offered = OPERATIONS | FUNCTIONS, {each.name: each for each in cls.operations} | cls.functions
        for name, each in offered.items():
            if name in _OTHER_MEANINGS:
                raise ValueError(f"{cls.__name__} must not define {name}: the name has another meaning in kernels")
            if known.get(name, each) != each and _DEFINED_BY[name] != owner:
                raise ValueError(f"{cls.__name__} must not define {name}: another operator already defines it")
        # The class may be there already, from before its module was loaded again.
        for name in [name for name, other in _DEFINED_BY.items() if other == owner]:
            for names in OPERATIONS, FUNCTIONS, _DEFINED_BY:
                names.pop(name, None)
        for name in [name for name, kind in KINDS.items() if (kind.__module__, kind.__qualname__) == owner]:
            KINDS.pop(name)
        for name in offered:
            _DEFINED_BY.setdefault(name, owner)
        OPERATIONS.update({each.name: each for each in cls.operations if _DEFINED_BY[each.name] == owner})
        FUNCTIONS.update(cls.functions)
        if "name" in vars(cls):
            KINDS.setdefault(cls.name, cls)

    @classmethod
    def _check_operands(cls):
        if not isinstance(cls.operands, tuple) or not 1 <= len(cls.operands) <= 2:
            raise ValueError(f"operands of {cls.__name__} must be a tuple of one or two members, not {cls.operands!r}")
        for operation in cls.operations:
            if not 1 <= operation.operands <= len(cls.operands):
                raise ValueError(f"operation {operation.name} must take 1 to {len(cls.operands)} operands, as "
                                 f"{cls.__name__} has, not {operation.operands!r}")

    def __post_init__(self):
        if operator.index(self.count) < 1:
            raise ValueError(f"count of {self.name} must be at least 1, not {self.count!r}")

    def make(self, format, *, quiet=False) -> Any:
        """A new component for numbers of a format; with ``quiet``, its results are zero while ``done`` is low.

        Raises: TypeError and ValueError for parameters that the component refuses.
        """
        timing = {parameter.name: getattr(self, parameter.name) for parameter in fields(self)
                  if parameter.name != "count"}
        return self.component(format, **timing, **({"quiet": True} if quiet else {}))
