"""The figures of the optical sensor's accuracy: they are those of this commit, and keep their limits."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from strapdown_lab.checkout import ROOT
from strapdown_lab.studies import optical

PUBLISHED = {
    "a": ((2.602, 0.902), (0.0004, 0.0005), (0.0001, 0.0005)),
    "b": ((0.903, 2.602), (0.0013, 0.0001), (0.0005, 0.0001)),
    "c": ((3.407, 1.701), (3.148, 10.197), (0.0014, 0.0008)),
    "d": ((2.619, 1.506), (0.109, 0.008), (0.0005, 0.0007)),
    "e": ((0.0, 0.0), (0.800, 0.0), (0.0011, 0.0)),
    "f": ((1.049, 1.034), (0.188, 0.049), (0.0020, 0.0019)),
}
"""Largest errors, roll and pitch in degrees, of an earlier model: without, patent's and exact compensation."""

DIGIT = 1e-4
"""Last digit of the published errors, degrees."""


@cache
def result():
    return json.loads((ROOT / "docs" / "report" / "optical.json").read_text(encoding="utf-8"))


def errors(letter, title=None):
    """Errors of the first row of a flight, or of that with a title."""
    return next(row["errors_deg"] for row in result()["flights"]
                if row["flight"] == letter and title in (None, row["title"]))


@pytest.mark.parametrize("index", [1, 4])
def test_flights_are_those_of_this_commit(index):
    case, row = optical.CASES[index], result()["flights"][index]
    measured = optical.flight_errors(case)
    assert (row["flight"], row["title"], row["errors_deg"].keys()) == (case.flight, case.title, measured.keys())
    for compensation, figures in measured.items():
        np.testing.assert_allclose(row["errors_deg"][compensation]["largest"], figures["largest"], rtol=1e-3, atol=1e-6)


def test_twin_is_that_of_this_commit():
    assert result()["equations_sha256"] == optical.optical_digest(), (
        "python -m strapdown_lab.studies.optical measures its errors again")


def test_twin_adds_half_a_thousandth_of_a_degree_at_most():
    for row in result()["flights"]:
        assert row["twin_deg"].keys() == row["errors_deg"].keys()
        assert max(map(max, row["twin_deg"].values())) <= 0.0005


def test_twin_and_reference_get_equal_inputs():
    """The first updates of flights that begin with a motion, with both compensations and with erection."""
    cases = [case for case in optical.CASES if case.flight == "f"] + [optical.CASES[-1]]
    for case, errors in zip(cases, optical.twin_errors(cases, 20), strict=True):
        assert errors.keys() == set(case.compensations) | {"exact"}
        assert max(map(max, errors.values())) < 1e-5


@pytest.mark.parametrize("title", ["and PRNU of 2 %", "and fringes of 3 %, lag, deferred charge"])
def test_positions_are_those_of_this_commit(title):
    figures = result()["positions"]
    error, _ = optical.position_error(0, figures["lines"], **optical.SPOTS[title])
    assert figures["rows"][title]["first_die_px"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    assert figures["rows"].keys() == optical.SPOTS.keys()


def test_geometry():
    assert optical.geometry() == pytest.approx(result()["geometry"], rel=0.01, abs=1e-11)
    assert result()["geometry"]["rays_deg"] < 1e-10
    assert result()["geometry"]["inverse_px"] < 1e-10


@pytest.mark.parametrize("letter", PUBLISHED)
def test_errors_in_flight_are_the_published_ones(letter):
    """Without compensation and with the patent's within 10 %; exact at most 4/3."""
    for compensation, published in zip(optical.ALL, PUBLISHED[letter], strict=True):
        found = np.array(errors(letter)[compensation]["largest"])
        if compensation == "exact":
            assert (found <= 4 / 3 * np.add(published, DIGIT / 2)).all()
        else:
            np.testing.assert_allclose(found, published, rtol=0.1, atol=DIGIT)


def test_errors_with_faults_of_the_sensors():
    for letter, title, most in (
            ("f", "0.1 px noise", 0.010), ("f", "1 px noise", 0.10), ("f", "k larger by 10 %", 0.14),
            ("f", "accelerometer bias of 0.05 m/s²", 0.29), ("g", "erection, 30 s", 0.128),
            ("g", "bearing drift of 0.2°/min on both axes", 3.53), ("g", "the same with erection, 30 s", 1.93)):
        assert max(errors(letter, title)["exact"]["largest"]) <= most, title
    assert errors("c", "without yaw rate")["exact"]["largest"] == pytest.approx([3.17, 9.96], rel=0.01)


def test_a_long_flight():
    """Largest of both angles: five legs, 600 s."""
    for title, published in (("five turns of 120°, 600 s", (3.79, 18.2)),
                             ("bearing drift of 0.2°/min on both axes", (4.86, 18.4))):
        found = [max(errors("g", title)[compensation]["largest"]) for compensation in ("none", "patent")]
        np.testing.assert_allclose(found, published, rtol=0.1)
    assert max(errors("g")["exact"]["largest"]) <= 4 / 3 * 0.012


def test_positions_keep_their_limits():
    rows = result()["positions"]["rows"]
    for title, most in (("shot and read noise", 0.02), ("and PRNU of 2 %", 0.05),
                        ("and fringes of 3 %, lag, deferred charge", 0.18)):
        assert rows[title]["rms_px"] <= most
        assert rows[title]["lost"] == 0


def test_picture(tmp_path, monkeypatch):
    short = optical.FLIGHTS | dict.fromkeys("cg", replace(optical.FLIGHTS["b"], duration_s=7))
    monkeypatch.setattr(optical, "FLIGHTS", short)
    optical.seen.cache_clear()
    optical.draw(tmp_path / "optical.png")
    optical.seen.cache_clear()
    assert (tmp_path / "optical.png").read_bytes().startswith(b"\x89PNG")


def test_the_example_in_the_docs(root):
    code, = re.findall(r"```python\n(.*?)```", (root / "docs" / "optical.md").read_text(encoding="utf-8"), re.DOTALL)
    names: dict = {}
    exec(code, names)
    assert names["lines"].shape == (100, 3648)
