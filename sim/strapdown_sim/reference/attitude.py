"""Attitude filter of the thesis in float64: complementary filter on a quaternion.

Written from the equations of the thesis (eqs. 2.26 to 2.47), with misprints corrected, in textbook
form: matrix products, cross products, Hamilton product. Nothing here depends on the order of
operations in hardware, so a mistyped equation on either side shows as a difference.

``c_n2b`` is the direction cosine matrix C_n^b, navigation to body: its rows are the body axes in
the navigation frame. The navigation frame is NWU: x magnetic north, y west, z up. See
``docs/notation.md``.
"""

from typing import NamedTuple

import numpy as np

__all__ = [
    "Attitude", "ComplementaryFilter", "acc_error", "alignment", "axis_matrix", "euler_angles", "full_turn",
    "gyro_correction", "mag_error", "matrix_from_euler_angles", "matrix_from_quaternion", "quaternion_step",
]

# Row k is the matrix of the cross product with axis k, row by row: u @ _SKEW is the matrix for u.
_SKEW = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0],
                  [0, 0, 1, 0, 0, 0, -1, 0, 0],
                  [0, -1, 0, 1, 0, 0, 0, 0, 0]], dtype=float)


class Attitude(NamedTuple):
    """Orientation of the body, one or many.

    Fields
    ------
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation (NWU) to body.
    pitch, roll, yaw : ndarray, shape (...)
        Angles of the sequence Z-Y-X, degrees; pitch in [-90, 90], roll in [-180, 180],
        yaw in [0, 360).
    """

    c_n2b: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    yaw: np.ndarray


def acc_error(a_b, c_n2b):
    """Error vector of the accelerometer, e = a/|a| x C_n^b (0, 0, 1).

    Parameters
    ----------
    a_b : ndarray, shape (..., 3)
        Specific force resolved in body axes, any unit; a zero vector gives no error.
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body.

    Returns
    -------
    ndarray, shape (..., 3)
        Sine of the angle from measured to estimated vertical, about the body axes.

    References
    ----------
    Thesis, eqs. 2.26 and 2.30.
    """
    return _cross(_normalise(a_b), np.asarray(c_n2b, dtype=float)[..., 2])


def mag_error(m_b, c_n2b):
    """Error vector of the magnetometer, e = m/|m| x C_n^b b.

    The reference field b has the horizontal and vertical size of the measured one, and no
    component to the west.

    Parameters
    ----------
    m_b : ndarray, shape (..., 3)
        Magnetic field resolved in body axes, any unit; a zero vector gives no error.
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body.

    Returns
    -------
    ndarray, shape (..., 3)
        Sine of the angle from measured to estimated field, about the body axes.

    References
    ----------
    Thesis, eqs. 2.27 to 2.30; eq. 2.27 prints C_n^b where its transpose is meant.
    """
    m_b, c_n2b = _normalise(m_b), np.asarray(c_n2b, dtype=float)
    h_n = _apply(np.swapaxes(c_n2b, -1, -2), m_b)
    b_n = np.zeros_like(h_n)
    b_n[..., 0] = np.hypot(h_n[..., 0], h_n[..., 1])
    b_n[..., 2] = h_n[..., 2]
    return _cross(m_b, _apply(c_n2b, b_n))


def tilt_reversed(a_b, c_n2b):
    """True where the specific force is more than 90 degrees from the estimated vertical, shape (...).

    Arguments as for `acc_error`.
    """
    return np.vecdot(np.asarray(a_b, dtype=float), np.asarray(c_n2b, dtype=float)[..., 2]) < 0


def heading_reversed(m_b, c_n2b):
    """True where the horizontal field is more than 90 degrees from the estimated north, shape (...).

    Arguments as for `mag_error`.
    """
    return np.vecdot(np.asarray(m_b, dtype=float), np.asarray(c_n2b, dtype=float)[..., 0]) < 0


def gyro_correction(g_deg_s, e_a, e_m, integral, *, kp, ki, period_s):
    """Angular rate corrected by the error vectors through a proportional and an integral gain.

    Parameters
    ----------
    g_deg_s : ndarray, shape (..., 3)
        Angular rate of the body resolved in body axes, degrees per second.
    e_a, e_m : ndarray, shape (..., 3)
        Error vectors of accelerometer and magnetometer.
    integral : ndarray, shape (..., 3)
        Integral of the error so far, times ``ki``, rad/s.
    kp, ki : float
        Gains, rad/s per unit error and rad/s^2 per unit error.
    period_s : float
        Sample period, seconds.

    Returns
    -------
    omega_b, integral : ndarray, shape (..., 3)
        Corrected angular rate and new integral, rad/s.

    References
    ----------
    Thesis, eq. 2.31.
    """
    e = np.add(e_a, e_m)
    integral = integral + ki * period_s * e
    return np.deg2rad(g_deg_s) + kp * e + integral, integral


