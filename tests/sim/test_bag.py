"""Bags of ROS, read back by rosbags."""

from dataclasses import replace

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from strapdown.config import ConfigError
from strapdown_lab.docs import own_kernel
from strapdown_sim.bag import BAGS, MissingRosbagsError, write_bag
from strapdown_sim.recordings import Recording
from strapdown_sim.replay import replay

COUNT = 50
RNG = np.random.default_rng(7)
RECORDING = Recording(
    "turn", 100.0, 1e9 + np.arange(COUNT) / 100, RNG.normal(size=(COUNT, 3)), RNG.normal(size=(COUNT, 3)), None,
    "m/s^2", None)

# Rows: the axes of a frame in east, north, up.
FRAMES = {"NWU": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)), "ENU": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
          "NED": ((0, 1, 0), (1, 0, 0), (0, 0, -1))}


@pytest.mark.parametrize("kind", BAGS)
@pytest.mark.parametrize("frame", FRAMES)
def test_messages(tmp_path, kind, frame):
    """Attitude in east, north, up; rates in rad/s; specific force; epoch time to the nanosecond."""
    to_enu = Rotation.random(COUNT, random_state=1)
    to_frame = Rotation.from_matrix(np.array(FRAMES[frame]) @ to_enu.as_matrix())
    path = write_bag(tmp_path, kind, RECORDING, to_frame.as_quat()[:, [3, 0, 1, 2]], frame)
    assert path == tmp_path / BAGS[kind]
    with AnyReader([path]) as reader:
        messages = [(stamp, reader.deserialize(raw, connection.msgtype))
                    for connection, stamp, raw in reader.messages() if connection.topic == "/imu/data"]
    assert len(messages) == COUNT
    for k, (stamp, message) in enumerate(messages):
        assert message.__msgtype__ == "sensor_msgs/msg/Imu"
        assert stamp == round(RECORDING.time_s[k] * 1e9)
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(stamp, 10**9)
        q, rate, force = message.orientation, message.angular_velocity, message.linear_acceleration
        found = Rotation.from_quat([q.x, q.y, q.z, q.w])
        assert (found * to_enu[k].inv()).magnitude() < 1e-9
        np.testing.assert_allclose(np.degrees([rate.x, rate.y, rate.z]), RECORDING.gyro_deg_s[k], atol=1e-12)
        np.testing.assert_array_equal([force.x, force.y, force.z], RECORDING.accel[k])


def test_without_rosbags(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.bag.find_spec", lambda name: None)
    with pytest.raises(MissingRosbagsError, match=r"^a bag needs rosbags: pip install 'strapdown\[bag\]'$"):
        write_bag(tmp_path, "mcap", RECORDING, np.zeros((COUNT, 4)), "NWU")


def test_a_core_without_attitude(root, tmp_path):
    page = (root / "docs" / "kernels.md").read_text(encoding="utf-8")
    exec(own_kernel(page), own := {"__name__": "my_core"})
    recording = replace(RECORDING, time_s=np.arange(COUNT) / 100)
    with pytest.raises(ConfigError, match=r"^COMPASS_top has no attitude, and a bag holds an attitude$"):
        replay(recording, own["COMPASS"], tmp_path, build=tmp_path / "build", command=(), bag="mcap")
    assert list(tmp_path.iterdir()) == []
