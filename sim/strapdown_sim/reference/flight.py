"""The flight attitude filter in float64, written from its equations in ``docs/flight.md``.

A Mahony filter (Mahony, Hamel and Pflimlin, "Nonlinear complementary filters on the special
orthogonal group", 2008) with additions for flight: a low-pass of the specific force in the earth
frame and a bias learnt at rest (Laidig and Seel, "VQF", 2023), a magnetometer that corrects the heading
only, with a weight that falls with the deviation of its field from the reference, and a start-up ramp.

Everything is computed in NWU (x magnetic north, y west, z up) with the vectors, rotations and exponentials
of the equations, and transformed to the wanted frame at the end. Nothing here depends on the kernel's form
or order of operations.
"""

import math
from typing import NamedTuple

import numpy as np

from .attitude import axis_matrix, euler_angles, matrix_from_quaternion

__all__ = ["ALIGNMENTS", "FRAME_QUATERNIONS", "LONGEST_PERIOD_S", "STATUS", "FlightFilter", "FlightResult"]

ALIGNMENTS = 4
LONGEST_PERIOD_S = 0.1
FIELD_SETTLING_PER_S = 2.0
SHORTEST = 2.0**-50
STATUS = ("accelerometer_missing", "magnetometer_missing", "starting", "at_rest", "magnetometer_rejected",
          "range_exceeded", "refused")

_HALF = np.sqrt(0.5)
FRAME_QUATERNIONS = {"NWU": np.array([1.0, 0, 0, 0]), "ENU": np.array([_HALF, 0, 0, _HALF]),
                     "NED": np.array([0.0, 1, 0, 0])}
"""Quaternion that transforms coordinates in NWU to coordinates in each navigation frame."""

UP = np.array([0.0, 0.0, 1.0])


class FlightResult(NamedTuple):
    """Outputs of the filter after each of N updates.

    Fields
    ------
    q_b2n : ndarray, shape (N, 4)
        Unit quaternion, scalar first, body to navigation.
    c_n2b : ndarray, shape (N, 3, 3)
        Direction cosine matrix, navigation to body.
    pitch, roll, yaw : ndarray, shape (N,)
        Degrees, of the sequence Z-Y-X in the navigation frame.
    bias_deg_s : ndarray, shape (N, 3)
        Bias of the gyro, body axes.
    earth : ndarray, shape (N, 3)
        Specific force in navigation axes, in its own unit.
    linear : ndarray, shape (N, 3)
        Specific force without gravity in body axes, in its own unit.
    status : dict
        Name of `STATUS` to an ndarray of bool, shape (N,).
    """

    q_b2n: np.ndarray
    c_n2b: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    yaw: np.ndarray
    bias_deg_s: np.ndarray
    earth: np.ndarray
    linear: np.ndarray
    status: dict


