"""The flight attitude filter in float64, written from its equations in ``docs/flight.md``.

A strapdown integration of the gyro, whose vertical is the specific force, low-passed in the earth frame, and whose gyro
bias is the state of a Kalman filter in motion and the gyro's average at rest (Laidig and Seel, "VQF", 2023). The
magnetometer corrects the heading only, with a weight that falls with the deviation of its field from the reference; at
the start the heading is a mean weighted by the same deviation.

Everything is computed in NWU (x north, y west, z up) with the vectors, rotations and exponentials of the equations, and
transformed to the wanted frame at the end. Nothing here depends on the kernel's form or order of operations.
"""

import math
from typing import NamedTuple

import numpy as np

from .attitude import axis_matrix, euler_angles, matrix_from_quaternion

__all__ = ["ALIGNMENTS", "FRAME_QUATERNIONS", "LONGEST_PERIOD_S", "NO_CALIBRATION", "STATUS", "FlightFilter",
           "FlightResult"]

ALIGNMENTS = 4
LONGEST_PERIOD_S = 0.1
SHORTEST = 2.0**-50
FULL_SCALE = 0.9989
STABLE = 0.5
LOST_RATE_DEG_S, LOST_PERIOD_S, CLOCK_AFTER_LOSS_S = 200.0, 1e-3, 0.3
CLOCK_AFTER_FAULT_S, RECOVERY_S, RECOVERY_WEIGHT, RECOVERY_TOLERANCE = 1.0, 3.0, 4.0, 0.2
HEADING_VARIANCE, HEADING_VARIANCE_AFTER_FAULT = 100.0, 5.0
REST_DEVIATIONS, REST_TURN = 4.0, 0.25
FIELD_DOUBT = 4.0
STALE_S = 1 - 2.0**-8
STUCK_LIMIT_RAD2_S, STUCK_SAMPLES, STUCK_RATE_DEG_S = 0.01, 8.0, 5.0
STATUS = ("accelerometer_missing", "magnetometer_missing", "starting", "at_rest", "magnetometer_rejected",
          "range_exceeded", "bias_clipped", "magnetometer_stuck", "external_used", "refused")

NO_CALIBRATION = {f"{sensor}_{part}": value for sensor in ("accelerometer", "gyro", "magnetometer")
                  for part, value in (("bias", (0.0, 0.0, 0.0)),
                                      ("matrix", ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))))}
