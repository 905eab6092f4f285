"""A core in Verilator whose bits are flipped while it works through samples: what follows from each fault."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from amaranth.utils import exact_log2

from strapdown.cores import Core
from strapdown.kernel.system import leaves

from .storage import ROM, Storage, exposed, storage
from .verilated import Interface, VerilatedModel

__all__ = ["HORIZON", "Fault", "FaultModel", "Outcome", "Verdict"]

GAP = 16
"""Idle cycles from the end of an update to the next start."""

HORIZON = 1000
"""Updates after a fault in which outputs that are wrong count; a second more if they are wrong at the end."""

MEASURES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("matrix", ("c",)), ("angles", ("angles",)), ("angles", ("attitude",)), ("quaternion", ("q",)),
    ("quaternion", ("e",)), ("velocity", ("velocity",)), ("position", ("position", "height")))
"""How outputs are compared: the kind of error, and the outputs that it needs, by the kernels' names."""


class Outcome(IntEnum):
    """What follows from a fault, from harmless to harmful.

    MASKED
        No output is wrong, and no update is refused.
    TRANSIENT
        Outputs are wrong for at most a second in all, or updates are refused or lost.
    WRONG_FLAGGED, WRONG_SILENT
        Outputs are wrong for more than a second in all. By then the status has shown a difference, or not.
    STUCK
        More than eight updates in a row are refused, and the core does not restart.
    OUT_OF_STEP
        An update has a wrong number of cycles, although there was another start between the fault and its own.
    DEAD_CHANNEL, HANG
        Such an update has no finish within twice the latency: of one channel, or of the core.
    """

    MASKED, TRANSIENT, WRONG_FLAGGED, WRONG_SILENT, STUCK, OUT_OF_STEP, DEAD_CHANNEL, HANG = range(8)


class Fault(NamedTuple):
    """One flipped bit.

    Fields
    ------
    place : int
        Index in ``FaultModel.places``.
    row, bit : int
        Row of a memory, 0 for a register; bit of the row.
    round : int
        Samples of each channel that the core has taken before, at least 1.
    time : float
        When, from one start (0) to the next (1).
    """

    place: int
    row: int
    bit: int
    round: int
    time: float


class Verdict(NamedTuple):
    """What follows from a fault.

    Fields
    ------
    outcome : Outcome
    restored : bool
        Whether after a reset the core equals one without a fault, over a hundred updates.
    error : float
        Largest error, in parts of what is allowed.
    updates : int
        Updates until this was known.
    """

    outcome: Outcome
    restored: bool
    error: float
    updates: int


@dataclass(frozen=True)
class FaultInterface(Interface):
    """Ports of a module, with its registers and memories, and how its outputs are compared.

    Parameters
    ----------
    places : tuple of Storage
        Registers and memories.
    measures : tuple of (str, tuple of int)
        Kind of error, and the indices in ``outputs`` of its numbers.
    input_widths : tuple of int
        Bits of each input.
    channels, width : int
        Number of channels, and bits of a number.
    status : int or None
        Index of the status port in ``outputs``.
    refused, restarted : int
        Masks of status bits, zero for a bit that the core does not have.
    """

    places: tuple[Storage, ...] = ()
    measures: tuple[tuple[str, tuple[int, ...]], ...] = ()
    input_widths: tuple[int, ...] = ()
    channels: int = 1
    width: int = 32
    status: int | None = None
    refused: int = 0
    restarted: int = 0

    def access(self):
        # Read only: a model whose registers may be written settles all signals in every half of a cycle.
        return "".join(sorted({f'public_flat_rd -module "{place.module}" -var "{place.variable}"\n'
                               for place in self.places}))

    def header(self):
        root = f"V{self.top}___024root"
        places = " ".join(f"PLACE({place.path}, {place.rows}, {int(place.kind != ROM)})" for place in self.places)
        measures = " ".join(f"MEASURE({kind}, {len(ports)}, {', '.join(map(str, ports))})"
                            for kind, ports in self.measures)
        lines = [f"#define ROOT_TYPE {root}", f"#define SETTLE {root}___eval_settle", f"#define PLACES {places}",
                 f"#define MEASURES {measures}", f"#define CHANNELS {self.channels}",
                 f"#define INPUT_WIDTHS {', '.join(map(str, self.input_widths))}",
                 f"#define FORMAT_WIDTH {self.width}", f"#define REFUSED_MASK {self.refused}ull",
                 f"#define RESTARTED_MASK {self.restarted}ull",
                 *([] if self.status is None else [f"#define STATUS {self.status}"])]
        return super().header() + "\n".join(lines) + "\n"


