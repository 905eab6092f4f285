"""Results kept on disk under a hash of everything that they depend on."""

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

__all__ = ["Cache"]


class Cache:
    """A folder of results, each named after the hash of what it was made from.

    Parameters
    ----------
    directory : path-like
        The folder; it is made when the first result is.
    """

    def __init__(self, directory: str | os.PathLike) -> None:
        self._directory = Path(directory)

    def file(self, inputs: dict, suffix: str, make: Callable[[Path], object]) -> Path:
        """Path of a result, made first if it is not there.

        Parameters
        ----------
        inputs : dict
            All that the result depends on, as JSON values: sources, options, versions.
        suffix : str
            End of the file name, with its dot.
        make : callable
            Called with the path to write to. A result that was cut off is made again.
        """
        key = hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:24]
        path = self._directory / f"{key}{suffix}"
        if not path.exists():
            self._directory.mkdir(parents=True, exist_ok=True)
            partial = path.with_name(f"{key}.{os.getpid()}.partial")
            make(partial)
            partial.replace(path)
        return path
