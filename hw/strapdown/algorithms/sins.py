"""Strapdown inertial navigation in a wander-azimuth platform frame (source 002).

Frames: b body (x right, y forward, z up), p platform (level, z up), e earth. ``t`` is C_b^p and
``c`` is C_e^p, both as rows; ``q`` is the quaternion of t, body to platform, scalar first. Rates
in rad/s, specific force in m/s², means over the sample period; ``v`` is the velocity in p, m/s,
``h`` the height above the ellipsoid, m. Angles come out in degrees.

Every integral is of second order in the period. Values in the middle of the interval are extrapolated
from the previous interval (``half`` is half of its change of velocity).
"""

from typing import Any, NamedTuple

from .attitude import DEGREES, Update
from .quaternion import rate_product
from .sine import half_turn, sine_cosine
from .vector import SHORTEST_SQUARE, add, column, cross, dot, length_squared, matrix_vector, polynomial, scale

__all__ = ["Earth", "SOURCE_EARTH", "Sample", "Settings", "Start", "State", "WGS84", "alignment_quaternion",
           "attitude_angles", "attitude_quaternion", "earth_and_transport_rate", "horizontal_directions",
           "matrix_of_quaternion", "north_east_velocity", "position_angles", "position_matrix", "sins_update",
           "start_position", "velocity_half_change", "vertical_loop"]


class Earth(NamedTuple):
    """Ellipsoid, rotation and gravity, g = gravity + gravity_latitude·sin²L − gravity_height·h (m, rad, s)."""

    radius: float
    flattening: float
    rate: float
    gravity: float
    gravity_latitude: float
    gravity_height: float

    @property
    def eccentricity_squared(self):
        """First eccentricity, squared."""
        return self.flattening * (2 - self.flattening)


SOURCE_EARTH = Earth(6_378_140.0, 1 / 298.257, 7.2921e-5, 9.7803, 0.051799, 3.086e-6)
"""Source 002; height term as in source 000, eq. 2.7, which prints a tenth of it."""

WGS84 = Earth(6_378_137.0, 1 / 298.257223563, 7.292115e-5, 9.7803253, 0.0518017, 3.086e-6)
"""WGS 84; gravity fitted to its formula at equator and pole."""


def earth_and_transport_rate(xp, c, v, h, earth):
    """ω_ie^p = Ω·(C13, C23, C33), and ω_ep^p from the curvature of the ellipsoid: eq. 6 and 7.

    K·v = k·v + δ·n·(n·v) for n = (C13, C23): k = 1/(R_N + h) is the curvature eastwards, and
    δ = (1/(R_M + h) − k)/cos²L = e'²·k for h = 0. Then ω_ep^p = (−(K·v)_y, (K·v)_x, 0). The source has
    K = (1 − e·C33² + 2e·n·nᵀ)/Re (its print is damaged), which equals this to first order in e. Here the
    terms in e² and h are kept; the terms left out are 3e-8 of k for the ellipsoid and (h/Re)³.

    Returns (spin, transport); the z component of transport is zero and left out.
    """
    e2 = earth.eccentricity_squared
    n, sine_squared = (c[0][2], c[1][2]), c[2][2] * c[2][2]
    flat = polynomial([1 / earth.radius, -e2 / 2 / earth.radius, -e2**2 / 8 / earth.radius], sine_squared)
    rise = flat * h
    lift = 1 - rise * (1 - rise)
    k = flat * lift
    along = e2 / (1 - e2) * (k * lift) * dot(n, v[:2])
    x, y = k * v[0] + along * n[0], k * v[1] + along * n[1]
    return scale(earth.rate, column(c, 2)), (-y, x)


