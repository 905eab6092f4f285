"""The complementary attitude filter of the 2015 thesis (source 000, chapters 2 and 4).

Frames: b body, n navigation (x magnetic north, y west, z up). ``c`` is C_n^b (navigation to
body) as rows, ``q`` the body-to-navigation quaternion, scalar first. Vectors are body
components. ``a`` and ``m`` may have any unit, ``g`` is in deg/s, angles come out in degrees.

The functions up to ``euler_angles`` are the equations of the thesis, one for each of its modules; ``matrix_angles`` are
the angles of the flight filter. ``attitude_update`` computes all equations of the thesis in another order, in which
less waits for a root, a division or an angle; its functions precede it.
"""

import math
from typing import NamedTuple

from .vector import SHORTEST_SQUARE, add, column, cross, dot, length_squared, permute, root, scale, transposed_vector

__all__ = ["Update", "accelerometer_error", "magnetometer_error", "rate_correction", "correction_gains",
           "quaternion_update", "matrix_from_quaternion", "euler_angles", "matrix_angles", "corrections", "turn",
           "turn_rounded_once", "pair_products", "pair_angles", "attitude_update"]

DEGREES = 180 / math.pi

SHORTEST = math.sqrt(SHORTEST_SQUARE)
"""Added to A and B in products: a pair (A, D1) or (B, D2) of zeros has the direction (1, 0)."""


GROWN = 1.5
"""Square of the length of s from which s is normalised, to the length 1.

A half turn h makes it grow by the factor 1 + |h|². Most updates need no normalisation, which rounds each time.
From 1 to 1.5, A and B of a level body are below 1, where the last place is at most 2**-24.
"""


POLE = 2.0**-42
"""A squared cosine of the pitch below this is as good as zero: it is the square of the error of c33, 8·2**-24.

For c33 = 1 − 2·(q1² + q2²)/|q|² near zero these are, in 2**-24: 3 of |q|², 1.8 of the reciprocal, and 3 of two products
and a sum. c23 has 2.
"""


class Update(NamedTuple):
    """Results of one update, by the names of the system's interface."""

    outputs: dict
    state: dict | None = None
    status: dict | None = None


def accelerometer_error(xp, a, v):
    """e_a = a/|a| × v with v = C·(0, 0, 1) = (c13, c23, c33): INS_acc, eq. 2.26 and 2.30.

    A vector without length gives zero. The vector product does not wait for the root.
    """
    square, _ = length_squared(a)
    return scale(xp.rsqrt(square), cross(a, v))


def magnetometer_error(xp, m, c, axes):
    """e_m = m × w for m := m/|m|; h = Cᵀ·m, b = (sqrt(hx² + hy²), 0, hz), w = C·b: INS_mag, eq. 2.27 to 2.30.

    ``m`` is in sensor axes; ``axes`` maps them to body axes. w is proportional to |m|, so e_m is computed
    from the field as measured and divided once by |m|². By the columns of C,
    m × w = bx·(m × c1) + hz·(m × c3): all values but bx are ready before the root of bx is.
    A vector without length gives zero.
    """
    m = permute(axes, m)
    square, _ = length_squared(m)
    h = transposed_vector(c, m)
    reciprocal = xp.reciprocal(square)
    north, up = (scale(reciprocal, cross(m, column(c, axis))) for axis in (0, 2))
    return add(scale(root(xp, dot(h[:2], h[:2])), north), scale(h[2], up))


def rate_correction(g, early, late, i, unit, integral_share, *, fewest=False):
    """i := i + Ki·T·e and omega = g·π/180 + Kp·e + i for e = e_a + e_m = early + late: INS_gyro, eq. 2.31.

    One degree per second is ``unit`` in the unit of ``omega`` and ``i``. ``early`` and ``late`` are in the same
    unit and contain the gain Kp + Ki·T, of which Ki·T is the fraction ``integral_share``. Returns (omega, i).
    omega is computed from the previous i and the whole gain: the same value, but it does not wait for the
    next i. ``late`` is added last. With ``fewest``, both sums contain early + late: fewer additions.
    """
    if fewest:
        error = add(early, late)
        return add(add(scale(unit, g), i), error), add(i, scale(integral_share, error))
    omega = add(add(add(scale(unit, g), i), early), late)
    return omega, add(i, scale(integral_share, add(early, late)))