"""Calibration of sensors that need none."""

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
    stale_field : bool
        Whether a field equal to the one before is no new sample.
    calibration : dict, optional
        Bias and matrix of each sensor, as `NO_CALIBRATION`, in sensor axes: corrected = matrix (sample - bias).
    others : float
        Gains, times and limits; see ``docs/flight.md``.

    Raises
    ------
    ValueError
        If the period is not positive, the frame unknown or axes do not name x, y and z.
    """

    def __init__(self, *, period_s, magnetometer_gain, acceleration_time, rest_rate, rest_acceleration, rest_time,
                 rest_average_time, bias_limit, bias_deviation, bias_drift, bias_noise, bias_learning,
                 bias_rest_deviation, field_tolerance, field_time, field_recovery_time, heading_weighting, ramp_time,
                 gyro_range, accelerometer_range, magnetic_declination, frame="NWU", axes=None, magnetometer=True,
                 stale_field=False, calibration=None):
        if not period_s > 0:
            raise ValueError(f"Sample period must be positive, not {period_s!r}")
        if frame not in FRAME_QUATERNIONS:
            raise ValueError(f"Frame must be one of {', '.join(FRAME_QUATERNIONS)}, not {frame!r}")
        self._period_s, self._frame, self._magnetometer = period_s, frame, magnetometer
        self._stale_field = stale_field
        self._axes = {sensor: axis_matrix((axes or {}).get(sensor, ("+x", "+y", "+z"))) for sensor in "agm"}
        self._calibration = {name: np.array(value, float)
                             for name, value in (NO_CALIBRATION | (calibration or {})).items()}
        self._km, self._tau = magnetometer_gain, acceleration_time
        self._rest_rate, self._rest_acceleration, self._rest_time = rest_rate, rest_acceleration, rest_time
        self._rest_tau, self._bias_limit = rest_average_time, bias_limit
        self._bias_start, self._bias_drift, self._bias_noise = bias_deviation, bias_drift, bias_noise
        self._bias_learning, self._bias_rest = bias_learning, bias_rest_deviation
        self._tolerance, self._field_tau, self._recovery_tau = field_tolerance, field_time, field_recovery_time
        self._weighting, self._ramp_time = heading_weighting, ramp_time
        self._gyro_range, self._accelerometer_range = gyro_range, accelerometer_range
        self._declination = math.radians(magnetic_declination)
        self._first_axis = matrix_from_quaternion(FRAME_QUATERNIONS[frame]).T[0]  # of the frame, in NWU
        self.reset()

    def reset(self, q_b2n=(1.0, 0.0, 0.0, 0.0), *, aligned=False):
        """Start again from a unit quaternion; with ``aligned`` the first samples do not turn it to the vertical."""
        before = -float(ALIGNMENTS)
        self._state = {
            "q": _product(_conjugate(FRAME_QUATERNIONS[self._frame]), np.array(q_b2n, dtype=float)),
            "pending": np.zeros(3), "force": LowPass(np.zeros(3)), "gyro_mean": np.zeros(3),
            "accel_mean": np.zeros(3), "unrest": 0.0, "bias": np.zeros(3),
            "bias_variance": self._bias_start**2, "horizontal": LowPass(np.zeros((2, 3))),
            "horizontal_bias": LowPass(np.zeros(2)), "clock": 0.0 if aligned else before, "rest_clock": 0.0,
            "recovery": 0.0,
            "field": np.zeros(2), "field_count": before, "field_age": 0.0,
            "heading_variance": HEADING_VARIANCE, "last_field": np.zeros(3), "field_moved": 0.0}

    def run(self, accel, mag, gyro_deg_s, *, period_s=None, mag_valid=None, external=None):
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
        external : ndarray, shape (N, 3), optional
            Acceleration in navigation axes, known from elsewhere, in the unit of ``accel``; zero by default.

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
        external = np.zeros_like(accel) if external is None else np.asarray(external, float) @ turn
        q, c = np.empty((count, 4)), np.empty((count, 3, 3))
        bias, earth, linear = (np.zeros((count, 3)) for _ in range(3))
        status = {name: np.zeros(count, dtype=bool) for name in STATUS}
        for k in range(count):
            answer = self._update(accel[k], mag[k], gyro[k], float(periods[k]), external[k])
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

    def _update(self, accel, mag, gyro, period_s, external):
        if not all(np.isfinite(x).all() for x in (accel, mag, gyro, period_s, external)):
            return None
        try:
            with np.errstate(over="raise", invalid="raise"):
                state, answer = self._step(accel, mag, gyro, period_s, external)
        except FloatingPointError:
            return None
        self._state = state
        return answer

    def _corrected(self, sensor, name, sample):
        """Calibrated sample in body axes."""
        return self._axes[sensor] @ (self._calibration[f"{name}_matrix"] @ (sample - self._calibration[f"{name}_bias"]))

    def _step(self, accel, mag, gyro, period_s, external):
        s, new = self._state, {}
        step = min(max(period_s, 0.0), LONGEST_PERIOD_S)
        a, g = self._corrected("a", "accelerometer", accel), self._corrected("g", "gyro", gyro)
        aligning = s["clock"] < 0

        # Strapdown: the measured rotation and the correction of the previous update, by half-angle tangents.
        turn = np.radians(g - s["bias"]) * step
        clipped = bool((np.abs(gyro) >= FULL_SCALE * self._gyro_range).any())
        beyond = clipped or step != period_s
        turn = (turn / 2 if beyond else _half_tangent(turn)) + s["pending"]
        new["q"] = _normalise(_product(s["q"], np.concatenate([[1.0], turn])))
        c_n2b = matrix_from_quaternion(new["q"])

        # The vertical: specific force, low-passed in the earth frame. After a fault of the gyro it is learnt anew.
        missing = _length(accel) < SHORTEST
        clock = CLOCK_AFTER_FAULT_S if clipped and not aligning else s["clock"]
        recovering, left = s["recovery"] > 0, max(s["recovery"] - step, 0.0)
        new["recovery"] = left if not clipped else 0.0 if aligning else RECOVERY_S
        earth = c_n2b.T @ a
        low = s["force"]
        weight = 1.0
        if recovering and abs(a @ a - low.value[2]**2) < RECOVERY_TOLERANCE * low.value[2]**2:
            weight = RECOVERY_WEIGHT
        learning = clock < math.sqrt(2) * self._tau
        if aligning:
            share = 1.0
        elif learning:
            share = min(weight * step / max(clock + step, 1e-30), 1.0)
        else:
            share = None
        if not missing:
            low = low.filtered(earth - external, step, self._tau, share)
        gravity = max(_length(low.value), SHORTEST)
        divisor = gravity + low.value[2]
        tilt = _cross(low.value, UP) / max(divisor, gravity / 2)
        if divisor < (0.5 if aligning else 2.0**-17) * gravity:
            tilt = 2.0 * self._first_axis
        # The navigation frame turns with the correction, to first order.
        new["force"] = LowPass(low.value + 2 * _cross(tilt, low.value) * (1, 1, 0), low.rate)

        # Rest: the mean of the squared deviations from the averages.
        smoothing = _response(step, self._rest_tau)
        deviation, shake = g - s["gyro_mean"], (np.zeros(3) if missing else a - s["accel_mean"])
        if aligning:
            new |= {"gyro_mean": g, "accel_mean": s["accel_mean"] + shake}
        else:
            new["gyro_mean"] = s["gyro_mean"] + (0.0 if beyond else smoothing) * deviation
            new["accel_mean"] = s["accel_mean"] + smoothing * shake
            motion = ((_length(deviation) / self._rest_rate)**2 * s["force"].value[2]**2
                      + (_length(shake) / self._rest_acceleration)**2)
            new["unrest"] = s["unrest"] + smoothing * (motion - s["unrest"])
        bound = max(REST_DEVIATIONS * math.sqrt(s["bias_variance"]), REST_TURN * self._rest_rate)
        still = (not missing and _length(new["gyro_mean"] - s["bias"]) <= bound
                 and new.get("unrest", s["unrest"]) <= s["force"].value[2]**2)
        new["rest_clock"] = s["rest_clock"] + step if still else 0.0
        at_rest = new["rest_clock"] > self._rest_time

        # The bias: at rest the gyro's average, in motion a Kalman filter of the rate that the tilt needs.
        h = c_n2b.T[:2]
        new["horizontal"] = s["horizontal"].filtered(h, step, self._tau, share)
        new["horizontal_bias"] = s["horizontal_bias"].filtered(h @ s["bias"], step, self._tau, share)
        bias = s["bias"]
        variance = min(s["bias_variance"] + self._bias_drift**2 * step, self._bias_start**2)
        if at_rest:
            bias = bias + smoothing * (new["gyro_mean"] - bias)
            variance += smoothing * (self._bias_rest**2 - variance)
        elif clock > self._ramp_time and not missing and step > 0:
            needed = np.degrees(2 * tilt[:2]) / max(step, 1e-6)
            rows = new["horizontal"].value
            errors = new["horizontal_bias"].value - rows @ bias - needed
            errors = np.where(np.abs(needed) <= self._bias_limit, errors, 0.0)
            for row, error in zip(rows, errors, strict=True):
                square = row @ row
                gain = variance / (variance * square + self._bias_noise**2 / step)
                bias = bias + gain * error * row
                variance *= 1 - self._bias_learning * gain * square
        clipping = _length(bias) > self._bias_limit
        new["bias"] = bias * (self._bias_limit / _length(bias)) if clipping else bias
        new["bias_variance"] = variance

        correction = tilt
        field = {"present": False, "rejected": False, "stuck": False}
        if self._magnetometer:
            field, heading = self._heading(mag, c_n2b, (g - s["bias"], s["gyro_mean"] - s["bias"]), step, clipped, new)
            correction = correction + heading * UP
        new["pending"] = c_n2b @ correction
        new["clock"] = clock + (step if not aligning else float(not missing))
        if share is None and np.degrees(2 * _length(tilt)) > LOST_RATE_DEG_S * max(step, LOST_PERIOD_S):
            new["clock"] = CLOCK_AFTER_LOSS_S
        exceeded = bool((np.abs(accel) >= FULL_SCALE * self._accelerometer_range).any())
        return s | new, {
            "earth": earth, "linear": a - gravity * c_n2b[:, 2], "accelerometer_missing": missing,
            "magnetometer_missing": self._magnetometer and not field["present"],
            "starting": clock < self._ramp_time, "at_rest": at_rest,
            "magnetometer_rejected": field["rejected"], "magnetometer_stuck": field["stuck"],
            "range_exceeded": exceeded or beyond or left > 0, "bias_clipped": clipping,
            "external_used": _length(external) >= SHORTEST}

    def _heading(self, mag, c_n2b, rates, step, clipped, new):
        """Correction about the vertical from the field, as tan(angle/2), and what became of the sample."""
        s = self._state
        m = self._corrected("m", "magnetometer", mag)
        present = _length(mag) >= SHORTEST
        elapsed = s["field_age"] + step
        age = min(elapsed, LONGEST_PERIOD_S)
        variance = max(s["heading_variance"], HEADING_VARIANCE_AFTER_FAULT) if clipped else s["heading_variance"]
        new |= {"field_age": min(elapsed, STALE_S) if self._stale_field else age, "heading_variance": variance}
        change = m - s["last_field"]
        if self._stale_field and s["field_count"] >= 0 and s["field_age"] < STALE_S:
            present = present and _length(change) >= SHORTEST
        if not present or s["clock"] < 0:
            return {"present": present, "rejected": False, "stuck": False}, 0.0
        new |= {"field_age": 0.0, "last_field": m}

        # Does the field turn in the body while the gyro does?
        strength = m @ m
        across, mean_across = (_cross(np.radians(each), m) for each in rates)
        slow = math.radians(STUCK_RATE_DEG_S)**2 * strength
        expected = max(across @ mean_across - slow, 0.0) * (age / 2)**2
        limit = STUCK_LIMIT_RAD2_S * age * strength + STUCK_SAMPLES * expected
        moved = min(max(s["field_moved"] + change @ change - expected, -limit), limit)
        new["field_moved"] = moved
        aligning = s["field_count"] < 0
        if moved < 0 and not aligning:
            return {"present": True, "rejected": False, "stuck": True}, 0.0

        # Heading and trust.
        n = c_n2b.T @ m
        seen = np.array([math.hypot(n[0], n[1]), n[2]])
        error = math.atan2(n[1], n[0]) + self._declination
        error = math.remainder(error, 2 * math.pi)
        allowed = (self._tolerance * _length(s["field"]))**2
        distance = (seen - s["field"]) @ (seen - s["field"])
        trust = max(1 - distance / allowed, 0.0) if allowed > SHORTEST**2 else 0.0
        settled = self._weighting / self._ramp_time
        if aligning:
            gain, follow = 1.0, 1.0
            new["heading_variance"] = HEADING_VARIANCE
        else:
            ratio = age / (variance * age + 1 + FIELD_DOUBT * distance / max(allowed, SHORTEST**2))
            ramp = ratio * max(variance - settled, 0.0)
            gain = max(age * self._km * trust, ramp)
            follow = max(-math.expm1(-age * (trust / self._field_tau + (1 - trust) / self._recovery_tau)), ramp)
            new["heading_variance"] = variance - variance**2 * ratio / self._weighting
        new["field"] = s["field"] + follow * (seen - s["field"])
        new["field_count"] = s["field_count"] + aligning
        rejected = not aligning and variance <= settled and trust == 0
        return ({"present": True, "rejected": rejected, "stuck": False},
                -gain * min(max(math.tan(error / 2), -1.0), 1.0))


class LowPass(NamedTuple):
    """A Butterworth low-pass of second order of an array: its value, and the value's change per sample."""

    value: np.ndarray
    rate: np.ndarray | float = 0.0

    def filtered(self, sample, step, time, share):
        """The low-pass after a sample. With a ``share`` it is a mean, in which the sample has this weight."""
        if share is not None:
            return LowPass(self.value + share * (sample - self.value))
        k = min(math.sqrt(2) * step / time, STABLE)
        rate = self.rate + k**2 * (sample - self.value) - math.sqrt(2) * k * self.rate
        return LowPass(self.value + rate, rate)


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
