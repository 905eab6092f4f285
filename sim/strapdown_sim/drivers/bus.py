"""A core behind AXI4-Lite and AXI4-Stream in Verilator: reads, writes, waits and words of streams through a pipe."""

import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike

from strapdown.bus import REGISTER_BITS
from strapdown.cores import Top

from .verilated import Interface, VerilatedModel

__all__ = ["ANSWER", "OKAY", "REQUEST", "SLVERR", "Bus", "BusInterface", "BusModel", "answer_words", "sample_words"]

OKAY, SLVERR = 0, 2
"""Responses of AXI."""

REQUEST = np.dtype([("operation", "u1"), ("strobes", "u1"), ("half", "<u2"), ("word", "<u4")])
ANSWER = np.dtype([("code", "<u4"), ("word", "<u4")])
"""What goes through the pipe; bus.cpp tells the meanings."""

READ, WRITE, WAIT, INTERRUPT, SEND, GET, RESET = b"RWNISGZ"

ALL_BYTES = 0xF
PATIENCE = 1_000_000
"""Cycles that an operation waits at most, unless it is told otherwise."""


@dataclass(frozen=True)
class BusInterface(Interface):
    """Ports of a core behind its bus.

    Parameters
    ----------
    streams, channels : bool
        Whether it has streams, and whether their words have a channel.
    """

    streams: bool = False
    channels: bool = False

    @classmethod
    def of_top(cls, top: Top) -> "BusInterface":
        """The interface of a core that ``strapdown.cores.axi_core`` makes."""
        ports = {port.name for port in top.ports}
        return cls(top.component.name, (), (), clock=top.control.clock.name, reset=top.control.reset.name,
                   streams="s_axis_tdata" in ports, channels="s_axis_tid" in ports)

    def header(self):
        """The C++ header that describes these ports for the driver."""
        return super().header() + "#define STREAMS\n" * self.streams + "#define CHANNELS\n" * self.channels


class Bus:
    """The bus of a running model. Made by ``BusModel.run``."""

    def __init__(self, process: subprocess.Popen) -> None:
        self._process = process

    def transact(self, requests: np.ndarray) -> np.ndarray:
        """Requests in order, shape (N,) of REQUEST, and their answers, shape (N,) of ANSWER.

        Raises: RuntimeError with the rule of AXI that the core has broken.
        """
        pipe, size = self._process.stdout, ANSWER.itemsize * len(requests)
        assert pipe is not None
        feeder = threading.Thread(target=_feed, args=(self._process.stdin, requests.tobytes()))
        feeder.start()
        answers = pipe.read(size)
        feeder.join()
        if len(answers) < size:
            assert self._process.stderr is not None
            raise RuntimeError(f"the model ended: {self._process.stderr.read().decode().strip()}")
        return np.frombuffer(answers, ANSWER)

    def _one(self, operation, half=0, word=0, strobes=0):
        code, word = self.transact(np.array([(operation, strobes, half, word)], REQUEST))[0]
        return int(code), int(word)

    def read(self, address: int) -> tuple[int, int]:
        """Response and data of a read."""
        return self._one(READ, address)

    def write(self, address: int, word: int, strobes: int = ALL_BYTES) -> int:
        """Response of a write of the bytes that ``strobes`` selects."""
        return self._one(WRITE, address, word, strobes)[0]

    def wait(self, cycles: int) -> tuple[int, int]:
        """Runs the clock. Returns the level of irq and the number of the cycle."""
        code, cycle = self._one(WAIT, word=cycles)
        return code & 1, cycle

    def interrupt(self, limit: int = PATIENCE) -> tuple[int, int]:
        """Runs the clock until irq is high, at most ``limit`` cycles. Returns as ``wait``."""
        return self._one(INTERRUPT, word=limit)

    def reset(self, cycles: int = 1) -> None:
        """Holds aresetn low; words of the streams that wait are lost."""
        self._one(RESET, word=cycles)

    def send(self, words: ArrayLike, last: Sequence[int] = (), channel: int = 0) -> None:
        """Words for the sample stream, shape (N,), with TLAST at those in ``last``. They go in while the clock runs."""
        requests = np.zeros(np.size(words), REQUEST)
        requests["operation"], requests["word"], requests["half"] = SEND, np.ravel(words), channel << 1
        requests["half"][list(last)] |= 1
        self.transact(requests)

    def get(self, count: int, limit: int = PATIENCE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """At most ``count`` words of the answer stream, each within ``limit`` cycles; and their TLAST and TID."""
        requests = np.zeros(count, REQUEST)
        requests["operation"], requests["word"] = GET, limit
        answers = self.transact(requests)
        got = answers[answers["code"] & 1 == 1]
        return got["word"], got["code"] >> 1 & 1, got["code"] >> 2


class BusModel(VerilatedModel):
    """A core behind its bus, Verilated. Its interface is a BusInterface."""

    DRIVER = files(__package__) / "bus.cpp"

    def command(self, *, seed: int = 1, stalls: int = 0) -> list[str]:
        """The command line of a process that answers requests; ``stalls`` in percent of the cycles, below 100.

        Raises: ValueError.
        """
        if not 0 <= stalls < 100:
            raise ValueError(f"stalls must be at least 0 and less than 100 percent, not {stalls!r}")
        return [str(self._executable), str(seed), str(stalls)]

    @contextmanager
    def run(self, *, seed: int = 1, stalls: int = 0) -> Iterator[Bus]:
        """Context manager: the Bus of a model after its reset. Raises: as ``command``."""
        command = self.command(seed=seed, stalls=stalls)
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE) as process:
            yield Bus(process)


def _feed(pipe, data):
    # A model that ends early takes no more; the missing answers show this.
    with suppress(BrokenPipeError):
        pipe.write(data)
        pipe.flush()


def sample_words(top: Top, inputs: Mapping[str, ArrayLike]) -> np.ndarray:
    """Words of samples as they go through a stream, shape (N, words) of uint32, from numbers by port, shape (N,)."""
    system, table, format = top.component.system, top.component.table, top.component.program.format
    with np.errstate(all="ignore"):
        bits = {word.port: system.input_bits(word.port, format, inputs[word.port]) for word in table.samples}
    return _words(table.samples, bits)


def answer_words(top: Top, result: Mapping[str, np.ndarray]) -> np.ndarray:
    """Words of answers as they come through a stream, shape (N, words) of uint32, from what ``System.run`` returns."""
    engine, table = top.component.engine, top.component.table
    bits = {word.port: top.component.program.format.to_bits(result[word.port]) for word in table.outputs}
    status = sum(np.asarray(result[name]).astype(np.uint32) << bit
                 for bit, name in enumerate(engine.status_names) if name in result)
    return np.column_stack([_words(table.outputs, bits), status])


def _words(words, bits):
    """The words of ports in the order of their registers."""
    return np.column_stack([np.asarray(bits[word.port], np.uint64) >> np.uint64(REGISTER_BITS * index)
                            for word in words for index in range(len(word.registers))]).astype(np.uint32)
