"""Results that are made once and stored in a folder."""

import fcntl
import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

from strapdown.files import written_whole

__all__ = ["Cache", "digest"]


def digest(*texts: str) -> str:
    """SHA-256 of texts, in hexadecimal digits."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


class Cache:
    """A folder of results (files or folders). Each is made once, even if several processes need it.

    External tools write the results to a path, so a library that stores Python values does not fit.

    Parameters
    ----------
    directory : path-like
        The folder; it is made together with the first result.
    """

    def __init__(self, directory: str | os.PathLike) -> None:
        self._directory = Path(directory)

    def named(self, name: str, make: Callable[[Path], object]) -> Path:
        """Path of the result called ``name``; ``make(path)`` makes it if it does not exist.

        The name must identify everything that the result depends on. An incomplete result is made again.
        """
        path = self._directory / name
        self._directory.mkdir(parents=True, exist_ok=True)
        # If several processes need the same result, one makes it and the others wait.
        with path.with_name(f"{name}.lock").open("w", encoding="utf-8") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                with written_whole(path) as partial:
                    make(partial)
        return path

    def file(self, inputs: dict, suffix: str, make: Callable[[Path], object]) -> Path:
        """Path of the result of ``inputs``; ``make(path)`` makes it if it does not exist.

        Parameters
        ----------
        inputs : dict
            Everything that the result depends on, as JSON values: sources, options, versions.
        suffix : str
            Suffix of the file name, with its dot.
        make : callable
            Called with the path to write to.
        """
        return self.named(f"{digest(json.dumps(inputs, sort_keys=True))[:24]}{suffix}", make)
