"""The Tcl scripts of a package, in tclsh, under stubs that know the commands, options and objects of Vivado and ISE."""

from pathlib import Path

import pytest

from .tcl import run

GOLDEN = Path(__file__).with_name("golden")

pytestmark = pytest.mark.ip

RUNS = {
    "package_ip": ("package_ip.tcl",),
    "pynq-z2": ("example.tcl", "pynq-z2"),
    "zedboard": ("example.tcl", "zedboard", "50"),
    "ise": ("ise.tcl",),
    "ooc": ("constraints/QUAT_direct_axi_ooc.xdc",),
    "xgui": ("xgui/QUAT_direct_axi_v1_0.tcl",),
    "driver": ("drivers/QUAT_direct_axi_v1_0/data/QUAT_direct_axi.tcl",),
}
"""Maps each list of calls to the script and its arguments."""


@pytest.fixture
def copied(package, tmp_path):
    """A package that may be changed, and in which scripts may write."""
    return package.copy(tmp_path)


@pytest.mark.parametrize("name", RUNS)
def test_calls_of_a_script(copied, name, tmp_path):
    status, errors, calls = run(copied, *RUNS[name], folder=tmp_path)
    assert (status, errors) == (0, "")
    assert calls == (GOLDEN / f"{name}.txt").read_text(encoding="utf-8")


def test_ise_takes_another_part(copied, tmp_path):
    status, errors, calls = run(copied, "ise.tcl", "Virtex5", "xc5vlx50t", "ff1136", "-1", folder=tmp_path)
    assert (status, errors) == (0, "")
    assert "project set device xc5vlx50t" in calls


def test_example_leaves_its_results_in_a_folder(copied, tmp_path):
    run(copied, "example.tcl", "pynq-z2", folder=tmp_path)
    assert {path.name for path in (copied.folder / "build" / "pynq-z2").iterdir() if path.is_file()} == {
        "QUAT_direct_axi.bit", "QUAT_direct_axi.hwh", "QUAT_direct_axi.xsa", "timing.rpt", "utilization.rpt",
        "utilization_by_cell.rpt"}


def test_example_warns_of_a_clock_that_is_too_fast(copied, tmp_path):
    assert run(copied, "example.tcl", "pynq-z2", "150", folder=tmp_path, slack=-0.5)[:2] == (
        0, "example.tcl: the design is too slow for 150 MHz: give a lower clock as the second argument")
    assert (copied.folder / "build" / "pynq-z2" / "QUAT_direct_axi.xsa").exists()


def test_scripts_of_a_core_without_streams(packages, tmp_path):
    copied = packages("quaternion_j3", streams=False).copy(tmp_path)
    for script in ("package_ip.tcl",), ("example.tcl", "pynq-z2"):
        status, errors, calls = run(copied, *script, folder=tmp_path)
        assert (status, errors) == (0, "")
        assert "axis" not in calls
        assert "dma" not in calls


def test_scripts_of_a_core_with_channels(packages, tmp_path):
    copied = packages("thesis_x8").copy(tmp_path)
    for script in ("package_ip.tcl",), ("example.tcl", "pynq-z2"), ("ise.tcl",):
        assert run(copied, *script, folder=tmp_path)[:2] == (0, "")