class FlightFilter:
    """The filter, with its state.

    Parameters
    ----------
    period_s : float
        Sample period for runs without one, seconds.
    frame : str
        Navigation frame: "NWU", "ENU" or "NED".
    axes : dict
        Sensor axes along body x, y and z of "a", "g" and "m"; see `axis_matrix`.
    magnetometer : bool
        False for the 6-axis filter, whose heading comes from the gyro alone.
    others : float
        Gains, times and limits; see ``docs/flight.md``.

    Raises
    ------
    ValueError
        If the period is not positive, the frame unknown or axes do not name x, y and z.
    """

    def __init__(self, *, period_s, accelerometer_gain, magnetometer_gain, acceleration_time, rest_rate,
                 rest_acceleration, rest_time, rest_average_time, bias_limit, bias_gain, bias_gain_after_rest,
                 field_tolerance, field_time, field_recovery_time, ramp_gain, ramp_time, gyro_range,
                 accelerometer_range, frame="NWU", axes=None, magnetometer=True):
        if not period_s > 0:
            raise ValueError(f"Sample period must be positive, not {period_s!r}")
        if frame not in FRAME_QUATERNIONS:
            raise ValueError(f"Frame must be one of {', '.join(FRAME_QUATERNIONS)}, not {frame!r}")
        self._period_s, self._frame, self._magnetometer = period_s, frame, magnetometer
        self._axes = {sensor: axis_matrix((axes or {}).get(sensor, ("+x", "+y", "+z"))) for sensor in "agm"}
        self._kp, self._km, self._tau = accelerometer_gain, magnetometer_gain, acceleration_time
        self._rest_rate, self._rest_acceleration, self._rest_time = rest_rate, rest_acceleration, rest_time
        self._rest_tau, self._bias_limit = rest_average_time, bias_limit
        self._ki, self._ki_after_rest = bias_gain, bias_gain_after_rest
        self._tolerance, self._field_tau, self._recovery_tau = field_tolerance, field_time, field_recovery_time
        self._ramp_gain, self._ramp_time = ramp_gain, ramp_time
        self._gyro_range, self._accelerometer_range = gyro_range, accelerometer_range
        self.reset()

    def reset(self, q_b2n=(1.0, 0.0, 0.0, 0.0), *, aligned=False):
        """Start again from a unit quaternion; with ``aligned`` the first samples do not have full weight."""
        before = 0.0 if aligned else -float(ALIGNMENTS)
        self._state = {
            "q": _product(_conjugate(FRAME_QUATERNIONS[self._frame]), np.array(q_b2n, dtype=float)),
            "pending": np.zeros(3), "first": np.zeros(3), "second": np.zeros(3), "mean": np.zeros(3),
            "bias": np.zeros(3), "clock": before, "rest_clock": 0.0, "rested": False,
            "field": np.zeros(2), "field_clock": before, "field_age": 0.0}

    def run(self, accel, mag, gyro_deg_s, *, period_s=None, mag_valid=None):
        """One update per sample of a recording, from the current state.

        Parameters
        ----------
        accel : ndarray, shape (N, 3)
            Specific force in sensor axes; zero if missing.
        mag : ndarray, shape (N, 3), or None
            Magnetic field in sensor axes, any unit; zero if missing.
        gyro_deg_s : ndarray, shape (N, 3)
            Angular rate in sensor axes, degrees per second.
        period_s : ndarray, shape (N,), optional
            Sample periods, seconds.
        mag_valid : ndarray of bool, shape (N,), optional
            Marks the valid samples of the field; all by default.

        Returns
        -------
        FlightResult

        Notes
        -----
        An update in which a number is not finite is refused: it changes neither outputs nor state.
        """
        accel, gyro = (np.asarray(samples, dtype=float) for samples in (accel, gyro_deg_s))
        count = len(accel)
        mag = np.zeros_like(accel) if mag is None else np.asarray(mag, dtype=float)
        if mag_valid is not None:
            mag = np.where(np.asarray(mag_valid, dtype=bool)[:, None], mag, 0.0)
        periods = np.broadcast_to(self._period_s if period_s is None else np.asarray(period_s, float), (count,))
        turn = matrix_from_quaternion(FRAME_QUATERNIONS[self._frame]).T  # NWU to n
        q, c = np.empty((count, 4)), np.empty((count, 3, 3))
        bias, earth, linear = (np.zeros((count, 3)) for _ in range(3))
        status = {name: np.zeros(count, dtype=bool) for name in STATUS}
        for k in range(count):
            answer = self._update(accel[k], mag[k], gyro[k], float(periods[k]))
            q[k] = _product(FRAME_QUATERNIONS[self._frame], self._state["q"])
            c[k] = matrix_from_quaternion(q[k])
            bias[k] = self._state["bias"]
            if answer is None:
                status["refused"][k] = True
                earth[k], linear[k] = earth[k - 1], linear[k - 1]
                continue
            earth[k], linear[k] = turn @ answer["earth"], answer["linear"]
            for name in STATUS[:-1]:
                status[name][k] = answer[name]
        pitch, roll, yaw = euler_angles(c)
        return FlightResult(q, c, pitch, roll, yaw, bias, earth, linear, status)

    def _update(self, accel, mag, gyro, period_s):
        if not all(np.isfinite(x).all() for x in (accel, mag, gyro, period_s)):
            return None
        try:
            with np.errstate(over="raise", invalid="raise"):
                state, answer = self._step(self._axes["a"] @ accel, self._axes["m"] @ mag, self._axes["g"] @ gyro,
                                           period_s)
        except FloatingPointError:
            return None
        self._state = state
        return answer

    def _step(self, a, m, g, period_s):
        s, new = self._state, {}
        step = min(max(period_s, 0.0), LONGEST_PERIOD_S)

        # Strapdown: the measured rotation and the correction of the previous update, by half-angle tangents.
        rate = g - s["bias"]
        beyond = _length(rate) > self._gyro_range or step != period_s
        turn = np.radians(rate) * step
        turn = (turn / 2 if beyond else _half_tangent(turn)) + s["pending"]
        new["q"] = _normalise(_product(s["q"], np.concatenate([[1.0], turn])))
        c_n2b = matrix_from_quaternion(new["q"])

        # The vertical: specific force, low-passed in the earth frame.
        missing = _length(a) < SHORTEST
        exceeded = _length(a) > self._accelerometer_range
        believed = not (missing or exceeded)
        ramp = max(1 - s["clock"] / self._ramp_time, 0.0)
        elapsed = max(s["clock"], 0.0) + step
        share = max(step / elapsed if elapsed else 0.0, _response(2 * step, self._tau)) if believed else 0.0
        earth = c_n2b.T @ a
        innovation = earth - s["first"]
        first = s["first"] + share * innovation
        second = s["second"] + share * (first - s["second"])
        gravity = max(_length(second), SHORTEST)
        tilt = _cross(second, UP) / max(gravity + second[2], gravity / 2)
        if gravity + second[2] < 2.0**-17 * gravity:
            tilt = _cross(second, UP) / (gravity / 2) + (2 - 2 * second[1] / gravity) * np.array([1.0, 0, 0])
        tilt_gain = 1.0 if s["clock"] < 0 else step * (self._kp + self._ramp_gain * ramp)
        correction = tilt_gain * tilt

        # The bias: at rest the gyro's average, in motion the tilt that it causes.
        smoothing = _response(step, self._rest_tau)
        deviation = g - s["mean"]
        new["mean"] = s["mean"] + (0.0 if beyond else 1.0 if s["clock"] < 0 else smoothing) * deviation
        still = (believed and _length(new["mean"]) <= self._bias_limit
                 and (_length(deviation) / self._rest_rate)**2
                 + (_length(innovation) / gravity / self._rest_acceleration)**2 <= 1)
        new["rest_clock"] = s["rest_clock"] + step if still else 0.0
        at_rest = new["rest_clock"] > self._rest_time
        bias = s["bias"] + (smoothing * (new["mean"] - s["bias"]) if at_rest else 0.0)
        # With the bias at its limit, gyro and correction balance at this tilt.
        largest = math.radians(self._bias_limit) / self._kp
        if s["clock"] > self._ramp_time and 2 * _length(tilt) <= largest:
            ki = self._ki_after_rest if s["rested"] else self._ki
            bias = bias - ki * step * np.degrees(2 * (c_n2b @ tilt))
        new["bias"] = bias if _length(bias) <= self._bias_limit else s["bias"]
        new["rested"] = s["rested"] or at_rest

        # Heading: the field's horizontal part, as far as the field looks like the earth's.
        field = c_n2b.T @ m
        present = self._magnetometer and _length(field) >= SHORTEST
        age = min(s["field_age"] + step, LONGEST_PERIOD_S)
        rejected = False
        new |= {name: s[name] for name in ("field", "field_clock")} | {"field_age": age}
        if present and s["clock"] >= 0:
            aligning = s["field_clock"] < 0
            error = math.atan2(field[1], field[0])
            seen = np.array([math.hypot(field[0], field[1]), field[2]])
            allowed = self._tolerance * _length(s["field"])
            distance = _length(seen - s["field"])
            weight = max(1 - (distance / allowed)**2, 0.0) if allowed > self._tolerance * SHORTEST else 0.0
            field_ramp = max(1 - s["field_clock"] / self._ramp_time, 0.0)
            gain = 1.0 if aligning else age * (self._km * weight + self._ramp_gain * field_ramp)
            correction = correction - gain * min(max(math.tan(error / 2), -1.0), 1.0) * UP
            follow = ((1 - weight) / self._recovery_tau + weight / self._field_tau
                      + FIELD_SETTLING_PER_S * field_ramp)
            new["field"] = s["field"] + (1.0 if aligning else -math.expm1(-age * follow)) * (seen - s["field"])
            new["field_clock"] = s["field_clock"] + (1.0 if aligning else age)
            new["field_age"] = 0.0
            rejected = s["field_clock"] > self._ramp_time and weight == 0

        # The rotation of the navigation frame also rotates the low-passed vectors in it, to first order.
        for name, low in ("first", first), ("second", second):
            new[name] = low + 2 * tilt_gain * _cross(tilt, low) * (1, 1, 0)
        new["pending"] = c_n2b @ correction
        new["clock"] = s["clock"] + (step if s["clock"] >= 0 else float(believed))
        return new, {
            "earth": earth, "linear": a - gravity * c_n2b[:, 2], "accelerometer_missing": missing,
            "magnetometer_missing": self._magnetometer and not present, "starting": s["clock"] < self._ramp_time,
            "at_rest": at_rest, "magnetometer_rejected": rejected,
            "range_exceeded": exceeded or beyond}


def _length(vector):
    return math.sqrt(vector @ vector)


def _cross(u, v):
    # Like numpy.cross, which takes ten times as long for two single vectors.
    return np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _response(period_s, time_s):
    """Weight of a new sample in a one-pole low-pass."""
    return -math.expm1(-period_s / time_s)


def _half_tangent(rotation):
    """tan(angle/2) along the axis of a rotation vector."""
    angle = _length(rotation)
    return rotation * (math.tan(angle / 2) / angle) if angle > 0 else rotation


def _conjugate(q):
    return q * (1.0, -1.0, -1.0, -1.0)


def _normalise(q):
    return q / _length(q)


def _product(p, q):
    """Hamilton product."""
    (pw, px, py, pz), (qw, qx, qy, qz) = p.tolist(), q.tolist()
    return np.array([pw * qw - px * qx - py * qy - pz * qz, pw * qx + px * qw + py * qz - pz * qy,
                     pw * qy - px * qz + py * qw + pz * qx, pw * qz + px * qy - py * qx + pz * qw])
