"""The complementary attitude filter of the 2015 thesis (source 000, chapters 2 and 4).

Frames: b body, n navigation (x magnetic north, y west, z up). ``c`` is C_n^b (navigation to
body) as rows, ``q`` the body-to-navigation quaternion, scalar first. Vectors are body
components. ``a`` and ``m`` may have any unit, ``g`` is in deg/s, angles come out in degrees.
"""

import math
from typing import NamedTuple

from .vector import SHORTEST_SQUARE, add, column, cross, dot, length_squared, permute, scale, transposed_vector

__all__ = ["Update", "accelerometer_error", "magnetometer_error", "rate_correction", "correction_gains",
           "quaternion_update", "matrix_from_quaternion", "scaled_matrix", "euler_angles", "matrix_angles",
           "attitude_update"]

DEGREES = 180 / math.pi


class Update(NamedTuple):
    """Results of one update, by the names of the system's interface."""

    outputs: dict
    state: dict | None = None
    status: dict | None = None


def accelerometer_error(xp, a, v, gain=1):
    """e_a = a/|a| × v with v = C·(0, 0, 1) = (c13, c23, c33): INS_acc, eq. 2.26 and 2.30.

    Returns (gain·e_a, true if ``a`` has no length, true if the angle from a to v is more than 90°). The vector
    product does not wait for the root and the division, which run at the same time. The gain is the dividend and
    needs no additional operation.
    """
    square, missing = length_squared(a)
    return scale(gain / xp.sqrt(square), cross(a, v)), missing, a[2] * v[2] < -(a[0] * v[0] + a[1] * v[1])


def magnetometer_error(xp, m, c, axes, gain=1):
    """e_m = m × w for m := m/|m|; h = Cᵀ·m, b = (sqrt(hx² + hy²), 0, hz), w = C·b: INS_mag, eq. 2.27 to 2.30.

    ``m`` is in sensor axes; ``axes`` maps them to body axes. w is proportional to |m|, so e_m is computed
    from the field as measured and divided once by |m|², without a root. By the columns of C,
    m × w = bx·(m × c1) + hz·(m × c3): all values but bx are ready before the root of bx is.
    Returns (gain·e_m, true if ``m`` has no length, true if the angle from h to north is more than 90°: hx < 0).
    """
    m = permute(axes, m)
    square, missing = length_squared(m)
    h = transposed_vector(c, m)
    north, up = (scale(gain / square, cross(m, column(c, axis))) for axis in (0, 2))
    return add(scale(xp.sqrt(dot(h[:2], h[:2])), north), scale(h[2], up)), missing, h[0] < 0.0


def rate_correction(g, e_a, e_m, i, unit, integral_share):
    """i := i + Ki·T·e and omega = g·π/180 + Kp·e + i for e = e_a + e_m: INS_gyro, eq. 2.31.

    One degree per second is ``unit`` of the unit of ``omega`` and ``i``. ``e_a`` and ``e_m`` are in the same
    unit and contain the gain Kp + Ki·T, of which Ki·T is the fraction ``integral_share``. Returns (omega, i).
    omega is computed from the previous i and the whole gain: the same value, but it does not wait for the
    next i. e_a waits for a root and a division and is therefore added last.
    """
    omega = add(add(add(scale(unit, g), i), e_m), e_a)
    return omega, add(i, scale(integral_share, add(e_a, e_m)))


def correction_gains(kp, ki, period):
    """The gain Kp + Ki·T of ``rate_correction``, and the fraction Ki·T of it, zero if the gain is zero.

    Both gains are 0 or more. If they are not constants, ``SHORTEST_SQUARE`` is added to the divisor, as in
    ``length_squared``.
    """
    integral = ki * period
    gain = kp + integral
    if isinstance(gain, float | int):
        return gain, integral / gain if gain else 0.0
    return gain, integral / (gain + SHORTEST_SQUARE)


def quaternion_step(q, half_turn):
    """q + q⊗(0, half_turn) for half_turn = T/2·omega, not normalised: eq. 2.42 (third row: + q3·gx)."""
    q0, q1, q2, q3 = q
    x, y, z = half_turn
    return ((q0 - q1 * x) - (q2 * y + q3 * z),
            (q1 + q0 * x) + (q2 * z - q3 * y),
            (q2 + q0 * y) - (q1 * z - q3 * x),
            (q3 + q0 * z) + (q1 * y - q2 * x))


def quaternion_update(xp, q, omega, half_period):
    """q := q + T/2·q⊗(0, omega), then q := q/|q|: INS_quat, eq. 2.42 and 2.45."""
    q = quaternion_step(q, scale(half_period, omega))
    return scale(xp.rsqrt(dot(q, q)), q)


def matrix_from_quaternion(xp, q):
    """C = C_n^b from q as rows: INS_matx, eq. 2.34 (in c23 read q0q1 for the second q1q2)."""
    _, q1, q2, q3 = q
    d0, d1, d2, d3 = add(q, q)
    return ((1 - (d2 * q2 + d3 * q3), d1 * q2 + d0 * q3, d1 * q3 - d0 * q2),
            (d1 * q2 - d0 * q3, 1 - (d1 * q1 + d3 * q3), d2 * q3 + d0 * q1),
            (d1 * q3 + d0 * q2, d2 * q3 - d0 * q1, 1 - (d1 * q1 + d2 * q2)))


