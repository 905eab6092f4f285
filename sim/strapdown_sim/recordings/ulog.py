"""ULog files of PX4. Topics are in forward, right, down and north, east, down; they are turned to the axes of a Log.

=====================================  ========================  ==========================================
topic                                  fields                    stream
=====================================  ========================  ==========================================
``sensor_combined``                    ``gyro_rad``              gyro, rad/s
..                                     ``accelerometer_m_s2``    accel, at its own relative time
..                                     ``magnetometer_ga``       mag, gauss, in logs of old versions
``vehicle_imu``                        ``delta_angle``, ``_dt``  gyro: angle by time, one for each IMU
..                                     ``delta_velocity``        accel: velocity by time
``sensor_gyro``, ``sensor_accel``      ``x``, ``y``, ``z``       gyro and accel of each IMU
``vehicle_magnetometer``               ``magnetometer_ga``       mag, gauss
``sensor_mag``                         ``x``, ``y``, ``z``       mag of each magnetometer, gauss
``vehicle_attitude``                   ``q``                     attitude, NED to NWU
``vehicle_local_position``             ``vx``, ``vy``, ``vz``    velocity
``vehicle_gps_position``               latitude, ...             position
``vehicle_air_data``                   ``baro_pressure_pa``      pressure
=====================================  ========================  ==========================================
"""

from contextlib import redirect_stdout, suppress
from io import StringIO

import numpy as np

from .extra import needed
from .log import (
    ACCEL,
    ATTITUDE,
    GYRO,
    MAG,
    POSITION,
    PRESSURE,
    VELOCITY,
    Log,
    Stream,
    from_frd,
    own_estimate,
    quaternion_from_ned,
)
from .recording import RecordingError

__all__ = ["MAGIC", "TOPICS", "read_ulog", "streams_of_topics"]

MAGIC = b"ULog\x01\x12\x35"

TOPICS = ("sensor_combined", "vehicle_imu", "sensor_gyro", "sensor_accel", "vehicle_magnetometer", "sensor_mag",
          "vehicle_attitude", "vehicle_local_position", "vehicle_gps_position", "vehicle_air_data")
"""Topics that are read."""

INVALID_RELATIVE = 2**31 - 1
"""Relative time stamp of a sample that is not there."""


def read_ulog(path):
    """The Log of a ULog file. Raises: RecordingError."""
    pyulog = needed(path, "ULog", "pyulog")
    try:
        # The library prints what it finds damaged.
        with path.open("rb") as file, redirect_stdout(StringIO()):
            log = pyulog.ULog(file)
    except Exception as error:  # the library raises what its parser meets
        raise RecordingError(f"{path}: not a ULog file that can be read ({type(error).__name__}: {error})") from None
    topics = {}
    for data in log.data_list:
        if len(data.data.get("timestamp", ())) > 1:
            topics[data.name, data.multi_id] = data.data
    streams = streams_of_topics(topics)
    if not any(stream.kind == GYRO for stream in streams):
        raise RecordingError(f"{path}: the log has none of the topics sensor_combined, vehicle_imu and sensor_gyro; "
                             "set SDLOG_PROFILE so that PX4 logs one, unless the file is cut off")
    lost = [dropout.duration for dropout in log.dropouts]
    notes = (f"the logger dropped out {len(lost)} times, {sum(lost) / 1000:.3g} s in all",) if lost else ()
    return Log(path, "ULog", tuple(streams), notes=notes)


def streams_of_topics(topics):
    """Streams of topics, which map (name, instance) to arrays by field."""
    return _Streams(topics).all()


