"""Random motion with a known truth, for as long as wanted: rotation about all axes, and acceleration that averages out.

Rates and velocity are white noise after two one-pole low-passes, so both stay bounded. Written without any core's
equations.
"""

from typing import NamedTuple

import numpy as np

__all__ = ["Wandering", "wander"]

CORNER_HZ = 1.0
FIELD = np.array([20.0, 0.0, -45.0])
"""Magnetic field in NWU, µT."""
GRAVITY = np.array([0.0, 0.0, 9.80665])


class Wandering(NamedTuple):
    """Motion of N samples.

    Fields
    ------
    rate_deg_s : ndarray, shape (N, 3)
        Mean rate in the interval before each sample, body axes.
    quaternion : ndarray, shape (N, 4)
        Attitude at each sample, body to NWU, scalar first.
    force, field : ndarray, shape (N, 3)
        Specific force, m/s², and magnetic field, µT, at each sample, body axes.
    """

    rate_deg_s: np.ndarray
    quaternion: np.ndarray
    force: np.ndarray
    field: np.ndarray


def wander(seconds, rate_hz, seed, *, turn_deg_s=60.0, acceleration=1.0):
    """Motion with a rate of ``turn_deg_s`` and an acceleration of ``acceleration`` m/s², each RMS of the vector.

    Returns
    -------
    Wandering
    """
    rng = np.random.default_rng(seed)
    count = round(seconds * rate_hz)
    rate = _smooth(rng.standard_normal((count, 3)), rate_hz)
    rate *= turn_deg_s / np.sqrt(np.mean(np.sum(rate**2, axis=1)))
    quaternion = _integral(np.radians(rate) / rate_hz)
    change = np.gradient(_smooth(rng.standard_normal((count, 3)), rate_hz), 1 / rate_hz, axis=0)
    change *= acceleration / np.sqrt(np.mean(np.sum(change**2, axis=1)))
    return Wandering(rate, quaternion, _to_body(quaternion, change + GRAVITY),
                     _to_body(quaternion, np.broadcast_to(FIELD, change.shape)))


def _smooth(noise, rate_hz):
    """White noise after two one-pole low-passes with the corner CORNER_HZ."""
    keep = np.exp(-2 * np.pi * CORNER_HZ / rate_hz)
    for _ in range(2):
        state, low = np.zeros(3), np.empty_like(noise)
        for k, sample in enumerate(noise):
            state = keep * state + (1 - keep) * sample
            low[k] = state
        noise = low
    return noise


def _integral(turns):
    """Attitude after each of some rotations by rotation vectors in rad, from (1, 0, 0, 0), exact."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    path = np.empty((len(turns), 4))
    angle = np.linalg.norm(turns, axis=1)
    steps = np.column_stack([np.cos(angle / 2), turns * (0.5 * np.sinc(angle / (2 * np.pi)))[:, None]])
    for k, (a, b, c, d) in enumerate(steps.tolist()):
        w, x, y, z = (w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c,
                      w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a)
        path[k] = w, x, y, z
    return path / np.linalg.norm(path, axis=1, keepdims=True)


def _to_body(quaternion, vectors):
    """Vectors in NWU as vectors in body axes."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]
    middle = np.cross(axis, vectors) + w * vectors
    return vectors + 2 * np.cross(axis, middle)
