"""What the field of a recording says about the calibration of its magnetometer."""

import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores import THESIS
from strapdown_sim.magnetometer import CELLS, FieldFacts, directions, field_facts, field_rows, harmonics, vertical
from strapdown_sim.recordings import read_recording
from strapdown_sim.reference.attitude import axis_matrix, matrix_from_quaternion
from strapdown_sim.sensors import in_body
from strapdown_sim.stimuli.turns import (
    DIP_DEG,
    EDGES,
    SIDES,
    STRENGTH_UT,
    TURNS,
    Turn,
    X,
    Z,
    turned_by_hand,
    with_error,
)

from ..twin import TwinModel

CLEAN = turned_by_hand((*TURNS, *SIDES, *EDGES))
LEVEL = turned_by_hand([Turn(Z, 0, 5), Turn(Z, 360), Turn(Z, 360)])
"""Turned about the vertical only."""


def heading_errors(recording, clean):
    """Errors of the magnetic heading with the true vertical, rad."""
    c_n2b = matrix_from_quaternion(clean.reference.quaternion)
    north, west = (np.moveaxis(np.einsum("nij,ni->nj", c_n2b, each.mag), -1, 0)[:2] for each in (recording, clean))
    return np.angle(np.exp(1j * (np.arctan2(north[1], north[0]) - np.arctan2(west[1], west[0]))))


def whole_sphere(count=4000):
    """Unit vectors, evenly over the sphere (Fibonacci)."""
    index = np.arange(count) + 0.5
    z, angle = 1 - 2 * index / count, np.pi * (1 + 5**0.5) * index
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=-1)


def test_cells_have_similar_areas_and_weights():
    """The middle of a face is 1.3 times as large as its corner."""
    seen = directions(3.0 * whole_sphere(200 * CELLS))
    counts = np.bincount(seen.cell, minlength=CELLS)
    assert seen.cells == CELLS
    assert counts.min() > 150
    assert counts.max() < 240
    np.testing.assert_allclose(np.bincount(seen.cell, seen.weight), 1)


def test_an_axis_is_in_the_middle_of_a_cell():
    noise = 0.01 * np.random.default_rng(3).standard_normal((100, 3))
    cells = [np.unique(directions(sign * axis + noise).cell) for axis in np.eye(3) for sign in (1, -1)]
    assert all(len(own) == 1 for own in cells)
    assert len(np.unique(cells)) == 6


def test_harmonics_are_orthonormal():
    shapes = harmonics(whole_sphere())
    np.testing.assert_allclose(shapes.T @ shapes / len(shapes), np.eye(9), atol=2e-3)


def test_vertical():
    """The noise of the gyro is 0.02 degrees after 4 s, that of 800 samples of the accelerometer less."""
    up = matrix_from_quaternion(CLEAN.reference.quaternion)[:, :, 2]
    for bias in (0, 0, 0), (0.5, -0.3, 0.4):
        tilt_deg = np.degrees(np.arccos(np.minimum(np.vecdot(vertical(with_error(CLEAN, "gyro", bias)), up), 1)))
        # Within 4 s of an end there is only one half.
        assert tilt_deg[400:-400].max() < 0.1 + np.linalg.norm(bias) * 2
        # The middle of the last rest.
        assert tilt_deg[-401] < 0.1


def test_clean_field():
    facts = field_facts(CLEAN)
    assert facts.strength == pytest.approx(STRENGTH_UT, abs=0.05)
    assert facts.dip_deg == pytest.approx(DIP_DEG, abs=0.1)
    # Noise of 0.3 µT in thousands of samples.
    assert facts.heading_error_deg < 0.1
    assert not facts.strength_varies
    assert not facts.dip_varies
    assert field_rows(facts, "calibrate it") == []


@pytest.mark.parametrize(("bias", "soft"), [
    ((3, -2, 4), np.zeros((3, 3))), ((0, 6, 0), np.zeros((3, 3))),
    ((0, 0, 0), [[0.06, 0.03, -0.02], [0.03, -0.04, 0.05], [-0.02, 0.05, -0.02]]),
    ((4, 0, -2), [[0.03, 0, 0.02], [0, -0.03, 0], [0.02, 0, 0]])])
def test_strength_tells_the_heading_error(bias, soft):
    """The derivation of the module holds over all attitudes; these ones are not evenly spread, which costs a third."""
    recording = with_error(CLEAN, "magnetometer", bias, np.linalg.inv(np.eye(3) + soft))
    facts = field_facts(recording)
    weight = directions(CLEAN.mag).weight
    true_deg = np.degrees(np.sqrt(np.average(heading_errors(recording, CLEAN) ** 2, weights=weight)))
    assert facts.heading_error_deg == pytest.approx(true_deg, rel=0.35)
    assert facts.strength_share > 0.9
    assert facts.strength_varies


def test_turn_about_the_vertical_is_enough():
    """A horizontal b changes the strength by b cos δ cos ψ, and the heading by b sin ψ over F cos δ."""
    recording = with_error(LEVEL, "magnetometer", (4, 2, 0))
    facts = field_facts(recording)
    true_deg = np.degrees(np.hypot(4, 2) / (STRENGTH_UT * np.cos(np.radians(DIP_DEG))) / np.sqrt(2))
    weight = directions(LEVEL.mag).weight
    assert np.degrees(np.sqrt(np.average(heading_errors(recording, LEVEL) ** 2, weights=weight))) == pytest.approx(
        true_deg, rel=0.15)
    # The cells that the circle crosses are not equally wide in ψ.
    assert facts.heading_error_deg == pytest.approx(true_deg * np.cos(np.radians(DIP_DEG)), rel=0.15)
    assert facts.strength_varies