class FaultModel(VerilatedModel):
    """A generated core, Verilated, whose registers, memories and ROM can be upset at any time.

    Parameters
    ----------
    core : strapdown.cores.Core
        The core that the file was made from, in binary32 or binary64.
    verilog : Path
        Its Verilog file.
    build : Path
        Folder for compiled models.

    Attributes
    ----------
    places : tuple of Storage
        All registers and memories of the core.

    Raises: ValueError for a core of another format, or without outputs that can be compared; and as VerilatedModel.
    """

    DRIVER = files(__package__) / "faults.cpp"

    def __init__(self, core: Core, verilog: str | os.PathLike, build: str | os.PathLike) -> None:
        self.core = core
        system, engine = core.system, core.engine
        fmt = engine.program.format
        if fmt.width not in (32, 64):
            raise ValueError(f"{system.name}: faults are judged in binary32 and binary64, not {fmt.name}")
        index = system.output_ports.index
        measures = tuple((kind, tuple(index(port) for name in names for port in leaves(system.outputs[name])))
                         for kind, names in MEASURES if all(name in system.outputs for name in names))
        if not measures:
            raise ValueError(f"{system.name} has neither attitude nor position, by which faults are judged")
        masks = {name: 1 << bit for bit, name in enumerate(engine.status_names)}
        text = exposed(Path(verilog).read_text(encoding="utf-8"))
        self.places = storage(text, system.name)
        widths = [system.input_width(port, fmt) for port in system.input_ports]
        if engine.channels > 1:
            widths.append(exact_log2(engine.channels))
        interface = FaultInterface.of_core(
            core, input_widths=tuple(widths), places=self.places, measures=measures, channels=engine.channels,
            width=fmt.width, status=len(system.output_ports) if system.status_port else None,
            refused=masks.get("refused", 0), restarted=masks.get("restarted", 0))
        with TemporaryDirectory() as folder:
            file = Path(folder) / f"{system.name}.v"
            file.write_text(text, encoding="utf-8")
            super().__init__(file, interface, build)

    def verdicts(self, faults: Sequence[Fault], samples: dict[str, np.ndarray], second: int) -> list[Verdict]:
        """What follows from each fault.

        Parameters
        ----------
        faults : sequence of Fault
            Their last round is at least HORIZON + ``second`` + 2 before the end of the samples.
        samples : dict
            Input port to numbers in the port's unit, shape (N, channels), or (N,) for one channel; all finite.
        second : int
            Updates of a channel in a second.

        Returns
        -------
        list of Verdict

        Raises: ValueError for a fault too early or too late; RuntimeError if an update takes a wrong number of cycles
        without a fault.
        """
        system, engine, channels = self.core.system, self.core.engine, self.core.engine.channels
        columns = [system.input_bits(port, engine.program.format, samples[port]) for port in system.input_ports]
        count = len(columns[0])
        columns = [np.asarray(column).reshape(count, channels) for column in columns]
        if channels > 1:
            columns.append(np.broadcast_to(np.arange(channels), (count, channels)))
        last = count - HORIZON - second - 2
        for fault in faults:
            if not 1 <= fault.round <= last:
                raise ValueError(f"{system.name}: a fault must be in rounds 1 to {last}, not {fault.round}")
        order = sorted(range(len(faults)), key=lambda number: (faults[number].round, faults[number].time))
        rows = np.array([[number, *faults[number][:4], int(faults[number].time * 2**32)] for number in order], "<u8")
        with TemporaryDirectory() as folder:
            file = Path(folder) / "samples"
            file.write_bytes(np.stack(columns, axis=-1).astype("<u8").tobytes())
            answer = self._answer(
                [str(file), *map(str, (self.core.latency, GAP, second, HORIZON))], rows,
                ("number", "outcome", "restored", "error", "updates"))
        found = [Verdict(Outcome(outcome), bool(restored), error / 1000, updates) for outcome, restored, error, updates
                 in zip(*(answer[name].tolist() for name in ("outcome", "restored", "error", "updates")), strict=True)]
        return [found[index] for index in np.argsort(answer["number"])]