def correction_gains(xp, kp, ki, period):
    """The gain Kp + Ki·T of ``rate_correction``, and the fraction Ki·T of it, zero if the gain is zero.

    Both gains are 0 or more. If they are not constants, ``SHORTEST_SQUARE`` is added to the divisor, as in
    ``length_squared``.
    """
    integral = ki * period
    gain = kp + integral
    if isinstance(gain, float | int):
        return gain, integral / gain if gain else 0.0
    return gain, integral * xp.reciprocal(gain + SHORTEST_SQUARE)


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


def euler_angles(xp, c11, c12, c13, cosine, c23, c33):
    """Pitch, roll and yaw (Z-Y-X) in degrees from elements of C_n^b: INS_euler, table 5-6.

    pitch = atan2(-c13, cosine) with cosine = sqrt(1 - c13²) = sqrt(c23² + c33²), roll =
    atan2(c23, c33), yaw = atan2(c12, c11) in [0, 360). All arguments may contain a common positive
    factor. A yaw less than 2**-15 degrees below zero becomes zero, because yaw + 360 would round to 360.

    Near a pitch of ±90° c11 and c12 are small differences, and the yaw is lost; ``matrix_angles`` keeps it.
    """
    pitch = xp.atan2_degrees(-c13, cosine)
    yaw = xp.atan2_degrees(c12, c11)
    yaw = xp.select(yaw + 2.0**-15 < 0.0, yaw + 360, xp.maximum(yaw, 0.0))
    roll = xp.atan2_degrees(c23, c33)
    return pitch, roll, yaw


def matrix_angles(xp, c):
    """Pitch, roll and yaw (Z-Y-X) in degrees from C_n^b: they give C back at any pitch.

    Near a pitch of ±90° roll and yaw are rotations about almost the same axis, and rounding decides how they share
    it. The yaw is therefore that of C without the roll that is given out: cos(yaw) and sin(yaw) are proportional to
    c33·c22 − c23·c32 and c23·c31 − c33·c21. Where c23² + c33² is below ``POLE``, (0, 1) replaces them, and the roll is
    zero.
    All elements may contain a common positive factor of 1 or more; it makes the region with a roll of zero smaller.
    """
    (_, _, c13), (c21, c22, c23), (c31, c32, c33) = c
    square = dot((c23, c33), (c23, c33))
    pole = square < POLE
    north, west = c33 * c22 - c23 * c32, c23 * c31 - c33 * c21
    north, west = xp.select(pole, c22, north), xp.select(pole, -c21, west)
    pitch, roll, yaw = euler_angles(xp, north, west, c13, xp.sqrt(square), c23, c33)
    return pitch, xp.select(pole, 0.0, roll), yaw


