"""``strapdown calibrate sensors``: from a recording to fields of a configuration, and back to its headings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_sim.recordings import read_recording
from strapdown_sim.sensor_calibration import calibrate_sensors, calibrated
from strapdown_sim.sensor_fits import FitError
from strapdown_sim.stimuli.turns import EDGES, SIDES, TURNS, Turn, X, Z, turned_by_hand, with_error

pytest.importorskip("scipy", reason="scipy is not installed, so nothing can be fitted.")

CLEAN = turned_by_hand(TURNS, rate_hz=50)
HARD, SOFT = (6.0, -4.0, 9.0), np.array([[1.05, 0.02, -0.01], [0.02, 0.97, 0.03], [-0.01, 0.03, 0.99]])
BIAS = 0.5, -0.3, 0.2
WRONG = with_error(with_error(CLEAN, "magnetometer", HARD, SOFT), "gyro", BIAS)


def write(path, recording):
    np.savez(path, t=recording.time_s, fs=recording.sample_rate_hz, gyro=np.radians(recording.gyro_deg_s),
             accel=recording.accel, **({} if recording.mag is None else {"mag": recording.mag}))
    return path


def run(*arguments):
    return CliRunner().invoke(main, ["calibrate", "sensors", *map(str, arguments)])


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A calibration of WRONG by the command: its result, and the folder that it wrote."""
    folder = tmp_path_factory.mktemp("calibration")
    return run(write(folder / "wrong.npz", WRONG), "--output", folder / "out"), folder / "out"


def test_command(written):
    result, folder = written
    assert result.exit_code == 0, result.output
    told = json.loads((folder / "calibration.json").read_text(encoding="utf-8"))
    assert told["fields"].keys() == {"magnetometer_bias", "magnetometer_matrix", "gyro_bias"}
    np.testing.assert_allclose(told["fields"]["magnetometer_bias"], HARD, atol=0.1)
    np.testing.assert_allclose(told["fields"]["magnetometer_matrix"], SOFT / np.cbrt(np.linalg.det(SOFT)), atol=0.003)
    np.testing.assert_allclose(told["fields"]["gyro_bias"], BIAS, atol=0.05)
    for name, values in told["standard_deviation"].items():
        assert np.shape(values) == np.shape(told["fields"][name])
        assert np.min(values) > 0
    assert told["not_fitted"].keys() == {"accelerometer"}
    assert told["field_before"]["strength_variation"] > 0.1
    assert told["field_after"]["strength_variation"] < 0.002
    assert (folder / "calibration.png").read_bytes().startswith(b"\x89PNG")
    line = (folder / "set.txt").read_text(encoding="utf-8")
    assert result.stdout.endswith(line)
    assert line.startswith("--set magnetometer_bias=")
    [note] = [text for text in result.stderr.splitlines() if "accelerometer" in text]
    assert note.startswith("strapdown: note: accelerometer: ")
    names = [row.split()[0] for row in result.stdout.splitlines() if row[:1].isalpha()]
    assert names == ["magnetometer_bias", "magnetometer_matrix", "gyro_bias", "field", "field", "written"]
    assert "headings err by about" in result.stdout


def test_units_of_the_device(shared_logs, tmp_path):
    """The log has a field in units of its own, and so has the calibration."""
    output = run(shared_logs / "xio_ximu3_Inertial.csv", "--output", tmp_path).stdout
    assert "µT" not in output
    assert output.splitlines()[0].startswith("magnetometer_bias")
    assert " a.u. ±" in output.splitlines()[0]


def test_a_small_unit_has_more_digits(tmp_path):
    """A field in tesla: 6.0 µT with the deviation of 0.02 µT that test_command has."""
    tesla = replace(WRONG, mag=1e-6 * WRONG.mag)
    line = run(write(tmp_path / "tesla.npz", tesla), "--output", tmp_path / "out").stdout.splitlines()[0]
    bias, _, deviation = line.partition("±")
    assert [float(word) for word in bias.split()[1:4]] == pytest.approx(1e-6 * np.array(HARD), abs=1e-7)
    assert all(1e-9 < float(word) < 1e-7 for word in deviation.split())


