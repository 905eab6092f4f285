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
from .vector import (
    SHORTEST_SQUARE,
    add,
    column,
    dot,
    permute,
    polynomial,
    scale,
    subtract,
    transposed_vector,
)

__all__ = ["ALIGNMENTS", "Calibration", "FRAMES", "Frame", "HEADING_VARIANCE", "LONGEST_PERIOD", "NO_CALIBRATION",
           "Parameters", "Sensors", "Settings", "State", "bias_update", "corrected", "field_correction", "field_moved",
           "flight_update", "heading", "low_pass", "matrix_of_turn", "rest", "tilt_correction", "turned", "vertical"]

DEGREES = 180 / math.pi

ALIGNMENTS = 4
"""Number of first samples with full weight. It is more than one, because a correction rotates by 127° at most."""

LONGEST_PERIOD = 0.1
"""Longest period in seconds; a longer one is limited to this. It keeps gain times period near 1 or below."""

SHORTEST_PERIOD = 1e-6
"""Shortest period in seconds by which an angle is divided."""

STABLE = 0.5
"""Limit of the low-pass's natural frequency times the period; it is stable up to 1.03."""

UPSIDE_DOWN = 2.0**-17
"""At an angle to upside down with half a square (rad²) below this, no axis can be measured; the first axis is used."""

FULL_SCALE = 0.9989
"""Part of its range from which an axis of a sensor is out of range: 32767/16.4 of 2000, rounded down."""

CLOCK_AFTER_FAULT = 1.0
"""The clock (s) after a rate beyond the range: the mean of the specific force counts as one of this time."""

LOST_RATE, LOST_PERIOD, CLOCK_AFTER_LOSS = 200.0, 1e-3, 0.3
"""A tilt that must be corrected faster than this (deg/s), in a period of this or more (s), shows that the vertical is
lost; and the clock (s) after it."""

RECOVERY_TIME, RECOVERY_WEIGHT, RECOVERY_TOLERANCE = 3.0, 4.0, 0.2
"""After a rate beyond the range: time (s) in which the tilt recovers, weight of a sample in it whose squared length is
that of gravity, and the relative tolerance of this square."""

HEADING_VARIANCE, HEADING_VARIANCE_AFTER_FAULT = 100.0, 5.0
"""Variance of the heading after its alignment, and after a rate beyond the range, in that of a field sample times s."""

REST_DEVIATIONS, REST_TURN = 4.0, 0.25
"""Largest difference of the gyro's average and the bias at rest: standard deviations of the bias, and not less than
this part of the limit of rest."""

FIELD_DOUBT = 4.0
"""Growth of a field sample's variance with its squared distance from the reference, in squared tolerances."""

STUCK_LIMIT, STUCK_SAMPLES, STUCK_RATE = 0.01, 8.0, 5.0
"""Largest sum of ``field_moved``: rad²/s, and number of samples that may repeat a field; rate across the field (deg/s)
from which it can be stuck."""


STALE_TIME = 1 - 2.0**-8
"""Time in s after which a field that still equals the one before is a sample all the same. It is no multiple of usual
periods, so that no rounding decides."""


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

    magnetometer_gain: Any
    """rad/s per radian of heading"""
    acceleration_time: Any
    """s, time constant of the earth-frame low-pass"""
    rest_rate: Any
    """deg/s RMS, from the gyro's average"""
    rest_acceleration: Any
    """fraction of gravity RMS, from the average of the specific force"""
    rest_time: Any
    """s without motion until the body is at rest"""
    rest_average_time: Any
    """s, time constant of both averages, of their deviations, and of the bias at rest"""
    bias_limit: Any
    """deg/s, length of the bias vector"""
    bias_deviation: Any
    """deg/s, standard deviation of the bias at the start"""
    bias_drift: Any
    """deg/s/√s, random walk of the bias"""
    bias_noise: Any
    """deg/s·√s, noise of the rate that the tilt needs"""
    bias_learning: Any
    """fraction by which a sample in motion reduces the variance of the bias"""
    bias_rest_deviation: Any
    """deg/s, standard deviation of the bias at rest"""
    field_tolerance: Any
    """fraction of the field's strength by which it may differ from the reference"""
    field_time: Any
    """s, time constant of the reference while the field agrees"""
    field_recovery_time: Any
    """s, the same while the field does not agree"""
    heading_weighting: Any
    """1 for a mean of the heading at the start; more gives later samples more weight"""
    ramp_time: Any
    """s, in which this mean ends, and the bias is not learnt in motion"""
    gyro_range: Any
    """deg/s, range of each axis"""
    accelerometer_range: Any
    """unit of the accelerometer, range of each axis"""
    magnetic_declination: Any
    """deg, magnetic north from true north, east positive"""


