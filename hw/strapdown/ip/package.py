"""The files of a package, and their places in its folder."""

from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path

from strapdown.bus import RegisterTable
from strapdown.config import Config
from strapdown.cores import Top
from strapdown.export import write
from strapdown.files import written_together

from . import c_header, device_tree, page, peakrdl, python_map, rdl
from .bench import bench
from .component import component
from .diagram import block_diagram
from .guide import guide_text
from .places import Places
from .scripts import ADDRESS, driver_description, scripts

__all__ = ["driver_files", "linux_files", "register_files", "write_package"]


def register_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file that follows from a register table alone to its text."""
    return {f"{table.name}.rdl": rdl.text(table), f"{table.name}.md": page.text(table),
            f"{table.name}.h": c_header.text(table), f"{table.name}_map.py": python_map.text(table)}


def driver_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file of the driver in C to its text; ``register_files`` has the header of the core."""
    return _texts("driver") | {f"{c_header.DRIVER_TABLE}.h": c_header.text(c_header.driver_table(table))}


def linux_files(table: RegisterTable) -> dict[str, str]:
    """Maps the name of each file for Linux to its text: the driver for /dev/uio, and the node of the device tree."""
    return _texts("linux") | {f"{table.name}.dtsi": device_tree.text(table, ADDRESS)}


def _texts(folder):
    """Maps the name of each file of a folder beside this module to its text."""
    sources = sorted((files(__package__) / folder).iterdir(), key=lambda path: path.name)
    return {path.name: path.read_text(encoding="utf-8") for path in sources if path.is_file()}


def write_package(top: Top, config: Config, directory: Path, *, command: str) -> Path:
    """Write the package of a core behind a bus to a folder, which is made if it is missing.

    Parameters
    ----------
    top : Top
        With an AxiCore, as ``axi_core`` makes it.
    config : Config
        Its configuration.
    directory : Path
    command : str
        The command line that makes the package again, quoted for a shell.

    Returns
    -------
    Path
        The folder. It has the memory map of PeakRDL, ``registers/NAME.xml``, only if PeakRDL is installed.

    Raises: OSError if the files cannot be written; then no file has changed.
    """
    table, places = top.component.table, Places(top.component.name)
    registers = register_files(table)
    sources = driver_files(table) | {f"{table.name}.h": registers[f"{table.name}.h"]}
    drivers = {f"{places.sources}/{file}": text for file, text in sources.items()} | driver_description(places, sources)
    texts = {
        places.component: component(top, places, drivers),
        places.guide: guide_text(config, top, picture=Path(places.blocks).name),
        **{f"registers/{file}": text for file, text in registers.items()},
        **{f"linux/{file}": text for file, text in linux_files(table).items()},
        **({places.peakrdl: peakrdl.text(registers[f"{table.name}.rdl"], places.vlnv)} if peakrdl.installed() else {}),
        **scripts(top, places, command), **bench(top, config, places), **drivers,
        # The metadata of the package have it also in an installation.
        "LICENSE": distribution("strapdown").read_text("licenses/LICENSE") or ""}
    with written_together(directory) as partial:
        write(top, partial / places.hdl, command=command, config=config)
        for file, text in texts.items():
            path = partial / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        block_diagram(top, partial / places.blocks)
    return directory