def attitude_quaternion(xp, q, omega, before, turn, step, a0, d0):
    """q := (1, −T/2·ω_ip^p)⊗q⊗(a, d·ω), not normalised: eq. 1 and 3, each rotation in its own frame.

    Bortz' coning term T/12·(before × ω) is added to ω = ω_ib^b; ``before`` is the previous sample.
    a and d are the polynomials of source 001. ``turn`` is ω_ip^p. Returns (q, |ω|²).
    """
    omega = add(omega, scale(step * (1 / 12), cross(before, omega)))
    square = dot(omega, omega)
    u = step * step * square
    q = add(scale(polynomial(a0, u), q), scale(step * polynomial(d0, u), rate_product(q, omega)))
    (q0, q1, q2, q3), (x, y, z) = q, scale(-0.5 * step, turn)
    return ((q0 - x * q1) - (y * q2 + z * q3),
            (q1 + x * q0) + (y * q3 - z * q2),
            (q2 + y * q0) + (z * q1 - x * q3),
            (q3 + z * q0) + (x * q2 - y * q1)), square


def matrix_of_quaternion(xp, q):
    """T = C_b^p as rows: eq. 4."""
    _, q1, q2, q3 = q
    d0, d1, d2, d3 = add(q, q)
    return ((1 - (d2 * q2 + d3 * q3), d1 * q2 - d0 * q3, d1 * q3 + d0 * q2),
            (d1 * q2 + d0 * q3, 1 - (d1 * q1 + d3 * q3), d2 * q3 - d0 * q1),
            (d1 * q3 - d0 * q2, d2 * q3 + d0 * q1, 1 - (d1 * q1 + d2 * q2)))


def velocity_half_change(xp, old, new, f, spin, turn, middle, down, step):
    """Half of V's change, T/2·(f^p − (2ω_ie^p + ω_ep^p) × V − (0, 0, down)): eq. 11.

    f^p is f resolved with the mean of T at both ends of the interval. ``middle`` is V in the middle of the
    interval, ``turn`` is ω_ie^p + ω_ep^p, and ``down`` is gravity plus the vertical loop's acceleration.
    """
    force = matrix_vector([add(*rows) for rows in zip(old, new, strict=True)], scale(0.25 * step, f))
    x, y, z = cross(add(spin, turn), middle)
    pull = scale(0.5 * step, (x, y, z + down))
    return tuple(a - b for a, b in zip(force, pull, strict=True))


def vertical_loop(xp, error, bias, step, damping, earth):
    """Third-order loop on error = h − altitude, three equal time constants of ``damping`` seconds.

    ḣ = V_z − 3λ·error, V̇_z = … − (3λ² + 2g/Re)·error − bias, bias' = λ³·error, λ = 1/damping.
    Returns (correction of ḣ, additional downward acceleration, bias).
    """
    rate = 1 / damping
    spring = 3 * rate**2 + 2 * earth.gravity / earth.radius
    return -3 * rate * error, spring * error + bias, bias + rate**3 * step * error


def position_matrix(xp, c, transport, step):
    """C := C − θ × (C − θ × C/2), θ = T·ω_ep^p, column by column: eq. 8 to second order."""
    x, y = scale(step, transport)

    def turned(a):
        return y * a[2], -(x * a[2]), x * a[1] - y * a[0]

    columns = []
    for index in range(3):
        a = column(c, index)
        middle = tuple(p - 0.5 * q for p, q in zip(a, turned(a), strict=True))
        columns.append(tuple(p - q for p, q in zip(a, turned(middle), strict=True)))
    return tuple(zip(*columns, strict=True))


def start_position(xp, latitude, longitude):
    """C_e^p of a position (degrees) with the platform along east, north and up: wander angle zero."""
    sin_latitude, cos_latitude = sine_cosine(xp, latitude)
    sin_longitude, cos_longitude = sine_cosine(xp, longitude)
    return ((-sin_longitude, cos_longitude, 0.0),
            (-sin_latitude * cos_longitude, -sin_latitude * sin_longitude, cos_latitude),
            (cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude))


