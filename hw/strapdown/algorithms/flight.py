"""An attitude filter for flight: 9-axis, or 6-axis without magnetometer.

Frames: b body, n navigation, with the axes of a ``Frame``; z is always vertical. ``c`` is
C_n^b (navigation to body) as rows, ``q`` the body-to-navigation quaternion, scalar first. ``a``
and ``m`` may have any unit, ``g`` and ``bias`` are in deg/s, angles come out in degrees.

A correction is a vector p along its axis with the length tan(angle/2): q⊗(1, p) rotates by exactly
that angle. For small angles p is half the angle in radians.

Order of an update: the gyro and the correction from the previous update rotate the quaternion. The new
attitude then resolves specific force and field in n. Their errors give a correction for the next
update, so the angles of this update do not wait for it.
"""

import math
from typing import Any, NamedTuple

from .attitude import Update, matrix_angles
from .vector import SHORTEST_SQUARE, add, dot, permute, scale, subtract, transposed_vector

__all__ = ["ALIGNMENTS", "FRAMES", "Frame", "LONGEST_PERIOD", "Parameters", "Sensors", "Settings", "State",
           "bias_update", "field_correction", "flight_update", "gyro_average", "heading", "low_pass",
           "matrix_of_turn", "tilt_correction", "turned", "vertical"]

DEGREES = 180 / math.pi

ALIGNMENTS = 4
"""Number of first samples with full weight. It is more than one, because a correction rotates by 127° at most."""

LONGEST_PERIOD = 0.1
"""Longest period in seconds; a longer one is limited to this. It keeps gain times period near 1 or below."""

UPSIDE_DOWN = 2.0**-17
"""Within this angle (rad) of upside down, no axis can be measured; an arbitrary horizontal axis is used."""

FIELD_SETTLING = 2.0
"""Rate (1/s) at which the field's reference follows the field at the beginning of the start-up ramp."""


class Frame(NamedTuple):
    """Axes of the navigation frame: whether z points up (1) or down (-1), and which axis is north."""

    up: int
    north: int

    def upward(self, vector):
        """Upward component of a vector in n."""
        return vector[2] if self.up > 0 else -vector[2]

    def horizontal(self, vector):
        """Component to the north, and the component a right-handed quarter turn about z from north."""
        return (vector[0], vector[1]) if self.north == 0 else (vector[1], -vector[0])


FRAMES = {"NWU": Frame(up=1, north=0), "ENU": Frame(up=1, north=1), "NED": Frame(up=-1, north=0)}


class Parameters(NamedTuple):
    """Gains, times and limits: constants, or values that are known only at run time."""

    accelerometer_gain: Any
    """rad/s per radian of tilt"""
    magnetometer_gain: Any
    """rad/s per radian of heading"""
    acceleration_time: Any
    """s, time constant of the earth-frame low-pass"""
    rest_rate: Any
    """deg/s, from the gyro's average"""
    rest_acceleration: Any
    """fraction of gravity, from the low-passed specific force"""
    rest_time: Any
    """s without motion until the body is at rest"""
    rest_average_time: Any
    """s, time constant of the gyro's average, and of the bias at rest"""
    bias_limit: Any
    """deg/s, length of the bias vector"""
    bias_gain: Any
    """rad/s² per radian of tilt, before the first rest"""
    bias_gain_after_rest: Any
    """the same after the first rest"""
    field_tolerance: Any
    """fraction of the field's strength by which it may differ from the reference"""
    field_time: Any
    """s, time constant of the reference while the field agrees"""
    field_recovery_time: Any
    """s, the same while the field does not agree"""
    ramp_gain: Any
    """rad/s per radian, added to both gains at the start"""
    ramp_time: Any
    """s, in which the ramp falls to zero"""
    gyro_range: Any
    """deg/s, longest rate vector that was measured in full"""
    accelerometer_range: Any
    """unit of the accelerometer, longest specific force that was measured in full"""


def is_constant(*values):
    """True if all values are numbers that are known, and checked, when the circuit is made."""
    return all(type(value) is float for value in values)


def squared(x):
    """x²."""
    return x * x


