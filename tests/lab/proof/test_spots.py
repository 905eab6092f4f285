"""Random lines in the Verilated spot finder: 20,000 agree, a wrong circuit is detected, runs are recorded."""

import json

import pytest
from click.testing import CliRunner

from strapdown.blocks import SpotFinder
from strapdown_lab.proof import __main__ as proof
from strapdown_lab.proof import spots
from strapdown_sim.drivers.toolchain import SimulatorMissingError

pytestmark = pytest.mark.verilator


@pytest.fixture
def folder(models, tmp_path):
    """A folder for sources; models go into the folder of other tests, to share Verilator's runtime."""
    models.mkdir(parents=True, exist_ok=True)
    (tmp_path / "models").symlink_to(models)
    return tmp_path


def run_of(folder, finder=None):
    try:
        return spots.SpotRun("tsl1402", folder, finder)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


def test_lines_agree(folder):
    (mismatches, found, several), rows = run_of(folder).check(1, 20_000)
    assert (mismatches, rows) == (0, [])
    assert found > 15_000
    assert several > 5_000


class LateFinder(SpotFinder):
    """A finder that reports a latency of one cycle too many."""

    @property
    def latency(self):
        return super().latency + 1


class PatientFinder(SpotFinder):
    """A finder that reports a longer gap than it has."""

    @property
    def gap(self):
        return super().gap + 1


def test_wrong_circuits_are_found(folder):
    with pytest.raises(RuntimeError, match=r"^spot finder, seed 1: 3$"):
        run_of(folder, LateFinder(256)).check(1, 10)
    (mismatches, _, _), rows = run_of(folder, PatientFinder(256)).check(1, 2_000)
    assert mismatches > 20
    assert len(rows) == 10
    assert rows[0].startswith("line ")


def test_command_records_runs(folder, monkeypatch):
    run = run_of(folder)
    monkeypatch.setattr(spots, "SpotRun", lambda sensor, build: run)
    monkeypatch.setattr(spots, "SHARD", 300)
    monkeypatch.setattr(proof, "ROOT", folder)
    (folder / "docs").mkdir()
    for lines in 500, 400:
        result = CliRunner().invoke(proof.main, ["spots", "--only", "tsl1402", "--lines", str(lines)])
        assert result.exit_code == 0, result.output
        assert result.output == f"tsl1402: {lines} lines, 0 mismatches\n"
    # The shorter run is not entered.
    stored = json.loads((folder / "docs" / "spots.json").read_text(encoding="utf-8"))
    assert (stored["tsl1402"]["lines"], stored["tsl1402"]["mismatches"]) == (500, 0)
    assert "| `tsl1402` | 500 |" in spots.table(stored)
    assert spots.table({}) == "No run is entered yet."

    monkeypatch.setattr(spots, "check", lambda *_, **options: (
        stored | {"tsl1402": stored["tsl1402"] | {"mismatches": 1}}, ["tsl1402: line 7 gives 0 not 1"]))
    result = CliRunner().invoke(proof.main, ["spots", "--only", "tsl1402"])
    assert result.exit_code == 1
    assert result.output.splitlines()[-1] == "  tsl1402: line 7 gives 0 not 1"
