"""The comparison of attitude filters: the filters that it runs, and the files that it writes."""

import json

import numpy as np
import pytest

from strapdown_lab.studies import accuracy
from strapdown_sim.errors import attitude_errors
from strapdown_sim.recordings import Recording

RATE_HZ = 100.0


@pytest.fixture(scope="module")
def level():
    """Ten seconds at rest, level, with body x to magnetic north."""
    count = 1000
    return Recording("level", RATE_HZ, np.arange(count) / RATE_HZ, np.zeros((count, 3)),
                     np.tile([0, 0, 9.81], (count, 1)), np.tile([20.0, 0, -40.0], (count, 1)), "m/s^2", None)


@pytest.mark.parametrize("name", accuracy.FILTERS)
def test_every_filter_tells_level_and_north(level, name):
    for package in accuracy.PACKAGES:
        if name.startswith(package):
            pytest.importorskip(package, reason=f"{package} is not installed: 'make accuracy' installs it.")
    quaternion = accuracy.FILTERS[name](level)
    assert quaternion.shape == (1000, 4)
    assert attitude_errors(quaternion[-1], (1, 0, 0, 0)).total < 0.5


def made_up():
    rows = {stem: {"axes": axes, "filters": {name: dict.fromkeys(accuracy.FIGURES, k + 1 + offset)
                                             for k, name in enumerate(accuracy.FILTERS)}}
            for stem, axes, offset in (("one", 9, 0.0), ("two", 9, 1.0), ("three", 6, 2.0))}
    return {"packages": dict.fromkeys(accuracy.PACKAGES, "1.0"), "without_reference": ["four"], "recordings": rows}


def test_means_are_by_number_of_axes_and_by_tuning(monkeypatch):
    first = next(iter(accuracy.FILTERS))
    monkeypatch.setattr(accuracy, "TUNED_ON", {"two"})
    assert accuracy.means(made_up(), 9)[first]["total"] == 1.5
    assert accuracy.means(made_up(), 9, tuned=True)[first]["total"] == 2.0
    assert accuracy.means(made_up(), 9, tuned=False)[first]["total"] == 1.0
    assert accuracy.means(made_up(), 6)[first]["total"] == 3.0
    assert accuracy.means(made_up(), 6, tuned=True) == {}


def test_table_has_a_row_a_recording_and_its_best_in_bold(monkeypatch):
    monkeypatch.setattr(accuracy, "TUNED_ON", {"two"})
    lines = accuracy.figure_table(made_up(), "total").splitlines()
    assert [line.split("|")[1].strip() for line in lines[2:]] == [
        "`two` \\*", "**mean, 9 axes, tuned on \\***", "`one`", "**mean, 9 axes, others**", "`three`",
        "**mean, 6 axes, others**"]
    assert lines[4].split("|")[2].strip() == "**1.00**"


def test_files(tmp_path):
    path = accuracy.write_accuracy(made_up(), tmp_path)
    assert json.loads((tmp_path / "accuracy.json").read_text(encoding="utf-8")) == made_up()
    assert "Not scored, because they have no reference orientation: `four`." in path.read_text(encoding="utf-8")
    assert (tmp_path / "accuracy.png").read_bytes().startswith(b"\x89PNG")


def test_a_reference_without_a_valid_sample_is_none(tmp_path, monkeypatch):
    for name, scalar in ("valid", 1.0), ("zero", 0.0):
        np.savez(tmp_path / f"{name}.npz", t=np.arange(9) / RATE_HZ, fs=RATE_HZ, gyro=np.zeros((9, 3)),
                 accel=np.tile((0.0, 0.0, 9.81), (9, 1)), quat_ref=np.tile((scalar, 0.0, 0.0, 0.0), (9, 1)))
    monkeypatch.setattr(accuracy, "version", lambda package: "1")
    monkeypatch.setattr(accuracy, "FILTERS", {})
    result = accuracy.measure(tmp_path)
    assert (list(result["recordings"]), result["without_reference"]) == (["valid"], ["zero"])