def response(xp, period, time):
    """1 - exp(-period/time): the weight of a new sample in a one-pole low-pass.

    Exact for constants. At run time it is x - x²/2 with x = min(period/time, 1): too small by less than
    a fraction x²/6, and stable for any period.
    """
    if is_constant(period, time):
        return -math.expm1(-period / time)
    return saturating(xp.minimum(period / time, 1.0))


def saturating(x):
    """x - x²/2 for x in [0, 1]: 1 - exp(-x) with a relative error below x²/6."""
    return x - 0.5 * (x * x)


def limited(xp, period):
    """A run-time period limited to [0, LONGEST_PERIOD]: (period, margin, which is negative if it was outside)."""
    margin = xp.minimum(period, LONGEST_PERIOD - period)
    return xp.minimum(xp.maximum(period, 0.0), LONGEST_PERIOD), margin


def share(xp, period, clock):
    """period/(clock + period): a new sample's weight in the mean since the clock was zero, and 1 before that."""
    elapsed = xp.maximum(clock, 0.0) + period
    return period / (elapsed if is_constant(period) else xp.maximum(elapsed, SHORTEST_SQUARE))


def low_pass(low, value, weight):
    """Two one-pole low-passes in series: ((first, second), value minus the previous first)."""
    first, second = low
    innovation = subtract(value, first)
    first = add(first, scale(weight, innovation))
    return (first, add(second, scale(weight, subtract(first, second)))), innovation


def held(xp, gain, *parameters):
    """A gain limited to [0, 1]; unchanged if its parameters are constants."""
    if is_constant(*parameters):
        return gain
    return xp.minimum(xp.maximum(gain, 0.0), 1.0)


def turned(xp, q, omega, square, beyond, pending, period):
    """q⊗(1, x), not normalised, for x = tan(T·|omega|/2) along omega, plus the pending correction.

    ``omega`` is in deg/s and ``square`` is its squared length. tan(y) = y + y³/3 leaves out 2/15·y⁵, which is
    0.00008° in a rotation by 10°. ``beyond`` the gyro's range tan(y) = y, so that no rate brings |q|² near
    overflow, where the reciprocal of |q|² is zero.
    """
    half = period * (0.5 / DEGREES)
    factor = xp.select(beyond, half, half + (half * half * half * (1 / 3)) * square)
    x, y, z = add(scale(factor, omega), pending)
    q0, q1, q2, q3 = q
    return ((q0 - q1 * x) - (q2 * y + q3 * z),
            (q1 + q0 * x) + (q2 * z - q3 * y),
            (q2 + q0 * y) + (q3 * x - q1 * z),
            (q3 + q0 * z) + (q1 * y - q2 * x))


def matrix_of_turn(q, reciprocal):
    """C = C_n^b as rows from q of any length, ``reciprocal`` = 1/|q|²."""
    _, q1, q2, q3 = q
    d0, d1, d2, d3 = scale(reciprocal + reciprocal, q)
    return ((1 - (d2 * q2 + d3 * q3), d1 * q2 + d0 * q3, d1 * q3 - d0 * q2),
            (d1 * q2 - d0 * q3, 1 - (d1 * q1 + d3 * q3), d2 * q3 + d0 * q1),
            (d1 * q3 + d0 * q2, d2 * q3 - d0 * q1, 1 - (d1 * q1 + d2 * q2)))


def tilt_correction(xp, low, frame):
    """tan(angle/2) from the low-passed specific force to the vertical, about the horizontal axis between them.

    With L = |low| and its upward component u it is (low × up)/(L + u). Beyond 120° the divisor stays at
    L/2, which keeps the length below √3. Returns ((x, y) in n, L, L²).
    """
    square = xp.maximum(dot(low, low), SHORTEST_SQUARE)
    length = xp.sqrt(square)
    divisor = length + frame.upward(low)
    reciprocal = 1 / xp.maximum(divisor, 0.5 * length)
    x, y = (low[1], -low[0]) if frame.up > 0 else (-low[1], low[0])
    x = xp.select(divisor < UPSIDE_DOWN * length, length, x)
    return (reciprocal * x, reciprocal * y), length, square


