"""External acceleration of a replay, from the velocity of a recording."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.config import ConfigError
from strapdown.cores import FLIGHT, FLIGHT_6AXIS, MAHONY
from strapdown_sim.errors import attitude_errors, match_reference, multiply, rms
from strapdown_sim.external import LONGEST_GAP_S, with_external_acceleration
from strapdown_sim.recordings import Recording, Reference, Track, read_recording
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.flight import FRAME_QUATERNIONS
from strapdown_sim.replay import for_recording
from strapdown_sim.truth import flight_filter

from ..twin import TwinModel

RATE_HZ, SECONDS = 50, 40.0
RATE_RAD_S, SPEED = 0.5, 6.0


def about_vertical(degrees):
    half = np.radians(degrees) / 2
    return np.array([np.cos(half), 0.0, 0.0, np.sin(half)])


def circling(heading_deg, *, mag=True, known=True):
    """A level body of constant heading whose velocity turns: its acceleration is SPEED·RATE_RAD_S to the left of it."""
    time_s = np.arange(0, SECONDS, 1 / RATE_HZ)
    count = len(time_s)
    fixes = np.arange(0, SECONDS, 0.1)
    east, north = SPEED * np.cos(RATE_RAD_S * fixes), SPEED * np.sin(RATE_RAD_S * fixes)
    velocity = Track(fixes, np.stack([east, north, 0 * fixes], axis=1))
    force = np.add(acceleration(time_s), (0, 0, 9.80665))
    c = matrix_from_quaternion(about_vertical(heading_deg))
    truth = Reference(time_s, np.tile(about_vertical(heading_deg), (count, 1)), np.ones(count, dtype=bool), "NWU",
                      heading_known=known)
    return Recording("circling", RATE_HZ, time_s, np.zeros((count, 3)), force @ c.T,
                     np.tile(c @ (20.0, 0, -40.0), (count, 1)) if mag else None, accel_unit="m/s^2", reference=truth,
                     velocity=velocity)


def acceleration(time_s):
    """Acceleration of ``circling`` in NWU."""
    east, north = -np.sin(RATE_RAD_S * time_s), np.cos(RATE_RAD_S * time_s)
    return SPEED * RATE_RAD_S * np.stack([north, -east, 0 * time_s], axis=1)


INSIDE = slice(RATE_HZ, -RATE_HZ)


@pytest.mark.parametrize("frame", FRAME_QUATERNIONS)
def test_the_change_of_the_velocity_in_the_frame_of_the_filter(frame):
    recording = circling(0)
    config = for_recording(FLIGHT.replace(frame=frame), recording)
    found, facts = with_external_acceleration(recording, config)
    expected = acceleration(recording.time_s) @ matrix_from_quaternion(FRAME_QUATERNIONS[frame])
    # A chord in place of an arc of 0.05 rad, and a straight line between chords: 1 - cos(0.025) each.
    assert np.abs(found.external - expected)[INSIDE].max() < 3 * SPEED * RATE_RAD_S * 0.025**2
    assert facts == {"from": "velocity", "turned_deg": 0.0}
    assert for_recording(config, found).external_input


@pytest.mark.parametrize("known", [True, False])
def test_without_magnetometer_the_velocity_turns_to_the_filters_north(known):
    """The filter starts with x to the north: from the reference, or from the accelerations, it is found 70° off."""
    recording = circling(70, mag=False, known=known)
    _, facts = with_external_acceleration(recording, for_recording(FLIGHT_6AXIS, recording))
    # The filter's vertical oscillates by a part of the acceleration, which turns its accelerations by a degree or two.
    assert facts["turned_deg"] == pytest.approx(-70, abs=1 if known else 3)


def test_gaps_of_the_velocity_are_no_acceleration():
    recording = circling(0)
    kept = (recording.velocity.time_s < 10) | (recording.velocity.time_s > 20)
    track = Track(recording.velocity.time_s[kept], recording.velocity.values[kept])
    found, _ = with_external_acceleration(replace(recording, velocity=track), for_recording(FLIGHT, recording))
    silent = (recording.time_s > 10 + LONGEST_GAP_S) & (recording.time_s < 20 - LONGEST_GAP_S)
    assert not found.external[silent].any()
    assert np.linalg.norm(found.external[recording.time_s < 9], axis=1).min() > 0.9 * SPEED * RATE_RAD_S


@pytest.mark.parametrize(("config", "change", "message"), [
    (FLIGHT, {"velocity": None}, "circling has no velocity for an external acceleration: leave out --external, or "
                                 "replay a log with GNSS"),
    (MAHONY, {}, "INS_top takes no external acceleration: replay it with a configuration of INS_flight"),
    (FLIGHT.replace(external_input=False), {}, "configuration flight: external_input must be true for an external "
                                               "acceleration")])
def test_errors_are_one_line(config, change, message):
    with pytest.raises(ConfigError) as error:
        with_external_acceleration(replace(circling(0), **change), config)
    assert str(error.value) == message


NWU_TO_ENU = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)
SHORT = 12 * RATE_HZ


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """An archive of NumPy with the start of ``circling``, whose velocity is known in every fifth sample."""
    recording, path = circling(0), tmp_path_factory.mktemp("external") / "circling.npz"
    velocity = np.full((len(recording.time_s), 3), np.nan)
    velocity[::5] = recording.velocity.values
    arrays = {"t": recording.time_s, "gyro": np.radians(recording.gyro_deg_s), "accel": recording.accel,
              "mag": recording.mag, "quat_ref": multiply(NWU_TO_ENU, recording.reference.quaternion),
              "vel_ref": velocity}
    np.savez(path, fs=RATE_HZ, **{name: values[:SHORT] for name, values in arrays.items()})
    return path


def test_an_archive_with_velocity_is_a_source(archive):
    """Samples without a velocity are no velocities: the result is that of the track."""
    found, told = (with_external_acceleration(recording, for_recording(FLIGHT, recording))
                   for recording in (read_recording(archive), circling(0)))
    assert found[1] == told[1]
    # The track has a velocity after the archive's last, so the last two middles differ.
    inside = slice(SHORT - RATE_HZ)
    np.testing.assert_allclose(found[0].external[inside], told[0].external[inside], atol=1e-9)


def replay(path, *options):
    return CliRunner().invoke(main, ["replay", str(path), "--config", "flight", *map(str, options)])


def test_the_command_gives_it_to_the_core(archive, tmp_path, monkeypatch):
    """The vertical of a body whose velocity turns: an acceleration of 3 m/s² tilts the filter that does not know it."""
    monkeypatch.setattr("strapdown_sim.replay.CoreModel", TwinModel)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog", lambda component, name, **options: "")
    result = replay(archive, "--external", "velocity", "--output", tmp_path)
    assert result.exit_code == 0, result.output
    assert "updates with status: external used" in result.output
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["external_acceleration"] == {"from": "velocity", "turned_deg": 0.0}
    assert summary["against_recorded_reference_deg"]["inclination_rms"] < 0.3
    unknowing = read_recording(archive)
    answer = flight_filter(FLIGHT.replace(sample_rate_hz=RATE_HZ)).run(
        unknowing.accel, unknowing.mag, unknowing.gyro_deg_s)
    match = match_reference(unknowing, answer.q_b2n)
    assert rms(attitude_errors(match.q_est, match.q_ref).inclination) > 1


def test_the_command_has_one_velocity_for_one_sensor(archive, tmp_path):
    result = replay(archive, "--set", "channels=2", "--external", "velocity", "--output", tmp_path / "out")
    assert (result.exit_code, result.stderr) == (
        2, "strapdown: --external is for one sensor: replay it with --set channels=1\n")
    assert not (tmp_path / "out").exists()
