"""Every kind of generated file passes the linters, but for the rules that its .vlt file names."""

import re

import pyslang
import pytest
from pyslang.ast import Compilation
from pyslang.syntax import SyntaxTree

from strapdown.cores import ATTITUDE_CORES, CONFIGS, SINS, THESIS, THESIS_X8, axi_core, main_module, uart_core
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.export import write, write_core
from strapdown.export.lint import WAIVED, waivers
from strapdown.tools import ToolError
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool, verilator_environment, verilator_root

CORES = {name: (name, THESIS) for name in ATTITUDE_CORES} | {
    config.name: (main_module(config), config) for config in CONFIGS.values() if config not in (THESIS, SINS)}
LINKED = "SINS_uart"
BUSES = {"INS_top_axi": (THESIS, True), "INS_top_axi without streams": (THESIS, False),
         "INS_top_x8_axi": (THESIS_X8, True)}


@pytest.fixture(scope="module", params=[*CORES, LINKED, *BUSES, *VENDOR_OPERATORS])
def verilog(request, make_module, tmp_path_factory):
    """A generated Verilog file: a core, the core with the serial link, a core behind a bus, or an operator."""
    folder, name = tmp_path_factory.mktemp("lint"), request.param
    if name in CORES:
        module, config = CORES[name]
        return write_core(make_module(module, config), config, folder, "strapdown generate")
    if name == LINKED:
        return write(uart_core(SINS, clock_hz=1e8, baud_rate=921_600), folder, command="", config=SINS)
    if name in BUSES:
        config, streams = BUSES[name]
        return write(axi_core(config, streams=streams), folder, command="", config=config)
    return write(VendorOperator(name), folder, command="")


def verilator(path, *options):
    return run_tool([verilator_root() / "bin" / "verilator", "--lint-only", "-Wall", "--quiet", *options, path],
                    environment=verilator_environment())


def test_verilator_is_silent(verilog):
    assert verilator(verilog, verilog.with_suffix(".vlt")).strip() == ""


def test_icarus_is_silent(verilog):
    if missing := icarus_missing():
        pytest.skip(missing)
    assert run_tool(["iverilog", "-g2001", "-Wall", "-o", verilog.with_suffix(".vvp"), verilog]) == ""


def test_slang_finds_no_errors(verilog):
    compilation = Compilation()
    compilation.addSyntaxTree(SyntaxTree.fromFile(str(verilog)))
    assert [str(found.code) for found in compilation.getAllDiagnostics() if found.isError()] == []


def test_slang_finds_errors(tmp_path):
    text = "module wrong(input a, output b);\n  assign b = c;\nendmodule\n"
    (tmp_path / "wrong.v").write_text(text, encoding="utf-8")
    compilation = Compilation()
    compilation.addSyntaxTree(SyntaxTree.fromFile(str(tmp_path / "wrong.v")))
    assert any(found.isError() for found in compilation.getAllDiagnostics()), pyslang.__version__


def test_every_rule_is_waived_for_its_file_only_with_a_reason(tmp_path, make_core):
    path = write_core(make_core("INS_atan", THESIS), THESIS, tmp_path, "")
    text = path.with_suffix(".vlt").read_text(encoding="ascii")
    assert text == waivers("INS_atan")
    assert len(WAIVED) <= 5
    assert re.findall(r'^// .*\nlint_off -rule (\w+) -file "\*INS_atan.v"$', text, re.MULTILINE) == [*WAIVED]
    # A fault that a user adds is found in spite of the waivers.
    path.write_text(path.read_text(encoding="ascii").replace("endmodule", "  wire [3:0] own = 5'd7;\nendmodule", 1),
                    encoding="ascii")
    with pytest.raises(ToolError, match="WIDTHTRUNC"):
        verilator(path, path.with_suffix(".vlt"))
