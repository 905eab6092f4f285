"""Files that are written completely or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import get_native_id

__all__ = ["written_together", "written_whole"]


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Context manager: gives the path of a new file or folder, which replaces ``path`` at the end.

    After an exception inside, ``path`` is unchanged and the new file is removed. The folder of ``path`` must exist.
    """
    partial = _beside(path)
    try:
        yield partial
        if path.is_dir():
            shutil.rmtree(path)
        partial.replace(path)
    finally:
        _remove(partial)


@contextmanager
def written_together(directory: Path) -> Iterator[Path]:
    """Context manager: gives an empty folder, whose files, those in its folders too, are moved into ``directory`` at
    the end.

    After an exception inside, ``directory`` is unchanged: no file is replaced, and a folder that did not exist is not
    made. Files of ``directory`` with other names are kept.
    """
    created = [folder for folder in (directory, *directory.parents) if not folder.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # Inside the folder, not beside it, because a rename must not cross file systems.
        partial = _beside(directory / "files")
        try:
            partial.mkdir()
            yield partial
            for file in sorted(path for path in partial.rglob("*") if path.is_file()):
                place = directory / file.relative_to(partial)
                place.parent.mkdir(parents=True, exist_ok=True)
                file.replace(place)
        finally:
            _remove(partial)
    except BaseException:
        for folder in created:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        raise


def _beside(path):
    """A name beside ``path`` that no other process or thread uses."""
    return path.with_name(f"{path.name}.{get_native_id()}.partial")


def _remove(partial):
    """Remove a file or folder if it exists."""
    if partial.is_dir():
        shutil.rmtree(partial)
    partial.unlink(missing_ok=True)
