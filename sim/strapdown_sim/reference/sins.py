"""Strapdown inertial navigation in float64, in the form of textbooks: rotation matrices.

Frames: body b (x right, y forward, z up); platform p, level, z up, its y axis turned from true
north by the wander angle, anticlockwise seen from above; earth e (z the rotation axis, x through
longitude 0). All arrays may have leading axes for independent navigators.

A sample is the mean rate and mean specific force over its interval. Integration is of
second order in the sample period: velocity in the middle of the interval is extrapolated from the
previous interval, attitude uses Bortz' coning term of two successive samples, specific force is
resolved with the mean of the attitudes at both ends. Rotations are exact (Rodrigues), curvatures
are those of the ellipsoid. Written from source 002 and textbooks (Titterton and Weston, chapters 3
and 11; Savage), not from any core's equations.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

__all__ = ["Navigation", "Navigator", "coarse_alignment", "platform_from_geodetic", "rest_errors", "rotation"]


class Navigation(NamedTuple):
    """Outputs of a navigator, shape (...) or (..., 3).

    Angles in rad; heading clockwise from true north in [0, 2·pi), pitch positive nose up, roll
    positive right side down, wander angle anticlockwise. velocity_m_s is east, north, up.
    """

    pitch: np.ndarray
    roll: np.ndarray
    heading: np.ndarray
    velocity_m_s: np.ndarray
    latitude: np.ndarray
    longitude: np.ndarray
    height_m: np.ndarray
    wander: np.ndarray


def rotation(vector):
    """Matrix that rotates vectors by a rotation vector (..., 3): Rodrigues' formula."""
    vector = np.asarray(vector, float)
    angle = np.sqrt((vector * vector).sum(-1))[..., None, None]
    skew = _skew(vector)
    return np.eye(3) + np.sinc(angle / np.pi) * skew + np.sinc(angle / (2 * np.pi)) ** 2 / 2 * (skew @ skew)


def platform_from_geodetic(latitude, longitude, wander=0.0):
    """C_e^p for a position and a wander angle, rad, shape (..., 3, 3)."""
    latitude, longitude, wander = np.broadcast_arrays(latitude, longitude, wander)
    zero = np.zeros(latitude.shape)
    east = np.stack([-np.sin(longitude), np.cos(longitude), zero], -1)
    up = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], -1)
    north = np.cross(up, east)
    c, s = np.cos(wander)[..., None], np.sin(wander)[..., None]
    return np.stack([c * east + s * north, c * north - s * east, up], axis=-2)


def coarse_alignment(f_b, omega_b):
    """C_b^n (east, north, up) at rest from mean specific force and mean rate, each (..., 3).

    Up is the direction of the specific force, east that of earth rate × up.
    """
    up = _unit(f_b)
    east = _unit(np.cross(omega_b, up))
    return np.stack([east, np.cross(up, east), up], axis=-2)


