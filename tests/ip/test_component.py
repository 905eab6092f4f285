"""The IP-XACT component, against its schema, the Verilog, the files, and the memory map that PeakRDL makes."""

from xml.etree import ElementTree

import pytest
from peakrdl_ipxact import IPXACTExporter, Standard
from systemrdl import RDLCompiler

from strapdown.bus import TABLE_SIZE

from .packages import component_faults, memory_map, read_by_ipyxact, verilog_ports

KINDS = {"streams": ("quaternion_j3", {}), "no streams": ("quaternion_j3", {"streams": False}),
         "channels": ("thesis_x8", {})}


@pytest.fixture(params=KINDS)
def any_package(request, packages):
    """Packages of different interfaces."""
    name, options = KINDS[request.param]
    return packages(name, **options)


def test_component_describes_the_core(any_package):
    assert component_faults(any_package, verilog_ports(any_package)) == []


def test_component_has_the_interfaces_of_the_core(packages):
    def names(**options):
        return [bus.name for bus in read_by_ipyxact(
            packages("quaternion_j3", **options).folder / "component.xml").busInterfaces.busInterface]
    assert names() == ["s_axi", "s_axis", "m_axis", "aclk", "aresetn", "irq"]
    assert names(streams=False) == ["s_axi", "aclk", "aresetn", "irq"]


def test_component_leaves_frequency_and_checksums_to_vivado(package):
    text = (package.folder / "component.xml").read_text(encoding="utf-8")
    assert not [word for word in ("FREQ_HZ", "checksum", "CHECKSUM") if word in text]


def test_component_is_read_by_ipyxact(package):
    read, table = read_by_ipyxact(package.folder / "component.xml"), package.top.component.table
    assert (read.vendor, read.library, read.name, read.version) == ("strapdown", "navigation", table.name, "1.0")
    (block,) = read.memoryMaps.memoryMap[0].addressBlock
    assert (int(block.range), int(block.width)) == (TABLE_SIZE, 32)
    assert [register.name for register in block.register] == [register.name for register in table]
    assert [port.name for port in read.model.ports.port] == [port.name for port in package.top.ports]


def test_memory_map_is_that_of_peakrdl(any_package, tmp_path):
    """PeakRDL reads the RDL, not the table."""
    name = any_package.places.name
    compiler = RDLCompiler()
    compiler.compile_file(str(any_package.folder / "registers" / f"{name}.rdl"))
    exporter = IPXACTExporter(standard=Standard.IEEE_1685_2009)
    exporter.export(compiler.elaborate().top, str(tmp_path / "map.xml"))
    expected = memory_map(ElementTree.parse(tmp_path / "map.xml").getroot())
    assert memory_map(any_package.component) == expected
    assert len(expected) == len(any_package.top.component.table.registers)


PHYSICAL = "</spirit:name>\n          </spirit:physicalPort>"

FAULTS = {
    "a port is wider": ("<spirit:left spirit:format=\"long\">11<", "<spirit:left spirit:format=\"long\">12<",
                        "port s_axi_awaddr differs"),
    "a port is mapped twice": (f"s_axi_arprot{PHYSICAL}", f"s_axi_awprot{PHYSICAL}",
                               "port s_axi_awprot is mapped 2 times"),
    "a port is not mapped": (f"m_axis_tlast{PHYSICAL}", f"m_axis_tend{PHYSICAL}",
                             "m_axis_tend"),
    "a file is missing": ("hdl/QUAT_direct_axi.v<", "hdl/QUAT_direct.v<", "there is no file hdl/QUAT_direct.v"),
    "a stream has no clock": ("s_axi:s_axis:m_axis", "s_axi:s_axis", "m_axis has no clock"),
    "the reset is active high": ("ACTIVE_LOW", "ACTIVE_HIGH", "the reset acts at the wrong level"),
    "an element is out of order": ("<spirit:vendor>strapdown</spirit:vendor>", "", "not expected"),
    "an access is unknown": (">read-only<", ">read<", "read"),
}


@pytest.fixture(scope="module")
def ports(package):
    """Ports of the Verilog of the small core."""
    return verilog_ports(package)


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_of_a_component_are_found(package, ports, fault, tmp_path):
    old, new, message = FAULTS[fault]
    changed = package.copy(tmp_path)
    changed.change("component.xml", old, new)
    assert any(message in found for found in component_faults(changed, ports))
