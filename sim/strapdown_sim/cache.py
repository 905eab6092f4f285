"""Results that are made once and stored in a folder."""

import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from strapdown.files import written_whole

__all__ = ["Cache", "NotMadeError", "digest"]


LOCK = ".lock"


def digest(*texts: str) -> str:
    """SHA-256 of texts, in hexadecimal digits."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


class NotMadeError(LookupError):
    """A result is not in a cache that makes none."""


class Cache:
    """A folder of results (files or folders). Each is made once, even if several processes need it.

    External tools write the results to a path, so a library that stores Python values does not fit.

    Parameters
    ----------
    directory : path-like
        The folder; it is made together with the first result.
    making : bool
        Whether results are made; if not, one that is missing raises a NotMadeError.
    """

    def __init__(self, directory: str | os.PathLike, *, making: bool = True) -> None:
        self._directory, self._making = Path(directory), making

    def as_it_is(self) -> "Cache":
        """The same folder as a cache that makes nothing."""
        return Cache(self._directory, making=False)

    def entries(self) -> dict[str, bytes]:
        """Contents of all files of the results, by their names."""
        return {str(path.relative_to(self._directory)): path.read_bytes() for path in sorted(self._directory.rglob("*"))
                if path.is_file() and path.suffix != LOCK}

    def add(self, entries: Mapping[str, bytes]) -> None:
        """Put the ``entries`` of another cache into this one, except for results that it has."""
        results: dict[str, dict[Path, bytes]] = {}
        for name, data in entries.items():
            result, *inner = Path(name).parts
            results.setdefault(result, {})[Path(*inner)] = data

        def make(path, files):
            for inner, data in files.items():
                (path / inner).parent.mkdir(parents=True, exist_ok=True)
                (path / inner).write_bytes(data)

        for result, files in results.items():
            self.named(result, partial(make, files=files))

    def named(self, name: str, make: Callable[[Path], object]) -> Path:
        """Path of the result called ``name``; ``make(path)`` makes it if it does not exist.

        The name must identify everything that the result depends on. An incomplete result is made again.
        """
        path = self._directory / name
        if not self._making:
            if not path.exists():
                raise NotMadeError(name)
            return path
        self._directory.mkdir(parents=True, exist_ok=True)
        # If several processes need the same result, one makes it and the others wait.
        with path.with_name(f"{name}{LOCK}").open("w", encoding="utf-8") as lock:
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
