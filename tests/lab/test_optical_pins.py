"""The figures of the runs from the pins of the optical sensor: their limits, and a short run of the script."""

import json

import pytest

from strapdown_lab.checkout import ROOT
from strapdown_lab.studies.optical_pins import RUNS, Run, run_from_pins

FILE = ROOT / "docs" / "report" / "optical_pins.json"


def test_runs_keep_the_limits():
    rows = json.loads(FILE.read_text(encoding="utf-8"))["runs"]
    assert [(row["config"], row["lines"], row["icarus_lines"]) for row in rows] == [
        (run.name, run.lines, run.icarus) for run in RUNS]
    for row in rows:
        assert row["updates"] == row["lines"]
        assert len(row["line_periods"]) == 1
        for name in ("differing_bits", "timing_violations", "frames_lost", "frames_differing", "icarus_differences"):
            assert row[name] == 0, name
    for row in rows[:3]:
        assert row["seconds"] >= 2
        assert row["position_rms_px"] <= 0.05
        for part, largest in (("arithmetic", 0.0005), ("equations", 0.005), ("total", 0.01)):
            assert row["errors_deg"][part]["largest"] <= largest, part


@pytest.mark.verilator
def test_a_short_run(models):
    row = run_from_pins(Run("optical_s11639", 4), models)
    assert (row["updates"], row["differing_bits"], row["frames_differing"]) == (4, 0, 0)