def field_correction(xp, h, reference, frame, parameters):
    """tan(angle/2) from the field's horizontal component to north, about z, and the weight of the field.

    Beyond ±90° the tangent stays at ±1. ``reference`` holds the field's usual (horizontal, upward) components.
    The weight is 1 - (distance/(tolerance·|reference|))²: it falls from 1 at the reference to 0 at the tolerance.

    Returns (tangent, weight, distance as two components, margin of the tolerance, true if there is no field).
    """
    north, beside = frame.horizontal(h)
    level = dot((north, beside), (north, beside))
    strength, upward = xp.sqrt(level), frame.upward(h)
    absent = level + upward * upward < SHORTEST_SQUARE
    tangent = -beside / xp.maximum(strength + north, SHORTEST_SQUARE)
    tangent = xp.select(north < 0.0, xp.select(beside < 0.0, 1.0, -1.0), tangent)
    distance = subtract((strength, upward), reference)
    allowed = squared(parameters.field_tolerance) * dot(reference, reference)
    margin = allowed - dot(distance, distance)
    weight = xp.maximum(margin, 0.0) / xp.maximum(allowed, SHORTEST_SQUARE)
    return tangent, weight, distance, margin, absent


def bias_update(xp, bias, mean, at_rest, smoothing, tilt_b, gain, limit):
    """The gyro's bias: at rest it follows the average; in motion it is corrected by the tilt that it causes.

    ``gain`` is per tangent of half the tilt. A bias beyond the limit is not learnt. If the limit is an input,
    the bias can already be beyond it; such a bias decays.
    """
    weight = xp.select(at_rest, smoothing, 0.0)
    candidate = subtract(add(bias, scale(weight, subtract(mean, bias))), scale(gain, tilt_b))
    beyond = limit * limit < dot(candidate, candidate)
    if not is_constant(limit):
        bias = subtract(bias, scale(smoothing, bias))
    return tuple(xp.select(beyond, old, new) for old, new in zip(bias, candidate, strict=True))


class Sensors(NamedTuple):
    """A sample in each sensor's axes; ``m`` is None in the 6-axis filter."""

    a: Any
    """specific force, any unit"""
    g: Any
    """angular rate, deg/s"""
    m: Any = None
    """field, any unit"""


class State(NamedTuple):
    """State between updates; a field with a default is None in the 6-axis filter."""

    q: Any
    pending: Any
    """correction for the next update, in b"""
    first: Any
    second: Any
    """specific force after one and two low-passes, in n"""
    mean: Any
    bias: Any
    """average and bias of the gyro, deg/s"""
    clock: Any
    """s since the alignment; during it, from -ALIGNMENTS to 0, number of samples"""
    rest_clock: Any
    """s without motion"""
    rested: Any
    """1 after the first rest, -1 before it"""
    reference: Any = None
    """usual (horizontal, upward) field"""
    field_clock: Any = None
    """like ``clock``, for the magnetometer"""
    field_age: Any = None
    """s since the previous field sample"""


class Settings(NamedTuple):
    """Parameters of an update."""

    period: Any
    """T in s: a constant, or a value limited to [0, LONGEST_PERIOD]"""
    parameters: Parameters
    frame: Frame
    axes: dict
    """sensor axes along body x, y and z, by "a", "g" and "m" """


class Vertical(NamedTuple):
    """Results from the specific force."""

    first: Any
    second: Any
    innovation: Any
    """specific force minus the first low-pass, in n"""
    earth: Any
    """specific force in n"""
    tilt: Any
    """correction about x and y of n"""
    tilt_b: Any
    """the same in b"""
    slack: Any
    """negative if the bias cannot be the cause of the tilt"""
    gravity: Any
    gravity_square: Any
    """length of the low-passed specific force, and its square"""
    starting: Any
    """part of the start-up ramp that is left; negative after it"""
    unusable: Any
    """condition: the specific force is not used"""
    missing: Any
    """condition: the specific force has no length"""
    margin: Any
    """negative if the specific force is beyond the sensor's range"""


