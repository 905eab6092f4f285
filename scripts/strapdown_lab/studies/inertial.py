"""Strapdown navigation without any aid on recordings that have a position.

The study compares the twin of ``SINS_top``, the float64 reference navigator and the recorded track, with
start values from the recording. Known errors of the sensors are removed first. The navigators must
agree with each other, and their drift must be typical of such sensors.
"""

from typing import NamedTuple

import numpy as np

from strapdown.cores import SINS, sins_top
from strapdown_sim.errors import quaternion_from_matrix
from strapdown_sim.recordings import read_recording
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.sins import Navigator, platform_from_geodetic, rotation
from strapdown_sim.stimuli.flight import WGS84

__all__ = ["Leg", "Run", "car_leg", "quadrotor_legs", "run_reference", "run_twin", "track_errors"]

HAIFA_DEG = 32.8
"""Latitude of the quadrotor's flights, which the recordings do not contain: gravity and earth rate depend on it."""

FRD_TO_RFU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_TO_RFU = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
STANDING_S = 2.0
"""Minimum time from the start of the car's leg to a speed of 0.5 m/s, so that the leg begins at rest."""


class Leg(NamedTuple):
    """Samples of L legs of one recording, each from a known start, and the true track.

    omega_b (N, L, 3), rad/s, and f_b, m/s²: in right, forward, up, means over ``period_s``.
    latitude (rad), height_m, q_b2n (L, 4) and velocity_m_s (L, 3) (east, north, up) are start values.
    sample (M,): numbers of samples after which the track has a point; position_m (L, M, 3): these points, from the
    start.
    """

    period_s: float
    omega_b: np.ndarray
    f_b: np.ndarray
    latitude: float
    height_m: float
    q_b2n: np.ndarray
    velocity_m_s: np.ndarray
    sample: np.ndarray
    position_m: np.ndarray


class Run(NamedTuple):
    """Navigation after each of N samples: position from the start and velocity, (N, L, 3), east, north, up."""

    position_m: np.ndarray
    velocity_m_s: np.ndarray


def quadrotor_legs(path, duration_s, every_s=5.0):
    """Legs of an ``ins_quad_*`` recording at regular intervals, with the fitted gyro bias removed.

    The attitude comes from the drone, position and velocity from RTK. All start values are taken at the same
    time of the IMU's clock.
    """
    recording = read_recording(path)
    with np.load(path) as arrays:
        mounting, bias, velocity, position, clock = (arrays[name].astype(float) for name in (
            "M_sensor_to_frd", "gyro_bias_fit", "vel_ref", "pos_ref", "t_pos"))
    known = np.flatnonzero(np.isfinite(velocity).all(axis=1))
    to_body, rate = FRD_TO_RFU @ mounting, recording.sample_rate_hz
    count, step = round(duration_s * rate), round(every_s / np.median(np.diff(clock)))
    points = np.arange(round(duration_s / np.median(np.diff(clock))) + 1)
    starts = known[:-len(points):step]
    first = np.searchsorted(recording.time_s, clock[starts], side="right")
    window = first[None, :] + np.arange(count)[:, None]
    gyro = np.radians(recording.gyro_deg_s) - bias
    reference = recording.reference
    assert reference is not None, "such a recording has the drone's own attitude"
    q = np.stack([np.interp(clock[starts], reference.time_s, x) for x in _continuous(reference.quaternion).T], -1)
    c_s2n = matrix_from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)).swapaxes(-1, -2)
    track = position[starts[:, None] + points]
    samples = np.round((clock[points] - clock[0]) * rate).astype(int)
    return Leg(1 / rate, (gyro @ to_body.T)[window], (recording.accel @ to_body.T)[window], np.radians(HAIFA_DEG), 0.0,
               quaternion_from_matrix(to_body @ c_s2n.swapaxes(-1, -2)), velocity[starts],
               samples[1:], (track - track[:, :1])[:, 1:])


