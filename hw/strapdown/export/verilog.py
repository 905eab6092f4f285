"""Plain Verilog-2001 with readable names, a header that explains it, a JSON description and waivers of lint rules."""

import inspect
import json
import re
from functools import partial
from importlib.metadata import metadata, version
from textwrap import dedent, wrap

from strapdown.ascii import ascii_text
from strapdown.files import written_together

from .backend import to_verilog
from .constants import with_constants
from .explain import operations_of_cycles, program_listing
from .lint import waivers

__all__ = ["description", "verilog_text", "versions", "without_comments", "write",
           "write_core"]

LINE_LENGTH = 104
"""Longest line of a paragraph in a header."""


LONGEST_LINE = 150
"""Longest line of a header, without the characters that make it a comment."""

MICROCODE = "microcode"
"""Name of the memory of the words; each gets its line of the listing as a comment."""


def write(top, directory, *, command, config=None):
    """Write the Verilog file of a module, a JSON file that describes it, and waivers of Verilator's lint rules.

    Parameters
    ----------
    top : Top
        The module. Its component gives name, title, ports, header and figures.
    directory : Path
        Folder for ``NAME.v``, ``NAME.json`` and ``NAME.vlt``; made if it is missing.
    command : str
        The command line that makes the files again, quoted for a shell; empty for none.
    config : Config or None
        The configuration of the module, if any.

    Returns
    -------
    Path
        The Verilog file.

    Raises: OSError if the files cannot be written; then no file has changed.
    """
    name = top.component.name
    files = {f"{name}.v": verilog_text(top, config, command=command),
             f"{name}.json": json.dumps(description(top, config, command), indent=2, allow_nan=False) + "\n",
             f"{name}.vlt": waivers(name)}
    with written_together(directory) as partial:
        for file, text in files.items():
            (partial / file).write_text(text, encoding="utf-8")
    return directory / f"{name}.v"


def write_core(core, config, directory, command):
    """Like ``write``, for a core from a configuration; returns the path of the Verilog."""
    return write(core, directory, command=command, config=config)


def verilog_text(top, config=None, *, command=""):
    """The Verilog file of a Top, in ASCII: header and modules; arguments as in ``write``.

    The text depends only on its arguments and the installed versions: every run and machine
    gives equal bytes.
    """
    vectors = [port.name for port in top.ports if port.vector]
    name = top.component.name
    words = {cycle: text for section in top.component.sections if section.program
             for cycle, text in operations_of_cycles(section.program)}
    text = to_verilog(top, name, vectors=vectors, comments={MICROCODE: words})
    return _header(top, config, command) + with_constants(text, name, top.constants)


def without_comments(text):
    """Verilog without its comments, and without lines that hold nothing else."""
    return re.sub(r" *//.*", "", re.sub(r"^ *//.*\n", "", text, flags=re.MULTILINE))


def description(top, config, command):
    """Contents of the JSON file beside a Verilog file, as a dict; arguments as in ``write``."""
    component = top.component
    return {
        "module": component.name,
        "description": component.title,
        **({"configuration": config.values} if config else {}),
        "latency_cycles": top.latency,
        "ports": [{"name": port.name, "direction": port.direction, "width": port.width, "meaning": port.meaning}
                  for port in top.ports],
        **({"parameters": [{"name": constant.name, "value": constant.digits, "meaning": constant.meaning}
                           for constant in top.constants]} if top.constants else {}),
        **component.facts,
        "versions": versions(),
        "command_line": command,
    }


def versions():
    """Versions of all packages that the Verilog depends on."""
    return {name: version(name) for name in ("strapdown", "amaranth")}


def _header(top, config, command):
    """The comment at the head of a Verilog file."""
    component = top.component
    tools = ", ".join(f"{name} {number}" for name, number in versions().items() if name != "strapdown")
    source, changed = (f", from configuration {config.name} ({config.description})",
                       "the kernel or the configuration") if config else ("", "the generator's options")
    lines = [f"{component.name}: {component.title}", "",
             f"Made by strapdown {version('strapdown')}, with {tools}{source}.",
             *([f"Command: {command}"] if command else []),
             f"Change {changed}, not this file.",
             f"SPDX-License-Identifier: {metadata('strapdown')['License-Expression']}"]
    if component.equations:
        lines += ["", "EQUATIONS"]
        for kernel in component.equations:
            lines += _equation(kernel)
    if config:
        lines += ["", "CONFIGURATION", *_table(sorted(config.values.items()))]
    lines += ["", "PORTS",
              *_table((port.name, f"{port.direction} {port.width}", port.meaning) for port in top.ports)]
    if top.constants:
        lines += ["", "PARAMETERS", *_table((constant.name, f"{constant.width}'h{constant.digits}", constant.meaning)
                                            for constant in top.constants)]
    for section in component.sections:
        lines += ["", section.title]
        for paragraph in section.paragraphs:
            lines += _paragraph(paragraph)
        if section.rows:
            lines += _table(section.rows)
        if section.program:
            lines += (f"  {line}" for line in program_listing(section.program))
    return _comment(lines) + "\n"


def _comment(lines):
    """Lines as Verilog comments, in printable ASCII; a line break inside a line starts another comment."""
    parts = (ascii_text(part) for line in lines for part in line.splitlines() or [""])
    return "".join(f"// {short}".rstrip() + "\n" for part in parts for short in _short(part))


def _short(line):
    """A line, or several if it is long."""
    indent = len(line) - len(line.lstrip()) + 4
    return wrap(line, LONGEST_LINE, subsequent_indent=" " * indent) or [""]


def _equation(kernel):
    """Lines on a kernel: the first paragraph of its docstring, else its source."""
    while isinstance(kernel, partial):
        kernel = kernel.func
    name = getattr(kernel, "__name__", type(kernel).__name__)
    if text := (inspect.getdoc(kernel) or "").partition("\n\n")[0]:
        return _paragraph(f"{name}: {text}")
    try:
        source = dedent(inspect.getsource(kernel))
    except (OSError, TypeError):
        return _paragraph(f"{name}: see the microprogram below")
    return [f"  {line}" for line in source.rstrip().splitlines()]


def _paragraph(text):
    """Text as indented lines of a header."""
    return wrap(text, LINE_LENGTH, initial_indent="  ", subsequent_indent="    ")


def _table(rows):
    """Rows of cells as indented, aligned lines of a header."""
    rows = [tuple(str(cell) for cell in row) for row in rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
