"""A system: equations with names for what goes in, what is kept and what comes out."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .numeric import Float64, Twin
from .trace import Tracer

__all__ = ["System", "leaves"]


def leaves(tree):
    """The leaves of nested tuples and dicts, in order."""
    if isinstance(tree, dict):
        tree = tuple(tree.values())
    if not isinstance(tree, tuple):
        return [tree]
    return [leaf for branch in tree for leaf in leaves(branch)]


def shaped(tree, function):
    """Nested tuples like ``tree`` (dicts become tuples), each leaf replaced by function(leaf)."""
    if isinstance(tree, tuple | list):
        return tuple(shaped(branch, function) for branch in tree)
    return function(tree)


@dataclass(frozen=True)
class System:
    """Equations and their interface.

    Attributes
    ----------
    name, title : str
        Name of the Verilog module, and one line on what it does.
    equations : callable
        Kernel ``equations(xp, **inputs, **state)``; returns an object with dicts ``outputs``,
        ``state`` and ``status``.
    inputs, outputs : dict
        Argument or result name to its port names, nested as the kernel nests it.
    state : dict
        Argument name to the names of its words, nested likewise.
    reset : dict
        State word to its value after reset.
    status : tuple of str
        Conditions of the kernel that are shown as status bits, lowest first.
    sections : tuple of str
        Stages of the kernel, in order.
    start, finish : str
        Ports of the handshake.
    kernels : tuple of callable
        The functions whose docstrings explain the equations.
    meanings : dict
        Argument or result name to meaning, unit and frame of its ports.
    status_port : str
        Port of the status bits; a system that has one refuses an update in which a number is
        not finite. Empty: NaN and infinity go their way to the outputs.
    """

    name: str
    title: str
    equations: Callable
    inputs: dict[str, object]
    outputs: dict[str, object]
    sections: tuple[str, ...]
    start: str
    finish: str
    kernels: tuple[Callable, ...] = ()
    meanings: dict[str, str] = field(default_factory=dict)
    state: dict[str, object] = field(default_factory=dict)
    reset: dict[str, float] = field(default_factory=dict)
    status: tuple[str, ...] = ()
    status_port: str = ""

    @property
    def input_ports(self):
        """Names of the data inputs, in order."""
        return tuple(leaves(self.inputs))

    @property
    def output_ports(self):
        """Names of the data outputs, in order."""
        return tuple(leaves(self.outputs))

    @property
    def port_meanings(self):
        """Data port to its meaning, unit and frame."""
        return {port: self.meanings.get(name, "") for group in (self.inputs, self.outputs)
                for name, tree in group.items() for port in leaves(tree)}

    def trace(self, pool):
        """The graph of the equations, in the operations and the format of a pool."""
        xp = Tracer(pool, self.sections)
        update = self.equations(
            xp,
            **{name: shaped(ports, lambda port: xp.source("input", port)) for name, ports in self.inputs.items()},
            **{name: shaped(words, lambda word: xp.source("state", word)) for name, words in self.state.items()})
        next_state: dict = {}
        for name, words in self.state.items():
            for word, symbol in zip(leaves(words), leaves(update.state[name]), strict=True):
                next_state[word] = xp.settled(symbol, word)
        outputs = {port: xp.settled(symbol)
                   for name, ports in self.outputs.items()
                   for port, symbol in zip(leaves(ports), leaves(update.outputs[name]), strict=True)}
        return xp.graph(
            inputs=self.input_ports, outputs=outputs, state=dict(self.reset), next_state=next_state,
            status={name: update.status[name].operand for name in self.status})

    def update_float64(self, inputs, state=None):
        """One update of the equations in float64: the kernel's truth.

        ``inputs`` and ``state`` map ports and words to arrays; the result maps output ports and
        state words to arrays and status names to bools.
        """
        return self._update(Float64(), np.float64, lambda array: array, inputs, state)

    def update_twin(self, pool, inputs, state=None):
        """One update as the circuit computes it, every bit: as ``update_float64``, with arrays of the format's dtype.

        An update in which a number that the circuit writes is not finite is refused by a system
        with a status port: ``refused`` tells which samples, their outputs and state are NaN.
        """
        xp = Twin(pool)
        with np.errstate(all="ignore"):
            update = self._update(xp, xp.given, lambda value: value.array, inputs, state)
            finite = xp.finite
            for array in inputs.values():
                finite = finite & np.isfinite(xp.given(array).array)
        if self.status_port:
            update["refused"] = ~finite
        return update

    def _update(self, xp, wrap, unwrap, inputs, state):
        state = {} if state is None else state
        update = self.equations(
            xp,
            **{name: shaped(ports, lambda port: wrap(inputs[port])) for name, ports in self.inputs.items()},
            **{name: shaped(words, lambda word: wrap(state[word])) for name, words in self.state.items()})
        results: dict = {}
        for names, values in (self.outputs, update.outputs), (self.state, update.state):
            for name, tree in names.items():
                results |= {leaf: unwrap(value) for leaf, value in zip(leaves(tree), leaves(values[name]), strict=True)}
        return results | {name: update.status[name] for name in self.status}