class Calibration(NamedTuple):
    """Errors of the sensors, in sensor axes and the units of the samples: corrected = matrix (sample - bias)."""

    accelerometer_bias: Any
    accelerometer_matrix: Any
    gyro_bias: Any
    gyro_matrix: Any
    magnetometer_bias: Any
    magnetometer_matrix: Any


IDENTITY = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NO_CALIBRATION = Calibration(*((0.0, 0.0, 0.0), IDENTITY) * 3)
"""The calibration of sensors without errors."""


def is_constant(*values):
    """True if all values are numbers that are known, and checked, when the circuit is made."""
    return all(type(value) is float for value in values)


def squared(x):
    """x²."""
    return x * x


def quotient(xp, a, b):
    """a / b, exact for constants; else by the operators of ``xp``."""
    return a / b if is_constant(a, b) else xp.divide(a, b)


def response(xp, period, time):
    """1 - exp(-period/time): the weight of a new sample in a one-pole low-pass.

    Exact for constants. At run time it is x - x²/2 with x = min(period/time, 1): too small by less than
    a fraction x²/6, and stable for any period.
    """
    if is_constant(period, time):
        return -math.expm1(-period / time)
    return saturating(xp.minimum(xp.divide(period, time), 1.0))


def saturating(x):
    """x - x²/2 for x in [0, 1]: 1 - exp(-x) with a relative error below x²/6."""
    return x - 0.5 * (x * x)


def limited(xp, period):
    """A run-time period limited to [0, LONGEST_PERIOD]: (period, margin, which is negative if it was outside)."""
    margin = xp.minimum(period, LONGEST_PERIOD - period)
    return xp.minimum(xp.maximum(period, 0.0), LONGEST_PERIOD), margin


def range_margin(xp, sample, limit):
    """Negative if an axis of a sample is at FULL_SCALE of its range, ``limit``, or beyond."""
    x, y, z = (x * x for x in sample)
    square = squared(FULL_SCALE * limit)
    if is_constant(limit):
        # At the limit itself the margin is negative too.
        square *= 1 - 2.0**-23
    return square - xp.maximum(xp.maximum(x, y), z)


def corrected(bias, matrix, sample):
    """matrix (sample - bias). Constants of zero and one cost no operation."""
    sample = tuple(x if is_constant(b) and b == 0 else x - b for x, b in zip(sample, bias, strict=True))
    return tuple(_combination(row, sample) for row in matrix)


def _combination(factors, values):
    """Sum of products of two vectors, without the terms whose constant factor is zero."""
    terms = [value if is_constant(factor) and factor == 1 else factor * value
             for factor, value in zip(factors, values, strict=True) if not is_constant(factor) or factor]
    return sum(terms[1:], terms[0])


def low_pass(state, value, gain, momentum):
    """Low-pass of second order of a vector: (low, rate), with the rate of change per sample.

    rate := momentum·rate + gain·(value - low); low := low + rate.
    """
    low, rate = state
    rate = add(scale(momentum, rate), scale(gain, subtract(value, low)))
    return add(low, rate), rate


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


def tilt_correction(xp, low, frame, aligning):
    """tan(angle/2) from the low-passed specific force to the vertical, about the horizontal axis between them.

    With L = |low| and its upward component u it is (low × up)/(L + u). Beyond 120° the divisor stays at
    L/2, which keeps the length below √3; there, while ``aligning``, it is 2 about the first axis, as it always is
    near upside down. Returns ((x, y) in n, L).
    """
    length = xp.sqrt(xp.maximum(dot(low, low), SHORTEST_SQUARE))
    divisor = length + frame.upward(low)
    reciprocal = xp.reciprocal(xp.maximum(divisor, 0.5 * length))
    x, y = (low[1], -low[0]) if frame.up > 0 else (-low[1], low[0])
    overturned = divisor < xp.select(aligning, 0.5, UPSIDE_DOWN) * length
    x, y = reciprocal * xp.select(overturned, length, x), reciprocal * xp.select(overturned, 0.0, y)
    return (x, y), length