def corrections(xp, a, m, c1, c3, gain, *, fewest):
    """Both error vectors times ``gain``, e_a·gain and e_m·gain, as a sum that is ready early and a summand that is not.

    e_a + e_m = a/|a| × c3 + hz/|m|² · m × c3 + bx/|m|² · m × c1, with hz = m·c3 and bx² = |m|² − hz², because the
    columns c1 and c3 of C are unit vectors; only the last term waits for bx. In binary32 bx² has an error of about
    2**-23·|m|². It may make the difference of a vertical field negative, so bx² is ``SHORTEST_SQUARE`` or more.
    bx = bx²/sqrt(bx²), and the root is the last factor. ``m`` is in body axes. With ``fewest``, the first two terms are
    one vector product: fewer products, but they wait for 1/|a| and 1/|m|².
    """
    square_a, accelerometer_missing = length_squared(a)
    square_m, magnetometer_missing = length_squared(m)
    hz = dot(m, c3)
    bx_squared = xp.maximum(square_m - hz * hz, SHORTEST_SQUARE)
    by_a, by_m, by_bx = gain * xp.rsqrt(square_a), gain * xp.reciprocal(square_m), xp.rsqrt(bx_squared)
    north = cross(m, c1)
    if fewest:
        early = cross(add(scale(by_a, a), scale(hz * by_m, m)), c3)
        late = scale(by_bx * (by_m * bx_squared), north)
    else:
        early = add(scale(hz * by_m, cross(m, c3)), scale(by_a, cross(a, c3)))
        late = scale(by_bx, scale(by_m * bx_squared, north))
    return early, late, {"accelerometer_missing": accelerometer_missing, "magnetometer_missing": magnetometer_missing,
                         "tilt_reversed": obtuse(a, c3), "heading_reversed": obtuse(m, c1)}


def obtuse(a, b):
    """True if the angle between two vectors of three components is more than 90°."""
    return a[2] * b[2] < -(a[0] * b[0] + a[1] * b[1])


def turn(s, half_turn):
    """s + s⊗(0, half_turn) for s = (A, B, D1, D2), not normalised: eq. 2.42.

    (A, D1, B, -D2) is a quaternion too: q times a constant one. Its step is that of q.
    """
    (a, b, d1, d2), (x, y, z) = s, half_turn
    return ((a - x * d1) + (z * d2 - y * b),
            (b - x * d2) + (y * a - z * d1),
            (d1 + x * a) + (y * d2 + z * b),
            (d2 + x * b) - (y * d1 + z * a))


def turn_rounded_once(s, half_turn):
    """The sum of ``turn`` in an order that takes one addition longer and rounds less: the small products come first."""
    (a, b, d1, d2), (x, y, z) = s, half_turn
    return (a + ((z * d2 - y * b) - x * d1),
            b + ((y * a - z * d1) - x * d2),
            d1 + ((y * d2 + z * b) + x * a),
            d2 + (x * b - (y * d1 + z * a)))


def pair_squares(s, least=None):
    """c13, c22 and c31 times u + v, and u = B² + D2² and v = A² + D1²: eq. 2.34 for s = (A, B, D1, D2).

    ``least``, if given, is added to u and v, so that they are more than zero.
    """
    aa, bb, dd1, dd2 = (x * x for x in s)
    u, v = (bb + dd2, aa + dd1) if least is None else (bb + (dd2 + least), aa + (dd1 + least))
    first, second = bb - dd2, aa - dd1
    return (v - u, first + second, first - second), u, v


def directed(s):
    """(A, B, D1, D2), where a pair of zeros, (A, D1) or (B, D2), has a direction."""
    a, b, d1, d2 = s
    return a + SHORTEST, b + SHORTEST, d1, d2


def pair_products(s, squares):
    """C as rows, with a factor: eq. 2.34 for s = (A, B, D1, D2). ``squares`` are the elements c13, c22 and c31.

    The other elements are (A² + B² + D1² + D2²)/2 times those of C: no product is doubled.
    """
    a, b, d1, d2 = s
    c13, c22, c31 = squares
    ab, bd1, dd = a * b, d1 * b, d1 * d2
    ad1, ad2, bd2 = a * d1, a * d2, b * d2
    return (ab + dd, bd1 - ad2, c13), (bd2 - ad1, c22, bd1 + ad2), (c31, -(bd2 + ad1), ab - dd)


