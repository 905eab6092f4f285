"""From a recording with iron to fields, and from the fields through the circuit to the heading of a clean recording."""

import json
import shlex

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_sim.errors import multiply
from strapdown_sim.stimuli.turns import TURNS, turned_by_hand, with_error

pytestmark = pytest.mark.ip

NWU_TO_ENU = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)


def write(path, recording):
    np.savez(path, t=recording.time_s, fs=recording.sample_rate_hz, gyro=np.radians(recording.gyro_deg_s),
             accel=recording.accel, mag=recording.mag, quat_ref=multiply(NWU_TO_ENU, recording.reference.quaternion))
    return path


def run(*words):
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_the_line_brings_the_heading_of_the_circuit_back(tmp_path, models):
    """Iron that turns the heading by degrees, and the fields that are known to 0.16 degrees of heading."""
    clean = turned_by_hand(TURNS, rate_hz=50)
    wrong = with_error(clean, "magnetometer", (6, -4, 9), np.array([[1.05, 0.02, -0.01], [0.02, 0.97, 0.03],
                                                                    [-0.01, 0.03, 0.99]]))
    wrong = with_error(wrong, "gyro", (0.5, -0.3, 0.2))
    files = {name: write(tmp_path / f"{name}.npz", each) for name, each in (("clean", clean), ("wrong", wrong))}
    line = run("calibrate", "sensors", files["wrong"], "--output", tmp_path / "calibration").splitlines()[-1]
    errors = {}
    for name, file, options in (("clean", "clean", ""), ("wrong", "wrong", ""), ("back", "wrong", line)):
        output = run("replay", files[file], "--config", "flight", *shlex.split(options), "--output", tmp_path / name,
                     "--build", models)
        assert ("magnetometer not calibrated" in output) == (name == "wrong")
        summary = json.loads((tmp_path / name / "summary.json").read_text(encoding="utf-8"))
        assert summary["bits_differing_from_twin"] == 0
        errors[name] = summary["against_recorded_reference_deg"]["heading_rms"]
    assert errors["wrong"] > 5
    assert errors["back"] == pytest.approx(errors["clean"], abs=0.16)
