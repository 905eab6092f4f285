"""A Verilated module as a function on NumPy arrays: takes rows of stimulus, returns rows of results."""

import os
import re
import subprocess
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..cache import Cache, digest
from .storage import CONSTANTS, unfilled
from .toolchain import compile_flags, compiler, run_tool, verilator_environment, verilator_root, verilator_runtime

__all__ = ["Interface", "VerilatedModel", "Waves"]


@dataclass(frozen=True)
class Interface:
    """The ports of a module that a driver needs.

    Parameters
    ----------
    top : str
        Name of the module.
    inputs, outputs : tuple of str
        Data ports, each at most 64 bits wide, without clock, reset, start and finish.
    start, finish : str or None
        Handshake of a transaction, if the module has one.
    ready : str or None
        Output that is high when a start is taken, for a module that does not take every start.
    clock, reset : str
        Names of these ports; an empty ``reset`` means none.
    reset_active : int
        Level of ``reset`` that resets.
    enable : str
        Name of a clock enable, which is always high; empty means none.
    probes : dict
        Internal signals to read after a transaction: maps a name to (module, variable, C++ expression
        under the Verilated root).
    constants : tuple of int
        Contents of the ROM of constants of a core's engine. The model is made without them, and gets them at the start
        of each run, so that cores that differ in no more share a model. Empty: the ROM is a part of the model.
    """

    top: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    start: str | None = None
    finish: str | None = None
    ready: str | None = None
    clock: str = "clk"
    reset: str = "rst_n"
    reset_active: int = 0
    enable: str = ""
    probes: dict[str, tuple[str, str, str]] = field(default_factory=dict)
    constants: tuple[int, ...] = ()

    @property
    def filled(self):
        """The constants that the model gets: those of a ROM. A single one is a part of the circuit."""
        return self.constants if len(self.constants) > 1 else ()

    @classmethod
    def of_core(cls, core, **fields):
        """The interface of a ``strapdown.cores.Core``; ``fields`` are added to its ports, or replace them."""
        system, several, enable = core.system, core.engine.channels > 1, core.control.enable
        ports = {"top": system.name, "inputs": (*system.input_ports, *(["in_channel"] if several else [])),
                 "outputs": (*system.output_ports, *([system.status_port] if system.status_port else [])),
                 "start": system.start, "finish": system.finish, "ready": "in_ready" if several else None,
                 "enable": enable.name if enable else ""}
        return cls(**(ports | fields))

    def access(self):
        """Verilator's configuration that keeps the inner signals, and lets the driver see them."""
        variables = {(module, variable) for module, variable, _ in self.probes.values()}
        if self.filled:
            variables.add((f"{self.top}_engine", CONSTANTS))
        return "".join(sorted(f'public_flat_rd -module "{module}" -var "{variable}"\n'
                              for module, variable in variables))

    def header(self):
        """The C++ header that describes these ports for the driver."""
        lines = [f'#include "V{self.top}.h"', f'#include "V{self.top}___024root.h"',
                 f"#define MODEL_TYPE V{self.top}", f"#define CLOCK {self.clock}"]
        if self.reset:
            lines += [f"#define RESET {self.reset}", f"#define RESET_ACTIVE {self.reset_active}"]
        if self.enable:
            lines.append(f"#define ENABLE {self.enable}")
        if self.start:
            lines += [f"#define START {self.start}", f"#define FINISH {self.finish}"]
        if self.ready:
            lines.append(f"#define READY {self.ready}")
        if self.filled:
            lines.append(f"#define CONSTANTS {self.top}__DOT__engine__DOT__{CONSTANTS}")
        for kind, names in (("INPUT", self.inputs), ("OUTPUT", self.outputs),
                            ("PROBE", [expression for _, _, expression in self.probes.values()])):
            lines += [f"#define {kind}_COUNT {len(names)}",
                      f"#define {kind}S " + " ".join(f"{kind}({name})" for name in names)]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False)
class Waves:
    """What a model writes to a waveform file (VCD), with a clock period of 10 ns.

    Parameters
    ----------
    path : Path
        File to write.
    time_ns : ndarray of int64, shape (N,)
        Time at which each transaction begins in the file, ns; -1 for one that is left out. One that begins before the
        end of the one before follows on it.
    """

    path: Path
    time_ns: np.ndarray


