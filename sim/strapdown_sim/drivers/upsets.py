"""A core whose registers get other contents, in Verilator: how it settles, and its next update."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from strapdown.cores import Core

from . import storage
from .core import state_bits
from .verilated import Interface, VerilatedModel

__all__ = ["ALL", "BIT", "POWER_UP", "REGISTER", "UpsetModel"]

BIT, REGISTER, ALL, POWER_UP = range(4)
"""What an upset reaches: one bit, one register, or every register of the core; or all registers and memories, before a
reset, as after a power-up without initial contents."""


@dataclass(frozen=True)
class UpsetInterface(Interface):
    """Ports of a module, with the registers and the memories to write.

    Parameters
    ----------
    registers : dict
        Register as (module, variable, C++ expression) to its width.
    memories : dict
        Memory, in the same way, to the width of its words.
    """

    registers: dict[tuple[str, str, str], int] = field(default_factory=dict)
    memories: dict[tuple[str, str, str], int] = field(default_factory=dict)

    def access(self):
        written = {(module, variable) for module, variable, _ in (*self.registers, *self.memories)}
        read = {(module, variable) for module, variable, _ in self.probes.values()} - written
        return "".join(f'public_flat_{kind} -module "{module}" -var "{variable}"\n'
                       for kind, signals in (("rd", read), ("rw", written)) for module, variable in sorted(signals))

    def header(self):
        registers = " ".join(f"REGISTER({path}, {width})" for (_, _, path), width in self.registers.items())
        memories = " ".join(f"MEMORY({path}, {width})" for (_, _, path), width in self.memories.items())
        return f"{super().header()}#define REGISTERS {registers}\n#define MEMORIES {memories}\n"


class UpsetModel(VerilatedModel):
    """A generated core, Verilated, with a state, and registers that can be written.

    Parameters
    ----------
    core : strapdown.cores.Core
        The core that the file was made from.
    verilog : Path
        Its Verilog file.
    build : Path
        Folder for compiled models.

    Attributes
    ----------
    registers : tuple of str
        All registers of the core, each as its module and its name there.
    """

    DRIVER = files(__package__) / "upsets.cpp"

    def __init__(self, core: Core, verilog: str | os.PathLike, build: str | os.PathLike) -> None:
        self.core = core
        system, program, several = core.system, core.engine.program, core.engine.channels > 1
        module, engine = f"{system.name}_engine", f"{system.name}__DOT__engine__DOT__"

        def variable(name, path=""):
            return module, name, engine + name + path

        memory = "main_memory" if several else "operands"
        if several:
            channel = "dut->in_channel"
            probes = {probe: variable("current", f"[{channel}] >> {bit} & 1")
                      for bit, probe in enumerate(("bank", "fresh"))}
        else:
            probes, channel = {name: variable(name) for name in ("bank", "fresh")}, "0"
        for word, address in program.state.items():
            probes |= {f"{word}.{bank}": variable(memory, f"[{address} + 2 * {channel} + {bank}]") for bank in (0, 1)}
        text = Path(verilog).read_text(encoding="utf-8")
        registers, memories = ({(place.module, place.variable, place.path): place.width
                                for place in storage.storage(text, system.name) if place.kind == kind}
                               for kind in (storage.REGISTER, storage.MEMORY))
        self.registers = tuple(f"{module}.{name}" for module, name, _ in registers)
        super().__init__(verilog, UpsetInterface.of_core(
            core, probes=probes, registers=registers, memories=memories), build)

    def next_updates(self, seeds: ArrayLike, cycles: ArrayLike, kinds: ArrayLike, samples: Mapping[str, np.ndarray],
                     register: str | None = None, *, load: bool = False) -> dict[str, np.ndarray]:
        """For each seed: a reset, so many cycles of random starts, an upset, time to settle, and one update.

        The time to settle is twice the latency.

        Parameters
        ----------
        seeds, cycles, kinds : ndarray of int
            Shape (N,); ``kinds`` are BIT, REGISTER, ALL or POWER_UP.
        samples : dict
            Input port to numbers or integers, shape (N, 2): those before the upset and those after it.
        register : str or None
            One of ``registers``, the only one to upset.
        load : bool
            Whether there are random starts while the core settles, so that other channels are in flight then.

        Returns
        -------
        dict
            Arrays of shape (N,): state words before the last update; output ports before it, and as ``after.PORT``
            after it; ``waited``, the cycles until its start was taken; ``cycles``, its latency, or zero if there was no
            finish.
        """
        fmt, system = self.core.engine.program.format, self.core.system
        bits = {port: np.asarray(values) if port == "in_channel" else system.input_bits(port, fmt, values)
                for port, values in samples.items()}
        number = np.full(len(np.asarray(seeds)), -1 if register is None else self.registers.index(register))
        header = np.column_stack([np.asarray(column).astype("<u8")
                                  for column in (seeds, cycles, kinds, number, np.full(len(number), load))])
        columns = [np.asarray(bits[port])[:, which].astype("<u8") for which in (0, 1) for port in self.interface.inputs]
        outputs = self.interface.outputs
        names = (*self.interface.probes, *outputs, "waited", "cycles", *(f"after.{port}" for port in outputs))
        limit = 2 * self.core.latency
        answer = self._answer([str(limit), str(limit)], np.column_stack([header, *columns]), names)
        stored = state_bits(fmt, self.core.engine.program.schedule.graph.state, answer)
        result = {name: values.astype(int) for name, values in answer.items()} | stored
        numbers = (*system.output_ports, *(f"after.{port}" for port in system.output_ports), *stored)
        return result | {name: fmt.from_bits(result[name].astype(fmt.bits_dtype)) for name in numbers}
