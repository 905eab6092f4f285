"""The files of a package, and their places in its folder."""

from pathlib import Path

from strapdown.bus import RegisterTable
from strapdown.files import written_together

from . import page, rdl

__all__ = ["register_files", "write_package"]


def register_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file that follows from a register table alone to its text."""
    return {f"{table.name}.rdl": rdl.text(table), f"{table.name}.md": page.text(table)}


def write_package(table: RegisterTable, directory: Path) -> Path:
    """Write the package of a core to a folder, which is made if it is missing.

    Raises: OSError if the files cannot be written; then no file has changed.
    """
    with written_together(directory) as partial:
        (partial / "registers").mkdir()
        for file, text in register_files(table).items():
            (partial / "registers" / file).write_text(text, encoding="utf-8")
    return directory
