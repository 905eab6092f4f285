"""Writes a replay as messages sensor_msgs/Imu to a bag of ROS: MCAP of ROS 2, or the format of ROS 1."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from .errors import conjugate, multiply
from .extras import MissingExtraError
from .recordings import Recording
from .reference.flight import FRAME_QUATERNIONS

__all__ = ["BAGS", "MissingRosbagsError", "require_rosbags", "write_bag"]

BAGS = {"mcap": "imu", "ros1": "imu.bag"}
"""Maps each kind of bag to the name of its folder or file. That of MCAP is a folder, as ROS 2 has it."""

TOPIC, FRAME = "/imu/data", "imu"


class MissingRosbagsError(MissingExtraError):
    """rosbags is not installed."""


def require_rosbags() -> None:
    """Raises: MissingRosbagsError if rosbags is not installed."""
    if find_spec("rosbags") is None:
        raise MissingRosbagsError("a bag needs rosbags: pip install 'strapdown[bag]'")


def write_bag(folder: Path, kind: str, recording: Recording, quaternion: np.ndarray, frame: str) -> Path:
    """Write a bag to a folder; returns its path.

    The messages have the attitude of the core (sensor to east, north, up, as REP-103 asks), the angular rate (rad/s)
    and the specific force (m/s^2) of the recording, in sensor axes. Covariances are zero, which means unknown.

    Parameters
    ----------
    folder : Path
        An existing folder, which has no such bag.
    kind : str
        A key of ``BAGS``.
    recording : Recording
    quaternion : ndarray, shape (N, 4)
        Sensor to the navigation frame, scalar first.
    frame : str
        Navigation frame, a key of ``FRAME_QUATERNIONS``.

    Raises: MissingRosbagsError.
    """
    require_rosbags()
    from rosbags.rosbag1 import Writer as Ros1Writer
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Ros2Writer
    from rosbags.typesys import Stores, get_typestore

    path, ros1 = folder / BAGS[kind], kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = {name.rpartition("/")[2]: store.types[name] for name in (
        "sensor_msgs/msg/Imu", "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Quaternion",
        "geometry_msgs/msg/Vector3")}
    to_enu = multiply(FRAME_QUATERNIONS["ENU"], conjugate(FRAME_QUATERNIONS[frame]))
    attitudes = multiply(to_enu, quaternion).tolist()
    rates, forces = np.radians(recording.gyro_deg_s).tolist(), recording.accel.tolist()
    zero = np.zeros(9)
    with Ros1Writer(path) if ros1 else Ros2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(TOPIC, "sensor_msgs/msg/Imu", typestore=store)
        serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
        for number, time_s in enumerate(recording.time_s.tolist()):
            stamp = round(time_s * 1e9)
            time = types["Time"](*divmod(stamp, 10**9))
            header = types["Header"](*([number] if ros1 else []), time, FRAME)
            w, *vector = attitudes[number]
            message = types["Imu"](header, types["Quaternion"](*vector, w), zero,
                                   types["Vector3"](*rates[number]), zero, types["Vector3"](*forces[number]), zero)
            writer.write(connection, stamp, serialize(message, message.__msgtype__))
    return path
