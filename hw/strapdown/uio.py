"""Driver for Linux: a core behind /dev/uio. See docs/software.md."""

import mmap
import os
import select
from types import ModuleType

import numpy as np

from .device import Driver

__all__ = ["Uio"]


class Uio(Driver):
    """A core behind a device of the driver ``uio_pdrv_genirq``.

    Parameters
    ----------
    path : str
        As ``/dev/uio0``.
    map : module
        As in ``Driver.open``.

    Raises: OSError if the device cannot be opened; DriverError, as ``Driver.open``.
    """

    def __init__(self, path: str | os.PathLike, map: ModuleType) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_SYNC)
        # NumPy stores an aligned element with one access.
        self._words = np.frombuffer(mmap.mmap(self._file, map.SIZE), "<u4")
        self.open(map)

    def read(self, offset: int) -> int:
        return int(self._words[offset // self._words.itemsize])

    def write(self, offset: int, value: int) -> None:
        self._words[offset // self._words.itemsize] = value

    def enable(self, *flags: str) -> None:
        """Enable the interrupts of flags, by their names in INTERRUPT_ENABLE, and disable the others."""
        self._put("INTERRUPT_ENABLE", sum(self._mask("INTERRUPT_ENABLE", flag) for flag in flags))

    def interrupt(self, timeout_s: float) -> tuple[str, ...]:
        """Wait for an interrupt; returns the flags that were set and enabled, and clears them; none after the time."""
        os.write(self._file, (1).to_bytes(4, "little"))
        if not select.select([self._file], [], [], timeout_s)[0]:
            return ()
        os.read(self._file, 4)
        flags = self._get("INTERRUPT_FLAGS") & self._get("INTERRUPT_ENABLE")
        self._put("INTERRUPT_FLAGS", flags)
        return tuple(name for name in self.map.FIELDS["INTERRUPT_FLAGS"] if flags & self._mask("INTERRUPT_FLAGS", name))
