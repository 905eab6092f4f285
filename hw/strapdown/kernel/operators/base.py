"""What an operator of a pool is: the operations that it offers to kernels, and the component that computes them."""

import operator
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

__all__ = ["FUNCTIONS", "OPERATIONS", "Operation", "Operator", "meaning"]


@dataclass(frozen=True)
class Operation:
    """What an operator computes for kernels: ``xp.<name>``.

    Attributes
    ----------
    name : str
        Name in kernels, graphs and listings.
    twin : callable
        The operator's component and arrays of the format's dtype to the array of results, bit for bit.
    float64 : callable
        Float64 arrays to the array of results.
    fallback : callable
        ``xp`` and values to the result that other operators give in a pool without this one. None: there is no way.
    mode : str
        Member of the component that is high for this operation, if it has several.
    spreads : bool
        Whether an operand that is infinite or NaN always gives a result that is infinite or NaN.
    takes_condition : bool
        Whether the last operand is a condition: only its sign counts.
    gives_condition : bool
        Whether the result is a condition of the kernel: only its sign counts.
    """

    name: str
    twin: Callable
    float64: Callable
    fallback: Callable | None = None
    mode: str = ""
    spreads: bool = False
    takes_condition: bool = False
    gives_condition: bool = False


OPERATIONS: dict[str, Operation] = {}
"""All operations by name; an operator enters its own where it is defined."""

FUNCTIONS: dict[str, Callable] = {}
"""What kernels can ask for beside them: name to a function of ``xp`` and operands, made of operations."""


def meaning(name):
    """The Operation, or the function of FUNCTIONS, that is ``xp.<name>``. Raises: AttributeError if there is none."""
    known = OPERATIONS | FUNCTIONS
    if name not in known:
        raise AttributeError(f"kernels have no operation {name!r}: choose from {', '.join(sorted(known))}")
    return known[name]


@dataclass(frozen=True)
class Operator:
    """Base of the kinds of operators: frozen dataclasses whose fields are count and timing parameters.

    Defining a subclass makes its operations known to kernels.

    Attributes
    ----------
    name : str
        Name of its instance in the Verilog; several instances are numbered.
    component : type
        The circuit. It takes the format of the numbers and the timing parameters by name, and has members
        ``start`` and ``result``, those of ``operands``, the modes of the operations and ``condition`` if an
        operation takes one; and ``latency`` and ``interval``.
    operations : tuple of Operation
        What the component computes.
    functions : dict
        What kernels can ask for beside that: name to a function of ``xp`` and operands, made of operations.
    operands : tuple of str
        Members of the component that take the operands, the condition excluded: one or two.
    direct : bool
        Whether results go straight to the result bus, and can be operands as they come out. Those of
        operators that are seldom used are registered once more on the way.
    beside : str
        Name of the operator whose pairs of read ports it shares; empty for one that has its own.
    count : int
        How many there are of it.
    """

    name: ClassVar[str]
    component: ClassVar[Callable[..., Any]]
    operations: ClassVar[tuple[Operation, ...]]
    functions: ClassVar[dict[str, Callable]] = {}
    operands: ClassVar[tuple[str, ...]] = ("a", "b")
    direct: ClassVar[bool] = False
    beside: ClassVar[str] = ""
    count = 1

    def __init_subclass__(cls, **arguments):
        super().__init_subclass__(**arguments)
        for name, each in ({operation.name: operation for operation in cls.operations} | cls.functions).items():
            if (OPERATIONS | FUNCTIONS).get(name, each) is not each:
                raise ValueError(f"{cls.__name__} must not define {name} anew: another operator has it already")
        OPERATIONS.update({operation.name: operation for operation in cls.operations})
        FUNCTIONS.update(cls.functions)

    def __post_init__(self):
        if operator.index(self.count) < 1:
            raise ValueError(f"count of {self.name} must be at least 1, not {self.count!r}")

    def make(self, format) -> Any:
        """A fresh component for numbers of a format.

        Raises: TypeError and ValueError for parameters that it refuses.
        """
        timing = {parameter.name: getattr(self, parameter.name) for parameter in fields(self)
                  if parameter.name != "count"}
        return self.component(format, **timing)