class VerilatedModel:
    """A module translated by Verilator, compiled, and run as a child process.

    Parameters
    ----------
    verilog : Path
        Verilog file with the module ``interface.top``.
    interface : Interface
        Its ports.
    build : Path
        Folder for everything that is made; a model whose modules and interface did not change, except for the
        constants, is not built again.
    waves : bool
        Whether the model keeps a waveform in ``transact``. It is slower, and a build of its own.

    Raises: SimulatorMissingError without Verilator or g++, before anything is made; ToolError if they fail.
    """

    DRIVER = files(__package__) / "verilated.cpp"
    # More flags of g++.
    FLAGS: ClassVar[tuple[str, ...]] = ()

    def __init__(self, verilog: str | os.PathLike, interface: Interface, build: str | os.PathLike, *,
                 waves: bool = False) -> None:
        self.interface, self._waves = interface, waves
        self._flags = (*self.FLAGS, *(["-DKEEP_WAVES"] if waves else []))
        build = Path(build).resolve()
        driver = self.DRIVER.read_text(encoding="utf-8")
        # A header of another wording makes the same model.
        modules = re.sub(r"^//.*\n", "", Path(verilog).read_text(encoding="utf-8"), flags=re.MULTILINE)
        if interface.filled:
            modules = unfilled(modules, interface.filled)
        key = digest(modules, interface.header(), interface.access(), driver,
                     *self._flags, str(verilator_root()))[:16]

        def make(folder):
            compiler()
            self._build(modules, folder, driver, *verilator_runtime(build / "runtime"))

        self._executable = Cache(build).named(f"{interface.top}-{key}", make) / "model"

    def _build(self, modules, partial, driver, objects, header):
        partial.mkdir()
        (partial / f"{self.interface.top}.v").write_text(modules, encoding="utf-8")
        (partial / "ports.h").write_text(self.interface.header(), encoding="utf-8")
        (partial / "main.cpp").write_text(driver, encoding="utf-8")
        (partial / "probes.vlt").write_text("`verilator_config\n" + self.interface.access(), encoding="utf-8")
        root = verilator_root()
        # The script beside it does not quote its own path, which may have spaces.
        run_tool([root / "bin" / "verilator_bin", "--cc", "-Wno-fatal", "-Wno-lint", "-O3", "--x-assign", "unique",
                  "--no-timing", *(["--trace-vcd"] if self._waves else []), "--top-module", self.interface.top,
                  "--Mdir", partial, partial / "probes.vlt", partial / f"{self.interface.top}.v"],
                 environment=verilator_environment())
        # One translation unit, because the headers of Verilator are longer than its code for a core. The parts that
        # Verilator calls slow run once, but g++ would take the longest time to optimise them.
        names = sorted(path.name for path in partial.glob("*.cpp"))
        slow = [name for name in names if name.endswith("Slow.cpp")]
        fast = [name for name in names if name not in slow]
        (partial / "all.cc").write_text("\n".join(
            [*(f'#include "{name}"' for name in fast), '#pragma GCC optimize("O0")',
             *(f'#include "{name}"' for name in slow), ""]), encoding="utf-8")
        sources = [partial / "all.cc", *([root / "include" / "verilated_vcd_c.cpp"] if self._waves else [])]
        run_tool([compiler(), *compile_flags(), *self._flags, f"-I{partial}", "-include", header, *sources, *objects,
                  "-o", partial / "model"])

    def stream(self, stimulus: Mapping[str, ArrayLike], *,
               progress: Callable[[int], object] | None = None) -> dict[str, np.ndarray]:
        """One row per clock cycle.

        Parameters
        ----------
        stimulus : dict
            Maps each input port to an integer array, shape (N,); omitted inputs are zero.
        progress : callable or None
            Called from time to time with the number of rows done.

        Returns
        -------
        dict
            Maps each output port to a uint64 array, shape (N,): its value in that cycle, before the edge.
        """
        return self._run(["stream"], stimulus, self.interface.outputs, progress)

    def transact(self, stimulus: Mapping[str, ArrayLike], *, limit: int = 10_000,
                 waves: Waves | None = None, progress: Callable[[int], object] | None = None) -> dict[str, np.ndarray]:
        """One row per transaction: start for one cycle, wait for finish, at most ``limit`` cycles.

        Inputs are inverted immediately after the edge that takes them. The result has a key per output
        and per probe, and ``cycles``: clock edges from the edge that takes the inputs until finish is high.
        ``waves`` says what a model made with ``waves`` keeps.
        Raises: RuntimeError if finish did not rise within ``limit``.
        """
        names = (*self.interface.outputs, *self.interface.probes, "cycles")
        answer = self._run(["transact", str(limit), *([waves.path] if waves else [])], stimulus, names, progress,
                           before=waves.time_ns if waves else None)
        late = np.flatnonzero(answer["cycles"] == 0)
        if late.size:
            raise RuntimeError(f"{self.interface.top}: no {self.interface.finish} within {limit} cycles "
                               f"in transaction {late[0]}")
        return answer

    def offer(self, stimulus: Mapping[str, ArrayLike], idle: ArrayLike, *, limit: int = 10_000,
              progress: Callable[[int], object] | None = None) -> dict[str, np.ndarray]:
        """One row a sample, offered until it is taken, while others are in flight.

        Parameters
        ----------
        stimulus : dict
            Maps each input port to an integer array, shape (N,).
        idle : ndarray
            Cycles without an offer before each sample, or -1: a reset in place of a sample.
        limit : int
            Greatest number of cycles in which no sample is taken or finished.

        Returns
        -------
        dict
            One row per finish, in order: outputs, probes, the ``row`` of the sample, and the numbers of the clock
            edges at which it was ``taken`` and ``finished``. Inputs are inverted while no sample is offered.
            Raises: RuntimeError beyond ``limit``.
        """
        names = (*self.interface.outputs, *self.interface.probes, "row", "taken", "finished")
        # After a reset some samples have no result.
        return self._run(["offer", str(limit)], stimulus, names, progress, before=np.asarray(idle, dtype=np.int64),
                         fewer=True)

    def _run(self, arguments, stimulus, names, progress, *, before=None, fewer=False):
        unknown = set(stimulus) - set(self.interface.inputs)
        if unknown:
            raise ValueError(f"{self.interface.top} has no input {', '.join(sorted(unknown))}")
        count = len(next(iter(stimulus.values())))
        rows = np.zeros((count, len(self.interface.inputs)), dtype="<u8")
        for column, name in enumerate(self.interface.inputs):
            if name in stimulus:
                rows[:, column] = stimulus[name]
        if before is not None:
            rows = np.column_stack([before.view("<u8"), rows])
        return self._answer(arguments, rows, names, progress, fewer=fewer)

    def _answer(self, arguments, rows, names, progress=None, *, fewer=False):
        """What the model answers to rows of numbers: name to column, one row for each, or ``fewer``."""
        constants = np.array(self.interface.filled, "<u8")
        view = bytearray(len(rows) * len(names) * 8)
        with subprocess.Popen([self._executable, *arguments], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            feeder = threading.Thread(target=_feed, args=(process.stdin, constants, rows))
            feeder.start()
            received = 0
            try:
                while received < len(view):
                    chunk = os.read(process.stdout.fileno(), 1 << 16)
                    if not chunk:
                        break
                    view[received:received + len(chunk)] = chunk
                    received += len(chunk)
                    if progress:
                        progress(received // (8 * len(names)))
            except BaseException:
                process.kill()
                raise
            finally:
                feeder.join()
        complete = received == len(view) or (fewer and received % (8 * len(names)) == 0)
        if process.returncode or not complete:
            raise RuntimeError(f"the model of {self.interface.top} ended early, status {process.returncode}")
        answer = np.frombuffer(view[:received], dtype="<u8").reshape(-1, len(names))
        return {name: answer[:, column] for column, name in enumerate(names)}


def _feed(pipe, *arrays):
    # A model that ends early takes no more rows; its exit status shows this.
    with suppress(BrokenPipeError), pipe:
        for array in arrays:
            pipe.write(array.data)