class Gyro(NamedTuple):
    """Results from the average of the gyro."""

    mean: Any
    rest_clock: Any
    at_rest: Any
    bias: Any
    rested: Any


class Heading(NamedTuple):
    """Results from the field."""

    correction: Any
    """correction of tilt and heading, in b"""
    state: dict
    status: dict


def vertical(xp, a, c, state, settings):
    """Low-passed specific force in n, and the correction of the tilt from it: a Vertical."""
    period, p, frame, _ = settings
    force = dot(a, a)
    missing = force < SHORTEST_SQUARE
    margin = squared(p.accelerometer_range) - force
    unusable = xp.select(missing, -1.0, margin) < 0.0
    starting = 1 - state.clock * (1 / p.ramp_time)
    weight = xp.maximum(share(xp, period, state.clock), response(xp, 2 * period, p.acceleration_time))
    earth = transposed_vector(c, a)
    (first, second), innovation = low_pass((state.first, state.second), earth, xp.select(unusable, 0.0, weight))
    tilt, gravity, gravity_square = tilt_correction(xp, second, frame)
    gain = held(xp, period * (p.accelerometer_gain + p.ramp_gain * xp.maximum(starting, 0.0)),
                p.accelerometer_gain, p.ramp_gain, p.ramp_time)
    # A tilt is attributed to the bias only if the bias can cause it.
    slack = squared(p.bias_limit * (0.5 / DEGREES) * (1 / p.accelerometer_gain)) - dot(tilt, tilt)
    tilt = scale(xp.select(state.clock < 0.0, 1.0, gain), tilt)
    tilt_b = tuple(row[0] * tilt[0] + row[1] * tilt[1] for row in c)
    return Vertical(first, second, innovation, earth, tilt, tilt_b, slack, gravity, gravity_square, starting, unusable,
                    missing, margin)


def gyro_average(xp, g, range_margin, up, state, settings):
    """Average of the gyro, detection of rest, and bias of the gyro: a Gyro. ``up`` is a Vertical."""
    period, p = settings.period, settings.parameters
    smoothing = response(xp, period, p.rest_average_time)
    deviation = subtract(g, state.mean)
    mean = add(state.mean, scale(xp.select(range_margin < 0.0, 0.0, xp.select(state.clock < 0.0, 1.0, smoothing)),
                                 deviation))
    restless = (up.gravity_square * (dot(deviation, deviation) * squared(1 / p.rest_rate))
                + dot(up.innovation, up.innovation) * squared(1 / p.rest_acceleration))
    rest_clock = xp.select(up.unusable, 0.0, state.rest_clock + period)
    rest_clock = xp.select(up.gravity_square < restless, 0.0, rest_clock)
    rest_clock = xp.select(squared(p.bias_limit) < dot(mean, mean), 0.0, rest_clock)
    at_rest = p.rest_time < rest_clock
    # The tilt is the gain times T times the tangent: divided by the gain, it is T times the tangent.
    learning = 2 * DEGREES / p.accelerometer_gain
    gain = xp.select(state.rested < 0.0, learning * p.bias_gain, learning * p.bias_gain_after_rest)
    gain = xp.select(up.starting < 0.0, xp.select(up.slack < 0.0, 0.0, gain), 0.0)
    bias = bias_update(xp, state.bias, mean, at_rest, smoothing, up.tilt_b, gain, p.bias_limit)
    return Gyro(mean, rest_clock, at_rest, bias, xp.select(at_rest, 1.0, state.rested))