def test_rows():
    facts = field_facts(with_error(CLEAN, "magnetometer", (6, -4, 9)))
    [(name, text)] = field_rows(facts, "calibrate it")
    assert name == "magnetometer not calibrated"
    assert text == (f"field strength varies by {100 * facts.strength_variation:.2g} % with attitude, headings err by "
                    f"about {facts.heading_error_deg:.2g}°: calibrate it")
    [(name, text)] = field_rows(field_facts(replace(CLEAN, mag=CLEAN.mag[:, [1, 0, 2]] * (1, -1, 1))), "")
    assert name == "magnetometer axes"
    assert text.endswith("° with attitude, field strength does not: are the axes of magnetometer and accelerometer "
                         "those of one body?")


def test_commands_tell(tmp_path, monkeypatch):
    """Both name the command that calibrates, for a shell; a core without magnetometer says nothing."""
    monkeypatch.setattr("strapdown_sim.replay.CoreModel", TwinModel)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog", lambda component, name, **options: "")
    turning = with_error(turned_by_hand([Turn(Z, 400)], rate_hz=10), "magnetometer", (6, -4, 9))
    path = tmp_path / "a turn.npz"
    np.savez(path, t=turning.time_s, fs=10.0, gyro=np.radians(turning.gyro_deg_s), accel=turning.accel, mag=turning.mag)
    row = re.compile(r"^magnetometer not calibrated +field strength varies by .* with attitude, headings err by about "
                     rf".*°: strapdown calibrate sensors {re.escape(shlex.quote(str(path)))}$", re.MULTILINE)
    assert row.search(run("inspect", path, "--picture", tmp_path / "a.png"))
    assert row.search(run("replay", path, "--config", "mahony", "--output", tmp_path / "out"))
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["field"] == pytest.approx(field_facts(read_recording(path))._asdict())
    assert not row.search(run("replay", path, "--config", "flight_6axis", "--output", tmp_path / "six"))
    assert "field" not in json.loads((tmp_path / "six" / "summary.json").read_text(encoding="utf-8"))


def run(*words):
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_wrong_axes():
    """The thesis's magnetometer is turned by 90 degrees; one along the body axes has wrong axes for it."""
    assert field_facts(in_body(CLEAN, THESIS)).dip_varies
    turned = replace(CLEAN, mag=CLEAN.mag @ np.linalg.inv(axis_matrix(THESIS.magnetometer_axes)).T)
    assert not field_facts(in_body(turned, THESIS)).dip_varies


def test_a_disturbed_place_is_no_calibration():
    """A field that changes with time, by 9 %, and not with attitude."""
    place = 1 + 0.12 * np.sin(2 * np.pi * CLEAN.time_s / 11)
    facts = field_facts(replace(CLEAN, mag=CLEAN.mag * place[:, None]))
    assert facts.strength_share < 0.3
    assert not facts.strength_varies


@pytest.mark.parametrize(("strength", "share", "dip_deg", "dip_share", "told"), [
    (0.01, 0.3, 8.0, 0.9, True), (0.01, 0.3, 4.0, 0.9, False), (0.01, 0.3, 8.0, 0.4, False),
    # The whole strength varies by 9 %: the place changes the dip too.
    (0.03, 0.11, 8.0, 0.9, False)])
def test_dip_tells_only_where_the_strength_is_steady(strength, share, dip_deg, dip_share, told):
    assert FieldFacts(48.0, 65.0, 80, strength, share, dip_deg, dip_share).dip_varies == told


def test_recordings_without_a_statement():
    assert field_facts(replace(CLEAN, mag=None)) is None
    assert field_facts(replace(CLEAN, mag=np.zeros_like(CLEAN.mag))) is None
    assert field_facts(turned_by_hand([Turn(X, 30, 5)], mag_noise_ut=0.0)) is None
    assert field_rows(None, "calibrate it") == []


def test_only_new_samples_count():
    """Repeated rows of a slower sensor are left out."""
    held = np.arange(len(CLEAN.time_s)) // 5 * 5
    facts = field_facts(replace(CLEAN, mag=CLEAN.mag[held], mag_new=np.arange(len(held)) % 5 == 0))
    assert facts.heading_error_deg < 0.2
    assert facts.dip_variation_deg < 0.2


@pytest.mark.parametrize(("name", "told"), [
    ("broad_02_undisturbed_slow_rotation_B", False), ("broad_07_undisturbed_fast_rotation_B", False),
    ("broad_16_undisturbed_fast_translation_B", False), ("broad_25_disturbed_tapping_B", False),
    ("broad_28_disturbed_stationary_magnet_A", False), ("broad_34_disturbed_attached_magnet_3cm", True)])
def test_real_recordings(shared_recordings, name, told):
    """Only the magnet on the sensor turns with it."""
    facts = field_facts(read_recording(shared_recordings / f"{name}.npz"))
    assert facts.strength_varies == told
    assert not facts.dip_varies
