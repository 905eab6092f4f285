"""Recordings through cores that start from given values."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.config import ConfigError
from strapdown.cores import QUATERNION_J3, SINS, main_module, system_of
from strapdown_sim.errors import attitude_errors, enu_to_nwu, rotation_angle
from strapdown_sim.navigation import (
    exact_attitude,
    navigated_attitude,
    navigation_inputs,
    position_beside,
    start_of,
    track_picture,
    velocity_beside,
)
from strapdown_sim.recordings import Log, Stream, read_recording, recording_of
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.replay import for_recording, port_inputs, replay

from ..twin import TwinModel

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
    track = position_beside(recording, *outputs["position"].T, outputs["height"])
    assert track.sample.tolist() == [0, 60]
    assert track.recorded.tolist() == place[:2]
    summary = track.summary()
    assert summary["points"] == 2
    assert summary["horizontal"]["max"] == pytest.approx(np.hypot(5, 3) * 0.6, rel=0.01)


def test_velocity_beside_that_of_the_log():
    recording = recorded(("velocity", [[3, 4, -2]] * 3))
    track = velocity_beside(recording, np.zeros((COUNT, 3)))
    assert track.recorded.tolist() == [[3, 4, -2]] * 2
    assert track.horizontal.tolist() == [5, 5]
    assert track.vertical.tolist() == [2, 2]


def test_attitude_of_a_navigator():
    """Against scipy: turns about down, right and forward, from forward, right, down to NED, and then half turns about
    forward and north on both sides."""
    angles = np.random.default_rng(3).uniform([-90, -180, 0], [90, 180, 360], (50, 3))
    half = Rotation.from_euler("x", 180, degrees=True)
    wanted = half * Rotation.from_euler("ZYX", angles[:, [2, 0, 1]], degrees=True) * half
    found = Rotation.from_quat(navigated_attitude({"attitude": angles}), scalar_first=True)
    assert (found * wanted.inv()).magnitude().max() < 1e-12


def page_of(folder):
    """The data of a page: of the cursor, and of plotly, by the name of each curve and its axis."""
    text = (folder / "replay.html").read_text(encoding="utf-8")
    (run,) = re.findall(r"const run = (.*);</script>", text)
    (figure,) = re.findall(r'Plotly\.newPlot\(\s*"curves",\s*(\[.*?\]),\s*\{"template"', text, re.DOTALL)
    return json.loads(run), {(trace["name"], trace["yaxis"]): trace for trace in json.loads(figure)}


@pytest.mark.parametrize("heading", [0.0, -40.0])
def test_the_estimate_of_the_log_beside_a_navigator(tmp_path, monkeypatch, heading):
    """A flight level and straight on; the log's own velocity and height differ by known numbers, and its heading turns
    on by 0.3 degrees in 0.6 s."""
    monkeypatch.setattr("strapdown_sim.replay.CoreModel", TwinModel)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog", lambda component, name, **options: f"module {name}();\n")
    turned = [Rotation.from_euler("z", -(heading + step), degrees=True).as_quat(scalar_first=True)
              for step in (0, 0.3, 0.6)]
    recording = recorded(("position", [[48.0, 11.0, 500.0], [48.0, 11.0, 503.0], [48.0, 11.0, 503.0]]),
                         ("velocity", [[0, 0, 0], [3, 4, -2], [3, 4, -2]]), ("attitude", turned), rates=(0, 0, 1e-6),
                         force=(0, 0, 9.81))
    result = replay(recording, SINS, tmp_path, build=tmp_path, command=(), html=True, bag="mcap")
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    # The earth turns by 0.0025 degrees in 0.6 s, and gravity is less than 9.81 by up to 0.04 m/s^2.
    assert summary["against_recorded_velocity_m_s"]["points"] == 2
    assert summary["against_recorded_velocity_m_s"]["horizontal"]["max"] == pytest.approx(5, abs=0.01)
    assert summary["against_recorded_velocity_m_s"]["vertical"]["max"] == pytest.approx(2, abs=0.03)
    assert summary["against_recorded_position_m"]["vertical"]["max"] == pytest.approx(3, abs=0.01)
    attitude = summary["against_recorded_reference_deg"]
    # The core starts with the log's heading, so there is no unknown constant.
    assert attitude["heading_known"]
    assert attitude["heading_rms"] == pytest.approx(0.3 / np.sqrt(2), abs=0.003)
    assert attitude["inclination_rms"] < 0.003
    run, curves = page_of(tmp_path)
    ports = [port.removeprefix("out_") for port in system_of("SINS_top", SINS).output_ports]

    def own(port):
        """What the log says in the panel of a port, at its samples."""
        number = ports.index(port) + 1
        values = curves["the log's own", "y" if number == 1 else f"y{number}"]["y"]
        array = np.frombuffer(base64.b64decode(values["bdata"]), values["dtype"])
        return array[np.isfinite(array)]

    assert own("veast").tolist() == [0, 3]
    assert own("height").tolist() == [500, 503]
    assert own("heading") % 360 == pytest.approx([heading % 360, (heading + 0.3) % 360])
    assert own("pitch") == pytest.approx([0, 0], abs=1e-9)
    first = Rotation.from_quat(run["attitude"]["quaternion"][0], scalar_first=True)
    assert (first * Rotation.from_quat(turned[0], scalar_first=True).inv()).magnitude() < 2e-4
    assert result.quaternion.shape == (COUNT, 4)
    again = read_recording(tmp_path / "imu")
    assert again.reference.frame == "ENU"
    assert rotation_angle(enu_to_nwu(again.reference.quaternion), result.quaternion).max() < 1e-6


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