def scaled_matrix(q):
    """|q|²·C as rows, and |q|², from q of any length: eq. 2.34 in its homogeneous form."""
    q0, q1, q2, q3 = q
    s0, s1, s2, s3 = (x * x for x in q)

    def twice(x):
        return x + x

    return (((s0 + s1) - (s2 + s3), twice(q1 * q2 + q0 * q3), twice(q1 * q3 - q0 * q2)),
            (twice(q1 * q2 - q0 * q3), (s0 - s1) + (s2 - s3), twice(q2 * q3 + q0 * q1)),
            (twice(q1 * q3 + q0 * q2), twice(q2 * q3 - q0 * q1), (s0 - s1) - (s2 - s3))), (s0 + s1) + (s2 + s3)


def euler_angles(xp, c11, c12, c13, cosine, c23, c33):
    """Pitch, roll and yaw (Z-Y-X) in degrees from elements of C_n^b: INS_euler, table 5-6.

    pitch = atan2(-c13, cosine) with cosine = sqrt(1 - c13²) = sqrt(c23² + c33²), roll =
    atan2(c23, c33), yaw = atan2(c12, c11) in [0, 360). All arguments may contain a common positive
    factor. A yaw less than 2**-15 degrees below zero becomes zero, because yaw + 360 would round to 360.

    Near a pitch of ±90° c11 and c12 are small differences, and the yaw is lost; ``matrix_angles`` keeps it.
    """
    pitch = DEGREES * xp.atan2(-c13, cosine)
    yaw = DEGREES * xp.atan2(c12, c11)
    yaw = xp.select(yaw + 2.0**-15 < 0.0, yaw + 360, xp.maximum(yaw, 0.0))
    roll = DEGREES * xp.atan2(c23, c33)
    return pitch, roll, yaw


def matrix_angles(xp, c):
    """Pitch, roll and yaw (Z-Y-X) in degrees from C_n^b: they give C back at any pitch.

    Near a pitch of ±90° roll and yaw are rotations about almost the same axis, and rounding decides how they share
    it. The yaw is therefore that of C without the roll that is given out: cos(yaw) and sin(yaw) are proportional to
    c33·c22 − c23·c32 and c23·c31 − c33·c21. Where c23 and c33 are zero, (0, 1) replaces them, and the roll is zero.
    All elements may contain a common positive factor of 1 or more.
    """
    (_, _, c13), (c21, c22, c23), (c31, c32, c33) = c
    square = dot((c23, c33), (c23, c33))
    pole = square < SHORTEST_SQUARE
    north, west = c33 * c22 - c23 * c32, c23 * c31 - c33 * c21
    north, west = xp.select(pole, c22, north), xp.select(pole, -c21, west)
    pitch, roll, yaw = euler_angles(xp, north, west, c13, xp.sqrt(square), c23, c33)
    return pitch, xp.select(pole, 0.0, roll), yaw


def attitude_update(xp, a, m, g, q, c, i, *, axes, period, kp, ki):
    """One update of INS_top; the stages are in the order of the thesis's state machine.

    The angles do not wait for the normalisation of the next quaternion: they need only the directions in |q|²·C.
    All angular rates, including ``i``, are multiplied by T/2: they are half the rotation of one period.

    The error e_a + e_m is zero at wrong attitudes too, its false equilibria; ``tilt_reversed`` or ``heading_reversed``
    is true at each of them. In navigation axes, with a_n = Cᵀ·a/|a| and h = Cᵀ·m/|m|, the error is
    (a_ny + hz·hy, hz·(bx − hx) − a_nx, −bx·hy). Where it is zero, hy is zero, so a_ny is zero and hx = ±bx.
    With hx = bx the attitude is right, or a_n = (0, 0, −1): upside down. With hx = −bx north is behind, and the pitch
    is wrong by asin(2·hz·bx).
    """
    with xp.section("ACC_MAG"):
        gain, integral_share = correction_gains(kp, ki, period)
        gain *= period / 2
        e_a, accelerometer_missing, tilt_reversed = accelerometer_error(xp, a, column(c, 2), gain)
        e_m, magnetometer_missing, heading_reversed = magnetometer_error(xp, m, c, axes, gain)
    with xp.section("GYRO"):
        half_turn, i = rate_correction(g, e_a, e_m, i, period / 2 / DEGREES, integral_share)
    with xp.section("QUAT"):
        q = quaternion_step(q, half_turn)
    with xp.section("MATX"):
        s, square = scaled_matrix(q)
        reciprocal = 1 / square
        q = scale(xp.sqrt(reciprocal), q)
        c = tuple(scale(reciprocal, row) for row in s)
    with xp.section("EULER"):
        angles = matrix_angles(xp, s)
    return Update(
        outputs={"c": c, "angles": angles},
        state={"q": q, "c": c, "i": i},
        status={"accelerometer_missing": accelerometer_missing, "magnetometer_missing": magnetometer_missing,
                "tilt_reversed": tilt_reversed, "heading_reversed": heading_reversed})