def test_a_calibrated_recording_needs_none():
    """The fit of what a fit has put right is nothing."""
    again = calibrate_sensors(calibrated(WRONG, calibrate_sensors(WRONG)))
    # Cells of directions are other ones after a correction, so weights are, within the deviations.
    np.testing.assert_allclose(again.magnetometer.bias, 0, atol=0.05)
    np.testing.assert_allclose(again.magnetometer.matrix, np.eye(3), atol=0.001)
    np.testing.assert_allclose(again.gyro.bias, 0, atol=1e-12)


def test_all_sensors():
    recording = with_error(turned_by_hand((*TURNS, *SIDES, *EDGES), rate_hz=50), "accelerometer", (0.1, -0.2, 0.15))
    found = calibrate_sensors(recording)
    assert found.fields.keys() == {"magnetometer", "gyro", "accelerometer"}
    assert found.notes == []
    assert found.options().count("--set") == 5
    [note] = calibrate_sensors(replace(turned_by_hand((*TURNS, *SIDES), rate_hz=50), mag=None)).notes[1:]
    assert note == "accelerometer: 7 attitudes at rest tell bias and scales; a full matrix needs three edges too"


def test_samples_that_are_missing_stay_missing():
    """A row without a field or a specific force has none after a calibration either; a rate of zero is a rate."""
    gaps = np.arange(len(CLEAN.time_s)) % 2 == 0
    recording = replace(WRONG, mag=np.where(gaps[:, None], WRONG.mag, 0), gyro_deg_s=np.zeros_like(WRONG.gyro_deg_s))
    found = calibrated(recording, calibrate_sensors(WRONG))
    assert not found.mag[~gaps].any()
    assert found.mag[gaps].all()
    np.testing.assert_allclose(found.gyro_deg_s, np.broadcast_to(-np.array(BIAS), found.gyro_deg_s.shape), atol=0.05)


def test_turned_axes_are_told():
    """A symmetric matrix does not turn a sensor that is mounted askew."""
    turned = replace(WRONG, mag=WRONG.mag[:, [1, 0, 2]] * (1, -1, 1))
    [note] = [line for line in calibrate_sensors(turned).notes if line.startswith("magnetometer")]
    assert note.startswith("magnetometer: after the calibration its dip still varies by ")
    assert note.endswith("° with attitude: are its axes those of the accelerometer?")


def test_a_field_that_still_varies_is_told():
    found = calibrate_sensors(WRONG)
    [note] = [line for line in replace(found, after=found.before).notes if line.startswith("magnetometer")]
    assert note == ("magnetometer: after the calibration its field strength still varies by "
                    f"{100 * found.before.strength_variation:.2g} % with attitude, headings err by about "
                    f"{found.before.heading_error_deg:.2g}°: choose a part of the recording with --from and --to, or "
                    "record far from iron and magnets")


def test_nothing_to_fit(tmp_path):
    path = write(tmp_path / "short.npz", replace(turned_by_hand([Turn(Z, 90), Turn(X, 90)], rate_hz=50), mag=None))
    result = run(path, "--output", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr.startswith(
        f"strapdown: {path}: magnetometer: the recording has no magnetometer; gyro: there is no rest that is long "
        "enough; let the sensor lie still for 10 s; accelerometer: it was never at rest; let ")
    assert not (tmp_path / "out").exists()
    with pytest.raises(FitError):
        calibrate_sensors(read_recording(path))


def test_without_scipy(tmp_path, monkeypatch):
    path = write(tmp_path / "wrong.npz", WRONG)
    monkeypatch.setattr("strapdown_sim.sensor_fits.find_spec", lambda name: None)
    result = run(path)
    assert (result.exit_code, result.stderr) == (
        2, "strapdown: a calibration needs scipy: pip install 'strapdown[calibrate]'\n")


def test_recordings_that_cannot_be_read(tmp_path):
    path = tmp_path / "notes.csv"
    path.write_text("", encoding="utf-8")
    assert run(path).stderr == f"strapdown: {path}: the file is empty\n"
