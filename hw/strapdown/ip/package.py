"""The files of a package, and their places in its folder."""

from importlib.resources import files
from pathlib import Path

from strapdown.bus import RegisterTable
from strapdown.files import written_together

from . import c_header, page, python_map, rdl

__all__ = ["driver_files", "register_files", "write_package"]


def register_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file that follows from a register table alone to its text."""
    return {f"{table.name}.rdl": rdl.text(table), f"{table.name}.md": page.text(table),
            f"{table.name}.h": c_header.text(table), f"{table.name}_map.py": python_map.text(table)}


def driver_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file of the driver in C to its text; ``register_files`` has the header of the core."""
    sources = sorted((files(__package__) / "driver").iterdir(), key=lambda path: path.name)
    return ({path.name: path.read_text(encoding="utf-8") for path in sources}
            | {f"{c_header.DRIVER_TABLE}.h": c_header.text(c_header.driver_table(table))})


def write_package(table: RegisterTable, directory: Path) -> Path:
    """Write the package of a core to a folder, which is made if it is missing.

    Raises: OSError if the files cannot be written; then no file has changed.
    """
    with written_together(directory) as partial:
        for folder, texts in {"registers": register_files(table), "drivers": driver_files(table)}.items():
            (partial / folder).mkdir()
            for file, text in texts.items():
                (partial / folder / file).write_text(text, encoding="utf-8")
    return directory