def car_leg(path, duration_s):
    """The leg of an ``ins_drive_*`` recording from its first rest on.

    Gyro bias, the accelerometer's scale, pitch and roll come from the rest. Heading is the first course
    minus the turn until then.
    """
    recording = read_recording(path)
    with np.load(path) as arrays:
        clock, position, velocity, course = (arrays[name].astype(float) for name in (
            "t_ref", "pos_ref", "vel_ref", "course_ref"))
        latitude, height = np.radians(float(arrays["lat0_deg"])), float(arrays["h0_m"])
    rate, time_s = recording.sample_rate_hz, recording.time_s
    moving = np.flatnonzero(np.linalg.norm(velocity, axis=1) > 0.5)[0]
    start = moving - round(STANDING_S / np.median(np.diff(clock)))
    rest = time_s < clock[start]
    force = recording.accel @ FLU_TO_RFU.T
    force = force * (WGS84.gravity(latitude, height) / np.linalg.norm(force[rest].mean(axis=0)))
    gyro = np.radians(recording.gyro_deg_s) @ FLU_TO_RFU.T
    gyro = gyro - gyro[rest].mean(axis=0)
    known = np.flatnonzero(np.isfinite(course))[0]
    turned = gyro[(time_s >= clock[start]) & (time_s < clock[known]), 2].sum() / rate
    up = force[rest].mean(axis=0) / np.linalg.norm(force[rest].mean(axis=0))
    # Course is clockwise from north; a turn about up is anticlockwise.
    heading = course[known] + turned
    forward = np.array([0.0, 1, 0]) - up[1] * up
    forward /= np.linalg.norm(forward)
    level = np.stack([np.cross(forward, up), forward, up])
    first, count = rest.sum(), round(duration_s * rate)
    track = position[start:start + round(duration_s / np.median(np.diff(clock))) + 1]
    samples = np.round((clock[start:start + len(track)] - clock[start]) * rate).astype(int)
    return Leg(1 / rate, gyro[first:first + count, None], force[first:first + count, None], latitude, height,
               quaternion_from_matrix((rotation([0, 0, -heading]) @ level).T)[None], np.zeros((1, 3)),
               samples[1:], (track - track[0])[None, 1:])


def run_reference(leg):
    """The float64 reference navigator, without a vertical aid."""
    lanes = len(leg.q_b2n)
    navigator = Navigator(
        WGS84, leg.period_s, c_b2p=matrix_from_quaternion(leg.q_b2n).swapaxes(-1, -2),
        c_e2p=np.tile(platform_from_geodetic(leg.latitude, 0.0), (lanes, 1, 1)),
        velocity=leg.velocity_m_s, height_m=np.full(lanes, leg.height_m))
    told = navigator.run(leg.omega_b, leg.f_b)
    return Run(_local(leg, told.latitude, told.longitude, told.height_m), told.velocity_m_s)


def run_twin(leg):
    """The twin of ``SINS_top`` at the recording's rate.

    The first update loads the start with the first sample; its navigation is omitted.
    """
    config = SINS.replace(sample_rate_hz=1 / leg.period_s, earth="wgs84")
    system = sins_top(config)
    omega, force = (np.concatenate([samples[:1], samples]) for samples in (leg.omega_b, leg.f_b))
    load = np.zeros((len(omega), 1))
    load[0] = 1.0
    inputs = system.bind(
        omega=omega, f=force, load=load, align=0.0, place=(np.degrees(leg.latitude), 0.0),
        start_v=leg.velocity_m_s, start_h=leg.height_m, start_q=leg.q_b2n)
    result, _ = system.run(config.pool, inputs)
    told = {name: values[1:] for name, values in system.read(result).items()}
    latitude, longitude = np.moveaxis(np.radians(told["position"]), -1, 0)
    return Run(_local(leg, latitude, longitude, told["height"]), told["velocity"])


def track_errors(leg, run):
    """Distance from the track, horizontal and vertical, m, at its points: shape (M, L, 2)."""
    error = run.position_m[leg.sample - 1] - leg.position_m.swapaxes(0, 1)
    return np.stack([np.hypot(error[..., 0], error[..., 1]), np.abs(error[..., 2])], axis=-1)


def _local(leg, latitude, longitude, height_m):
    """Position from the start, east, north, up, m."""
    meridian, prime = WGS84.radii(leg.latitude)
    return np.stack([longitude * (prime + leg.height_m) * np.cos(leg.latitude),
                     (latitude - leg.latitude) * (meridian + leg.height_m), height_m - leg.height_m], axis=-1)


def _continuous(q):
    """Quaternions without changes of sign from one to the next."""
    signs = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    return q * np.concatenate([[1.0], signs])[:, None]
