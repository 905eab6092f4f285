"""Campaigns of faults: what is drawn, what is kept from run to run, the figures in docs/, and 300 flips of INS_top."""

import json
from collections import Counter

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cores import CONFIGS, FLIGHT, QUATERNION_J3, SINS, THESIS, THESIS_X8, main_module, quat_direct
from strapdown_lab import docs
from strapdown_lab.checkout import ROOT, block
from strapdown_lab.faults import campaign
from strapdown_lab.faults.__main__ import main
from strapdown_lab.faults.campaign import Campaign, drawn, figures, harmful
from strapdown_lab.faults.samples import ATTITUDE_RECORDING, GENERATED, samples_of
from strapdown_lab.faults.tables import cores_table, places_tables
from strapdown_lab.report.measure import core_circuit
from strapdown_sim.cache import digest
from strapdown_sim.drivers.faults import Fault, FaultModel, Outcome, Verdict
from strapdown_sim.drivers.storage import MEMORY, REGISTER, Storage
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.reference.attitude import matrix_from_quaternion

PLACES = (Storage(REGISTER, "a", "x", "a__DOT__x", 1, 3), Storage(MEMORY, "b", "y", "a__DOT__b__DOT__y", 4, 5),
          Storage(REGISTER, "b", "z", "a__DOT__b__DOT__z", 1, 1))


def test_every_bit_is_drawn_equally_often():
    faults = drawn(PLACES, 24_000, 1, range(10, 13))
    counts = Counter(fault[:3] for fault in faults)
    assert set(counts) == {(index, row, bit) for index, place in enumerate(PLACES)
                           for row in range(place.rows) for bit in range(place.width)}
    # Five standard deviations of a binomial distribution with mean 1000.
    assert max(abs(count - 1000) for count in counts.values()) < 5 * 1000**0.5
    assert {fault.round for fault in faults} == {10, 11, 12}
    assert 0 <= min(fault.time for fault in faults) < 0.001
    assert 0.999 < max(fault.time for fault in faults) < 1


def test_more_faults_begin_with_the_same_ones():
    assert drawn(PLACES, 100, 5, range(4))[:30] == drawn(PLACES, 30, 5, range(4))
    assert drawn(PLACES, 30, 6, range(4)) != drawn(PLACES, 30, 5, range(4))


def test_names_select_places():
    assert {fault.place for fault in drawn(PLACES, 50, 1, range(2), r"^b\.")} == {1, 2}
    with pytest.raises(campaign.NothingChosenError, match=r"^no register or memory matches 'counter'$"):
        drawn(PLACES, 50, 1, range(2), "counter")


def test_figures():
    faults = [Fault(0, 0, 1, 9, 0.5), Fault(1, 2, 4, 9, 0.25), Fault(1, 0, 0, 8, 0.5), Fault(1, 1, 1, 7, 0.0)]
    verdicts = [Verdict(Outcome.MASKED, True, 0.0, 1), Verdict(Outcome.WRONG_SILENT, False, 2.0, 9),
                Verdict(Outcome.WRONG_SILENT, True, 2.0, 9), Verdict(Outcome.STUCK, True, 0.0, 9)]
    report = {"config": "thesis", "module": "INS_top", **figures(PLACES, faults, verdicts)}
    assert (report["bits"], report["faults"]) == (24, 4)
    assert report["places"] == [
        {"place": "x", "kind": REGISTER, "bits": 3, "faults": 1, "outcomes": {"MASKED": 1}, "lasting": {}},
        {"place": "b.y", "kind": MEMORY, "bits": 20, "faults": 3, "outcomes": {"WRONG_SILENT": 2, "STUCK": 1},
         "lasting": {"WRONG_SILENT": 1}}]
    assert report["harmful"] == [
        {"place": "b.y", "row": 1, "bit": 1, "round": 7, "time": 0.0, "outcome": "STUCK"}]
    assert harmful(report, THESIS) == report["harmful"]
    assert harmful(report, SINS) == []
    assert cores_table([report]).splitlines()[-1] == \
        "| `INS_top` | `thesis` | 24 | 4 | 25.0 % | 0.0 % | 0.0 % | 50.0 % | 25.0 % | 1 | 0 | 0 | 0 |"
    assert places_tables([report]).splitlines()[0] == "### INS_top, configuration thesis"
    assert places_tables([report]).splitlines()[-1] == "| `b.y` | memory | 20 | 3 | 2 | 1 | 1 |"


class Invented:
    """A model whose verdicts follow from the faults, and which stops after some of them."""

    DRIVER = FaultModel.DRIVER
    places = PLACES
    asked = 0
    until = 1 << 60

    def __init__(self, core, verilog, build):
        pass

    def verdicts(self, faults, samples, second):
        Invented.asked += len(faults)
        if Invented.asked > Invented.until:
            raise KeyboardInterrupt
        return [Verdict(Outcome(fault.bit), fault.row == 0, fault.time, fault.round) for fault in faults]


@pytest.fixture
def invented(monkeypatch):
    def write(core, config, folder, command):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "a.v").write_text("module a;\nendmodule\n", encoding="utf-8")
        return folder / "a.v"

    monkeypatch.setattr(campaign, "write_core", write)
    monkeypatch.setattr(campaign, "FaultModel", Invented)
    monkeypatch.setattr(Invented, "asked", 0)
    return Invented