class _Streams:
    """Streams of topics, which map (name, instance) to arrays by field."""

    def __init__(self, topics):
        self._topics = topics
        first = [data["timestamp"][0] for (name, _), data in topics.items()
                 if name in ("sensor_combined", "vehicle_imu", "sensor_gyro")]
        self._origin = int(min(first, default=0))

    def all(self):
        found = []
        for part in self._combined, self._imus, self._raw, self._fields, self._others:
            # A topic without one of its fields is damaged, or of another version.
            with suppress(KeyError):
                found += part()
        return found

    def _named(self, name):
        return [(instance, data) for (topic, instance), data in sorted(self._topics.items()) if topic == name]

    def _time(self, data, field="timestamp"):
        stamps = data[field] if field in data and (data[field] > 0).all() else data["timestamp"]
        return (stamps.astype(np.int64) - self._origin) * 1e-6

    def _vectors(self, data, *names):
        return from_frd(np.stack([data[name] for name in names], axis=-1))

    def _relative(self, data, field, time_s):
        """Time of samples whose stamps are relative to those of the topic; the same array if they are equal."""
        relative = data.get(field)
        if relative is None or not relative.any():
            return time_s
        return np.where(relative == INVALID_RELATIVE, np.nan, time_s + relative * 1e-6)

    def _combined(self):
        for _, data in self._named("sensor_combined"):
            name, time_s = "sensor_combined", self._time(data)
            # In 2016 it had three IMUs, of which the first is taken.
            gyro = "gyro_rad" if "gyro_rad[0]" in data else "gyro_rad_s"
            yield Stream(GYRO, name, time_s, np.degrees(self._vectors(data, *_indexed(gyro))), "rad/s")
            yield Stream(ACCEL, name, self._relative(data, "accelerometer_timestamp_relative", time_s),
                         self._vectors(data, *_indexed("accelerometer_m_s2")), "m/s^2")
            if "magnetometer_ga[0]" in data:
                yield Stream(MAG, name, self._relative(data, "magnetometer_timestamp_relative", time_s),
                             100 * self._vectors(data, *_indexed("magnetometer_ga")), "G")

    def _imus(self):
        for instance, data in self._named("vehicle_imu"):
            name, time_s = f"vehicle_imu {instance}", self._time(data, "timestamp_sample")
            angle, velocity = (self._vectors(data, *_indexed(field)) for field in ("delta_angle", "delta_velocity"))
            # In old versions one time counts for both, in s; in others each has its own, in us.
            times = [data.get(f"{field}_dt", data.get("dt")) * (1e-6 if f"{field}_dt" in data else 1.0)
                     for field in ("delta_angle", "delta_velocity")]
            with np.errstate(divide="ignore", invalid="ignore"):
                yield Stream(GYRO, name, time_s, np.degrees(angle / times[0][:, None]), "rad/s")
                yield Stream(ACCEL, name, time_s, velocity / times[1][:, None], "m/s^2")

    def _raw(self):
        for kind, topic, scale, unit in (GYRO, "sensor_gyro", np.degrees(1.0), "rad/s"), \
                (ACCEL, "sensor_accel", 1.0, "m/s^2"):
            for instance, data in self._named(topic):
                if "x" in data:
                    yield Stream(kind, f"sensor {instance}", self._time(data, "timestamp_sample"),
                                 scale * self._vectors(data, "x", "y", "z"), unit)

    def _fields(self):
        for topic, fields in ("vehicle_magnetometer", _indexed("magnetometer_ga")), ("sensor_mag", ("x", "y", "z")):
            for instance, data in self._named(topic):
                if fields[0] in data:
                    yield Stream(MAG, f"{topic} {instance}", self._time(data, "timestamp_sample"),
                                 100 * self._vectors(data, *fields), "G")

    def _others(self):
        for _, data in self._named("vehicle_attitude"):
            yield Stream(ATTITUDE, "vehicle_attitude", self._time(data, "timestamp_sample"),
                         quaternion_from_ned(np.stack([data[f"q[{k}]"] for k in range(4)], axis=-1)), frame="NWU",
                         meaning=own_estimate("autopilot"))
        for _, data in self._named("vehicle_local_position"):
            yield Stream(VELOCITY, "vehicle_local_position", self._time(data, "timestamp_sample"),
                         np.stack([data["vy"], data["vx"], -data["vz"]], axis=-1), "m/s")
        for instance, data in self._named("vehicle_gps_position"):
            if "lat" in data:
                place = data["lat"] * 1e-7, data["lon"] * 1e-7, data["alt"] * 1e-3
            else:
                place = data["latitude_deg"], data["longitude_deg"], data["altitude_msl_m"]
            name = f"vehicle_gps_position {instance}"
            yield Stream(POSITION, name, self._time(data), np.stack(place, axis=-1), "deg")
        for _, data in self._named("vehicle_air_data"):
            yield Stream(PRESSURE, "vehicle_air_data", self._time(data), data["baro_pressure_pa"][:, None], "Pa")


def _indexed(field):
    return tuple(f"{field}[{axis}]" for axis in range(3))