@dataclass
class Navigator:
    """A strapdown navigator; ``step`` takes one sample.

    Attributes
    ----------
    earth : strapdown_sim.stimuli.flight.Earth
        Or another object with ``radius_m``, ``flattening``, ``rate_rad_s``, ``radii``, ``gravity``.
    period_s : float
        Sample period.
    c_b2p, c_e2p : ndarray, shape (..., 3, 3)
        Attitude and position at the start.
    velocity : ndarray, shape (..., 3)
        Velocity in p, m/s.
    height_m : ndarray, shape (...)
        Height above the ellipsoid.
    damping_s : float or None
        Time constant of the third-order vertical loop that an altitude closes; None: free.
    """

    earth: Any
    period_s: float
    c_b2p: np.ndarray
    c_e2p: np.ndarray
    velocity: np.ndarray
    height_m: np.ndarray
    damping_s: float | None = None
    _gain: Any = field(init=False, default=0.0)
    _before: Any = field(init=False, default=None)
    _bias: Any = field(init=False, default=0.0)

    def __post_init__(self):
        self.velocity = np.array(self.velocity, float)
        self._gain = np.zeros_like(self.velocity)

    def step(self, omega_b, f_b, altitude_m=None):
        """Advance by one sample: mean rate (rad/s) and specific force (m/s²), shape (..., 3)."""
        t, c = self.period_s, self.c_e2p
        alpha = np.asarray(omega_b, float) * t
        before = alpha if self._before is None else self._before
        middle = self.velocity + self._gain / 2

        # Transport rate: rotation of the vertical while the vehicle moves over the ellipsoid, by its curvature tensor.
        sine = c[..., 2, 2]
        north = c[..., :2, 2]
        meridian, prime = self.earth.radii(np.arcsin(np.clip(sine, -1, 1)))
        k_north, k_east = 1 / (meridian + self.height_m), 1 / (prime + self.height_m)
        cosine2 = (north * north).sum(-1)
        northward = (north * middle[..., :2]).sum(-1) / cosine2
        level = k_east[..., None] * middle[..., :2] + ((k_north - k_east) * northward)[..., None] * north
        transport = np.stack([-level[..., 1], level[..., 0], np.zeros_like(sine)], -1)
        spin = self.earth.rate_rad_s * c[..., :, 2]

        # Attitude: body and platform rotate against inertial space.
        body, platform, position = rotation(np.stack([
            alpha + _cross(before, alpha) / 12, -(spin + transport) * t, -transport * t]))
        old = self.c_b2p
        self.c_b2p = platform @ old @ body
        self._before = alpha

        # Velocity.
        f_p = (((old + self.c_b2p) / 2) @ np.asarray(f_b, float)[..., None])[..., 0]
        gravity = self.earth.gravity(np.arcsin(np.clip(sine, -1, 1)), self.height_m)
        rate = f_p - _cross(2 * spin + transport, middle)
        rate[..., 2] -= gravity
        climb = 0.0
        if self.damping_s is not None:
            # Three equal time constants; the second gain compensates for gravity, which decreases with height.
            pull, error = 1 / self.damping_s, self.height_m - altitude_m
            spring = 2 * self.earth.gravity_m_s2 / self.earth.radius_m
            climb = -3 * pull * error
            rate[..., 2] -= (3 * pull**2 + spring) * error + self._bias
            self._bias = self._bias + t * pull**3 * error
        self._gain = rate * t
        self.height_m = self.height_m + t * (self.velocity[..., 2] + self._gain[..., 2] / 2 + climb)
        self.velocity = self.velocity + self._gain

        # Position.
        self.c_e2p = position @ c

    def navigation(self):
        """The current outputs of the navigator.

        With the sine s of the pitch and the anticlockwise grid heading g, and with latitude L, longitude l and wander
        angle w,

            T21 + T13 = (1 + s) sin(g + roll),   T11 - T23 = (1 + s) cos(g + roll),
            T21 - T13 = (1 - s) sin(g - roll),   T11 + T23 = (1 - s) cos(g - roll),
            -C11 - C22 = (1 + sin L) sin(l + w),   C12 - C21 = (1 + sin L) cos(l + w),
            C22 - C11 = (1 - sin L) sin(l - w),    C12 + C21 = (1 - sin L) cos(l - w).

        The pair with the larger factor gives g and l at any pitch and latitude. Where the roll or the wander angle is
        undefined, it is zero.
        """
        t, c = self.c_b2p, self.c_e2p
        up, north = t[..., 2, :], c[..., :, 2]
        wander = np.arctan2(north[..., 0] + 0.0, north[..., 1] + 0.0)
        roll = np.arctan2(-up[..., 0] + 0.0, up[..., 2] + 0.0)
        grid = np.where(up[..., 1] > 0,
                        np.arctan2(t[..., 1, 0] + t[..., 0, 2], t[..., 0, 0] - t[..., 1, 2]) - roll,
                        np.arctan2(t[..., 1, 0] - t[..., 0, 2], t[..., 0, 0] + t[..., 1, 2]) + roll)
        longitude = np.where(c[..., 2, 2] > 0,
                             np.arctan2(-c[..., 0, 0] - c[..., 1, 1], c[..., 0, 1] - c[..., 1, 0]) - wander,
                             np.arctan2(c[..., 1, 1] - c[..., 0, 0], c[..., 0, 1] + c[..., 1, 0]) + wander)
        cos, sin = np.cos(wander), np.sin(wander)
        v = self.velocity
        enu = np.stack([cos * v[..., 0] - sin * v[..., 1], sin * v[..., 0] + cos * v[..., 1], v[..., 2]], -1)
        return Navigation(
            np.arctan2(up[..., 1], np.hypot(up[..., 0], up[..., 2])), roll,
            np.mod(-(grid + wander), 2 * np.pi), enu, np.arctan2(c[..., 2, 2], np.hypot(c[..., 2, 0], c[..., 2, 1])),
            np.mod(longitude + np.pi, 2 * np.pi) - np.pi, self.height_m, wander)

    def run(self, omega_b, f_b, altitude_m=None):
        """All samples (N, ..., 3) in order: the Navigation after each, stacked along a new first axis."""
        told = []
        for k in range(len(omega_b)):
            self.step(omega_b[k], f_b[k], None if altitude_m is None else altitude_m[k])
            told.append(self.navigation())
        return Navigation(*(np.stack(values) for values in zip(*told, strict=True)))