def test_an_interrupted_campaign_continues(invented, monkeypatch, tmp_path, make_core):
    def run(folder, count):
        done = []
        report = Campaign(QUATERNION_J3, count, 1).run(tmp_path / folder, make_core=make_core, progress=done.append)
        assert sum(done) == count
        return report

    monkeypatch.setattr(invented, "until", 500)
    with pytest.raises(KeyboardInterrupt):
        run("a", 700)
    (file,) = (tmp_path / "a").glob("*.csv")
    kept = len(file.read_text(encoding="utf-8").splitlines())
    assert kept == 500
    # A line that was not written to its end.
    with file.open("a", encoding="utf-8") as lines:
        lines.write("650,1,")
    monkeypatch.setattr(invented, "until", 1 << 60)
    monkeypatch.setattr(invented, "asked", 0)
    interrupted = run("a", 700)
    assert invented.asked == 200
    assert run("b", 700) == interrupted
    assert interrupted["samples"] == GENERATED
    monkeypatch.setattr(invented, "asked", 0)
    assert run("b", 800)["faults"] == 800
    assert invented.asked == 100


def test_the_command(invented, monkeypatch, tmp_path):
    arguments = ["--config", "quaternion_j3", "--count", "40", "--output", str(tmp_path)]
    result = CliRunner().invoke(main, arguments)
    report = json.loads((tmp_path / "quaternion_j3.json").read_text(encoding="utf-8"))
    # Bit 4 of the memory is stuck, in these invented verdicts.
    assert result.exit_code == bool(report["harmful"]) == 1
    assert result.stderr.startswith("stuck: b.y, row ")
    count = sum(place["outcomes"].get("TRANSIENT", 0) for place in report["places"])
    assert f"transient      {count:7}" in result.output
    result = CliRunner().invoke(main, [*arguments, "--only", "nothing"])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "Error: Invalid value for --only: no register or memory matches 'nothing'"

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(Campaign, "run", interrupted)
    result = CliRunner().invoke(main, arguments)
    assert (result.exit_code, result.stderr) == (1, "Error: interrupted; the same command continues from here\n")


def test_samples_from_recordings(shared_recordings, make_core):
    core = make_core(main_module(THESIS_X8), THESIS_X8)
    samples = samples_of(core, THESIS_X8, 600, shared_recordings)
    assert samples.source == ATTITUDE_RECORDING
    ports = core.system.read(samples.ports, core.system.inputs)
    force, field = (np.linalg.norm(ports[name], axis=-1) for name in "am")
    assert force.shape == (600, 8)
    np.testing.assert_allclose(np.median(force, axis=0), 9.8, rtol=0.03)
    np.testing.assert_allclose(np.median(field, axis=0), 44, rtol=0.05)
    # Each channel has its own part, and the motion of a hand in it.
    rates = np.linalg.norm(ports["g"], axis=-1).mean(axis=0)
    assert rates.min() > 5
    assert len(set(rates.tolist())) == 8


def test_generated_samples_of_a_navigator(make_core):
    core = make_core(main_module(SINS), SINS)
    samples = samples_of(core, SINS, 300, None)
    assert samples.source == GENERATED
    result, _ = core.system.run_float64({port: values[:, 0] for port, values in samples.ports.items()})
    outputs = core.system.read(result)
    heading, pitch = np.unwrap(outputs["attitude"][:, 2], period=360), outputs["attitude"][:, 0]
    assert heading[[120, -1]] - heading[0] == pytest.approx([50, -20], abs=0.1)
    assert pitch[[0, 165, -1]] == pytest.approx([0, 10, -5], abs=0.1)
    np.testing.assert_allclose(np.linalg.norm(outputs["velocity"], axis=1), 60, atol=0.1)


def test_generated_samples_of_an_attitude_core(make_core):
    """The field is constant in the frame that the rates lead to, and points north and down at the start."""
    core, count = make_core(main_module(FLIGHT), FLIGHT), 2000
    ports = core.system.read(samples_of(core, FLIGHT, count, None).ports, core.system.inputs)
    propagation = quat_direct(QUATERNION_J3)
    result, _ = propagation.run_float64(propagation.bind(
        omega=np.radians(ports["g"][:, 0]), load=0.0, start=(1.0, 0.0, 0.0, 0.0)))
    c_n2b = matrix_from_quaternion(propagation.read(result)["e"])
    field = np.einsum("nji,nj->ni", c_n2b, ports["m"][:, 0])
    np.testing.assert_allclose(field, np.broadcast_to([20, 0, -40], field.shape), atol=0.1)
    assert np.ptp(ports["m"][:, 0], axis=0).max() > 10
    np.testing.assert_allclose(ports["a"][0, 0], [0, 0, 9.8], atol=0.1)
    # Another channel flies in another direction, from the same field.
    np.testing.assert_allclose(np.linalg.norm(ports["m"], axis=-1), np.hypot(20, 40))


@pytest.mark.verilator
def test_300_flips_of_the_core_of_the_thesis(models, make_core, tmp_path):
    try:
        report = Campaign(THESIS, 300, 2015).run(tmp_path, make_core=make_core, models=models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))
    assert harmful(report, THESIS) == []
    outcomes = sum((Counter(place["outcomes"]) for place in report["places"]), Counter())
    assert outcomes.total() == 300
    assert outcomes["MASKED"] > 150
    assert outcomes["WRONG_SILENT"] > 20


FIGURES = sorted((ROOT / "docs" / "faults").glob("*.json"))


@pytest.mark.parametrize("file", FIGURES, ids=lambda file: file.stem)
def test_figures_are_of_these_circuits(file, make_core):
    report, config = json.loads(file.read_text(encoding="utf-8")), CONFIGS[file.stem]
    circuit = core_circuit(make_core(main_module(config), config), config)
    assert report["verilog_sha256"] == digest(circuit), f"make faults CONFIG={config.name} finds them again"
    assert harmful(report, config) == []


def test_tables_in_the_docs_are_those_of_the_figures():
    text = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    for name, content in docs.faults_blocks().items():
        assert block(text, name)[1].strip() == content
