"""Traces of kernels: a kernel runs once with symbols in place of numbers, which gives the graph of its operations."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from .operators import OPERATIONS
from .value import Namespace, Value

__all__ = ["Node", "Operand", "Graph", "Origin", "Tracer"]

EQUATIONS = "strapdown.algorithms."
"""Beginning of the names of this package's modules whose lines count as the origin of an operation."""


class Origin(NamedTuple):
    """A line of a kernel."""

    file: str
    line: int
    function: str

    def __str__(self):
        return f"{self.file}:{self.line} {self.function}"


@dataclass(frozen=True, eq=False)
class Node:
    """One value of a graph: the result of an operation, an input, a state word or a constant.

    ``operation`` is an operation of a pool's units, or input, state or constant. ``label`` is the
    port, state word or number of the last three.
    ``origin`` is the chain of kernel lines that caused the operation, outermost first.
    """

    operation: str
    # Not in the representation, which would show a shared operand once for each path that leads to it.
    operands: tuple["Operand", ...] = field(default=(), repr=False)
    label: str = ""
    value: float = 0.0
    section: str = ""
    origin: tuple[Origin, ...] = ()

    @property
    def computed(self):
        """True if a unit has to compute it."""
        return self.operation not in ("input", "state", "constant")

    @property
    def condition(self):
        """The Operand whose sign is the condition; None if the operation has no condition."""
        return self.operands[-1] if self._takes_condition else None

    @property
    def arguments(self):
        """The operands that are numbers, without the condition."""
        return self.operands[:-1] if self._takes_condition else self.operands

    @property
    def spreads(self):
        """True if an operand that is infinite or NaN always gives a result that is infinite or NaN."""
        return self.computed and OPERATIONS[self.operation].spreads

    @property
    def _takes_condition(self):
        return self.computed and OPERATIONS[self.operation].takes_condition

    def __str__(self):
        if not self.computed:
            return self.label
        arguments = ", ".join(f"{'-' * operand.negated}{operand.node.label or '·'}" for operand in self.operands)
        return f"{self.operation}({arguments})"


class Operand(NamedTuple):
    """A node as an operand of an operation: its value, or its value with the opposite sign."""

    node: Node
    negated: bool = False


@dataclass(frozen=True)
class Graph:
    """The operations of one system, in an order that respects their dependences.

    Attributes
    ----------
    nodes : tuple of Node
        All values that are needed, operands before results.
    inputs : tuple of str
        Input ports, in order.
    state : dict
        Maps each state word to its value after reset.
    next_state, outputs, status : dict
        Map each state word, output port or status bit to the node that gives it. A status bit is the
        sign of its operand.
    sections : tuple of str
        Stages, in order.
    """

    nodes: tuple[Node, ...]
    inputs: tuple[str, ...]
    outputs: dict[str, Node]
    state: dict[str, float] = field(default_factory=dict)
    next_state: dict[str, Node] = field(default_factory=dict)
    status: dict[str, Operand] = field(default_factory=dict)
    sections: tuple[str, ...] = ()

    @property
    def reset_outputs(self):
        """Maps each output port to its value after a reset: that of the state word that it equals, else zero."""
        words = {node: word for word, node in self.next_state.items()}
        return {port: self.state[words[node]] if node in words else 0.0 for port, node in self.outputs.items()}

    def count(self):
        """Number of operations of each kind."""
        kinds = [node.operation for node in self.nodes if node.computed]
        return {kind: kinds.count(kind) for kind in sorted(set(kinds))}


class Symbol(Value):
    """A value that is not known yet."""

    def __init__(self, namespace, operand):
        super().__init__(namespace)
        self.operand = operand


class Condition(NamedTuple):
    """True where the sign bit of an operand is set."""

    operand: Operand

    def __bool__(self):
        raise TypeError("a kernel's value is not known while the kernel runs: use xp.select")