def alignment_quaternion(xp, f, omega):
    """Quaternion body to (east, north, up) at rest, any length, from sums of specific force and rate.

    Up is along f, east along ω × up. The quaternion is the column of 4·q·qᵀ with the largest diagonal
    element (Shepperd, 1978), so its length is never near zero.
    """
    square, _ = length_squared(f)
    up = scale(xp.rsqrt(square), f)
    east = cross(omega, up)
    square, _ = length_squared(east)
    east = scale(xp.rsqrt(square), east)
    (t11, t12, t13), (t21, t22, t23), (t31, t32, t33) = east, cross(up, east), up
    q01, q02, q03, q12, q13, q23 = t32 - t23, t13 - t31, t21 - t12, t12 + t21, t13 + t31, t23 + t32
    total, difference = t22 + t33, t22 - t33
    near, far = 1 + t11, 1 - t11

    first = chosen(xp, total < 0.0, (q01, near - total, q12, q13), (near + total, q01, q02, q03))
    second = chosen(xp, difference < 0.0, (q03, q13, q23, far - difference), (q02, q12, far + difference, q23))
    larger = xp.maximum(near + total, near - total) < xp.maximum(far + difference, far - difference)
    return chosen(xp, larger, second, first)


def horizontal_directions(xp, c, loads):
    """North in p, (C13, C23), and up in e, (C31, C32), without their vertical parts; their length; wander angle, cos L.

    In an update that loads, and where north is undefined, north is (0, 1), the length is 1, and up is a quarter turn
    behind east, (C12, −C11): the wander angle (radians) is zero, and the longitude belongs to it. The arctangent does
    not wait for this choice. The length is cos L otherwise.
    """
    square = dot(c[2][:2], c[2][:2])
    cosine = xp.sqrt(square)
    along_y = xp.select(loads, -1.0, square - SMALLEST_COSINE**2) < 0.0
    north = (c[0][2], c[1][2])
    return (chosen(xp, along_y, (0.0, 1.0), north), chosen(xp, along_y, (c[0][1], -c[0][0]), c[2][:2]),
            xp.select(along_y, 1.0, cosine), xp.select(along_y, 0.0, xp.atan2(*north)), cosine)


SMALLEST_COSINE = 2.0**-30
"""Within a centimetre of the earth's pole north is undefined."""


def north_east_velocity(xp, north, v, length):
    """Velocity east and north from V and the direction to the north, (C13, C23), with its length."""
    inverse = 1 / length
    return inverse * (v[0] * north[1] - v[1] * north[0]), inverse * dot(v[:2], north)


def attitude_angles(xp, t, north):
    """Pitch, roll and true heading in degrees: eq. 5. ``north`` is (C13, C23) with any positive factor.

    Heading is clockwise from true north in [0, 360): minus the source's grid heading atan2(−T12, T22) less the wander
    angle atan2(C13, C23), both anticlockwise, taken in one arctangent. At a pitch of ±90° (T12, T22) is zero. The
    direction forward is therefore a quarter turn from that to the right without the roll,
    (T33·T11 − T31·T13, T33·T21 − T31·T23), as in ``attitude.matrix_angles``; where T31 and T33 are zero, (0, 1)
    replaces them.
    """
    square = t[2][0] * t[2][0] + t[2][2] * t[2][2]
    pole = square < SHORTEST_SQUARE
    x, y = chosen(xp, pole, (t[0][0], t[1][0]), tuple(t[2][2] * row[0] - t[2][0] * row[2] for row in t[:2]))
    pitch = xp.atan2(t[2][1], xp.sqrt(square))
    roll = xp.select(pole, 0.0, xp.atan2(-t[2][0], t[2][2]))
    heading = DEGREES * xp.atan2(-(y * north[1] + x * north[0]), x * north[1] - y * north[0])
    # Like the yaw of the attitude cores, it is zero where adding 360 would round to 360.
    heading = xp.select(heading + 2.0**-15 < 0.0, heading + 360, xp.maximum(heading, 0.0))
    return DEGREES * pitch, DEGREES * roll, heading