def field_correction(xp, h, reference, frame, parameters):
    """tan(angle/2) from the field's horizontal component to north, about z, and how the field fits its reference.

    Beyond ±90° the tangent stays at ±1. ``reference`` holds the field's usual (horizontal, upward) components.
    The weight is 1 - (distance/(tolerance·|reference|))²: it falls from 1 at the reference to 0 at the tolerance.

    Returns (tangent, weight, deviation as two components, squared distance, squared tolerance).
    """
    north, beside = _to_true_north(frame.horizontal(h), parameters.magnetic_declination, frame)
    strength, upward = xp.sqrt(dot((north, beside), (north, beside))), frame.upward(h)
    tangent = xp.divide(-beside, xp.maximum(strength + north, SHORTEST_SQUARE))
    tangent = xp.select(north < 0.0, xp.select(beside < 0.0, 1.0, -1.0), tangent)
    deviation = subtract((strength, upward), reference)
    distance = dot(deviation, deviation)
    allowed = squared(parameters.field_tolerance) * dot(reference, reference)
    weight = xp.divide(xp.maximum(allowed - distance, 0.0), xp.maximum(allowed, SHORTEST_SQUARE))
    return tangent, weight, deviation, distance, allowed


def _to_true_north(field, declination, frame):
    """Components of the field to magnetic north and beside it, from those to true north.

    At run time sine and cosine of the declination are polynomials, with errors below 3e-5 up to 90°.
    """
    if is_constant(declination):
        if declination == 0:
            return field
        sine, cosine = math.sin(declination / DEGREES), math.cos(declination / DEGREES)
    else:
        x = declination * (1 / DEGREES)
        square = x * x
        sine = x * polynomial((1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880), square)
        cosine = polynomial((1.0, -1 / 2, 1 / 24, -1 / 720, 1 / 40320), square)
    north, beside = field
    sine = sine if frame.up > 0 else -sine
    return cosine * north - sine * beside, sine * north + cosine * beside


def field_moved(xp, state, m, rates, age):
    """By how much more the field turned in the body than half of what the gyro says: negative if it is stuck.

    The sum of |change of m|² - (age/2)²·((rate × m)·(mean_rate × m) - STUCK_RATE²·|m|²), the second term not below
    zero, limited to ±STUCK_LIMIT·age·|m|², plus this term STUCK_SAMPLES times. ``rates`` are the rate and its mean, in
    deg/s: vibration does not turn the mean, and a mean rate that has ended is no rate. ``age`` is the time since the
    last sample.
    """
    (rate, mean_rate), change, square = rates, subtract(m, state.last_field), dot(m, m)
    across = (dot(rate, mean_rate) - STUCK_RATE**2) * square - dot(rate, m) * dot(mean_rate, m)
    expected = squared(age * (0.5 / DEGREES)) * xp.maximum(across, 0.0)
    limit = STUCK_LIMIT * age * square + STUCK_SAMPLES * expected
    moved = state.field_moved + (dot(change, change) - expected)
    return xp.minimum(xp.maximum(moved, -limit), limit)


class Sensors(NamedTuple):
    """A sample in each sensor's axes; ``m`` is None in the 6-axis filter."""

    a: Any
    """specific force, any unit"""
    g: Any
    """angular rate, deg/s"""
    m: Any = None
    """field, any unit"""
    external: Any = None
    """acceleration in n that is known from elsewhere, unit of the specific force; None without"""


