"""An openXC7 toolchain: what its folder must hold, its log, its figures. The folder openxc7 has a stand-in for it."""

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_lab.report.path_words import path_words, place_words
from strapdown_lab.synthesis import OpenXc7, PathReportError, ToolMissingError, place_openxc7, read_path

STAND_IN = Path(__file__).parent / "openxc7"

SUM = """
module sum(input clk, input [7:0] a, b, output reg [7:0] y);
  reg [7:0] first;
  always @(posedge clk) begin
    first <= a + b;
    y <= first + b;
  end
endmodule
"""


@pytest.fixture
def folder(tmp_path):
    return Path(shutil.copytree(STAND_IN, tmp_path / "openxc7"))


def test_the_median_of_the_seeds_and_its_path(folder, yosys, cache, tmp_path):
    """The stand-in refuses a netlist with hierarchy, and pins without a location."""
    found = place_openxc7(OpenXc7.found(folder), SUM, "sum", type(cache)(tmp_path / "cache"))
    assert found.fmax_mhz == (100, 110, 120)
    assert found.median_mhz == 110
    assert found.critical == ("first_FDRE_Q_3", "seed_2_FDRE_Q")


def test_the_frequency_after_routing_counts():
    log = ("Info: Max frequency for clock 'clk': 250.00 MHz (PASS at 100.00 MHz)\n\n"
           "Info: Critical path report for clock 'clk' (posedge -> posedge):\nInfo:       type curr  total name\n"
           "Info:   clk-to-q  0.46  0.46 Source inner.a_RAMB18E1_DO.DOADO[3]\nInfo:      setup  0.1  9.0 Setup "
           "inner.b_FDRE_Q.D\n\nInfo: Max frequency for clock   'clk': 94.24 MHz (FAIL at 100.00 MHz)\n")
    assert read_path(log) == (94.24, ("a_RAMB18E1_DO", "b_FDRE_Q"))


@pytest.mark.parametrize(("log", "message"), [
    ("ERROR: no\n", "the log of nextpnr-xilinx has no clock frequency"),
    ("Info: Max frequency for clock 'clk': 94.24 MHz (PASS at 12.00 MHz)\n",
     "the log of nextpnr-xilinx has no critical path")])
def test_a_log_without_figures_is_refused(log, message):
    with pytest.raises(PathReportError, match=f"^{message}$"):
        read_path(log)


def remove(name):
    return lambda folder: (folder / name).unlink()


def rename(folder):
    (folder / "chipdb" / "xc7z010.bin").rename(folder / "xc7a35t.bin")


@pytest.mark.parametrize(("change", "message"), [
    (remove("nextpnr-xilinx"), "has no program nextpnr-xilinx, nor has its folder bin: docs/report.md says what it "
                               "must hold"),
    (remove("chipdb/xc7z010.bin"), "has no chip database xc7*.bin, nor has its folder chipdb: docs/report.md says how "
                                   "to make one"),
    (lambda folder: shutil.copy(folder / "chipdb" / "xc7z010.bin", folder / "xc7a35t.bin"),
     "must have one chip database, not xc7a35t.bin, xc7z010.bin"),
    (rename, "needs a file pins.xdc with pins of xc7a35t for clk, serial_in and serial_out"),
])
def test_what_is_missing_is_told(folder, change, message):
    change(folder)
    with pytest.raises(ToolMissingError, match=re.escape(f"{folder} {message}")):
        OpenXc7.found(folder)


def test_a_program_that_does_not_start(folder):
    (folder / "nextpnr-xilinx").write_text("#!/no/such/interpreter\n", encoding="utf-8")
    with pytest.raises(ToolMissingError, match=r"nextpnr-xilinx does not start: No such file or directory$"):
        OpenXc7.found(folder)


def test_own_pins_replace_those_of_the_zybo(folder):
    assert "L16" in OpenXc7.found(folder).pins
    (folder / "pins.xdc").write_text("own", encoding="utf-8")
    rename(folder)
    assert OpenXc7.found(folder).pins == "own"


@pytest.mark.parametrize(("name", "words"), [
    ("engine.adder.coarse_magnitude", "adder, rank coarse"),
    ("engine.multiplier_2.partial_partial_0_DSP48E1_P", "multiplier_2, rank partial"),
    ("engine.adder.a", "adder, operands"),
    ("engine.multiplier_0.a_fraction", "multiplier_0, operands"),
    ("engine.multiplier_0_result", "result of multiplier_0"),
    ("engine.main_memory.0.0", "main memory"),
    ("engine.divider_0.remainder_FDRE_Q_7", "divider_0, `remainder`"),
    ("engine.next_word_DP16KD_DOB8", "microcode"),
    ("engine.port1_b", "operand register b of read pair 1"),
    ("engine.out_yaw_arrives", "write enable of out_yaw"),
    ("first_FDRE_Q_3", "`first`"),
])
def test_places_have_words(name, words):
    assert place_words(name) == words


def test_a_path_has_both_ends():
    assert path_words(["engine.adder.coarse_shifted", "engine.adder.normalise_sum"]) == \
        "adder, rank coarse → adder, rank normalise"
    assert path_words(["engine.divider.remainder_TRELLIS_FF_Q_1"] * 2) == "within divider, `remainder`"


@pytest.fixture
def report(monkeypatch, tmp_path):
    """Runs the command with invented figures of the other tools."""
    monkeypatch.chdir(tmp_path)
    for flow in "_xc7", "_ecp5", "_openxc7":
        figures = {"lut": 1, "memory_lut": 0, "ff": 1, "dsp": 0, "bram": 0, "fmax_mhz": {"_ecp5": 80.0}.get(flow, 90.0),
                   "fmax_mhz_of_seeds": [80.0], "critical": ["engine.adder.a", "engine.adder.align_sum"]}
        monkeypatch.setattr(f"strapdown_lab.report.measure.{flow}", lambda *given, figures=figures: figures)
    monkeypatch.setattr("strapdown_lab.report.measure.tool_versions", lambda *packages: dict.fromkeys(packages, "1"))
    monkeypatch.setattr("strapdown_lab.report.measure.asynchronous_paths", lambda *given: ())
    monkeypatch.setattr("strapdown_lab.report.measure.simulated_cycles",
                        lambda core, path, build: (core.latency, core.interval))
    return lambda *words: CliRunner().invoke(main, ["report", "--config", "quaternion_j2", *words])


def test_both_targets_are_in_the_report(report, folder):
    assert report("--xilinx", str(folder)).exit_code == 0
    page = Path("build/report/report.md").read_text(encoding="utf-8")
    path = "adder, operands → adder, rank align"
    assert f"| `QUAT_direct` | `quaternion_j2` | ECP5 | 80 | {path} |" in page
    assert f"| `QUAT_direct` | `quaternion_j2` | openXC7 | 90 | {path} |" in page
    assert "- MHz, openXC7: `synth_xilinx -family xc7 -flatten -abc9; nextpnr-xilinx --chipdb xc7z010.bin" in page


def test_errors_are_one_line(report, folder):
    result = report("--xilinx", str(folder), "--no-place")
    assert result.stderr == "strapdown: --xilinx needs place and route: omit --no-place\n"
    (folder / "nextpnr-xilinx").unlink()
    (line,) = report("--xilinx", str(folder)).stderr.splitlines()
    assert line.startswith(f"strapdown: {folder} has no program nextpnr-xilinx")
