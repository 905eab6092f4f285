"""A system: equations, and the names of their inputs, state and outputs."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .numeric import Float64, Twin
from .operators import OPERATIONS, integer_bits
from .pool import Pool
from .refusals import Refusals
from .trace import Tracer

__all__ = ["IGNORED", "REFUSED", "RESTARTED", "System", "leaves", "matrix", "vector"]

ENGINE_BITS = REFUSED, IGNORED, RESTARTED = "refused", "ignored", "restarted"
"""Status bits of the engines."""

REFUSALS = "refusals in a row"
"""Name of the count of refusals beside the state; no port or word can have it."""

FIRST_BLOCK, LARGEST_BLOCK = 256, 4096
"""Number of samples of a run that are computed at once: the first, and the greatest."""


def leaves(tree):
    """The leaves of nested tuples and dicts, in order."""
    if isinstance(tree, dict):
        tree = tuple(tree.values())
    if not isinstance(tree, tuple):
        return [tree]
    return [leaf for branch in tree for leaf in leaves(branch)]


def shaped(tree, function):
    """``tree`` as nested tuples (dicts become tuples), with each leaf replaced by function(leaf)."""
    if isinstance(tree, tuple | list):
        return tuple(shaped(branch, function) for branch in tree)
    return function(tree)


def _shape(tree):
    """Shape of an array with one element per leaf of nested tuples."""
    return (len(tree), *_shape(tree[0])) if isinstance(tree, tuple) else ()


def vector(pattern, names="xyz"):
    """Names of a vector's components: ``pattern`` with each of ``names`` in place of its braces."""
    return tuple(pattern.format(name) for name in names)


def matrix(pattern):
    """Names of the elements of a 3×3 matrix, by rows: ``pattern`` with 11 to 33 in place of its braces."""
    return tuple(vector(pattern, (f"{row}{column}" for column in "123")) for row in "123")


class Rounded(Float64):
    """The namespace in which a kernel computes on NumPy numbers of a pool's format.

    Operators whose results are often not those of NumPy, rounded, are their twins. What the pool has no operator for is
    computed by others, as in the circuit.
    """

    def __init__(self, pool):
        self._pool, self._dtype, self._operations = pool, pool.format.dtype, pool.operations
        self._twins = {operation.name for each in pool.operators for operation in each.operations
                       if not operation.rounded}

    def __getattr__(self, name):
        if name in self._twins:
            return partial(self._twin, name)
        operation = OPERATIONS.get(name)
        if operation and operation.fallback and name not in self._operations:
            return partial(operation.fallback, self)
        return super().__getattr__(name)

    def _twin(self, name, *operands):
        return self._pool.compute(name, *(self._pool.format.array(operand) for operand in operands))[()]

    def from_integer(self, integer):
        """An integer as a number of the type."""
        return np.asarray(integer).astype(self._dtype)[()]

    def select(self, condition, a, b):  # type: ignore[override]
        """Like NumPy's ``where``, but two Python floats become numbers of the type, not float64."""
        return np.where(condition, a, b).astype(self._dtype)[()]