class State(NamedTuple):
    """State between updates; a field with a default is None in the 6-axis filter."""

    q: Any
    pending: Any
    """correction for the next update, in b"""
    force: Any
    force_rate: Any
    """low-passed specific force in n, and its change per sample"""
    gyro_mean: Any
    accel_mean: Any
    """averages in b"""
    unrest: Any
    """mean of the squared deviations from them, each in its limit of rest, times squared gravity"""
    bias: Any
    bias_variance: Any
    """bias of the gyro, deg/s, and its variance"""
    rows: Any
    rows_rate: Any
    """the horizontal axes of n in b, low-passed like the specific force"""
    rows_bias: Any
    rows_bias_rate: Any
    """the bias along them, low-passed in the same way"""
    clock: Any
    """s since the alignment; during it, from -ALIGNMENTS to 0, number of samples"""
    settled: Any
    """1 if the previous update low-passed, 0 if it took a mean"""
    rest_clock: Any
    """s without motion"""
    recovery: Any
    """s until the tilt has recovered from a rate beyond the range"""
    reference: Any = None
    """usual (horizontal, upward) field"""
    field_count: Any = None
    """field samples of the alignment, from -ALIGNMENTS to 0"""
    field_age: Any = None
    """s since the previous field sample"""
    heading_variance: Any = None
    last_field: Any = None
    """previous field sample in b"""
    field_moved: Any = None
    """as the function of this name"""


class Settings(NamedTuple):
    """Parameters of an update."""

    period: Any
    """T in s: a constant, or a value limited to [0, LONGEST_PERIOD]"""
    parameters: Parameters
    frame: Frame
    axes: dict
    """sensor axes along body x, y and z, by "a", "g" and "m" """
    calibration: Calibration = NO_CALIBRATION
    stale_field: bool = False
    """whether a field equal to the previous one is no new sample"""


class Vertical(NamedTuple):
    """Results from the specific force."""

    force: Any
    force_rate: Any
    """low-passed specific force in n after the correction, and its rate"""
    gain: Any
    momentum: Any
    """factors of the low-pass"""
    settled: Any
    """1 if it is a low-pass, 0 if it is a mean"""
    earth: Any
    """specific force in n"""
    tilt: Any
    """correction about x and y of n"""
    tilt_b: Any
    """the same in b"""
    gravity: Any
    """length of the low-passed specific force"""


class Rest(NamedTuple):
    """Results from the averages of gyro and specific force."""

    gyro_mean: Any
    accel_mean: Any
    unrest: Any
    rest_clock: Any
    at_rest: Any
    smoothing: Any
    """weight of a new sample in the averages"""


class Bias(NamedTuple):
    """The gyro's bias, and what its equations need in the next update."""

    bias: Any
    variance: Any
    rows: Any
    rows_bias: Any
    """each low-passed: (value, rate)"""
    margin: Any
    """negative if the bias was clipped"""


class Heading(NamedTuple):
    """Results from the field."""

    correction: Any
    """correction of tilt and heading, in b"""
    state: dict
    status: dict


def vertical(xp, a, c, external, missing, state, settings):
    """Low-passed specific force in n, and the correction of the tilt from it: a Vertical."""
    period, p, frame = settings.period, settings.parameters, settings.frame
    aligning = state.clock < 0.0
    # A Butterworth low-pass, after a mean at the start that is as long.
    natural = quotient(xp, math.sqrt(2) * period, p.acceleration_time)
    natural = min(natural, STABLE) if is_constant(natural) else xp.minimum(natural, STABLE)
    elapsed = xp.maximum(state.clock, 0.0) + period
    share = xp.divide(period, elapsed if is_constant(period) else xp.maximum(elapsed, SHORTEST_SQUARE))
    square, expected = dot(a, a), squared(frame.upward(state.force))
    off = square - expected
    near = RECOVERY_TOLERANCE * expected - xp.maximum(off, -off)
    plain = xp.select(near < 0.0, -1.0, state.recovery - SHORTEST_PERIOD) < 0.0
    share = xp.select(plain, 1.0, RECOVERY_WEIGHT) * share
    if not is_constant(period):
        share = xp.select(aligning, 1.0, share)
    mean = state.clock < math.sqrt(2) * p.acceleration_time
    gain = xp.select(mean, share, squared(natural))
    settled = xp.select(mean, 0.0, 1.0)
    # The rate is that of the low-pass: zero after a mean.
    momentum = state.settled * (1 - math.sqrt(2) * natural)
    momentum = xp.select(mean, 0.0, momentum)
    earth = transposed_vector(c, a)
    value = earth if external is None else subtract(earth, external)
    force, rate = low_pass((state.force, state.force_rate), value, gain, momentum)
    force = tuple(xp.select(missing, old, new) for old, new in zip(state.force, force, strict=True))
    rate = tuple(xp.select(missing, old, new) for old, new in zip(state.force_rate, rate, strict=True))
    tilt, gravity = tilt_correction(xp, force, frame, aligning)
    tilt_b = tuple(row[0] * tilt[0] + row[1] * tilt[1] for row in c)
    # The correction turns n. Its effects on z, and of the heading on x and y, are of second order and left out.
    x, y = add(tilt, tilt)
    force = force[0] + y * force[2], force[1] - x * force[2], force[2]
    return Vertical(force, rate, gain, momentum, settled, earth, tilt, tilt_b, gravity)