def quaternion_step(q_b2n, omega_b, period_s):
    """One step of dq/dt = q (0, omega) / 2, first order, normalised.

    Parameters
    ----------
    q_b2n : ndarray, shape (..., 4)
        Quaternion, scalar first, body to navigation.
    omega_b : ndarray, shape (..., 3)
        Angular rate of the body relative to the navigation frame, resolved in body axes, rad/s.
    period_s : float
        Sample period, seconds.

    Returns
    -------
    ndarray, shape (..., 4)
        Unit quaternion at the end of the period.

    References
    ----------
    Thesis, eqs. 2.40 to 2.46; eq. 2.42 prints -q3 gx in its third row where + is meant.
    """
    q_b2n, omega_b = np.asarray(q_b2n, dtype=float), np.asarray(omega_b, dtype=float)
    scalar, vector = q_b2n[..., :1], q_b2n[..., 1:]
    slope = np.concatenate([-np.vecdot(vector, omega_b)[..., None],
                            scalar * omega_b + _cross(vector, omega_b)], axis=-1)
    return _normalise(q_b2n + period_s / 2 * slope)


def matrix_from_quaternion(q_b2n):
    """Direction cosine matrix C_n^b = 1 - 2 q0 [u x] + 2 [u x]^2 with u = (q1, q2, q3).

    Parameters
    ----------
    q_b2n : ndarray, shape (..., 4)
        Quaternion, scalar first, body to navigation.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body; orthogonal for a unit quaternion.

    References
    ----------
    Thesis, eq. 2.34, which prints q1 q2 in c23 where q0 q1 is meant.
    """
    q_b2n = np.asarray(q_b2n, dtype=float)
    skew = _skew(q_b2n[..., 1:])
    return np.eye(3) + 2 * (skew @ skew - q_b2n[..., 0, None, None] * skew)


def euler_angles(c_n2b):
    """Angles of the sequence Z-Y-X that rotates the navigation axes into the body axes.

    Parameters
    ----------
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body.

    Returns
    -------
    pitch, roll, yaw : ndarray, shape (...)
        Degrees; pitch in [-90, 90], roll in [-180, 180], yaw in [0, 360). Pitch and yaw are
        right-handed turns about west and up: nose down and nose to the west are positive.

    Notes
    -----
    At a pitch of +90 degrees only roll - yaw is defined, at -90 degrees only roll + yaw; c23 and c33 are zero
    there, and the roll is zero. With s = sin(pitch),

        c21 - c32 = (1 + s) sin(roll - yaw),    c22 + c31 = (1 + s) cos(roll - yaw),
        -c21 - c32 = (1 - s) sin(roll + yaw),   c22 - c31 = (1 - s) cos(roll + yaw).

    The pair with the larger factor gives the yaw that belongs to the roll, at any pitch.

    References
    ----------
    E. Bernardes and S. Viollet, "Quaternion to Euler angles conversion", PLoS ONE 17(11), 2022, which
    uses the same sum and difference.
    """
    c_n2b = np.asarray(c_n2b, dtype=float)
    down = -c_n2b[..., 0, 2]
    (c21, c22, c23), (c31, c32, c33) = (np.moveaxis(c_n2b[..., row, :], -1, 0) for row in (1, 2))
    pitch = np.arctan2(down, np.hypot(c23, c33))
    roll = np.arctan2(c23 + 0.0, c33 + 0.0)  # the sum makes +0 from -0
    yaw = np.where(down > 0, roll - np.arctan2(c21 - c32, c22 + c31), np.arctan2(-c21 - c32, c22 - c31) - roll)
    return np.degrees(pitch), np.degrees(roll), full_turn(np.degrees(yaw))


def full_turn(degrees):
    """An angle in [0, 360), degrees, shape (...)."""
    # The remainder of a tiny negative angle rounds to 360; a second remainder makes it zero.
    return np.mod(np.mod(degrees, 360), 360)


def matrix_from_euler_angles(pitch, roll, yaw):
    """Direction cosine matrix of three successive rotations about one axis each: the inverse of `euler_angles`.

    Parameters
    ----------
    pitch, roll, yaw : array_like, shape (...)
        Degrees.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body.
    """
    def about(axis, degrees):
        half = np.radians(np.asarray(degrees, dtype=float))[..., None] / 2
        return matrix_from_quaternion(np.concatenate([np.cos(half), np.sin(half) * np.eye(3)[axis]], axis=-1))

    return about(0, roll) @ about(1, pitch) @ about(2, yaw)


def alignment(a_b, m_b):
    """Orientation of a body at rest, in which neither sensor has an error.

    Parameters
    ----------
    a_b : ndarray, shape (..., 3)
        Specific force resolved in body axes, any unit: its direction is up.
    m_b : ndarray, shape (..., 3)
        Magnetic field resolved in body axes, any unit, not parallel to ``a_b``: its horizontal
        part is magnetic north.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body; its columns are north, west and up.
    """
    up = _normalise(a_b)
    west = _normalise(_cross(up, np.asarray(m_b, dtype=float)))
    return np.stack([_cross(west, up), west, up], axis=-1)


