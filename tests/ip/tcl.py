"""Runs a Tcl script of a package under stubs of the vendors' commands, which tclsh executes."""

import re
import subprocess
from pathlib import Path

from .packages import NAMES, SPIRIT, memory_map

STUBS = Path(__file__).with_name("vivado.tcl")

BOARDS = "tul.com.tw:pynq-z2:part0:1.0", "em.avnet.com:zed:part0:1.3", "em.avnet.com:zed:part0:1.4"


def word(value):
    """A Python value as a word of Tcl; texts must have no special characters."""
    if isinstance(value, dict):
        value = [part for pair in value.items() for part in pair]
    if isinstance(value, list | tuple):
        return "{" + " ".join(word(part) for part in value) + "}"
    text = str(value)
    assert re.fullmatch(r"[\w.:*/%-]*", text), text
    return text or "{}"


def facts_of(package, **changes):
    """What the stubs know of a package, from its component.xml, and of this "Vivado"."""
    root = package.component
    pins, interfaces = {}, {}
    for bus in root.iterfind("s:busInterfaces/s:busInterface", NAMES):
        name = bus.findtext("s:name", "", NAMES)
        kind = bus.find("s:busType", NAMES).get(f"{{{SPIRIT}}}name")
        master = bus.find("s:master", NAMES) is not None
        if kind in ("aximm", "axis"):
            interfaces[name] = ("master" if master else "slave", kind, "aclk")
        else:
            pins[name] = ("out" if master else "in", kind)
    (block,) = root.iterfind("s:memoryMaps/s:memoryMap/s:addressBlock", NAMES)
    vlnv = [root.findtext(f"s:{part}", "", NAMES) for part in ("vendor", "library", "name", "version")]
    registers = [(name, offset, size, [field[:4] for field in fields])
                 for name, offset, size, _, _, fields in memory_map(root)]
    return {"name": vlnv[2], "vlnv": ":".join(vlnv), "pins": pins, "interfaces": interfaces,
            "range": block.findtext("s:range", "", NAMES), "registers": registers, "boards": BOARDS,
            "progress": "100%", "slack": 0.5, "synthesised": 1} | changes


def run(package, script, *arguments, folder, **changes):
    """Runs a script of a package.

    Returns the exit status, what it printed to the error stream, and the calls: words between blanks, the folder of the
    package as a point.
    """
    described, record = folder / "facts.tcl", folder / "calls"
    described.write_text(f"set facts {word(facts_of(package, **changes))}\n", encoding="utf-8")
    record.write_text("", encoding="utf-8")
    done = subprocess.run(["tclsh", STUBS, described, record, package.folder / script, *arguments], cwd=folder,
                          capture_output=True, text=True, check=False)
    calls = record.read_text(encoding="utf-8").replace(str(package.folder), ".")
    return done.returncode, done.stderr.strip(), calls
