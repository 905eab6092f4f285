"""Verilog and JSON of the operators under the vendor cores' names."""

import json
import re
from importlib.metadata import version

from .backend import to_verilog
from .verilog import comment, paragraph, table, versions

__all__ = ["operator_description", "operator_text", "write_operator"]


def operator_text(vendor):
    """The Verilog file of a ``VendorOperator``: header and modules. Equal bytes on every run."""
    kind = vendor.kind
    # Tidied under a name that no signal has: `less` is also one of the comparison's.
    top = f"vendor_{kind.name}"
    body = to_verilog(vendor, top).replace(top, kind.name)
    if kind.result.width == 1:
        # The vendor declares a bit of result as a vector of one.
        head, end, rest = body.partition("endmodule\n")
        body = re.sub(rf"^  (output|wire|reg) (?={kind.result.name}\b)", r"  \1 [0:0] ", head, flags=re.MULTILINE) \
            + end + rest
    return _header(vendor) + body


def _header(vendor):
    kind = vendor.kind
    lines = [f"{kind.name}: {kind.title}", "",
             f"Made by strapdown {version('strapdown')}. Change the generator's options, not this file.",
             "", "PORTS",
             *table((port["name"], f"{port['direction']} {port['width']}", port["meaning"]) for port in _ports(vendor)),
             "", "TIMING"]
    lines += paragraph(
        f"Operands are taken at each rising edge of clk with {kind.new_data} and ce high, one operation a cycle. "
        f"rdy is high with the result {vendor.latency} edges with ce high later, the taking one counted. While ce is "
        "low, all registers hold. sclr high at a rising edge takes back all operations under way, whatever ce is.")
    lines += paragraph(
        f"The operator has {vendor.operator.latency} register ranks"
        + (f"; {vendor.extra_ranks} more follow it, which synthesis may move into it (retiming)."
           if vendor.extra_ranks else "."))
    lines += ["", "NUMBERS"]
    for note in _notes(kind):
        lines += paragraph(note)
    return comment(lines)


def _notes(kind):
    """The notes of a kind, and what its format does with subnormals."""
    notes = [*kind.notes]
    if any(port.width == 32 for port in kind.operands):
        notes.append("A subnormal operand counts as zero of its sign.")
        if kind.result.width == 32:
            notes.append("A result below 2^-126, before rounding, becomes zero of its sign.")
    return notes


def _ports(vendor):
    """All ports: name, direction, width, meaning."""
    kind = vendor.kind
    meaning = {kind.new_data: "new data: takes the operands", "clk": "clock, rising edge",
               "sclr": "synchronous clear, overrides ce", "ce": "clock enable",
               "rdy": "high while the result of an operation is there",
               **{port.name: port.meaning for port in (*kind.operands, kind.result)}}
    return [{"name": name, "direction": "input" if member.flow.name == "In" else "output",
             "width": len(getattr(vendor, name)), "meaning": meaning[name]}
            for name, member in vendor.signature.members.items()]


def operator_description(vendor, command):
    """What the JSON beside a Verilog file says, as a dict; ``command`` makes the file again."""
    return {
        "module": vendor.kind.name,
        "description": vendor.kind.title,
        "latency_cycles": vendor.latency,
        "interval_cycles": 1,
        "extra_ranks": vendor.extra_ranks,
        "ports": _ports(vendor),
        "numbers": _notes(vendor.kind),
        "versions": versions(),
        "command_line": command,
    }


def write_operator(vendor, directory, command):
    """Write ``<module>.v`` and ``<module>.json`` into ``directory``; returns the Verilog's path."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{vendor.kind.name}.v"
    path.write_text(operator_text(vendor))
    path.with_suffix(".json").write_text(json.dumps(operator_description(vendor, command), indent=2) + "\n")
    return path
