"""Scripts, constraints and descriptions for tools, from the templates beside this file."""

import re
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from strapdown.ascii import ascii_text
from strapdown.bus import TABLE_SIZE

from . import peakrdl
from .component import BUSES, FAMILIES, interfaces
from .memory_map import ACCESS, BLOCK

__all__ = ["driver_description", "filled", "scripts"]

PART = "xc7z020clg400-1"
"""Part for which Vivado packages a core; any of the families would do."""

ISE_PART = "Spartan6", "xc6slx45", "csg324", "-3"
"""Family, device, package and speed grade for which ISE synthesises, unless others are given."""

ADDRESS = 0x43C0_0000
"""Address of the core in the example design."""

TEMPLATES = Environment(loader=FileSystemLoader(Path(__file__).parent / "templates"), undefined=StrictUndefined,
                        autoescape=False, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)

def tcl_word(text: str) -> str:
    """A text as one word of Tcl."""
    return '"' + re.sub(r'[\\"$\[\]{}]', r"\\\g<0>", text) + '"'


TEMPLATES.filters["word"] = tcl_word


def filled(template: str, **values: object) -> str:
    """Text of a template, in ASCII."""
    text = TEMPLATES.get_template(template).render(**values)
    return re.sub(r"[^\n\t]+", lambda found: ascii_text(found[0]), text)


def scripts(top, places, command) -> dict[str, str]:
    """Maps each script, constraint and description for a tool to its text.

    Parameters
    ----------
    top : Top
        With an AxiCore.
    places : Places
        Of its package.
    command : str
        The command line that makes the package again, quoted for a shell; empty for none.
    """
    table = top.component.table
    buses = [bus for bus in interfaces(top) if bus in BUSES]
    values = {
        "name": places.name, "vlnv": places.vlnv, "places": places, "part": PART, "ise_part": ISE_PART,
        "address": ADDRESS, "block": BLOCK, "size": TABLE_SIZE, "registers": table.registers, "access": ACCESS,
        "families": FAMILIES, "buses": buses, "streams": table.streams,
        "configuration": table.configuration, "title": top.component.title, "command": command,
        "peakrdl": peakrdl.installed(),
        "display": f"{places.name}: {table.title}",
        "description": f"{top.component.title}. Configuration {table.configuration}."}
    return {path: filled(template, **values) for path, template in {
        "package_ip.tcl": "package_ip.tcl", "example.tcl": "example.tcl", "ise.tcl": "ise.tcl",
        places.gui: "xgui.tcl", places.clock_alone: "ooc.xdc", "strapdown.core": "strapdown.core",
        "generator.core": "generator.core", "fusesoc_generator.py": "fusesoc_generator.py",
        "README.md": "README.md"}.items()}


def driver_description(places, sources) -> dict[str, str]:
    """Maps each file that describes the driver to Vivado and Vitis to its text.

    Parameters
    ----------
    places : Places
        Of the package.
    sources : iterable of str
        Names of the C files and headers of the driver.
    """
    values = {"name": places.name, "vlnv": places.vlnv,
              "c_files": [file for file in sources if file.endswith(".c")],
              "headers": [file for file in sources if file.endswith(".h")]}
    return {path: filled(template, **values) for path, template in {
        f"{places.data}/{places.name}.mdd": "driver.mdd", f"{places.data}/{places.name}.tcl": "driver.tcl",
        f"{places.sources}/Makefile": "driver.mk"}.items()}