def position_angles(xp, sine, cosine, up):
    """Latitude and longitude in degrees from sin L, cos L and (C31, C32): eq. 9."""
    return scale(DEGREES, (xp.atan2(sine, cosine), xp.atan2(up[1], up[0])))


class Sample(NamedTuple):
    """Measurements, means over the sample period; the altitude is None without a vertical loop."""

    omega: Any
    """rad/s"""
    f: Any
    """m/s²"""
    altitude: Any = None
    """m"""


class Start(NamedTuple):
    """Start values of a load."""

    load: Any
    """above 1/2: this update loads"""
    align: Any
    """above 1/2: the load starts an alignment; else ``q`` is the attitude"""
    place: Any
    """latitude and longitude, degrees"""
    v: Any
    """velocity east, north, up, m/s"""
    h: Any
    """height, m"""
    q: Any
    """quaternion body to east-north-up, any length"""


class State(NamedTuple):
    """State between updates; the bias is None without a vertical loop."""

    q: Any
    t: Any
    c: Any
    v: Any
    half: Any
    """half of the latest change of ``v``"""
    h: Any
    before: Any
    """rate of the previous sample; during an alignment the sum of all samples"""
    force: Any
    """specific force likewise"""
    left: Any
    """-1: navigates; 1 or more: aligns, number of samples left; 0: waits for a start"""
    bias: Any = None
    """of the vertical loop, m/s²"""


class Settings(NamedTuple):
    """Constants of a core."""

    earth: Earth
    period: float
    """s"""
    samples: int
    """number of samples that an alignment averages"""
    damping: float
    """time constant of the vertical loop, s; 0 without one"""
    a0: tuple[float, ...]
    d0: tuple[float, ...]
    """coefficients of the attitude's polynomials"""
    rate_max: float
    """rad/s"""
    force_max: float
    """m/s²"""


class Mode(NamedTuple):
    """Actions of an update."""

    loads: Any
    """condition: the update takes the start values"""
    place: Any
    """start latitude and longitude, degrees, the latter between -180 and 180"""
    place_excess: Any
    """positive if a start angle is out of range"""
    step: Any
    """s: the period while the core navigates, else zero, so that velocity and position do not change"""
    finishes: Any
    """negative if this is the last sample of an alignment"""
    total_rate: Any
    total_force: Any
    """sums over an alignment"""
    next_left: Any
    next_before: Any
    next_force: Any
    """values of these fields in the next state"""


def chosen(xp, condition, a, b):
    """The vector ``a`` where the condition holds, else ``b``."""
    return tuple(xp.select(condition, p, q) for p, q in zip(a, b, strict=True))


def mode(xp, sample, start, state, settings):
    """The Mode of this update: load, align, navigate or wait."""
    loads, after = start.load > 0.5, state.left - 1
    place, place_excess = start_angles(xp, start, loads)
    step = xp.select(loads, 0.0, xp.select(state.left < 0.0, settings.period, 0.0))
    goes_on = xp.select(loads, -1.0, after - 0.5)
    total_rate, total_force = add(state.before, sample.omega), add(state.force, sample.f)
    finishes = (state.left - 0.5) * (state.left - 1.5)
    next_left = xp.select(finishes < 0.0, -1.0, xp.select(goes_on < 0.0, state.left, after))
    next_left = xp.select(loads, xp.select(start.align > 0.5, settings.samples - 1.0, -1.0), next_left)
    return Mode(loads, place, place_excess, step, finishes, total_rate, total_force, next_left,
                chosen(xp, goes_on < 0.0, sample.omega, total_rate), chosen(xp, goes_on < 0.0, sample.f, total_force))


