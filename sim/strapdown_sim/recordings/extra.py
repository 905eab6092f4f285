"""Readers that an extra of the package installs."""

import importlib
from pathlib import Path
from types import ModuleType

from .recording import RecordingError

__all__ = ["needed"]


def needed(path: Path, form: str, module: str) -> ModuleType:
    """A module that the extra ``logs`` installs. Raises: RecordingError, with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise RecordingError(f"{path}: to read {form} files, install their reader: "
                             "pip install 'strapdown[logs]'") from None