MESSAGES = {
    "no board is named": (("example.tcl",), {}, "name a board, as in: vivado -mode batch -source example.tcl -tclargs "
                                                "pynq-z2. Boards: pynq-z2 zedboard"),
    "the board is unknown": (("example.tcl", "zybo"), {}, "name a board"),
    "the board files are missing": (("example.tcl", "zedboard"), {"boards": ["tul.com.tw:pynq-z2:part0:1.0"]},
                                    "this Vivado has no board files em.avnet.com:zed:part0:*"),
    "the implementation fails": (("example.tcl", "pynq-z2"), {"progress": "42%"}, "the implementation failed: see"),
    "the part is no part": (("ise.tcl", "Spartan6"), {}, "name a part by family, device, package and speed"),
    "the synthesis fails": (("ise.tcl",), {"synthesised": 0}, "the synthesis failed: see"),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_a_script_ends_with_a_sentence(copied, name, tmp_path):
    words, facts, message = MESSAGES[name]
    status, errors, _ = run(copied, *words, folder=tmp_path, **facts)
    assert status == 1
    assert errors.startswith(f"{words[0]}: ")
    assert message in errors
    assert "\n" not in errors


EXAMPLE, PACKAGER, ISE, CLOCK = RUNS["pynq-z2"], RUNS["package_ip"], RUNS["ise"], RUNS["ooc"]

FAULTS = {
    "unknown command": (EXAMPLE, "save_bd_design", "save_design", "invalid command name"),
    "unknown option": (EXAMPLE, "-to_step", "-until", "unknown option -until"),
    "option without value": (EXAMPLE, "-force -file [file join $folder $name.xsa]", "-force -file",
                             "no value after it"),
    "too few words": (EXAMPLE, "create_bd_design system", "create_bd_design", "takes 1 to 1 words"),
    "missing file": (PACKAGER, "hdl/QUAT_direct_axi.v", "hdl/QUAT_direct.v", "there is no file"),
    "missing constraints": (PACKAGER, "_ooc.xdc", ".xdc", "there is no file"),
    "unknown use of a file": (PACKAGER, "USED_IN {out_of_context", "USED_IN {alone", "cannot be used in alone"),
    "pin that the core does not have": (EXAMPLE, "core/aresetn", "core/rst_n", "there is no pin core/rst_n"),
    "interface that the core does not have": (EXAMPLE, "core/s_axis", "core/s_stream", "there is no interface"),
    "interfaces of two kinds": (EXAMPLE, "control/M01_AXI dma/S_AXI_LITE", "control/M01_AXI dma/S_AXIS_S2MM",
                                "is of another kind"),
    "unconnected clock of the core": (EXAMPLE, " core/aclk", "", "input core/aclk is not connected"),
    "unconnected clock of the DMA": (EXAMPLE, " dma/m_axi_s2mm_aclk", "", "input dma/m_axi_s2mm_aclk is not connected"),
    "unconnected reset": (EXAMPLE, " dma/axi_resetn", "", "input dma/axi_resetn is not connected"),
    "unconnected interrupt": (EXAMPLE, "connect core/irq ps7/IRQ_F2P", "", "input ps7/IRQ_F2P is not connected"),
    "unconnected stream": (EXAMPLE, "join_interfaces core/m_axis dma/S_AXIS_S2MM", "", "is not connected"),
    "two sources": (EXAMPLE, "connect core/irq ps7/IRQ_F2P", "connect core/irq ps7/IRQ_F2P ps7/IRQ_F2P",
                    "connected twice"),
    "port of the processor that is off": (EXAMPLE, "CONFIG.PCW_USE_S_AXI_HP0 1", "CONFIG.PCW_USE_S_AXI_HP0 0",
                                          "there is no pin ps7/S_AXI_HP0_ACLK"),
    "scatter and gather": (EXAMPLE, "CONFIG.c_include_sg 0", "CONFIG.c_include_sg 1", "m_axi_sg_aclk is not connected"),
    "unknown setting": (EXAMPLE, "CONFIG.c_sg_length_width", "CONFIG.c_length_width", "has no property"),
    "core that is not in the catalogue": (EXAMPLE, "update_ip_catalog", "", "the IP catalogue of this Vivado has no"),
    "unknown segment": (EXAMPLE, "core/s_axi/reg0", "core/s_axi/regs", "there is no segment"),
    "no address": (EXAMPLE, "foreach space {dma/Data_MM2S dma/Data_S2MM}", "foreach space {dma/Data_MM2S}",
                   "dma/Data_S2MM has no memory"),
    "clock net of another source": (EXAMPLE, "connect ps7/FCLK_CLK0 ps7/S_AXI_HP0_ACLK",
                                    "connect ps7/FCLK_RESET0_N ps7/S_AXI_HP0_ACLK", "is of another kind"),
    "wrong top": (EXAMPLE, "set_property top system_wrapper", "set_property top system", "the wrapper is not the top"),
    "wrong part": (EXAMPLE, "xc7z020clg400-1", "xc7z020clg400-9", "unknown part"),
    "stream without clock": (PACKAGER, "ipx::associate_bus_interfaces -busif m_axis -clock aclk $core", "",
                             "interface m_axis has no clock"),
    "interrupt without level": (PACKAGER, "set_property value LEVEL_HIGH", "set_property value EDGE_RISING",
                                "irq has no sensitivity"),
    "register elsewhere": (PACKAGER, "{SCRATCH 0x00C", "{SCRATCH 0x0C0", "is not that of component.xml"),
    "clock at a port that does not exist": (CLOCK, "get_ports aclk", "get_ports clk", "there is no port clk"),
    "clock at the reset": (CLOCK, "get_ports aclk", "get_ports aresetn", "is no clock"),
    "unknown setting of ISE": (ISE, "Add I/O Buffers", "Add IO Buffers", "is not known"),
    "unknown process of ISE": (ISE, "process run \"Synthesize - XST\"", "process run Synthesize",
                               "there is no process"),
    "missing file in ISE": (ISE, "hdl/QUAT_direct_axi.v", "QUAT_direct_axi.v", "there is no file"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_of_a_script_are_found(copied, fault, tmp_path):
    words, old, new, message = FAULTS[fault]
    copied.change(words[0], old, new)
    status, errors, _ = run(copied, *words, folder=tmp_path)
    assert status != 0
    assert message in " ".join(errors.split())