def heading(xp, m, c, tilt_b, state, settings):
    """Correction of tilt and heading, with the heading from the field; state and status of the field: a Heading."""
    p = settings.parameters
    h = transposed_vector(c, permute(settings.axes["m"], m))
    tangent, believed, distance, margin, absent = field_correction(xp, h, state.reference, settings.frame, p)
    # The heading is not corrected before the vertical is aligned.
    idle = xp.select(absent, -1.0, state.clock) < 0.0
    age = xp.minimum(state.field_age + settings.period, LONGEST_PERIOD)
    starting = 1 - state.field_clock * (1 / p.ramp_time)
    ramp = xp.maximum(starting, 0.0)
    gain = held(xp, age * (p.magnetometer_gain * believed + p.ramp_gain * ramp),
                p.magnetometer_gain, p.ramp_gain, p.ramp_time)
    turn = xp.select(state.field_clock < 0.0, 1.0, gain) * tangent
    turn = xp.select(idle, 0.0, turn)
    correction = tuple(x + row[2] * turn for x, row in zip(tilt_b, c, strict=True))
    slow = 1 / p.field_recovery_time
    rate = (slow + (1 / p.field_time - slow) * believed) + FIELD_SETTLING * ramp
    follow = xp.select(state.field_clock < 0.0, 1.0, saturating(xp.minimum(age * rate, 1.0)))
    reference = add(state.reference, scale(xp.select(idle, 0.0, follow), distance))
    passed = xp.select(state.field_clock < 0.0, 1.0, age)
    field_clock = state.field_clock + xp.select(idle, 0.0, passed)
    field_age = xp.select(idle, age, 0.0)
    rejected = xp.select(idle, 1.0, xp.select(starting < 0.0, margin, 1.0))
    return Heading(correction, {"reference": reference, "field_clock": field_clock, "field_age": field_age},
                   {"magnetometer_missing": absent, "magnetometer_rejected": rejected < 0.0})


def with_navigation_frame(up):
    """Both low-passes of a Vertical, rotated by the correction, which rotates n: first and second.

    The effects of the correction on z, and of the heading on x and y, are of second order and left out.
    """
    x, y = add(up.tilt, up.tilt)
    return {name: (low[0] + y * low[2], low[1] - x * low[2], low[2])
            for name, low in (("first", up.first), ("second", up.second))}


def flight_update(xp, sensors, state, settings):
    """One update of the filter. Without a field it is the 6-axis filter: its heading comes from the gyro alone.

    Parameters
    ----------
    sensors : Sensors
    state : State
    settings : Settings

    Returns
    -------
    Update
    """
    p, frame = settings.parameters, settings.frame
    with xp.section("GYRO"):
        a, g = permute(settings.axes["a"], sensors.a), permute(settings.axes["g"], sensors.g)
        omega = subtract(g, state.bias)
        square = dot(omega, omega)
        range_margin = squared(p.gyro_range) - square
        if not is_constant(settings.period):
            period, period_margin = limited(xp, settings.period)
            settings = settings._replace(period=period)
            range_margin = xp.minimum(range_margin, period_margin)
    with xp.section("QUAT"):
        q = turned(xp, state.q, omega, square, range_margin < 0.0, state.pending, settings.period)
        reciprocal = 1 / dot(q, q)
    with xp.section("MATX"):
        c = matrix_of_turn(q, reciprocal)
        q = scale(xp.sqrt(reciprocal), q)
    with xp.section("ACC_MAG"):
        up = vertical(xp, a, c, state, settings)
        gyro = gyro_average(xp, g, range_margin, up, state, settings)
        range_exceeded = xp.minimum(up.margin, range_margin) < 0.0
        field = Heading(up.tilt_b, {}, {})
        status = {"accelerometer_missing": up.missing, "starting": -up.starting < 0.0, "at_rest": gyro.at_rest,
                  "range_exceeded": range_exceeded}
        if sensors.m is not None:
            field = heading(xp, sensors.m, c, up.tilt_b, state, settings)
        low_passes = with_navigation_frame(up)
        passed = xp.select(state.clock < 0.0, xp.select(up.unusable, 0.0, 1.0), settings.period)
        clock = state.clock + passed
    with xp.section("EULER"):
        angles = matrix_angles(xp, c)
        linear = subtract(a, scale(up.gravity, tuple(frame.upward(row) for row in c)))
    return Update(
        outputs={"c": c, "angles": angles, "q": q, "bias": gyro.bias, "earth": up.earth, "linear": linear},
        state={"q": q, "pending": field.correction, **low_passes, "mean": gyro.mean, "bias": gyro.bias, "clock": clock,
               "rest_clock": gyro.rest_clock, "rested": gyro.rested, **field.state},
        status=status | field.status)