@dataclass(frozen=True)
class System:
    """Equations and their interface.

    Attributes
    ----------
    name, title : str
        Name of the Verilog module, and its function in one line.
    equations : callable
        Kernel ``equations(xp, **inputs, **state)``; returns an object with dicts ``outputs``,
        ``state`` and ``status``.
    inputs, outputs : dict
        Maps each argument or result to its port names, nested as in the kernel.
    state : dict
        Maps each argument to the names of its words, nested as in the kernel.
    reset : dict
        Maps each state word to its value after reset; omitted words are zero.
    status : tuple of str
        Conditions of the kernel that become status bits, lowest first.
    sections : tuple of str
        Sections of the kernel, in order.
    start, finish : str
        Ports of the handshake.
    kernels : tuple of callable
        The functions whose docstrings describe the equations in the header.
    meanings : dict
        Maps each argument or result to meaning, unit and frame of its ports.
    integers : dict
        Maps each input port that takes an integer in two's complement, such as the word of an analogue-to-digital
        converter, to its number of bits, at least 2. The equations get the number; the pool needs a Converter.
    status_port : str
        Port of the status bits. A system with a status port refuses an update in which a number is
        not finite. Empty: NaN and infinity propagate to the outputs.
    status_order : tuple of str
        Names of all bits of the status port, lowest first. A bit of `ENGINE_BITS` that the engine does not have is left
        out; a bit that is neither the engine's nor the system's stays low, for another circuit. Empty: the bits of the
        engine, in its order.
    restart_after : int
        Number of updates, refused in a row although every input was finite, after which the state starts again from its
        reset values. Outputs hold until the next update that is not refused. 0: never.
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
    integers: dict[str, int] = field(default_factory=dict)
    state: dict[str, object] = field(default_factory=dict)
    reset: dict[str, float] = field(default_factory=dict)
    status: tuple[str, ...] = ()
    status_port: str = ""
    status_order: tuple[str, ...] = ()
    restart_after: int = 0

    def __post_init__(self):
        names = [self.start, self.finish, *self.input_ports, *self.output_ports, *filter(None, [self.status_port])]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{self.name} has two ports called {twice[0]!r}")
        words = dict.fromkeys(leaves(self.state), 0.0)
        if unknown := [word for word in self.reset if word not in words]:
            raise ValueError(f"reset names {unknown[0]!r}, which is not a word of the state")
        object.__setattr__(self, "reset", words | self.reset)
        if self.restart_after < 0:
            raise ValueError(f"restart_after must be 0 or more, not {self.restart_after!r}")
        if self.restart_after and not (self.state and self.status_port):
            raise ValueError(f"restart_after must be 0, not {self.restart_after!r}: {self.name} has no state, or no "
                             "status port and so no refused updates")
        if missing := [name for name in (*self.status, REFUSED, IGNORED)
                       if self.status_order and name not in self.status_order]:
            raise ValueError(f"status_order must name {missing[0]!r}, which is a status bit")
        for port, bits in self.integers.items():
            if port not in self.input_ports:
                raise ValueError(f"integers names {port!r}, which is not an input port")
            if bits < 2:
                raise ValueError(f"integer port {port} must have at least 2 bits, not {bits!r}")

    def renamed(self, names):
        """The same system with other names of ports.

        ``names`` maps ports to their new names; other ports keep theirs. Raises: ValueError for a port that does not
        exist, or if two ports get the same name.
        """
        ports = (self.start, self.finish, *self.input_ports, *self.output_ports, self.status_port)
        if unknown := [port for port in names if port not in ports]:
            raise ValueError(f"{self.name} has no port {unknown[0]!r}")

        def name(port):
            return names.get(port, port)

        return replace(self, start=name(self.start), finish=name(self.finish), status_port=name(self.status_port),
                       inputs={key: shaped(tree, name) for key, tree in self.inputs.items()},
                       outputs={key: shaped(tree, name) for key, tree in self.outputs.items()},
                       integers={name(port): bits for port, bits in self.integers.items()})

    def restarting(self, after):
        """The same system with ``restart_after``; without state or status port no update is refused, and it is 0."""
        return replace(self, restart_after=after if self.state and self.status_port else 0)

    @property
    def input_ports(self):
        """Names of the data inputs, in order."""
        return tuple(leaves(self.inputs))

    @property
    def output_ports(self):
        """Names of the data outputs, in order."""
        return tuple(leaves(self.outputs))

    def ordered_status(self, bits):
        """Status bits of an engine, in the order of ``status_order``."""
        return tuple(name for name in self.status_order or bits if name in bits or name not in ENGINE_BITS)

    def input_width(self, port, format):
        """Bits of an input port of an engine for numbers of a format."""
        return self.integers.get(port, format.width)

    def input_bits(self, port, format, values):
        """Bits at an input port as unsigned integers, from numbers, or from integers for an integer port."""
        if port in self.integers:
            return np.asarray(values, np.int64).view(np.uint64) & np.uint64((1 << self.integers[port]) - 1)
        return format.to_bits(values)

    def finite_inputs(self, format, inputs):
        """True where all floating-point inputs are finite, after rounding to a format; integers are."""
        with np.errstate(all="ignore"):
            finite = [np.isfinite(format.array(values)) for port, values in inputs.items() if port not in self.integers]
        return np.logical_and.reduce(np.broadcast_arrays(True, *finite))

    @property
    def port_meanings(self):
        """Maps each data port to its meaning, unit and frame."""
        return {port: self.meanings.get(name, "") for group in (self.inputs, self.outputs)
                for name, tree in group.items() for port in leaves(tree)}

    @property
    def _own_modules(self):
        """Names of the modules outside this package that define the equations."""
        package = __name__.partition(".")[0]
        modules = {function.__module__ for function in (self.equations, *self.kernels)}
        return {module for module in modules if module.partition(".")[0] != package}

    def bind(self, **values):
        """Numbers for all input ports, from arrays with the nesting of the kernel's arguments.

        Parameters
        ----------
        **values
            For each name in ``inputs`` an array of shape (..., 3) for a vector of three, (..., 3, 3) for a
            matrix, (...) for a scalar, in the unit of its ports. The leading axes broadcast.

        Returns
        -------
        dict
            Maps each input port to an array of the shape of the leading axes.

        Raises: TypeError for a name that is missing or unknown; ValueError for a shape that does not fit.
        """
        if missing := [name for name in self.inputs if name not in values]:
            raise TypeError(f"{self.name} lacks the input {missing[0]!r}: give {', '.join(self.inputs)}")
        return self._bound("input", self.inputs, values)

    def bind_state(self, **values):
        """Numbers for all words of the state, like ``bind`` for inputs; an omitted name has its reset value.

        Raises: TypeError for a name that is unknown; ValueError for a shape that does not fit.
        """
        reset = self.read(self.reset, self.state)
        return self._bound("state", self.state, reset | values)

    def read(self, result, names=None):
        """Arrays with the nesting of the kernel, from numbers by port or word: the inverse of ``bind``.

        Parameters
        ----------
        result : dict
            Maps each port or word to numbers, as returned by ``run``, ``update_twin``, ``update_float64`` and the
            drivers.
        names : dict, optional
            The ports to read: ``outputs`` by default; or ``inputs``, or ``state``.

        Returns
        -------
        dict
            Maps each name to an array of shape (..., 3) for a vector of three, (..., 3, 3) for a matrix, (...) for a
            scalar.
        """
        arrays = {}
        for name, tree in (self.outputs if names is None else names).items():
            stacked = np.stack(np.broadcast_arrays(*(result[leaf] for leaf in leaves(tree))), axis=-1)
            arrays[name] = stacked.reshape(stacked.shape[:-1] + _shape(tree))
        return arrays

    def _bound(self, kind, trees, values):
        """Maps each leaf to its array, for values by the names of ``trees``."""
        if unknown := [name for name in values if name not in trees]:
            raise TypeError(f"{self.name} has no {kind} {unknown[0]!r}: choose from {', '.join(trees)}")
        arrays: dict = {}
        leading = {}
        for name, tree in trees.items():
            array, shape = np.asarray(values[name]), _shape(tree)
            leading[name] = array.shape[:array.ndim - len(shape)]
            if array.shape != leading[name] + shape:
                wanted = ", ".join(("...", *map(str, shape)))
                raise ValueError(f"{self.name}: {kind} {name} must have the shape ({wanted}), not {array.shape}")
            flat = array.reshape(*leading[name], math.prod(shape))
            arrays |= {leaf: flat[..., index] for index, leaf in enumerate(leaves(tree))}
        try:
            common = np.broadcast_shapes(*leading.values())
        except ValueError:
            told = ", ".join(f"{name} {shape}" for name, shape in leading.items())
            raise ValueError(f"{self.name}: the leading axes must broadcast, not {told}") from None
        return {leaf: np.broadcast_to(array, common).copy() for leaf, array in arrays.items()}

    def trace(self, pool):
        """The graph of the equations, in the operations and the format of a pool.

        Raises: ValueError for an operation that the pool lacks, for an input port that has the name of a unit, and for
        an integer port that is too wide.
        """
        for unit in pool.units:
            if unit.name in self.input_ports:
                raise ValueError(f"input port {unit.name} must not have the name of an operator of the pool")
        for port, bits in self.integers.items():
            if bits > (most := integer_bits(pool.format)):
                raise ValueError(f"integer port {port} must have at most {most} bits in {pool.format.name}, not {bits}")
        xp = Tracer(pool, self.sections, modules=self._own_modules)
        update = self._evaluated(xp, lambda port: xp.source("input", port), lambda word: xp.source("state", word))
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
        """One update of the equations in float64.

        ``inputs`` and ``state`` map ports and words to arrays; the result maps output ports and
        state words to arrays and status names to bools.
        """
        return self._update(Float64(), np.float64, lambda array: array, inputs, state)

    def update_twin(self, pool, inputs, state=None):
        """One update, equal to the circuit in every bit: like ``update_float64``, in the format's dtype.

        A system with a status port refuses an update in which a number that the circuit writes is not
        finite: ``refused`` marks these updates. Outputs and state of refused updates have no meaning here.
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

    def run(self, pool: Pool, inputs: Mapping[str, ArrayLike],
            state: Mapping[str, ArrayLike] | None = None) -> tuple[dict, dict]:
        """Updates of the twin in order, one per sample, each from the state after the previous update.

        Parameters
        ----------
        pool : Pool
        inputs : dict
            Maps each input port to numbers of shape (N, ...), as from ``bind``: N samples; the other axes are
            independent runs.
        state : dict, optional
            State before the first sample, for example from an earlier ``run`` or from ``bind_state``; the reset
            state by default.

        Returns
        -------
        result : dict
            Maps each output port and state word to an array of the format's dtype, shape (N, ...), with the
            values after each update, and each status name to bools. A refused update (``refused``, if the system has
            a status port) does not change outputs and state, and has no other status. ``restarted``, if the system has
            ``restart_after``, marks the refused updates after which the state has its reset values.
        state : dict
            State after the last sample, outputs and the count of refusals included; another run can continue from it.

        Notes
        -----
        An update needs the state after the previous update, but the twin is fast only on many samples at
        once. NumPy's own arithmetic therefore predicts the states of a block of samples, one after the
        other, and the twin computes the whole block from the predicted states. The samples after the
        first wrong prediction are computed again, so the result never depends on the prediction.
        """
        fmt, words = pool.format, tuple(self.reset)
        ports = self._samples(
            {port: np.asarray(inputs[port]) if port in self.integers else fmt.from_bits(fmt.to_bits(inputs[port]))
             for port in self.input_ports})
        count, *lanes = ports[self.input_ports[0]].shape
        start = self.trace(pool).reset_outputs | self.reset | (state or {})
        held = {name: np.broadcast_to(fmt.array(start[name]), lanes) for name in (*self.output_ports, *words)}
        before = {word: held[word] for word in words}
        refusals = np.broadcast_to(start.get(REFUSALS, 0), lanes)
        blocks, first, size = [], 0, FIRST_BLOCK if words else count
        while first < count:
            block = {port: array[first:first + size] for port, array in ports.items()}
            guess = self._predicted(pool, block, before, refusals)
            with np.errstate(all="ignore"):
                twin = self.update_twin(pool, block, guess)
            shape = next(iter(block.values())).shape
            twin = {name: np.broadcast_to(values, shape) for name, values in twin.items()}
            refused = twin.setdefault("refused", np.zeros(shape, bool))
            restarted, counts = Refusals(self.restart_after, refusals).updates(refused, self.finite_inputs(fmt, block))
            after = {word: np.where(restarted, fmt.array(self.reset[word]), np.where(refused, guess[word], twin[word]))
                     for word in words}
            wrong = np.zeros(shape[0] - 1, bool)
            for word in words:
                differs = fmt.to_bits(after[word][:-1]) != fmt.to_bits(guess[word][1:])
                wrong |= differs.any(axis=tuple(range(1, differs.ndim)))
            good = int(wrong.argmax()) + 1 if wrong.any() else shape[0]
            if self.restart_after:
                refusals, twin["restarted"] = counts[good - 1], restarted
            blocks.append({name: values[:good] for name, values in (twin | after).items()})
            before = {word: after[word][good - 1] for word in words}
            first, size = first + good, min(2 * good, LARGEST_BLOCK) if words else count
        result = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
        refused = result["refused"] if self.status_port else result.pop("refused")
        # An output has the value of the last update that was not refused; row 0 is the start.
        row = np.maximum.accumulate(np.where(refused, 0, np.arange(1, count + 1).reshape(-1, *(1 for _ in lanes))))
        for port in self.output_ports:
            shown = np.concatenate((held[port][None], result[port]))
            result[port] = np.take_along_axis(shown, row, axis=0)
        result |= {name: result[name] & ~refused for name in self.status}
        return result, {name: result[name][-1] for name in held} | ({REFUSALS: refusals} if self.restart_after else {})

    def run_float64(self, inputs, state=None):
        """Updates of the equations in float64, in order: like ``run``, without the circuit's rounding.

        Outputs before the first update that is not refused are zero. Parameters and results are those of
        ``run``, in float64.
        """
        columns = [*self._samples({port: np.asarray(inputs[port], None if port in self.integers else float)
                                   for port in self.input_ports}).values()]
        start = dict.fromkeys(self.output_ports, 0.0) | self.reset | (state or {})
        held = {name: np.float64(start[name]) for name in (*self.output_ports, *self.reset)}
        refusals = Refusals(self.restart_after, start.get(REFUSALS, 0))
        rows = []
        with np.errstate(all="ignore"):
            for sample in zip(*columns, strict=True):
                update = self.update_float64(dict(zip(self.input_ports, sample, strict=True)), held)
                if self.status_port:
                    numbers = np.broadcast_arrays(*sample, *(update[name] for name in held))
                    refused = ~np.isfinite(numbers).all(axis=0)
                    if refused.any():
                        update |= {name: np.where(refused, held.get(name, False), update[name]) for name in update}
                    update["refused"] = refused
                    if self.restart_after:
                        finite = np.isfinite(np.broadcast_arrays(*sample)).all(axis=0)
                        update["restarted"] = refusals.update(refused, finite)
                        update |= {word: np.where(update["restarted"], reset, update[word])
                                   for word, reset in self.reset.items()}
                held = {name: update[name] for name in held}
                rows.append(update)
        lanes = columns[0].shape[1:]
        result = {name: np.stack([np.broadcast_to(row[name], lanes) for row in rows]) for name in rows[0]}
        return result, {name: result[name][-1] for name in held} | (
            {REFUSALS: refusals.count} if self.restart_after else {})

    def _samples(self, columns):
        """Input port to its numbers, all of one shape (N, ...). Raises: ValueError if there is no sample."""
        arrays = np.broadcast_arrays(*columns.values())
        if arrays[0].ndim == 0 or len(arrays[0]) == 0:
            raise ValueError(f"{self.name}: a run needs at least one sample along the first axis, "
                             f"not numbers of shape {arrays[0].shape}")
        return dict(zip(columns, arrays, strict=True))

    def _predicted(self, pool, inputs, state, refusals):
        """State before each update of a block; nearly always equal to that of the twin.

        NumPy rounds as the operators do, except for subnormal numbers, trigonometry and tables.
        """
        if not state:
            return {}
        xp, dtype, count = Rounded(pool), pool.format.dtype, len(next(iter(inputs.values())))
        counted = Refusals(self.restart_after, refusals)
        states = {word: np.empty((count, *values.shape), dtype) for word, values in state.items()}
        rows = [dict(zip(inputs, row, strict=True)) for row in zip(*inputs.values(), strict=True)]
        with np.errstate(all="ignore"):
            for index, row in enumerate(rows):
                for word, values in state.items():
                    states[word][index] = values
                update = self._update(xp, lambda value: value, lambda value: value, row, state)
                finite = np.isfinite(sum(row.values()))
                kept = np.isfinite(sum(update[name] for name in (*self.output_ports, *state))) & finite \
                    if self.status_port else True
                restarts = counted.update(~np.asarray(kept), finite)
                state = {word: np.where(restarts, self.reset[word], np.where(kept, update[word], values)).astype(dtype)
                         for word, values in state.items()}
        return states

    def _evaluated(self, xp, read_input, read_state):
        """Results of the equations for the values of input ports and state words."""
        def number(port):
            value = read_input(port)
            return xp.from_integer(value) if port in self.integers else value

        return self.equations(xp, **{name: shaped(ports, number) for name, ports in self.inputs.items()},
                              **{name: shaped(words, read_state) for name, words in self.state.items()})

    def _update(self, xp, wrap, unwrap, inputs, state):
        state = {} if state is None else state
        update = self._evaluated(
            xp, lambda port: xp.given_integer(inputs[port]) if port in self.integers else wrap(inputs[port]),
            lambda word: wrap(state[word]))
        results: dict = {}
        for names, values in (self.outputs, update.outputs), (self.state, update.state):
            for name, tree in names.items():
                results |= {leaf: unwrap(value) for leaf, value in zip(leaves(tree), leaves(values[name]), strict=True)}
        return results | {name: update.status[name] for name in self.status}