class Tracer(Namespace):
    """The namespace that records the operations of a kernel; equal operations are recorded once.

    Sign changes cost nothing, because the operand that reads the value makes them.

    Parameters
    ----------
    pool : Pool
        Supplies the number format and the available operations.
    sections : tuple of str
        Stages that the kernel may name; operations outside of them belong to the first stage.
    modules : set of str
        Names of modules outside this package whose lines also count as the origin of an operation.
    """

    def __init__(self, pool, sections, modules=frozenset()):
        super().__init__(pool)
        self._sections = sections
        self._modules = frozenset(modules)
        self._section = sections[0]
        self._nodes: dict[tuple, Node] = {}
        self._words: dict[Node, str] = {}

    # Sources of values.

    def lift(self, number):
        magnitude = float(self.pool.format.array(abs(number)))
        label = f"{magnitude:.{self.pool.format.decimal_digits}g}"
        return self._symbol(Operand(self._node("constant", label=label, value=magnitude), number < 0))

    def source(self, operation, label):
        """The symbol of an input port or a state word."""
        return self._symbol(Operand(self._node(operation, label=label)))

    # Operations.

    def negate(self, a):
        return self._symbol(Operand(a.operand.node, not a.operand.negated))

    def add(self, a, b):
        # x - 0 is x for every x; ``subtract`` makes -0 from the constant 0.
        if b.operand.node.operation == "constant" and b.operand.node.value == 0 and b.operand.negated:
            return a
        return super().add(a, b)

    def apply(self, operation, *operands):
        return self._compute(operation, *operands)

    def is_negative(self, a):
        return Condition(a.operand)

    def select(self, condition, a, b):
        return self._compute("select", self.lift_value(a), self.lift_value(b), condition=condition.operand)

    @contextmanager
    def section(self, name):
        """Context manager: operations inside belong to the stage ``name``."""
        if name not in self._sections:
            raise ValueError(f"section must be one of {', '.join(self._sections)}, not {name!r}")
        outer, self._section = self._section, name
        yield
        self._section = outer

    # The graph.

    def settled(self, symbol, word=None):
        """A computed node with the value of ``symbol``: a copy if the value is an input, a state word or negated.

        Each state ``word`` gets a separate node, because a node is written to one address.
        """
        operand = symbol.operand
        shared = word is not None and self._words.setdefault(operand.node, word) != word
        if operand.negated or not operand.node.computed or shared:
            return self._node("copy", (operand,), label=word or "")
        return operand.node

    def graph(self, **interface):
        """The graph of the nodes that ``outputs``, ``next_state`` and ``status`` need."""
        wanted = [*interface["outputs"].values(), *interface.get("next_state", {}).values(),
                  *(operand.node for operand in interface.get("status", {}).values())]
        needed = set()
        while wanted:
            node = wanted.pop()
            if node not in needed:
                needed.add(node)
                wanted += [operand.node for operand in node.operands]
        nodes = tuple(node for node in self._nodes.values() if node in needed)
        return Graph(nodes=nodes, sections=self._sections, **interface)

    def _compute(self, operation, *symbols, condition=None):
        operands = tuple(symbol.operand for symbol in symbols)
        if condition is not None:
            operands += (condition,)
        return self._symbol(Operand(self._node(operation, operands)))

    def _node(self, operation, operands=(), label="", value=0.0):
        key = (operation, operands, label)
        if key not in self._nodes:
            self._nodes[key] = Node(operation, operands, label, value, self._section, tuple(_origin(self._modules)))
        return self._nodes[key]

    def _symbol(self, operand):
        return Symbol(self, operand)


def _origin(modules) -> Iterator[Origin]:
    """The kernel lines on the call stack, outermost first; those of ``modules`` and of the package's equations."""
    chain = []
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        module = frame.f_globals.get("__name__", "")
        if module.startswith(EQUATIONS):
            file = module.removeprefix("strapdown.").replace(".", "/") + ".py"
            chain.append(Origin(file, frame.f_lineno, frame.f_code.co_name))
        elif module in modules:
            # A user's file: its name without the path on this machine.
            chain.append(Origin(Path(frame.f_code.co_filename).name, frame.f_lineno, frame.f_code.co_name))
        frame = frame.f_back
    # A generator expression inside a kernel function has a separate frame: keep that of the function.
    named = [origin for origin in chain if not origin.function.startswith("<")]
    yield from reversed(named or chain)
