"""A core for several channels in Verilator: takes samples with a channel, gives results with a channel."""

import os
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from strapdown.cores import Core
from strapdown.kernel.refusals import Refusals

from .verilated import Interface, VerilatedModel

__all__ = ["RESET", "StreamModel"]

RESET = -1
"""In place of a number of idle cycles: a reset of the core, without a sample."""


class StreamModel:
    """A generated core for several channels, Verilated.

    Parameters
    ----------
    core : strapdown.cores.Core
        The core that the file was made from, its engine a StreamEngine.
    verilog : Path
        Its Verilog file.
    build : Path
        Folder for compiled models.
    """

    def __init__(self, core: Core, verilog: str | os.PathLike, build: str | os.PathLike) -> None:
        self.core = core
        system, program = core.system, core.engine.program
        self._format = program.format
        self._state = dict(program.schedule.graph.state)
        engine = f"{system.name}__DOT__engine__DOT__"
        # The state of the channel that finishes: its bank has just changed and cannot change again so soon.
        probes = {name: (f"{system.name}_engine", "current", f"{engine}current[dut->out_channel] >> {bit} & 1")
                  for bit, name in enumerate(("bank", "fresh"))}
        bank = f"(dut->rootp->{probes['bank'][2]})"
        probes |= {word: (f"{system.name}_engine", "main_memory",
                          f"{engine}main_memory[{address} + 2 * dut->out_channel + {bank}]")
                   for word, address in program.state.items()}
        outputs = (*system.output_ports, "out_channel", *([system.status_port] if system.status_port else []))
        self._model = VerilatedModel(verilog, Interface.of_core(
            core, outputs=outputs, probes=probes, constants=program.constant_words), build)

    def update(self, channels: ArrayLike, inputs: Mapping[str, ArrayLike], idle: ArrayLike = 0, *,
               progress: Callable[[int], object] | None = None) -> dict[str, np.ndarray]:
        """One update per sample, in order, from reset; each sample is offered until it is taken.

        Parameters
        ----------
        channels : ndarray of int
            Channel of each sample, shape (N,).
        inputs : dict
            Input port to numbers, shape (N,), in the port's unit; rounded to the core's format, or integers.
        idle : int or ndarray of int
            Cycles without an offer before each sample, or ``RESET``.
        progress : callable or None
            Called from time to time with the number of updates done.

        Returns
        -------
        dict
            One row per finish. Maps each output port and state word of that channel to an array of the format's dtype;
            ``out_channel``, the status port, the ``row`` of the sample, and the numbers of the clock edges at which it
            was ``taken`` and ``finished`` to integers.
        """
        fmt, system = self._format, self.core.system
        with np.errstate(all="ignore"):
            bits = {port: system.input_bits(port, fmt, inputs[port]) for port in system.input_ports}
        answer = self._model.offer(bits | {"in_channel": np.asarray(channels)},
                                   np.broadcast_to(idle, np.shape(channels)), progress=progress)
        numbers = (*system.output_ports, *self._state)
        for word, reset in self._state.items():
            answer[word] = np.where(answer["fresh"] == 1, fmt.encode(reset), answer[word])
        return {name: fmt.from_bits(values.astype(fmt.bits_dtype)) if name in numbers else values.astype(int)
                for name, values in answer.items()}

    def differing_bits(self, inputs: Mapping[str, ArrayLike], result: Mapping[str, np.ndarray],
                       resets: Sequence[int] = ()) -> int:
        """Number of bits of ``result``, as returned by ``update``, that differ from the software twin.

        The twin computes each update again from the state of its channel after the channel's previous update,
        all updates in one call. The first updates, and those after a row in ``resets``, start from the reset
        state. If no bit differs, the run equals that of one twin per channel.
        """
        fmt, system = self._format, self.core.system
        channel, epoch = result["out_channel"], np.searchsorted(np.asarray(resets, dtype=int), result["row"])
        before: dict = {word: np.full(len(channel), fmt.array(value)) for word, value in self._state.items()}
        runs = [np.flatnonzero((channel == own[0]) & (epoch == own[1]))
                for own in set(zip(channel.tolist(), epoch.tolist(), strict=True))]
        for rows in runs:
            for word, values in before.items():
                values[rows[1:]] = result[word][rows[:-1]]
        taken = {port: np.asarray(values)[result["row"]] for port, values in inputs.items()}
        twin = system.update_twin(self.core.engine.program.schedule.pool, taken, before)
        refused, count = twin.get("refused", np.zeros(len(channel), dtype=bool)), 0
        restarted, finite = np.zeros(len(channel), dtype=bool), system.finite_inputs(fmt, taken)
        for rows in runs:
            restarted[rows], _ = Refusals(system.restart_after).updates(refused[rows], finite[rows])
        twin["restarted"] = restarted
        for name in (*system.output_ports, *self._state):
            # Outputs hold the values of the previous update of any channel; zero after a reset.
            held = before.get(name, np.concatenate(([fmt.array(0)], result[name][:-1])))
            if name not in before:
                held[np.flatnonzero(np.diff(epoch, prepend=-1))] = 0
            expected = np.where(refused, held, twin[name])
            if name in before:
                expected = np.where(restarted, fmt.array(self._state[name]), expected)
            count += int(np.bitwise_count(fmt.to_bits(expected) ^ fmt.to_bits(result[name])).sum())
        if not system.status_port:
            return count
        expected = sum(((twin[name] & ~refused) if name in system.status else twin[name]).astype(int) << bit
                       for bit, name in enumerate(self.core.engine.status_names))
        return count + int(np.bitwise_count(expected ^ result[system.status_port]).sum())