def start_angles(xp, start, loads):
    """Start latitude and longitude in degrees, the latter between -180 and 180: (angles, excess).

    Without a load, the inputs may be any numbers, and both angles are zero. The excess is positive if latitude or
    longitude is out of range.
    """
    latitude, longitude = (xp.select(loads, angle, 0.0) for angle in start.place)
    excess = xp.maximum(latitude * latitude - 90.0**2, longitude * longitude - 360.0**2)
    return (latitude, half_turn(xp, longitude)), excess


def sins_update(xp, sample, start, state, settings):
    """One update of SINS_top.

    An update with a load takes the start values with its sample. It may start an alignment, with this sample as
    the first. While the core does not navigate, the step is zero, so that the same equations do not change
    velocity and position.

    Parameters
    ----------
    sample : Sample
    start : Start
    state : State
    settings : Settings

    Returns
    -------
    Update
    """
    earth, f, c, h, bias = settings.earth, sample.f, state.c, state.h, state.bias
    with xp.section("MODE"):
        does = mode(xp, sample, start, state, settings)
        loads, step = does.loads, does.step
    with xp.section("ALIGN"):
        aligned = alignment_quaternion(xp, does.total_force, does.total_rate)
    with xp.section("RATES"):
        middle = add(state.v, state.half)
        spin, transport = earth_and_transport_rate(xp, c, middle, h, earth)
        turn = (spin[0] + transport[0], spin[1] + transport[1], spin[2])
    with xp.section("ATTITUDE"):
        moved, rate_square = attitude_quaternion(
            xp, state.q, sample.omega, state.before, turn, step, settings.a0, settings.d0)
        q = chosen(xp, does.finishes < 0.0, aligned, moved)
        q = chosen(xp, loads, start.q, q)
        # Before an alignment the start quaternion may be zero; it then stays zero.
        q = scale(xp.rsqrt(dot(q, q) + SHORTEST_SQUARE), q)
        t = matrix_of_quaternion(xp, q)
    with xp.section("VELOCITY"):
        down = (earth.gravity + earth.gravity_latitude * (c[2][2] * c[2][2])) - earth.gravity_height * h
        climb = state.v[2]
        if settings.damping:
            correction, pull, bias = vertical_loop(xp, h - sample.altitude, bias, step, settings.damping, earth)
            climb, down = climb + correction, down + pull
            bias = xp.select(loads, 0.0, bias)
        half = velocity_half_change(xp, state.t, t, f, spin, turn, middle, down, step)
        h = xp.select(loads, start.h, h + step * (climb + half[2]))
        v = tuple(xp.select(loads, a, b + (d + d)) for a, b, d in zip(start.v, state.v, half, strict=True))
    with xp.section("POSITION"):
        moved_c = position_matrix(xp, c, transport, step)
        c = tuple(chosen(xp, loads, *rows) for rows in zip(start_position(xp, *does.place), moved_c, strict=True))
    with xp.section("OUTPUT"):
        # A load gives out the start angles unchanged, with north along the platform's y: no output waits for a sine.
        north, up, length, wander, cosine = horizontal_directions(xp, moved_c, loads)
        attitude = attitude_angles(xp, t, north)
        position = position_angles(xp, moved_c[2][2], cosine, up)
        v_east, v_north = north_east_velocity(xp, north, v, length)
        shown = chosen(xp, loads, does.place, position)
        excess = xp.maximum(does.place_excess, xp.maximum(rate_square - settings.rate_max**2,
                                                          dot(f, f) - settings.force_max**2))
    state = {"q": q, "t": t, "c": c, "v": v, "half": half, "h": h, "before": does.next_before,
             "force": does.next_force, "left": does.next_left}
    return Update(
        outputs={"attitude": attitude, "velocity": (v_east, v_north, v[2]), "position": shown, "height": h,
                 "wander": DEGREES * wander},
        state=state | ({"bias": bias} if settings.damping else {}),
        status={"aligning": does.next_left > 0.5, "navigating": does.next_left < 0.0, "out_of_range": excess > 0.0})
