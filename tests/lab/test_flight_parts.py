"""The table of the parts of the flight filter is that of this commit, and its variants are those that they say."""

import json

import numpy as np
import pytest

from strapdown.cores import FLIGHT
from strapdown_lab.studies import flight_parts
from strapdown_sim.recordings import Recording, Reference

RATE_HZ, COUNT = 100.0, 1000


@pytest.fixture(scope="module")
def result(root):
    """The figures in docs/report."""
    return json.loads((root / "docs" / "report" / "flight_parts.json").read_text(encoding="utf-8"))


def test_figures_are_those_of_this_commits_equations(result):
    assert result["equations_sha256"] == flight_parts.parts_digest(), (
        "python -m strapdown_lab.studies.flight_parts measures them again")
    assert result["parts"].keys() == flight_parts.PARTS.keys()


def test_another_equation_has_another_digest(monkeypatch):
    before = flight_parts.parts_digest()
    monkeypatch.setattr(flight_parts, "FLIGHT", FLIGHT.replace(magnetometer_gain=0.11))
    assert flight_parts.parts_digest() != before


def test_a_variant_without_bias_turns_with_the_gyros_error():
    """Ten seconds at rest with an error of the gyro about the vertical, without magnetometer."""
    time_s = np.arange(COUNT) / RATE_HZ
    truth = Reference(time_s, np.tile((1.0, 0, 0, 0), (COUNT, 1)), np.ones(COUNT, dtype=bool), "NWU",
                      heading_known=True)
    level = Recording("level", RATE_HZ, time_s, np.tile((0, 0, 1.0), (COUNT, 1)),
                      np.tile((0, 0, 9.81), (COUNT, 1)), None, "m/s^2", truth)
    learnt, not_learnt = (flight_parts.scores([level], flight_parts.PARTS[name])["level"]
                          for name in ("all", "without any bias"))
    assert learnt["total"] < 0.7 < 2 < not_learnt["total"]
    assert learnt["inclination"] < 1e-3