def pair_angles(xp, c, u, v, *, fewest):
    """Pitch, roll and yaw (Z-Y-X) in degrees from ``pair_products``, u and v: they give C back at any pitch.

    yaw = arg(A + i·D1) − arg(B + i·D2) and roll = arg(A + i·D1) + arg(B + i·D2) are the arguments of the products
    c11 + i·c12 and c33 + i·c23 of these pairs. One pair vanishes at a pitch of ±90°, but its direction keeps all its
    digits. The cosine of the pitch is sqrt(u·v)·2/(u + v); u and v are more than zero, and may contain another factor
    than ``c``. With ``fewest``, the tangent of the pitch is (u − v)/sqrt(u·v)/2: one product fewer, but it waits for
    the root.
    """
    (c11, c12, c13), (_, _, c23), (_, _, c33) = c
    square = u * v
    if fewest:
        return euler_angles(xp, c11, c12, (v - u) * xp.rsqrt(square), 2.0, c23, c33)
    return euler_angles(xp, c11, c12, 0.5 * c13, square * xp.rsqrt(square), c23, c33)


def attitude_update(xp, a, m, g, s, c, i, *, axes, period, kp, ki, fewest=False):
    """One update of INS_top; the stages are in the order of the thesis's state machine.

    The attitude is s = (A, B, D1, D2) = (q0 − q2, q0 + q2, q1 + q3, q1 − q3), times any factor. With these sums the
    elements of C are sums of two products or of squares. The angles need their directions only, and do not wait for
    the length of s. All angular rates, including ``i``, are multiplied by T/2: they are half the rotation of one
    period. Of ``c``, the first and the last column are used. The next state is the sum that rounds less. It is
    normalised only if the square of its length has reached ``GROWN``: what is rounded in each update adds up.

    With ``fewest``, the update consists of fewer operations, but more of them wait for others: s is normalised to the
    length sqrt(2) before its products are computed, and only the elements that are sums of squares are divided by
    |s|². This s is the next state too. Of C, the next state has the first and the last column only.

    The error e_a + e_m is zero at wrong attitudes too, its false equilibria; ``tilt_reversed`` or ``heading_reversed``
    is true at each of them. In navigation axes, with a_n = Cᵀ·a/|a| and h = Cᵀ·m/|m|, the error is
    (a_ny + hz·hy, hz·(bx − hx) − a_nx, −bx·hy). Where it is zero, hy is zero, so a_ny is zero and hx = ±bx.
    With hx = bx the attitude is right, or a_n = (0, 0, −1): upside down. With hx = −bx north is behind, and the pitch
    is wrong by asin(2·hz·bx).
    """
    with xp.section("ACC_MAG"):
        gain, integral_share = correction_gains(xp, kp, ki, period)
        gain *= period / 2
        early, late, status = corrections(xp, a, permute(axes, m), column(c, 0), column(c, -1), gain, fewest=fewest)
    with xp.section("GYRO"):
        half_turn, i = rate_correction(g, early, late, i, period / 2 / DEGREES, integral_share, fewest=fewest)
    with xp.section("QUAT"):
        s, before = turn(s, half_turn), s
        if not fewest:
            once_rounded = turn_rounded_once(before, half_turn)
    with xp.section("MATX"):
        if fewest:
            s = directed(s)
            squares, u, v = pair_squares(s)
            square = u + v
            s = scale(math.sqrt(2) * xp.rsqrt(square), s)
            c = products = pair_products(s, scale(xp.reciprocal(square), squares))
        else:
            squares, u, v = pair_squares(s, SHORTEST_SQUARE)
            products = pair_products(directed(s), squares)
            square = u + v
            once = xp.reciprocal(square)
            twice = once + once
            c = tuple(tuple((once if row + index == 2 else twice) * element for index, element in enumerate(elements))
                      for row, elements in enumerate(products))
            s = scale(xp.select(square < GROWN, 1.0, xp.rsqrt(square)), once_rounded)
    with xp.section("EULER"):
        angles = pair_angles(xp, products, u, v, fewest=fewest)
    kept = tuple((row[0], row[-1]) for row in c) if fewest else c
    return Update(outputs={"c": c, "angles": angles}, state={"s": s, "c": kept, "i": i}, status=status)
