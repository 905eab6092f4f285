"""The complementary attitude filter of the 2015 thesis (source 000, chapters 2 and 4).

Frames: b body, n navigation (x magnetic north, y west, z up). ``c`` is C_n^b (navigation to
body) as rows, ``q`` the body-to-navigation quaternion, scalar first. Vectors are body
components. ``a`` and ``m`` may have any unit, ``g`` is in deg/s, ``omega`` in rad/s, angles
come out in degrees.
"""

import math
from typing import NamedTuple

from .vector import add, column, cross, dot, length_squared, matrix_vector, permute, scale, transposed_vector

__all__ = ["Update", "accelerometer_error", "magnetometer_error", "rate_correction", "quaternion_update",
           "matrix_from_quaternion", "euler_angles", "attitude_update"]

DEGREES = 180 / math.pi


class Update(NamedTuple):
    """What one update gives: values by name, the same names as the system's interface."""

    outputs: dict
    state: dict | None = None
    status: dict | None = None


def accelerometer_error(xp, a, v):
    """e_a = a/|a| × v with v = C·(0, 0, 1) = (c13, c23, c33): INS_acc, eq. 2.26 and 2.30.

    Returns (e_a, whether ``a`` has no length). The product comes before the division, so that
    square root and division run beside it.
    """
    square, missing = length_squared(xp, a)
    return scale(1 / xp.sqrt(square), cross(a, v)), missing


def magnetometer_error(xp, m, c, axes):
    """e_m = m × w for m := m/|m|; h = Cᵀ·m, b = (sqrt(hx² + hy²), 0, hz), w = C·b: INS_mag, eq. 2.27 to 2.30.

    ``m`` is in sensor axes, ``axes`` lays them along the body's. w is proportional to |m|, so
    e_m is the error of the field as measured, divided once by |m|²: no root, and the division
    runs beside the rest. Returns (e_m, whether ``m`` has no length).
    """
    m = permute(axes, m)
    square, missing = length_squared(xp, m)
    h = transposed_vector(c, m)
    b = (xp.sqrt(dot(h[:2], h[:2])), h[2])
    w = matrix_vector([(row[0], row[2]) for row in c], b)
    return scale(1 / square, cross(m, w)), missing


def rate_correction(xp, g, e_a, e_m, i, kp, ki_period):
    """i := i + Ki·T·e and omega = g·π/180 + Kp·e + i for e = e_a + e_m: INS_gyro, eq. 2.31.

    Returns (omega, i).
    """
    e = add(e_a, e_m)
    i = add(i, scale(ki_period, e))
    return add(add(scale(1 / DEGREES, g), scale(kp, e)), i), i


def quaternion_update(xp, q, omega, half_period):
    """q := q + T/2·q⊗(0, omega), then q := q/|q|: INS_quat, eq. 2.42 (third row: + q3·gx) and 2.45."""
    (q0, q1, q2, q3), (p0, p1, p2, p3) = q, scale(half_period, q)
    x, y, z = omega
    q = ((q0 - p1 * x) - (p2 * y + p3 * z),
         (q1 + p0 * x) + (p2 * z - p3 * y),
         (q2 + p0 * y) - (p1 * z - p3 * x),
         (q3 + p0 * z) + (p1 * y - p2 * x))
    square, _ = length_squared(xp, q)
    return scale(1 / xp.sqrt(square), q)


def matrix_from_quaternion(xp, q):
    """C = C_n^b from q as rows: INS_matx, eq. 2.34 (in c23 read q0q1 for the second q1q2)."""
    _, q1, q2, q3 = q
    d0, d1, d2, d3 = add(q, q)
    return ((1 - (d2 * q2 + d3 * q3), d1 * q2 + d0 * q3, d1 * q3 - d0 * q2),
            (d1 * q2 - d0 * q3, 1 - (d1 * q1 + d3 * q3), d2 * q3 + d0 * q1),
            (d1 * q3 + d0 * q2, d2 * q3 - d0 * q1, 1 - (d1 * q1 + d2 * q2)))


def euler_angles(xp, c11, c12, c13, c23, c33):
    """Pitch, roll and yaw (Z-Y-X) in degrees from elements of C_n^b: INS_euler, table 5-6.

    pitch = atan2(-c13, sqrt(1 - c13²)), roll = atan2(c23, c33), yaw = atan2(c12, c11) in
    [0, 360). The root's argument is held at zero or above, for gimbal lock and for a c13 that
    rounding took past one. A yaw less than 2**-15 degrees below zero is zero: plus 360 it would
    round to 360.
    """
    cosine = xp.sqrt(xp.maximum(1 - c13 * c13, 0.0))
    yaw = DEGREES * xp.atan2(c12, c11)
    roll = DEGREES * xp.atan2(c23, c33)
    pitch = DEGREES * xp.atan2(-c13, cosine)
    yaw = xp.select(yaw + 2.0**-15 < 0.0, yaw + 360, xp.maximum(yaw, 0.0))
    return pitch, roll, yaw


def attitude_update(xp, a, m, g, q, c, i, *, axes, period, kp, ki):
    """One update of INS_top, its stages in the order of the thesis's state machine."""
    with xp.section("ACC_MAG"):
        e_a, accelerometer_missing = accelerometer_error(xp, a, column(c, 2))
        e_m, magnetometer_missing = magnetometer_error(xp, m, c, axes)
    with xp.section("GYRO"):
        omega, i = rate_correction(xp, g, e_a, e_m, i, kp, ki * period)
    with xp.section("QUAT"):
        q = quaternion_update(xp, q, omega, period / 2)
    with xp.section("MATX"):
        c = matrix_from_quaternion(xp, q)
    with xp.section("EULER"):
        angles = euler_angles(xp, c[0][0], c[0][1], c[0][2], c[1][2], c[2][2])
    return Update(
        outputs={"c": c, "angles": angles},
        state={"q": q, "c": c, "i": i},
        status={"accelerometer_missing": accelerometer_missing, "magnetometer_missing": magnetometer_missing})