def rest(xp, a, g, missing, beyond, state, settings):
    """Averages of gyro and specific force, and detection of rest by their mean squared deviations: a Rest."""
    period, p = settings.period, settings.parameters
    aligning = state.clock < 0.0
    smoothing = response(xp, period, p.rest_average_time)
    weight = xp.select(aligning, 1.0, smoothing)
    gravity_square = squared(settings.frame.upward(state.force))
    deviation, shake = subtract(g, state.gyro_mean), subtract(a, state.accel_mean)
    gyro_mean = add(state.gyro_mean, scale(
        xp.select(aligning, 1.0, xp.select(beyond, 0.0, smoothing)), deviation))
    accel_mean = add(state.accel_mean, scale(xp.select(missing, 0.0, weight), shake))
    motion = (gravity_square * (dot(deviation, deviation) * squared(quotient(xp, 1.0, p.rest_rate)))
              + xp.select(missing, 0.0, dot(shake, shake)) * squared(quotient(xp, 1.0, p.rest_acceleration)))
    unrest = state.unrest + xp.select(aligning, 0.0, smoothing) * (motion - state.unrest)
    rest_clock = xp.select(missing, 0.0, state.rest_clock + period)
    rest_clock = xp.select(gravity_square < unrest, 0.0, rest_clock)
    # A mean rate that the bias cannot have is a steady turn.
    turn = subtract(gyro_mean, state.bias)
    bound = xp.maximum(REST_DEVIATIONS**2 * state.bias_variance, squared(REST_TURN * p.rest_rate))
    rest_clock = xp.select(bound < dot(turn, turn), 0.0, rest_clock)
    return Rest(gyro_mean, accel_mean, unrest, rest_clock, p.rest_time < rest_clock, smoothing)


def bias_update(xp, c, missing, up, resting, state, settings):
    """The gyro's bias: at rest it follows the average; in motion a Kalman filter learns it from the tilt: a Bias.

    The correction of the tilt in a sample is a rate along each horizontal axis of n. The low-pass delays it, so the
    filter compares it with the axes, and with the bias along them, after the same low-pass.
    """
    period, p = settings.period, settings.parameters
    axes = column(c, 0), column(c, 1)
    along = tuple(dot(axis, state.bias) for axis in axes)
    factors = up.gain, up.momentum
    rows, rows_rate = zip(*(low_pass(before, axis, *factors) for before, axis in zip(
        zip(state.rows, state.rows_rate, strict=True), axes, strict=True)), strict=True)
    rows_bias, rows_bias_rate = low_pass((state.rows_bias, state.rows_bias_rate), along, *factors)
    # Nothing is learnt before the end of the ramp, at rest, without a sample, or from a rate that no bias can have.
    idle = xp.select(resting.at_rest, -1.0, xp.select(missing, -1.0, state.clock - p.ramp_time)) < 0.0
    largest = squared(p.bias_limit * period * (0.5 / DEGREES))
    to_rate = quotient(xp, 2 * DEGREES, period if is_constant(period) else xp.maximum(period, SHORTEST_PERIOD))
    variance = xp.minimum(state.bias_variance + squared(p.bias_drift) * period, squared(p.bias_deviation))
    at_rest = xp.select(resting.at_rest, resting.smoothing, 0.0)
    bias = add(state.bias, scale(at_rest, subtract(resting.gyro_mean, state.bias)))
    for row, low, tilt in zip(rows, rows_bias, up.tilt, strict=True):
        square = dot(row, row)
        if is_constant(period):
            gain = xp.divide(variance, variance * square + quotient(xp, squared(p.bias_noise), period))
        else:
            information = variance * period
            gain = xp.divide(information, information * square + squared(p.bias_noise))
        error = (low - dot(row, state.bias)) - to_rate * tilt
        gain = xp.select(idle, 0.0, gain)
        bias = add(bias, scale(xp.select(largest < tilt * tilt, 0.0, gain * error), row))
        variance = variance - (p.bias_learning * (gain * square)) * variance
    variance = variance + at_rest * (squared(p.bias_rest_deviation) - variance)
    # 1/√x = 1.5 - 0.5·x near 1: a bias that is too long by a small part is shortened to the limit.
    margin = 0.5 - dot(bias, bias) * (0.5 * squared(quotient(xp, 1.0, p.bias_limit)))
    bias = scale(xp.maximum(xp.select(margin < 0.0, 1 + margin, 1.0), 0.0), bias)
    return Bias(bias, variance, (rows, rows_rate), (rows_bias, rows_bias_rate), margin)


