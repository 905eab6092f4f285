"""A core in Verilator: updates on float arrays, with access to the internal state."""

import os
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from strapdown.cores import Core
from strapdown.kernel.refusals import Refusals

from .verilated import Interface, VerilatedModel, Waves

__all__ = ["CoreModel", "state_bits"]


def state_bits(fmt, state, answer):
    """Encodings of state words: those of the bank in use, or the reset values if the state is fresh.

    Parameters
    ----------
    fmt : FloatFormat
    state : dict
        State word to its reset value.
    answer : dict
        The probes ``bank``, ``fresh``, and ``WORD.0`` and ``WORD.1`` of each word, shape (N,).

    Returns: dict of arrays, shape (N,), in the order of ``state``.
    """
    return {word: np.where(answer["fresh"] == 1, fmt.encode(reset),
                           np.where(answer["bank"] == 1, answer[f"{word}.1"], answer[f"{word}.0"]))
            for word, reset in state.items()}


class CoreModel:
    """A generated core, Verilated.

    Parameters
    ----------
    core : strapdown.cores.Core
        The core that the file was made from.
    verilog : Path
        Its Verilog file.
    build : Path
        Folder for compiled models.
    waves : bool
        See VerilatedModel.
    """

    def __init__(self, core: Core, verilog: str | os.PathLike, build: str | os.PathLike, *,
                 waves: bool = False) -> None:
        self.core = core
        system, program = core.system, core.engine.program
        self._format = program.format
        self._state = dict(program.schedule.graph.state)
        engine = f"{system.name}__DOT__engine__DOT__"
        probes = {f"{word}.{bank}": (f"{system.name}_engine", "operands", f"{engine}operands[{2 * index + bank}]")
                  for index, word in enumerate(self._state) for bank in (0, 1)}
        if probes:
            probes |= {name: (f"{system.name}_engine", name, engine + name) for name in ("bank", "fresh")}
        self._model = VerilatedModel(verilog, Interface.of_core(
            core, probes=probes, constants=program.constant_words), build, waves=waves)

    def update(self, inputs: Mapping[str, ArrayLike], *, waves: Waves | None = None,
               progress: Callable[[int], object] | None = None) -> dict[str, np.ndarray]:
        """One update per sample, in order, from reset.

        Parameters
        ----------
        inputs : dict
            Input port to numbers, shape (N,), in the port's unit; rounded to the core's format, or integers.
        waves : Waves or None
            Waveform of some updates, from a model that was made with ``waves``.
        progress : callable or None
            Called from time to time with the number of updates done.

        Returns
        -------
        dict
            Maps each output port and state word to an array of the format's dtype, shape (N,), with the
            values after each update; the status port and ``cycles`` to integers.
        """
        fmt, system = self._format, self.core.system
        with np.errstate(all="ignore"):
            bits = {port: system.input_bits(port, fmt, inputs[port]) for port in system.input_ports}
        answer = self._model.transact(bits, limit=2 * self.core.latency, waves=waves, progress=progress)
        result = {port: fmt.from_bits(answer[port].astype(fmt.bits_dtype)) for port in system.output_ports}
        result["cycles"] = answer["cycles"].astype(int)
        if system.status_port:
            result[system.status_port] = answer[system.status_port].astype(int)
        stored = state_bits(fmt, self._state, answer)
        return result | {word: fmt.from_bits(bits.astype(fmt.bits_dtype)) for word, bits in stored.items()}

    def differing_bits(self, inputs: Mapping[str, ArrayLike], result: Mapping[str, np.ndarray]) -> int:
        """Number of bits of ``result``, as returned by ``update``, that differ from the software twin.

        The twin computes each update again from the state that the circuit held before it, all updates
        in one call. The first state is the reset state. So, if no bit differs, the whole run equals a
        run of the twin from reset, in every bit of outputs and state.
        """
        fmt, system = self._format, self.core.system
        before = {word: np.concatenate(([fmt.array(reset)], result[word][:-1])) for word, reset in self._state.items()}
        twin = system.update_twin(self.core.engine.program.schedule.pool, inputs, before)
        refused = twin.get("refused", np.zeros(len(result["cycles"]), dtype=bool))
        twin["restarted"], _ = Refusals(system.restart_after).updates(refused, system.finite_inputs(fmt, inputs))
        held = {port: fmt.array(value) for port, value in self.core.engine.reset_outputs.items()}
        count = 0
        for name in (*system.output_ports, *self._state):
            previous = before[name] if name in before else np.concatenate(([held[name]], result[name][:-1]))
            expected = np.where(refused, previous, twin[name])
            if name in before:
                expected = np.where(twin["restarted"], fmt.array(self._state[name]), expected)
            count += int(np.bitwise_count(fmt.to_bits(expected) ^ fmt.to_bits(result[name])).sum())
        if system.status_port:
            expected = sum(((twin[name] & ~refused) if name in system.status else twin[name]).astype(int) << bit
                           for bit, name in enumerate(self.core.engine.status_names) if name in twin)
            count += int(np.bitwise_count(expected ^ result[system.status_port]).sum())
        return count
