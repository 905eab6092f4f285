"""The calibration of the optical attitude sensor against instruments whose constants are known."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_sim.calibrate import CCDS, CONSTANTS, fit_attitudes, fit_rest
from strapdown_sim.instrument.calibration import SET_B, Calibration
from strapdown_sim.instrument.flights import body_from_level
from strapdown_sim.instrument.rays import measured_angles
from strapdown_sim.reference.optical import angles_of_pixels, pixels_of_angles

UNIT = Calibration(1811.2, 1830.25, -3.2e-4, 8 / 25_500, 0.02, -0.01, 0.0045, 0.006, 0.24, 8e-4)
ANGLES = [(r, p) for r in (-25, -15, -5, 5, 15, 25) for p in (-25, -15, -5, 5, 15, 25)]


def write(path, columns, rows):
    path.write_text("\n".join([",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n",
                    encoding="utf-8")
    return path


def table(folder, angles=ANGLES, *, unit=UNIT, noise_px=0.0, seed=1):
    pixels = np.stack(pixels_of_angles(*np.radians(angles).T, unit), axis=-1)
    pixels = pixels + noise_px * np.random.default_rng(seed).standard_normal(pixels.shape)
    return write(folder / "table.csv", ("roll_deg", "pitch_deg", "roll_px", "pitch_px"), np.hstack([angles, pixels]))


def rest(folder, *, tilt_deg=5.0, duration_s=60.0, noise_px=0.0, unit=UNIT, attitude=(2.0, -3.0), count=200):
    """The axis of a rotor at rest, on its circle about the vertical."""
    time_s = np.linspace(0, duration_s, count)
    azimuth = 0.7 - unit.k * 9.80665 * time_s
    tilt = np.radians(tilt_deg)
    axis = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(count, np.cos(tilt))], -1)
    roll, pitch = np.radians(attitude)
    pixels = np.stack(pixels_of_angles(*measured_angles(body_from_level(axis, roll, pitch)), unit), axis=-1)
    pixels = pixels + noise_px * np.random.default_rng(2).standard_normal(pixels.shape)
    return write(folder / "rest.csv", ("time_s", "roll_deg", "pitch_deg", "roll_px", "pitch_px"),
                 np.hstack([time_s[:, None], np.tile(attitude, (count, 1)), pixels]))


def run(*arguments):
    return CliRunner().invoke(main, ["calibrate", "optical", *map(str, arguments)])


@pytest.mark.parametrize("unit", [UNIT, SET_B])
def test_constants_without_noise(tmp_path, unit):
    fit = fit_rest(rest(tmp_path, unit=unit), fit_attitudes(table(tmp_path, unit=unit)))
    found, wanted = asdict(fit.calibration), asdict(unit)
    # Positions have nine digits in the file.
    for name in CONSTANTS:
        assert found[name] == pytest.approx(wanted[name], rel=2e-6, abs=2e-7), name


def test_constants_with_noise_are_within_their_deviations(tmp_path):
    fit = fit_rest(rest(tmp_path, noise_px=0.1), fit_attitudes(table(tmp_path, noise_px=0.1)))
    found, wanted = asdict(fit.calibration), asdict(UNIT)
    misses = [abs(found[name] - wanted[name]) / fit.deviation[name] for name in CONSTANTS]
    assert max(misses) < 4
    assert 0.3 < np.sqrt(np.mean(np.square(misses))) < 2
    # The positions that are told have the noise, without the degrees of freedom of the constants.
    assert np.std(np.concatenate([fit.error_px[ccd] for ccd in CCDS])) == pytest.approx(0.1, rel=0.25)


def test_angles_after_calibration(tmp_path):
    """0.1 px are 0.002°: attitudes between the points are as good."""
    words = fit_attitudes(table(tmp_path, noise_px=0.1)).calibration
    grid = np.radians(np.meshgrid(np.linspace(-25, 25, 21), np.linspace(-25, 25, 21)))
    told = angles_of_pixels(*pixels_of_angles(*grid, UNIT), words)
    assert np.degrees(np.abs(np.subtract(told, grid))).max() < 0.004


def test_command_writes_words(tmp_path):
    result = run(table(tmp_path, noise_px=0.02), "--rest", rest(tmp_path, noise_px=0.02), "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))
    assert told["words"].keys() == UNIT.ports().keys()
    for port, word in told["words"].items():
        assert np.uint32(int(word["word"], 16)).view(np.float32) == np.float32(word["value"]), port
        assert word["word"] in result.output
    assert told["points"] == len(ANGLES)
    assert told["errors"]["pitch"]["rms_px"] == pytest.approx(0.02, rel=0.3)
    assert (tmp_path / "out" / "calibration.png").read_bytes().startswith(b"\x89PNG")


def test_held_constants_keep_their_values(tmp_path):
    unit = Calibration(1811.2, 1830.25, 3.2e-4, 3.2e-4)
    five = [(-10, -10), (0, 10), (10, 0), (5, 5)]
    held = ("tilt_r=0", "c3_r=0", "tilt_p=0", "c3_p=0", "h=0.0", "k=8e-4")
    result = run(table(tmp_path, five, unit=unit), *(word for hold in held for word in ("--hold", hold)),
                 "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))
    assert told["words"]["in_n0_r"]["value"] == pytest.approx(1811.2, abs=1e-5)
    assert told["words"]["in_k"]["value"] == 8e-4
    assert told["standard_deviation"].keys() == {"n0_r", "scale_r", "n0_p", "scale_p"}


def test_as_many_points_as_constants_tell_no_deviation(tmp_path):
    fit = fit_attitudes(table(tmp_path, [(-20, -10), (-8, 20), (7, -20), (20, 9)]), {"h": 0.24})
    assert fit.calibration.tilt_r == pytest.approx(0.02, abs=1e-6)
    assert set(fit.deviation.values()) == {None}


HOLD = "add other attitudes, or hold a constant, as in --hold"


@pytest.mark.parametrize(("angles", "message"), [
    (ANGLES[:3], "3 points do not determine the 4 constants n0_r, scale_r, tilt_r, c3_r; add points, or hold constants "
                 "with --hold"),
    ([(5, p) for p in range(9)], "all points have the same roll; the constants of its CCD need several"),
    ([(r, 5) for r in range(9)], "all points have the same pitch; the constants of its CCD need several"),
    ([(r, p) for r in (-9, 0, 9) for p in (-9, 0, 9)],
     f"the points do not determine scale_r, c3_r; {HOLD} c3_r=0"),
    ([(r, 0) for r in (-9, -3, 3, 9)] + [(0, p) for p in (-9, -3, 3, 9)],
     f"the points do not determine h; {HOLD} h=0"),
    ([(95, 0), *ANGLES], "attitudes must be within ±90 degrees")])
def test_points_that_do_not_determine_the_constants(tmp_path, angles, message):
    result = run(table(tmp_path, angles), "--output", tmp_path / "out")
    assert (result.exit_code, result.stderr) == (2, f"strapdown: {tmp_path / 'table.csv'}: {message}\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("changes", "message"), [
    ({"tilt_deg": 0.2}, "the rotor axis is tilted by 0.20 degrees, which is too little for k; tilt it by at least 0.5"),
    ({"count": 2}, "a rest needs at least 3 points whose times rise"),
    ({"duration_s": 0.0}, "a rest needs at least 3 points whose times rise")])
def test_rests_without_k(tmp_path, changes, message):
    result = run(table(tmp_path), "--rest", rest(tmp_path, **changes), "--output", tmp_path / "out")
    assert (result.exit_code, result.stderr) == (2, f"strapdown: {tmp_path / 'rest.csv'}: {message}\n")


@pytest.mark.parametrize(("hold", "message"), [
    ("c4=0", f"--hold: no constant is called 'c4': choose from {', '.join(CONSTANTS)}"),
    ("c3_r", "--hold takes NAME=VALUE, as in --hold c3_r=0, not 'c3_r'"),
    ("h=nan", "--hold: h must be a finite number, not nan")])
def test_mistakes_in_hold(tmp_path, hold, message):
    result = run(table(tmp_path), "--hold", hold)
    assert (result.exit_code, result.stderr) == (2, f"strapdown: {message}\n")


def test_a_file_that_is_no_table(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("roll_deg,pitch_deg,roll_px\n1,2,3\n4,5,6\n", encoding="utf-8")
    assert run(path).stderr == f"strapdown: {path}: no column 'pitch_px'; add it\n"
