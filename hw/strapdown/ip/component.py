"""The IP-XACT component of a core behind a bus, as Vivado's IP catalogue reads it."""

from collections.abc import Iterable

from strapdown.ascii import ascii_text

from .memory_map import memory_map
from .spirit import document, element, xilinx

__all__ = ["component", "interfaces"]

CLOCK, RESET, INTERRUPT = "aclk", "aresetn", "irq"
"""Ports that are an interface each."""

BUSES = {"s_axi": ("aximm", "slave"), "s_axis": ("axis", "slave"), "m_axis": ("axis", "master")}
"""Interfaces whose ports have a common prefix: their type, and the side of the core."""

FAMILIES = ("artix7", "kintex7", "kintexu", "kintexuplus", "spartan7", "virtex7", "virtexu", "virtexuplus", "zynq",
            "zynquplus")
"""Families of the catalogue; the Verilog has no vendor primitive."""

SYNTHESIS, SIMULATION, GUI, DRIVER = (
    "xilinx_verilogsynthesis", "xilinx_verilogbehavioralsimulation", "xilinx_xpgui", "xilinx_softwaredriver")
"""Views."""

TYPES = {".v": "verilogSource", ".tcl": "tclSource", ".c": "cSource", ".h": "cSource"}
"""File types of IP-XACT; others are the user's."""


def component(top, places, drivers: Iterable[str]) -> str:
    """Text of ``component.xml``.

    Parameters
    ----------
    top : Top
        A core behind a bus: its component has a ``table``.
    places : Places
        Of its package.
    drivers : iterable of str
        Files of the driver, relative to the package.
    """
    table, vlnv = top.component.table, places.vlnv
    return document(element(
        "component",
        element("vendor", vlnv.vendor), element("library", vlnv.library), element("name", vlnv.name),
        element("version", vlnv.version),
        element("busInterfaces", *_interfaces(top)),
        element("memoryMaps", memory_map("s_axi", table)),
        element("model", element("views", *_views(vlnv)), element("ports", *(_port(port) for port in top.ports))),
        element("fileSets", *_file_sets(places, drivers)),
        element("description", ascii_text(f"{top.component.title}. Configuration {table.configuration}.")),
        element("parameters", element(
            "parameter", element("name", "Component_Name"),
            element("value", vlnv.identifier, resolve="user", id="PARAM_VALUE.Component_Name", order=1))),
        element("vendorExtensions", xilinx(
            "coreExtensions",
            xilinx("supportedFamilies", *(xilinx("family", family, lifeCycle="Production") for family in FAMILIES)),
            xilinx("taxonomies", xilinx("taxonomy", "/UserIP")),
            xilinx("displayName", f"{vlnv.name}: {ascii_text(table.title)}"),
            xilinx("vendorDisplayName", vlnv.vendor),
            xilinx("coreRevision", 1)))))


def interfaces(top):
    """Maps each interface to its ports: name of the bus to port of the module."""
    ports = [port.name for port in top.ports]
    buses = {bus: {port.removeprefix(f"{bus}_").upper(): port for port in ports if port.startswith(f"{bus}_")}
             for bus in BUSES}
    return {bus: mapped for bus, mapped in buses.items() if mapped} | {
        CLOCK: {"CLK": CLOCK}, RESET: {"RST": RESET}, INTERRUPT: {"INTERRUPT": INTERRUPT}}


