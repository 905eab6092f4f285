"""Recordings through cores that start from given values."""

from pathlib import Path

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import QUATERNION_J3, SINS, main_module, system_of
from strapdown_sim.errors import attitude_errors, rotation_angle
from strapdown_sim.navigation import exact_attitude, navigation_inputs, start_of, track_errors, track_picture
from strapdown_sim.recordings import Log, Stream, recording_of
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.replay import for_recording, port_inputs

COUNT, RATE_HZ = 120, 100.0
TURN = np.array([np.cos(0.3), 0.1, -0.2, 0.5])
TURN = TURN / np.linalg.norm(TURN)


def recorded(*streams, rates=(0, 0, 90), force=(0, 0, 9.80665)):
    """A Recording with constant rates (deg/s) and force, and further streams."""
    time_s = np.arange(COUNT) / RATE_HZ
    return recording_of(Log(Path("flight.bin"), "made here", (
        Stream("gyro", "imu", time_s, np.tile(np.array(rates, float), (COUNT, 1)), "deg/s"),
        Stream("accel", "imu", time_s, np.tile(np.array(force, float), (COUNT, 1)), "m/s^2"),
        *(Stream(kind, kind, np.array([0.0, 0.6, 1.2]), np.array(values, float), frame="NWU", meaning="an estimate")
          for kind, values in streams))))


def twin(recording, config):
    config = for_recording(config, recording)
    system = system_of(main_module(config), config)
    result, _ = system.run(config.pool, port_inputs(recording, config))
    return system.read(result)


def test_the_start_is_the_attitude_of_the_log():
    start = start_of(recorded(("attitude", [TURN, TURN, TURN])))
    assert start.quaternion == pytest.approx(TURN)
    assert start.source == "an estimate"


@pytest.mark.parametrize("force", [(0, 0, 9.8), (3, -4, 8), (1, 2, -9.5), (0, 0, -9.8)])
def test_without_attitude_the_start_is_level(force):
    start = start_of(recorded(force=force))
    assert start.source == "level, heading zero"
    # The matrix is navigation to body.
    up = matrix_from_quaternion(start.quaternion).T @ (np.array(force) / np.linalg.norm(force))
    assert up == pytest.approx([0, 0, 1], abs=1e-9)


def test_quaternion_is_propagated_from_the_start():
    recording = recorded(("attitude", [TURN] * 3), rates=(30, -20, 90))
    outputs = twin(recording, QUATERNION_J3)["e"].astype(float)
    assert outputs[0] == pytest.approx(TURN, abs=1e-6)
    # The turn of 119 samples of 10 ms, by its angle.
    angle = np.linalg.norm([30, -20, 90]) * 1.19
    assert rotation_angle(outputs[:1], outputs[-1:])[0] == pytest.approx(angle, abs=1e-3)
    assert attitude_errors(outputs, exact_attitude(recording)).total.max() < 1e-3


def test_navigator_starts_where_the_log_is():
    place = [[48.0, 11.0, 500.0]] * 3
    recording = recorded(("position", place), ("velocity", [[5, 3, 0]] * 3), ("attitude", [[1, 0, 0, 0]] * 3),
                         rates=(0, 0, 0))
    outputs = twin(recording, SINS.replace(earth="wgs84"))
    # Forward is north in NWU: the heading is zero, and the velocity is kept but for gravity's error.
    assert outputs["attitude"][-1] == pytest.approx([0, 0, 0], abs=0.01)
    assert outputs["velocity"][0] == pytest.approx([5, 3, 0], abs=0.01)
    seconds = (COUNT - 1) / RATE_HZ
    north, east = np.radians(outputs["position"][-1] - [48, 11]) * [6.378e6, 6.388e6 * np.cos(np.radians(48))]
    assert north == pytest.approx(3 * seconds, rel=0.01)
    assert east == pytest.approx(5 * seconds, rel=0.01)
    errors = track_errors(recording, *outputs["position"].T, outputs["height"])
    assert errors["points"] == 2
    assert errors["horizontal"]["max"] == pytest.approx(np.hypot(5, 3) * 0.6, rel=0.01)


def test_axes_of_a_navigator():
    place = ("position", [[48.0, 11.0, 500.0]] * 3)
    attitude = ("attitude", [[np.sqrt(0.5), 0, 0, np.sqrt(0.5)]] * 3)
    recording = recorded(place, attitude, rates=(1, 2, 3), force=(1, 2, 9.7))
    values = navigation_inputs(recording, SINS.systems()["SINS_top"](SINS).inputs, "SINS_top")
    # Right is minus left.
    assert np.degrees(values["omega"][0]) == pytest.approx([-2, 1, 3])
    assert values["f"][0] == pytest.approx([-2, 1, 9.7])
    # Forward to the west in NWU: of right, forward, up in east, north, up, forward is minus east.
    assert pytest.approx([-1, 0, 0], abs=1e-9) == matrix_from_quaternion(values["start_q"]).T @ [0, 1, 0]


def test_a_navigator_without_position_is_refused():
    recording = recorded()
    with pytest.raises(ConfigError, match=r"^SINS_top starts from a latitude, and the log has no position: replay a "
                                          r"log with GNSS$"):
        port_inputs(recording, for_recording(SINS, recording))


def test_track_is_drawn(tmp_path):
    recording = recorded(("position", [[48.0, 11.0, 500.0], [48.1, 11, 500], [48.1, 11.1, 500]]))
    latitude, longitude = np.linspace(48, 48.1, COUNT), np.linspace(11, 11.1, COUNT)
    for name in "ab":
        track_picture(tmp_path / name, title="track", recording=recording, latitude=latitude, longitude=longitude)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a").read_bytes().startswith(b"\x89PNG")
