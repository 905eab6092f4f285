"""Reports of Vivado, read by ``strapdown report --vivado``. The reports here were made by hand."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_lab.report.vivado import read_timing, read_utilization

REPORTS = Path(__file__).with_name("vivado")
UTILIZATION, TIMING = REPORTS / "utilization.rpt", REPORTS / "timing.rpt"


def invoke(*paths):
    return CliRunner().invoke(main, ["report", "--vivado", *map(str, paths)])


def test_utilization():
    assert read_utilization(UTILIZATION) == {
        "LUT": (1111, 53200), "LUT as memory": (22, 17400), "register": (3333, 106400), "block RAM": (5.5, 140),
        "DSP": (6, 220)}


def test_utilization_of_other_versions_and_families(tmp_path):
    """Before 2021 without the column of prohibited sites; after a synthesis with a star; UltraScale has CLBs."""
    text = UTILIZATION.read_text(encoding="utf-8").replace("|          0 |", "|").replace("| Prohibited |", "|")
    text = text.replace("Slice LUTs ", "CLB LUTs*").replace("Slice Registers", "CLB Registers")
    (tmp_path / "utilization.rpt").write_text(text, encoding="utf-8")
    assert read_utilization(tmp_path / "utilization.rpt") == read_utilization(UTILIZATION)


def test_timing():
    assert read_timing(TIMING) == {"clk_fpga_0": (10.0, -2.5), "clk_slow": (25.0, 5.0)}


def test_command_prints_both():
    result = invoke(UTILIZATION, TIMING)
    assert result.exit_code == 0
    assert result.output.splitlines() == [
        "LUT            1,111 of 53,200",
        "LUT as memory  22 of 17,400",
        "register       3,333 of 106,400",
        "block RAM      5.5 of 140",
        "DSP            6 of 220",
        "clk_fpga_0     80 MHz; the constraint of 100 MHz is missed by 2.5 ns",
        "clk_slow       50 MHz; the constraint of 40 MHz is met"]


@pytest.mark.parametrize(("paths", "message"), [
    ((TIMING, TIMING), f"{TIMING} does not say how many LUT the design takes: name the file that report_utilization "
                       "-file has written"),
    ((UTILIZATION, UTILIZATION), f"{UTILIZATION} has no clock with a slack: name the file that report_timing_summary "
                                 "-file has written")])
def test_other_files_are_refused(paths, message):
    result = invoke(*paths)
    assert (result.exit_code, result.stderr.strip()) == (2, f"strapdown: {message}")


def test_a_missing_file_is_one_line(tmp_path):
    result = invoke(tmp_path / "utilization.rpt", TIMING)
    assert result.exit_code == 2
    assert "does not exist" in result.stderr
