"""Driver of a core behind its bus, in Python. It needs NumPy and the core's map, and nothing else of this package."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["Driver", "DriverError", "Update", "from_words", "to_words"]

NUMBERS: dict[str, str] = {"binary16": "<f2", "binary32": "<f4", "binary64": "<f8"}
"""Types of NumPy by format; other words are integers."""

WORD_BITS = 32
WORD = np.uint64(0xFFFF_FFFF)


class DriverError(RuntimeError):
    """The core is not the one that was expected, or does not do what it was told."""


@dataclass(frozen=True)
class Update:
    """A finished update.

    Attributes
    ----------
    number : int
        Its number since the reset of the core, modulo 2^32; 0 before the first.
    status : tuple of str
        Names of the status bits that are set. With ``refused``, the outputs are those of the update before.
    outputs : dict
        Output port to number.
    """

    number: int
    status: tuple[str, ...]
    outputs: dict[str, Any]


def to_words(ports: tuple, values: Mapping[str, ArrayLike]) -> np.ndarray:
    """Words in the order of registers and streams, shape (N, words) of uint32.

    Parameters
    ----------
    ports : tuple
        ``SAMPLES``, ``PARAMETERS`` or ``OUTPUTS`` of a map.
    values : mapping
        Maps each port to numbers, shape (N,) or ().

    Raises: KeyError for a port that is missing.
    """
    columns = []
    for port, _, count, format in ports:
        array = np.atleast_1d(np.asarray(values[port]))
        if format in NUMBERS:
            number = array.astype(NUMBERS[format])
            bits = number.view(f"<u{number.itemsize}").astype(np.uint64)
        else:
            bits = array.astype(np.int64).astype(np.uint64)
        columns += [bits >> np.uint64(WORD_BITS * index) & WORD for index in range(count)]
    return np.stack(columns, axis=-1).astype("<u4")


def from_words(ports: tuple, words: ArrayLike) -> dict[str, np.ndarray]:
    """The inverse of ``to_words``: port to numbers, shape (N,)."""
    columns = iter(np.asarray(words).astype(np.uint64).T)
    values = {}
    for port, _, count, format in ports:
        bits = sum(next(columns) << np.uint64(WORD_BITS * index) for index in range(count))
        if format in NUMBERS:
            number = np.dtype(NUMBERS[format])
            bits = bits.astype(f"<u{number.itemsize}").view(number)
        values[port] = bits
    return values


class Driver:
    """A core behind its bus. A subclass adds ``read`` and ``write``, which access a register as a whole word."""

    map: ModuleType
    """The map that ``open`` was given."""

    def read(self, offset: int) -> int:
        """The word at an offset in bytes."""
        raise NotImplementedError

    def write(self, offset: int, value: int) -> None:
        """Write a word at an offset in bytes."""
        raise NotImplementedError

    def open(self, map: ModuleType) -> None:
        """Check that the core is that of a map; the core is as it was.

        Parameters
        ----------
        map : module
            NAME_map.py, which was generated with the core.

        Raises: DriverError if there is no core, or another one.
        """
        self.map = map
        expected = map.CONSTANTS
        found = {name: self._get(name) for name in expected}
        if found["IDENTITY"] != expected["IDENTITY"]:
            raise DriverError(f"there is no core at this address: IDENTITY reads {found['IDENTITY']:#010x}")
        if (found["VERSION"] ^ expected["VERSION"]) >> WORD_BITS // 2:
            raise DriverError(f"the map is for version {expected['VERSION']:#010x} of the registers, and the core has "
                              f"{found['VERSION']:#010x}")
        if found["CONFIGURATION"] != expected["CONFIGURATION"]:
            raise DriverError(f"the core was generated with another configuration than {map.NAME}_map.py: use the map "
                              "from the folder of its package")

    def reset(self) -> None:
        """Reset the state of the core to that after power-up. Parameters and enabled interrupts stay."""
        self._command("core_reset")

    def set(self, **parameters: float) -> None:
        """Set parameters, by port; they act from the next start. Raises: TypeError for an unknown one."""
        known = {port[0]: port for port in self.map.PARAMETERS}
        for name, value in parameters.items():
            if name not in known:
                raise TypeError(f"{self.map.NAME} has no parameter {name!r}: it has {', '.join(known) or 'none'}")
            self._put_words((known[name],), {name: value})

    def select(self, channel: int) -> None:
        """Select the channel of the next starts. Raises: DriverError if the core has no such channel."""
        _, width = self.map.FIELDS.get("CHANNEL", {"value": (0, 0)})["value"]
        if not 0 <= channel < 1 << width:
            raise DriverError(f"{self.map.NAME} has no channel {channel}: it has {1 << width}")
        if width:
            self._put("CHANNEL", channel)

    @property
    def status_names(self) -> tuple[str, ...]:
        """Names of the status bits, lowest first."""
        return tuple(self.map.FIELDS["SNAPSHOT_STATUS"])

    def start(self, sample: Mapping[str, ArrayLike]) -> None:
        """Start an update with a sample: port to number.

        Raises: DriverError if an update runs, or if the samples come from the stream; then nothing is started.
        """
        if self._field("STATUS", "busy") or (self._streams and self._field("CONTROL", "stream")):
            raise DriverError("the core is busy, or takes its samples from the stream")
        self._started = self._get("UPDATES")
        self._put_words(self.map.SAMPLES, sample)
        self._command("start")

    def wait(self, polls: int = 100_000) -> None:
        """Wait for the end of the update that was started. Raises: DriverError after a number of looks at the core."""
        for _ in range(polls):
            if self._get("UPDATES") != self._started:
                return
        raise DriverError("the update did not finish")

    def snapshot(self) -> Update:
        """The last finished update."""
        self._command("snapshot")
        bits = self._get("SNAPSHOT_STATUS")
        status = tuple(name for name, (low, _) in self.map.FIELDS["SNAPSHOT_STATUS"].items() if bits >> low & 1)
        words = [self.read(offset + 4 * index) for _, offset, count, _ in self.map.OUTPUTS for index in range(count)]
        outputs = {port: values[0] for port, values in from_words(self.map.OUTPUTS, [words]).items()}
        return Update(self._get("SNAPSHOT_UPDATE"), status, outputs)

    def update(self, sample: Mapping[str, ArrayLike]) -> Update:
        """Start an update with a sample, wait for its end, and read it. Raises: as ``start`` and ``wait``."""
        self.start(sample)
        self.wait()
        return self.snapshot()

    @property
    def _streams(self):
        return "stream" in self.map.FIELDS["CONTROL"]

    def _get(self, name):
        return self.read(self.map.REGISTERS[name])

    def _put(self, name, word):
        self.write(self.map.REGISTERS[name], word)

    def _mask(self, name, field):
        low, width = self.map.FIELDS[name][field]
        return ((1 << width) - 1) << low

    def _field(self, name, field):
        return self._get(name) & self._mask(name, field)

    def _command(self, field):
        """Give a command; the stream stays on or off."""
        self._put("CONTROL", self._get("CONTROL") | self._mask("CONTROL", field))

    def _put_words(self, ports, values):
        words = iter(to_words(ports, values)[0].tolist())
        for _, offset, count, _ in ports:
            for index in range(count):
                self.write(offset + 4 * index, next(words))