def heading(xp, m, absent, c, tilt_b, rates, clipped, state, settings):
    """Correction of tilt and heading, with the heading from the field; state and status of the field: a Heading.

    The weight of the field is that of ``field_correction``. At the start, and after a rate beyond the range, the
    heading is the state of a Kalman filter with one measurement per field sample, whose variance grows with the
    distance from the reference.
    """
    p = settings.parameters
    h = transposed_vector(c, m)
    tangent, believed, deviation, distance, allowed = field_correction(xp, h, state.reference, settings.frame, p)
    aligning = state.field_count < 0.0
    # The heading is not corrected before the vertical is aligned.
    idle = xp.select(absent, -1.0, state.clock) < 0.0
    elapsed = state.field_age + settings.period
    age = xp.minimum(elapsed, LONGEST_PERIOD)
    kept_age = xp.minimum(elapsed, STALE_TIME) if settings.stale_field else age
    moved = field_moved(xp, state, m, rates, age)
    stuck = xp.select(idle, 1.0, xp.select(aligning, 1.0, moved))
    unused = xp.select(idle, -1.0, stuck) < 0.0
    variance = xp.select(clipped, xp.maximum(state.heading_variance, HEADING_VARIANCE_AFTER_FAULT),
                         state.heading_variance)
    settled = quotient(xp, p.heading_weighting, p.ramp_time)
    ratio = xp.divide(age * allowed,
                      xp.maximum(allowed * (variance * age + 1) + FIELD_DOUBT * distance, SHORTEST_SQUARE))
    ramp = ratio * xp.maximum(variance - settled, 0.0)
    learnt = variance - (variance * ratio) * (variance * quotient(xp, 1.0, p.heading_weighting))
    gain = xp.maximum(held(xp, age * (p.magnetometer_gain * believed), p.magnetometer_gain), ramp)
    turn = xp.select(unused, 0.0, xp.select(aligning, 1.0, gain) * tangent)
    correction = tuple(x + row[2] * turn for x, row in zip(tilt_b, c, strict=True))
    slow, fast = quotient(xp, 1.0, p.field_recovery_time), quotient(xp, 1.0, p.field_time)
    follow = xp.maximum(saturating(xp.minimum(age * (slow + (fast - slow) * believed), 1.0)), ramp)
    reference = add(state.reference, scale(xp.select(unused, 0.0, xp.select(aligning, 1.0, follow)), deviation))
    rejected = xp.select(unused, 1.0, xp.select(settled < variance, 1.0, allowed - distance))
    return Heading(
        correction,
        {"reference": reference, "field_count": state.field_count + xp.select(
            idle, 0.0, xp.select(aligning, 1.0, 0.0)), "field_age": xp.select(idle, kept_age, 0.0),
         "heading_variance": xp.select(unused, variance, xp.select(aligning, HEADING_VARIANCE, learnt)),
         "last_field": tuple(xp.select(idle, old, new) for old, new in zip(state.last_field, m, strict=True)),
         "field_moved": xp.select(idle, state.field_moved, moved)},
        {"magnetometer_missing": absent, "magnetometer_rejected": rejected < 0.0, "magnetometer_stuck": stuck < 0.0})


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
    p, frame, axes, cal = settings.parameters, settings.frame, settings.axes, settings.calibration
    with xp.section("GYRO"):
        a = permute(axes["a"], corrected(cal.accelerometer_bias, cal.accelerometer_matrix, sensors.a))
        g = permute(axes["g"], corrected(cal.gyro_bias, cal.gyro_matrix, sensors.g))
        omega = subtract(g, state.bias)
        square = dot(omega, omega)
        gyro_margin = range_margin(xp, sensors.g, p.gyro_range)
        clipped = gyro_margin < 0.0
        beyond = clipped
        if not is_constant(settings.period):
            period, period_margin = limited(xp, settings.period)
            settings = settings._replace(period=period)
            gyro_margin = xp.minimum(gyro_margin, period_margin)
            beyond = gyro_margin < 0.0
    with xp.section("QUAT"):
        q = turned(xp, state.q, omega, square, beyond, state.pending, settings.period)
        reciprocal = xp.reciprocal(dot(q, q))
    with xp.section("MATX"):
        c = matrix_of_turn(q, reciprocal)
        q = scale(xp.sqrt(reciprocal), q)
    with xp.section("ACC_MAG"):
        clock = xp.select(clipped, xp.select(state.clock < 0.0, state.clock, CLOCK_AFTER_FAULT), state.clock)
        state = state._replace(clock=clock)
        missing = dot(sensors.a, sensors.a) < SHORTEST_SQUARE
        up = vertical(xp, a, c, sensors.external, missing, state, settings)
        resting = rest(xp, a, g, missing, beyond, state, settings)
        learnt = bias_update(xp, c, missing, up, resting, state, settings)
        recovery = xp.maximum(state.recovery - settings.period, 0.0)
        exceeded = xp.minimum(xp.minimum(gyro_margin, range_margin(xp, sensors.a, p.accelerometer_range)),
                              SHORTEST_PERIOD - recovery)
        field = Heading(up.tilt_b, {}, {})
        status = {"accelerometer_missing": missing, "starting": state.clock < p.ramp_time,
                  "at_rest": resting.at_rest, "range_exceeded": exceeded < 0.0, "bias_clipped": learnt.margin < 0.0}
        if sensors.m is not None:
            m = permute(axes["m"], corrected(cal.magnetometer_bias, cal.magnetometer_matrix, sensors.m))
            present = dot(sensors.m, sensors.m)
            if settings.stale_field:
                # A repeated field is absent, but for the alignment, and for too long a time.
                change = subtract(m, state.last_field)
                young = xp.select(state.field_count < 0.0, 1.0, state.field_age - STALE_TIME) < 0.0
                repeated = xp.select(young, 0.0, present)
                present = xp.select(dot(change, change) < SHORTEST_SQUARE, repeated, present)
            rates = omega, subtract(state.gyro_mean, state.bias)
            field = heading(xp, m, present < SHORTEST_SQUARE, c, up.tilt_b, rates, clipped, state, settings)
        if sensors.external is not None:
            status["external_used"] = -dot(sensors.external, sensors.external) < -SHORTEST_SQUARE
        aligned = xp.select(clock < 0.0, xp.select(missing, 0.0, 1.0), settings.period)
        longest = LOST_RATE * (0.5 / DEGREES) * (
            max(settings.period, LOST_PERIOD) if is_constant(settings.period)
            else xp.maximum(settings.period, LOST_PERIOD))
        kept = squared(longest) - up.settled * dot(up.tilt, up.tilt)
    with xp.section("EULER"):
        angles = matrix_angles(xp, c)
        linear = subtract(a, scale(up.gravity, tuple(frame.upward(row) for row in c)))
    rows, rows_bias = learnt.rows, learnt.rows_bias
    return Update(
        outputs={"c": c, "angles": angles, "q": q, "bias": learnt.bias, "earth": up.earth, "linear": linear},
        state={"q": q, "pending": field.correction, "force": up.force, "force_rate": up.force_rate,
               "gyro_mean": resting.gyro_mean, "accel_mean": resting.accel_mean,
               "unrest": resting.unrest, "bias": learnt.bias, "bias_variance": learnt.variance,
               "rows": rows[0], "rows_rate": rows[1],
               "rows_bias": rows_bias[0], "rows_bias_rate": rows_bias[1],
               "clock": xp.select(kept < 0.0, CLOCK_AFTER_LOSS, clock + aligned),
               "settled": up.settled, "rest_clock": resting.rest_clock,
               "recovery": xp.select(clipped, xp.select(clock < 0.0, 0.0, RECOVERY_TIME), recovery), **field.state},
        status=status | field.status)