def rest_errors(earth, latitude, time_s, *, tilt=(0, 0, 0), gyro_bias=(0, 0, 0)):
    """Errors of a level navigator at rest after ``time_s``, from the textbooks' linear model.

    Parameters
    ----------
    latitude, time_s : float
        rad, s. Vertical channel held.
    tilt : sequence of 3 floats
        Initial attitude error φ about east, north, up, rad: computed C = (I − [φ×])·C.
    gyro_bias : sequence of 3 floats
        Measured minus true rate, east, north, up, rad/s.

    Returns
    -------
    ndarray, shape (7,)
        φ (3), velocity error east and north (m/s), latitude and longitude error (rad).

    References
    ----------
    Titterton and Weston, 2nd ed., 12.3, here in east-north-up.
    """
    spin, g = earth.rate_rad_s, float(earth.gravity(latitude, 0.0))
    meridian, prime = earth.radii(latitude)
    s, c = spin * np.sin(latitude), spin * np.cos(latitude)
    a = np.zeros((7, 7))
    # φ̇ = −ω_in × φ + δω_in − bias, with δω_in = (−v_n/M, v_e/N − s·δL, v_e·tan L/N + c·δL).
    a[0, 1], a[0, 2], a[0, 4] = s, -c, -1 / meridian
    a[1, 0], a[1, 3], a[1, 5] = -s, 1 / prime, -s
    a[2, 0], a[2, 3], a[2, 5] = c, np.tan(latitude) / prime, c
    # v̇ = f × φ for f = (0, 0, g), minus the Coriolis term.
    a[3, 1], a[3, 4] = -g, 2 * s
    a[4, 0], a[4, 3] = g, -2 * s
    a[5, 4], a[6, 3] = 1 / meridian, 1 / (prime * np.cos(latitude))
    # ẋ = A·x + b as one homogeneous system; its exponential is a Taylor series over short steps.
    whole = np.zeros((8, 8))
    whole[:7, :7], whole[:3, 7] = a, -np.asarray(gyro_bias, float)
    steps = int(np.ceil(time_s / 10))
    short, term = np.eye(8), np.eye(8)
    for order in range(1, 20):
        term = term @ whole * (time_s / steps / order)
        short = short + term
    return (np.linalg.matrix_power(short, steps) @ [*tilt, 0, 0, 0, 0, 1])[:7]


# Row k is the matrix of the vector product with axis k, row by row.
_SKEW = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], float)


def _skew(v):
    return (v @ _SKEW).reshape(*v.shape, 3)


def _cross(a, b):
    return (_skew(a) @ b[..., None])[..., 0]


def _unit(v):
    v = np.asarray(v, float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