def _interfaces(top):
    """The bus interfaces."""
    mapped, widths = interfaces(top), {port.name: port.width for port in top.ports}
    for bus, (kind, side) in BUSES.items():
        if bus not in mapped:
            continue
        role = element(side, element("memoryMapRef", memoryMapRef=bus)) if kind == "aximm" else element(side)
        if kind == "aximm":
            parameters = {"DATA_WIDTH": widths[f"{bus}_wdata"], "PROTOCOL": "AXI4LITE",
                          "READ_WRITE_MODE": "READ_WRITE", "ADDR_WIDTH": widths[f"{bus}_awaddr"]}
        else:
            parameters = {"TDATA_NUM_BYTES": widths[f"{bus}_tdata"] // 8, "TID_WIDTH": widths.get(f"{bus}_tid", 0),
                          "TDEST_WIDTH": 0, "TUSER_WIDTH": 0, "HAS_TREADY": 1, "HAS_TSTRB": 0, "HAS_TKEEP": 0,
                          "HAS_TLAST": 1}
        yield _interface(bus, "interface", kind, role, mapped[bus], parameters)
    streams = ":".join(bus for bus in BUSES if bus in mapped)
    yield _interface(CLOCK, "signal", "clock", element("slave"), mapped[CLOCK],
                     {"ASSOCIATED_BUSIF": streams, "ASSOCIATED_RESET": RESET})
    yield _interface(RESET, "signal", "reset", element("slave"), mapped[RESET], {"POLARITY": "ACTIVE_LOW"})
    yield _interface(INTERRUPT, "signal", "interrupt", element("master"), mapped[INTERRUPT],
                     {"SENSITIVITY": "LEVEL_HIGH"})


def _interface(name, library, kind, role, ports, parameters):
    """A bus interface of a kind of Vivado's library."""
    vlnv = {"vendor": "xilinx.com", "library": library, "version": "1.0"}
    return element(
        "busInterface", element("name", name), element("busType", **vlnv, name=kind),
        element("abstractionType", **vlnv, name=f"{kind}_rtl"), role,
        element("portMaps", *(element(
            "portMap", element("logicalPort", element("name", logical)),
            element("physicalPort", element("name", physical))) for logical, physical in ports.items())),
        element("parameters", *(element(
            "parameter", element("name", key), element("value", value, id=f"BUSIFPARAM_VALUE.{name.upper()}.{key}"))
            for key, value in parameters.items())))


def _views(vlnv):
    """The views, each with the file set of its name."""
    for name, environment, model in (
            (SYNTHESIS, "verilogSource:vivado.xilinx.com:synthesis", True),
            (SIMULATION, "verilogSource:vivado.xilinx.com:simulation", True),
            (GUI, ":vivado.xilinx.com:xgui.ui", False),
            (DRIVER, ":vivado.xilinx.com:sw.driver", False)):
        yield element(
            "view", element("name", name), element("displayName", name), element("envIdentifier", environment),
            *([element("language", "verilog"), element("modelName", vlnv.name)] if model else []),
            element("fileSetRef", element("localName", f"{name}_view_fileset")))


def _port(port):
    """A port; an optional one has the value that it takes while nothing is connected."""
    vector = [element("vector", element("left", port.width - 1, format="long"),
                      element("right", 0, format="long"))] if port.width > 1 else []
    driver = [element("driver", element("defaultValue", 0, format="long"))] if port.name.endswith(OPTIONAL) else []
    return element("port", element("name", port.name), element(
        "wire", element("direction", {"input": "in", "output": "out"}[port.direction]), *vector,
        element("wireTypeDefs", element("wireTypeDef", element("typeName", "wire"),
                                        element("viewNameRef", SYNTHESIS), element("viewNameRef", SIMULATION))),
        *driver))


OPTIONAL = ("_awprot", "_arprot", "s_axis_tid", "s_axis_tlast")
"""Ends of the names of inputs that may stay unconnected."""


def _file_sets(places, drivers):
    """The file sets of the views."""
    clock = ("xdc", "USED_IN_implementation", "USED_IN_out_of_context", "USED_IN_synthesis")
    for name, files in (
            (SYNTHESIS, {places.verilog: (), places.clock_alone: clock}),
            (SIMULATION, {places.verilog: ()}),
            (GUI, {places.gui: ("XGUI_VERSION_2",)}),
            (DRIVER, {file: ("driver_src",) if "/src/" in file else (f"driver_{file.rpartition('.')[2]}",)
                      for file in drivers})):
        yield element("fileSet", element("name", f"{name}_view_fileset"), *(_file(*file) for file in files.items()))


def _file(path, kinds):
    """A file with its types."""
    known = TYPES.get(path[path.rfind("."):])
    return element("file", element("name", path), *([element("fileType", known)] if known else []),
                   *(element("userFileType", kind) for kind in kinds))
