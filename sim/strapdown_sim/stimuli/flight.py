"""Flights with a known truth: ideal sensors, and the vehicle's attitude, velocity and position.

Speed, track and climb angle are smooth, piecewise polynomial functions of time. Attitude, rates
and specific force follow from them in closed form. Position is their integral over the ellipsoid
of revolution, computed by Gauss quadrature in every sample interval. Sensors give means over the
interval, like integrating gyros and accelerometers.

Body axes: x right, y forward, z up. Navigation axes: east, north, up. Heading is clockwise from
true north, pitch positive nose up, roll positive right side down. Written from source 000,
chapter 2.2, without any core's equations.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

__all__ = ["Change", "Earth", "Flight", "Truth", "SOURCE_EARTH", "WGS84", "airliner", "at_rest", "sensor_errors"]


class Earth(NamedTuple):
    """Ellipsoid, rotation and gravity.

    Fields
    ------
    radius_m, flattening : float
        Semi-major axis, and 1 − (semi-minor / semi-major).
    rate_rad_s : float
        Rotation.
    gravity_m_s2, gravity_latitude, gravity_height : float
        g = gravity_m_s2 + gravity_latitude·sin²L − gravity_height·h. The height term of textbooks is
        3.086e-6 1/s²; source 000, eq. 2.7 prints a tenth of it.
    """

    radius_m: float
    flattening: float
    rate_rad_s: float
    gravity_m_s2: float
    gravity_latitude: float
    gravity_height: float

    def radii(self, latitude):
        """Radii of curvature of meridian and prime vertical, m."""
        e2 = self.flattening * (2 - self.flattening)
        root = np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        return self.radius_m * (1 - e2) / root**3, self.radius_m / root

    def gravity(self, latitude, height_m):
        """Gravity, down, m/s²."""
        return (self.gravity_m_s2 + self.gravity_latitude * np.sin(latitude) ** 2) - self.gravity_height * height_m


SOURCE_EARTH = Earth(6_378_140.0, 1 / 298.257, 7.2921e-5, 9.7803, 0.051799, 3.086e-6)
"""Constants of source 002; height term of gravity as in textbooks."""

WGS84 = Earth(6_378_137.0, 1 / 298.257223563, 7.292115e-5, 9.7803253, 0.0518017, 3.086e-6)
"""Constants of WGS 84; gravity fitted to its formula at equator and pole."""


class Change(NamedTuple):
    """A smooth change of ``what`` ("speed_m_s", "track_deg" or "climb_deg") by ``by`` in ``duration_s``."""

    what: str
    start_s: float
    duration_s: float
    by: float


class Truth(NamedTuple):
    """The vehicle at the end of each sample interval; each field has shape (N,) or (N, 3).

    latitude, longitude in rad, height_m; velocity_m_s east, north, up; heading, pitch, roll in
    rad; c_b2n, shape (N, 3, 3), body to east-north-up.
    """

    time_s: np.ndarray
    latitude: np.ndarray
    longitude: np.ndarray
    height_m: np.ndarray
    velocity_m_s: np.ndarray
    heading: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    c_b2n: np.ndarray


@dataclass(frozen=True)
class Flight:
    """A flight, of ``duration_s`` seconds.

    Attributes
    ----------
    latitude_deg, longitude_deg, height_m, track_deg, climb_deg, speed_m_s : float
        At the start.
    changes : tuple of Change
        Manoeuvres; starts and durations are whole multiples of the sample period.
    angle_of_attack_deg : float
        Pitch minus climb angle.
    earth : Earth
        The model of the earth.

    The vehicle points along its track, and its bank makes the side force of turns zero.
    """

    duration_s: float
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    height_m: float = 0.0
    track_deg: float = 0.0
    climb_deg: float = 0.0
    speed_m_s: float = 0.0
    changes: tuple[Change, ...] = field(default=())
    angle_of_attack_deg: float = 0.0
    earth: Earth = SOURCE_EARTH

    def sample(self, period_s, *, nodes=3):
        """Ideal sensors and truth.

        Parameters
        ----------
        period_s : float
            Sample period.
        nodes : int
            Gauss nodes in a sample interval: the quadrature is of order 2·nodes.

        Returns
        -------
        omega_b, f_b : ndarray, shape (N, 3)
            Angular rate against inertial space, rad/s, and specific force, m/s², in body axes,
            means over the interval k·T … (k + 1)·T.
        truth : Truth
            At (k + 1)·T.
        """
        count = round(self.duration_s / period_s)
        points, weights = np.polynomial.legendre.leggauss(nodes)
        points, weights = (points + 1) / 2, weights / 2
        begins = np.arange(count) * period_s
        motion = self._position(begins, points, weights, period_s)
        omega_b, f_b, _ = self._sensors(begins[:, None] + points * period_s, *motion.inside)
        mean = weights @ omega_b, weights @ f_b
        ends = begins + period_s
        c_b2n, v = self._sensors(ends, *motion.ends[1:])[2]
        angles = self._angles(ends)
        heading, pitch, roll = (angles[name][0] for name in ("heading", "pitch", "roll"))
        longitude, latitude, height = motion.ends
        return *mean, Truth(ends, latitude, longitude, height, v, np.mod(heading, 2 * np.pi), pitch, roll, c_b2n)

    def distance(self, period_s=1.0):
        """Length of the path over ground and air, m."""
        begins = np.arange(0, self.duration_s, period_s)
        points, weights = np.polynomial.legendre.leggauss(4)
        return float((self._value("speed_m_s", begins[:, None] + (points + 1) / 2 * period_s)[0] @ weights).sum()
                     * period_s / 2)

    def _value(self, what, time_s):
        """Value and first two derivatives of one of the three functions of time."""
        time_s = np.asarray(time_s, float)
        total = [np.full(time_s.shape, float(getattr(self, what))), np.zeros(time_s.shape), np.zeros(time_s.shape)]
        for change in self.changes:
            if change.what == what:
                begun = time_s > change.start_s
                x = np.minimum((time_s[begun] - change.start_s) / change.duration_s, 1)
                # The step of degree 7 with three continuous derivatives.
                bell = x * (1 - x)
                steps = (x * x * x * x * (35 + x * (-84 + x * (70 - 20 * x))), 140 * bell * bell * bell,
                         420 * bell * bell * (1 - 2 * x))
                for power, step in enumerate(steps):
                    total[power][begun] += change.by / change.duration_s**power * step
        return total

    def _angles(self, time_s):
        """Heading, pitch and roll, each with its rate, and the path's speed, track and climb with theirs."""
        speed = self._value("speed_m_s", time_s)
        track, climb = ([np.radians(x) for x in self._value(what, time_s)] for what in ("track_deg", "climb_deg"))
        # A bank without side force: tan(roll) = v·ψ̇/g.
        g = self.earth.gravity_m_s2
        slope, slope_rate = speed[0] * track[1] / g, (speed[1] * track[1] + speed[0] * track[2]) / g
        roll = np.arctan(slope), slope_rate / (1 + slope**2)
        pitch = climb[0] + np.radians(self.angle_of_attack_deg), climb[1]
        return {"speed": speed, "heading": track, "climb": climb, "pitch": pitch, "roll": roll}

    def _position(self, begins, points, weights, period_s):
        """Latitude, longitude and height inside the intervals and at their ends."""
        times = begins[:, None] + points * period_s
        # Row k integrates the polynomial through the nodes from the start of the interval to node k.
        powers = np.arange(len(points))
        integral = (points[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(points[:, None] ** powers)

        def integrate(rate, start):
            whole = period_s * (rate @ weights)
            ends = start + np.cumsum(whole)
            return (ends - whole)[:, None] + period_s * rate @ integral.T, ends

        east, north, up = np.moveaxis(self._velocity(self._angles(times))[0], -1, 0)
        height, height_end = integrate(up, self.height_m)
        latitude = np.full(times.shape, np.radians(self.latitude_deg))
        # The radii depend only weakly on the latitude: each iteration adds four digits.
        for _ in range(8):
            meridian, prime = self.earth.radii(latitude)
            latitude, latitude_end = integrate(north / (meridian + height), np.radians(self.latitude_deg))
        prime = self.earth.radii(latitude)[1]
        _, longitude_end = integrate(east / ((prime + height) * np.cos(latitude)), np.radians(self.longitude_deg))
        return _Position((latitude, height), (longitude_end, latitude_end, height_end))

    @staticmethod
    def _velocity(angles):
        """Velocity east, north, up, and its rate."""
        (v, a, _), (track, turn, _), (climb, tilt, _) = angles["speed"], angles["heading"], angles["climb"]
        along = np.stack([np.cos(climb) * np.sin(track), np.cos(climb) * np.cos(track), np.sin(climb)], axis=-1)
        right = np.stack([np.cos(climb) * np.cos(track), -np.cos(climb) * np.sin(track), 0 * track], axis=-1)
        above = np.stack([-np.sin(climb) * np.sin(track), -np.sin(climb) * np.cos(track), np.cos(climb)], axis=-1)
        return v[..., None] * along, a[..., None] * along + v[..., None] * (
            turn[..., None] * right + tilt[..., None] * above)

    def _sensors(self, time_s, latitude, height):
        """Angular rate and specific force at an instant, body axes; (C_b^n, velocity)."""
        angles = self._angles(time_s)
        v, v_rate = self._velocity(angles)
        heading, pitch, roll = (angles[name][0] for name in ("heading", "pitch", "roll"))
        turn, pitch_rate, roll_rate = (angles[name][1] for name in ("heading", "pitch", "roll"))
        tilt = _turn(0, pitch) @ _turn(1, roll)
        c_b2n = _turn(2, -heading) @ tilt

        meridian, prime = self.earth.radii(latitude)
        east, north = v[..., 0], v[..., 1]
        zero = np.zeros(np.shape(latitude))
        earth_rate = self.earth.rate_rad_s * np.stack([zero, np.cos(latitude), np.sin(latitude)], axis=-1)
        transport = np.stack([-north / (meridian + height), east / (prime + height),
                              east * np.tan(latitude) / (prime + height)], axis=-1)
        gravity = np.stack([zero, zero, self.earth.gravity(latitude, height)], axis=-1)
        f_n = v_rate + np.cross(2 * earth_rate + transport, v) + gravity

        # Eq. 2.15: heading turns about the vertical, pitch about the levelled x, roll about the body's y.
        omega_b = (_apply_transposed(tilt, np.stack([zero, zero, -turn], axis=-1))
                   + _apply_transposed(_turn(1, roll), np.stack([pitch_rate, zero, zero], axis=-1))
                   + np.stack([zero, roll_rate, zero], axis=-1) + _apply_transposed(c_b2n, earth_rate + transport))
        return omega_b, _apply_transposed(c_b2n, f_n), (c_b2n, v)


class _Position(NamedTuple):
    inside: tuple
    ends: tuple


def _turn(axis, angle):
    """Active rotation by ``angle`` about a coordinate axis, shape (..., 3, 3)."""
    angle = np.asarray(angle, float)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1
    matrix[..., j, j] = matrix[..., k, k] = np.cos(angle)
    matrix[..., k, j] = np.sin(angle)
    matrix[..., j, k] = -np.sin(angle)
    return matrix


def _apply_transposed(c, a):
    return np.einsum("...ji,...j->...i", c, a)


def airliner(*, latitude_deg=45.75, longitude_deg=126.65, rest_s=120, earth=SOURCE_EARTH):
    """One hour: at rest, take-off, climb to about 8,000 m, four turns, cruise at 220 m/s, descent."""
    t = rest_s
    return Flight(
        duration_s=3600, latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=150, track_deg=30,
        earth=earth,
        changes=(
            Change("speed_m_s", t, 40, 80), Change("climb_deg", t + 40, 10, 8), Change("speed_m_s", t + 60, 200, 140),
            Change("track_deg", t + 120, 80, 75), Change("climb_deg", t + 320, 30, -8),
            Change("track_deg", t + 700, 140, -130), Change("track_deg", t + 1300, 210, 200),
            Change("track_deg", t + 2100, 70, -60), Change("climb_deg", t + 2600, 30, -4),
            Change("speed_m_s", t + 2700, 100, -60), Change("climb_deg", t + 2900, 30, 4)))


def at_rest(duration_s, *, latitude_deg, heading_deg=0.0, pitch_deg=0.0, earth=SOURCE_EARTH):
    """Standing still on the ground at longitude 0 and height 0."""
    return Flight(duration_s=duration_s, latitude_deg=latitude_deg, track_deg=heading_deg,
                  angle_of_attack_deg=pitch_deg, earth=earth)


def sensor_errors(count, period_s, *, constant, white, correlation_s=3600.0, seed):
    """Errors of a triad: constant, white noise and first-order Markov process, shape (count, 3).

    Eq. 2.24 of source 000, whose print of the Markov process is damaged. With β = 1/``correlation_s`` it is
    M(k+1) = exp(−βT)·M(k) + sqrt(1 − exp(−2βT))·w(k), so its standard deviation is that of
    w. ``constant`` and ``white`` (which is also w's standard deviation) are in the sensor's unit; the
    source uses 1 and 0.02 deg/h, and 10 and 50 µg.
    """
    rng = np.random.default_rng(seed)
    decay = np.exp(-period_s / correlation_s)
    drive = np.sqrt(1 - decay**2) * white * rng.standard_normal((count, 3))
    markov, level = np.empty((count, 3)), white * rng.standard_normal(3)
    for k in range(count):
        markov[k] = level
        level = decay * level + drive[k]
    return constant + white * rng.standard_normal((count, 3)) + markov
