"""The table of cases in which filters fail is that of this commit, and the cases are what their titles say."""

import json

import numpy as np
import pytest

from strapdown_lab.studies import flight_cases
from strapdown_sim.errors import rotation_angle
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.stimuli.wander import FIELD, wander


def test_figures_are_those_of_this_commits_equations(root):
    result = json.loads((root / "docs" / "report" / "flight_cases.json").read_text(encoding="utf-8"))
    assert result["equations_sha256"] == flight_cases.cases_digest(), (
        "python -m strapdown_lab.studies.flight_cases measures them again")


@pytest.fixture(scope="module")
def motion():
    return wander(20.0, 50.0, 4, turn_deg_s=40.0, acceleration=2.0)


def test_a_random_motion_is_consistent(motion):
    """The gyro leads from each attitude to the next; force and field are gravity, motion and the field in the body."""
    rates = np.radians(motion.rate_deg_s[1:]) / 50.0
    steps = rotation_angle(motion.quaternion[:-1], motion.quaternion[1:])
    assert np.degrees(np.linalg.norm(rates, axis=1)) == pytest.approx(steps, abs=1e-9)
    c = matrix_from_quaternion(motion.quaternion)
    assert np.einsum("nji,nj->ni", c, motion.field) == pytest.approx(np.tile(FIELD, (len(c), 1)), abs=1e-9)
    pull = np.einsum("nji,nj->ni", c, motion.force) - (0, 0, 9.80665)
    assert np.sqrt(np.mean(np.sum(pull**2, axis=1))) == pytest.approx(2.0)
    assert np.sqrt(np.mean(np.sum(motion.rate_deg_s**2, axis=1))) == pytest.approx(40.0)


def test_a_recording_is_cut_and_turned_over(motion):
    recording = flight_cases.hour(4.0)
    late = flight_cases.started(recording, 1.5)
    assert (len(late.time_s), late.time_s[0]) == (125, 1.5)
    assert not late.reference.valid[:75].any()
    assert late.reference.valid[75:].all()
    turned = flight_cases.turned_over(recording)
    # The same vectors in the earth frame.
    for before, after in ((recording.accel, turned.accel), (recording.mag, turned.mag)):
        earth = [np.einsum("nji,nj->ni", matrix_from_quaternion(each.reference.quaternion), vectors)
                 for each, vectors in ((recording, before), (turned, after))]
        assert earth[1] == pytest.approx(earth[0], abs=1e-9)
    assert turned.gyro_deg_s == pytest.approx(recording.gyro_deg_s * (1, -1, -1))
