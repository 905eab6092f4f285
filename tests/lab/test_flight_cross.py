"""The tables of the cross-validation and of the magnet are those of this commit, and what their titles say."""

import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from strapdown_lab.studies import flight_cross, flight_magnet
from strapdown_lab.studies.flight_cases import cases_digest, hour, twin
from strapdown_sim.errors import attitude_errors, multiply, rms
from strapdown_sim.stimuli.wander import FIELD


@pytest.mark.parametrize("name", ["flight_cross", "flight_magnet"])
def test_figures_are_those_of_this_commits_equations(root, name):
    result = json.loads((root / "docs" / "report" / f"{name}.json").read_text(encoding="utf-8"))
    assert result["equations_sha256"] == cases_digest(), f"python -m strapdown_lab.studies.{name} measures them again"


def test_each_recording_is_in_one_half_and_each_set_in_both():
    recordings = [replace(hour(0.1), name=name) for name in (
        "tumvi_b", "broad_3", "broad_1", "tumvi_a", "broad_2", "other", "ins_quad_x", "ins_quad_y", "broad_4")]
    assert [[each.name for each in half] for half in flight_cross.halves(recordings)] == [
        ["broad_1", "broad_3", "ins_quad_x", "tumvi_a"], ["broad_2", "broad_4", "ins_quad_y", "tumvi_b"]]


@pytest.fixture(scope="module")
def recording():
    return hour(10.0)


def test_inputs_of_the_tuned_twin_have_the_effect_of_the_configuration(recording):
    q = flight_cross.Flight().attitude(recording, flight_cross.Flight.defaults)
    assert rms(attitude_errors(q, twin(recording, external=False)).total) < 1e-3


def test_the_search_lowers_the_error(recording):
    class Offset:
        defaults: ClassVar = {"a": 1.0, "b": 4.0}

        def attitude(self, recording, parameters):
            tilt = np.log(parameters["a"] / 3)**2 + np.log(parameters["b"] / 2)**2 + 0.01
            count = len(recording.time_s)
            turn = np.tile((np.cos(tilt / 2), np.sin(tilt / 2), 0, 0), (count, 1))
            return multiply(turn, recording.reference.quaternion)

    found = flight_cross.tuned(Offset(), [recording], runs=100)
    assert found == pytest.approx({"a": 3.0, "b": 2.0}, rel=0.02)


def test_a_mean_weighs_relative_errors():
    assert flight_cross.geometric_mean([1.0, 4.0]) == pytest.approx(2.0)


def test_the_mean_field_of_a_motion_points_north_and_turns_with_the_reference(recording):
    """The synthetic field has its strength and dip, and points north but for the noise; the reference may be turned."""
    first = flight_magnet.first_directions(recording)
    assert first["directions"] == pytest.approx(np.zeros(len(flight_magnet.FIRST_S)), abs=0.5)
    assert first["strength"] == pytest.approx(np.linalg.norm(FIELD), abs=0.2)
    half = np.radians(30.0) / 2
    turned = multiply((np.cos(half), 0, 0, np.sin(half)), recording.reference.quaternion)
    beside = replace(recording, reference=replace(recording.reference, quaternion=turned))
    assert flight_magnet.first_directions(beside)["directions"] == pytest.approx([30.0] * 5, abs=0.5)
    assert flight_magnet.mean_so_far(beside) == pytest.approx(30.0, abs=0.5)