def axis_matrix(axes):
    """Matrix that takes sensor axes to body axes.

    Parameters
    ----------
    axes : sequence of str
        Sensor axis, with sign, along each body axis: ("+y", "-x", "+z") makes body x the sensor's
        +y, body y its -x and body z its +z.

    Returns
    -------
    ndarray, shape (3, 3)
        Signed permutation P with m_b = P m_sensor.

    Raises
    ------
    ValueError
        If ``axes`` does not name x, y and z once each, with a sign.
    """
    axes = tuple(axes)
    names = [str(axis)[1:] for axis in axes]
    if sorted(names) != ["x", "y", "z"] or any(str(axis)[0] not in "+-" for axis in axes):
        raise ValueError(f"Axes must name x, y and z once each with a sign, not {axes!r}")
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[1])] = -1.0 if axis[0] == "-" else 1.0
    return matrix


class ComplementaryFilter:
    """The thesis's attitude filter: its state, a single update, and runs over recordings.

    Parameters
    ----------
    kp : float
        Proportional gain, rad/s per unit error. The thesis has 10.
    ki : float
        Integral gain, rad/s^2 per unit error. The thesis has 0.5.
    period_s : float
        Sample period, seconds. The thesis has 0.002.
    mag_axes : sequence of str
        Magnetometer axis along each body axis, see `axis_matrix`. The thesis has
        ("+y", "-x", "+z").

    Attributes
    ----------
    q_b2n : ndarray, shape (4,)
        Quaternion, scalar first, body to navigation.
    c_n2b : ndarray, shape (3, 3)
        Direction cosine matrix, navigation to body.
    integral : ndarray, shape (3,)
        Integral correction, rad/s.

    Raises
    ------
    ValueError
        If the period is not positive or ``mag_axes`` does not name three axes.

    Notes
    -----
    An update in which a number is not finite, in the sample or in an intermediate result, is refused:
    state and outputs do not change.
    """

    def __init__(self, *, kp, ki, period_s, mag_axes=("+x", "+y", "+z")):
        if not period_s > 0:
            raise ValueError(f"Sample period must be positive, not {period_s!r}")
        self._gains = {"kp": kp, "ki": ki, "period_s": period_s}
        self._mag_axes = axis_matrix(mag_axes)
        self.reset()

    def reset(self, q_b2n=(1.0, 0.0, 0.0, 0.0)):
        """Start again from a unit quaternion, body to navigation, without integral correction."""
        self.q_b2n, self.integral = np.array(q_b2n, dtype=float), np.zeros(3)
        self.c_n2b = matrix_from_quaternion(self.q_b2n)

    def update(self, a, m, g_deg_s):
        """One sample period.

        Parameters
        ----------
        a : ndarray, shape (3,)
            Specific force in body axes, any unit; zero if missing.
        m : ndarray, shape (3,)
            Magnetic field in magnetometer axes, any unit; zero if missing.
        g_deg_s : ndarray, shape (3,)
            Angular rate in body axes, degrees per second.

        Returns
        -------
        Attitude
            Orientation after the update.
        """
        with np.errstate(over="raise", invalid="raise"):
            self._step(*(np.asarray(vector, dtype=float) for vector in (a, m, g_deg_s)))
        return Attitude(self.c_n2b, *euler_angles(self.c_n2b))

    def run(self, accel, mag, gyro_deg_s):
        """One update per sample of a recording, from the current state.

        Parameters
        ----------
        accel : ndarray, shape (N, 3)
            Specific force in body axes, any unit.
        mag : ndarray, shape (N, 3), or None
            Magnetic field in magnetometer axes, any unit; None without magnetometer.
        gyro_deg_s : ndarray, shape (N, 3)
            Angular rate in body axes, degrees per second.

        Returns
        -------
        Attitude
            Orientation after each update: c_n2b of shape (N, 3, 3), angles of shape (N,).
        """
        accel, gyro_deg_s = np.asarray(accel, dtype=float), np.asarray(gyro_deg_s, dtype=float)
        mag = np.zeros_like(accel) if mag is None else np.asarray(mag, dtype=float)
        c_n2b = np.empty((len(accel), 3, 3))
        with np.errstate(over="raise", invalid="raise"):
            for k, sample in enumerate(zip(accel, mag, gyro_deg_s, strict=True)):
                self._step(*sample)
                c_n2b[k] = self.c_n2b
        return Attitude(c_n2b, *euler_angles(c_n2b))

    def _step(self, a, m, g_deg_s):
        try:
            e_a = acc_error(a, self.c_n2b)
            e_m = mag_error(self._mag_axes @ m, self.c_n2b)
            omega_b, integral = gyro_correction(g_deg_s, e_a, e_m, self.integral, **self._gains)
            q_b2n = quaternion_step(self.q_b2n, omega_b, self._gains["period_s"])
        except FloatingPointError:
            return
        if np.isfinite(q_b2n).all():
            self.q_b2n, self.c_n2b, self.integral = q_b2n, matrix_from_quaternion(q_b2n), integral


def _apply(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


def _skew(u):
    return (u @ _SKEW).reshape(*u.shape[:-1], 3, 3)


def _cross(u, v):
    return _apply(_skew(u), v)


def _normalise(vector):
    vector = np.asarray(vector, dtype=float)
    length = np.sqrt(np.vecdot(vector, vector))
    return vector / (length + (length == 0))[..., None]
