"""The float64 reference of the flight filter against physical statements."""

import numpy as np
import pytest

from strapdown.cores import FLIGHT
from strapdown_sim.errors import attitude_errors, conjugate, multiply, rotation_angle
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.flight import FRAME_QUATERNIONS, STATUS, FlightFilter

RATE_HZ = 100
G = 9.81
UP, FIELD = np.array([0, 0, G]), np.array([20.0, 0.0, -45.0])  # in NWU
PARAMETERS = FLIGHT.parameters._asdict()


def model(**changes):
    return FlightFilter(**({"period_s": 1 / RATE_HZ} | PARAMETERS | changes))


def about(axis, degrees):
    """Quaternion of a right-handed rotation."""
    axis = np.asarray(axis, dtype=float)
    half = np.radians(degrees) / 2
    return np.array([np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis))])


def attitude(seconds, rate_deg_s=None, start=(1.0, 0, 0, 0)):
    """Attitude (body to NWU) at the end of each sample of a rotation; rate_deg_s(t) in body axes."""
    q, path = np.asarray(start, dtype=float), []
    for k in range(round(seconds * RATE_HZ)):
        if rate_deg_s is not None:
            turn = np.asarray(rate_deg_s((k + 0.5) / RATE_HZ)) / RATE_HZ
            if turn.any():
                q = multiply(q, about(turn, np.linalg.norm(turn)))
        path.append(q)
    return np.array(path)


def sensors(q_b2n, *, acceleration=None, field=FIELD):
    """Specific force and field in body axes, for an attitude path and vectors in NWU."""
    c = matrix_from_quaternion(q_b2n)
    force = UP if acceleration is None else UP + acceleration
    return np.einsum("nij,...nj->ni", c, np.broadcast_to(force, (len(q_b2n), 3))), \
        np.einsum("nij,...nj->ni", c, np.broadcast_to(field, (len(q_b2n), 3)))


def rates(q_b2n):
    """Gyro samples (deg/s) that rotate each attitude of a path to the next; the first sample is at rest."""
    steps = multiply(conjugate(q_b2n[:-1]), q_b2n[1:])
    steps = steps * np.where(steps[:, :1] < 0, -1.0, 1.0)
    length = np.linalg.norm(steps[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.degrees(np.arctan2(length, steps[:, :1]))
    turn = np.divide(steps[:, 1:], length, out=np.zeros_like(steps[:, 1:]), where=length > 0) * angle
    return np.vstack([np.zeros(3), turn * RATE_HZ])


def wobble(t):
    return 60 * np.array([np.sin(1.3 * t), np.cos(1.7 * t), np.sin(0.9 * t + 1)])


STARTS = [about((1, 0, 0), 0), about((1, 0, 0), 180), about((0, 1, 0), 180), about((0, 0, 1), 180),
          about((0, 0, 1), 90), about((1, 2, 3), 200), about((3, -1, 1), 120), about((0, 1, 0), -90),
          about((1, 1e-3, 0), 179.5)]


@pytest.mark.parametrize("start", STARTS)
def test_alignment_needs_no_second(start):
    """At rest in any attitude, also upside down or facing south: accurate to 1° after 0.5 s, to 0.01° after 4 s."""
    q = attitude(4, start=start)
    accel, mag = sensors(q)
    result = model().run(accel, mag, np.zeros_like(accel))
    errors = rotation_angle(result.q_b2n, q)
    assert errors[RATE_HZ // 2:].max() < 1
    assert errors[-1] < 0.01
    assert result.status["starting"][:3 * RATE_HZ].all()
    assert not result.status["starting"][-1]


@pytest.mark.parametrize("wrong", [90, -90, 179, 180])
def test_a_wrong_yaw_is_right_within_half_a_second(wrong):
    q = attitude(1)
    accel, mag = sensors(q)
    start = model()
    start.reset(about((0, 0, 1), wrong), aligned=True)
    errors = rotation_angle(start.run(accel, mag, np.zeros_like(accel)).q_b2n, q)
    assert errors[0] > abs(wrong) - 12
    # From 90° to 5° at ramp_gain·sin(error): ln(tan 45°/tan 2.5°)/10 s = 0.31 s, slightly more because the ramp falls.
    assert errors[RATE_HZ // 2:].max() < 5 or abs(wrong) > 90
    assert errors[-1] < 5


def test_a_magnetometer_that_comes_late_is_believed_at_once():
    q = attitude(12, wobble, about((0, 0, 1), 90))
    accel, mag = sensors(q)
    late = np.arange(len(q)) >= 8 * RATE_HZ
    result = model().run(accel, mag, rates(q), mag_valid=late)
    errors = attitude_errors(result.q_b2n, q)
    assert errors.heading[8 * RATE_HZ - 1] > 80
    assert errors.heading[8 * RATE_HZ + RATE_HZ // 2:].max() < 5
    assert (result.status["magnetometer_missing"] == ~late).all()


@pytest.mark.parametrize(("frame", "turn", "angles"), [
    # Body axes: with z up x forward and y left, with z down x forward and y right.
    ("NED", ("pitch", 20), {"pitch": 20, "roll": 0, "yaw": 0}),    # nose up: positive pitch
    ("NED", ("right", 30), {"pitch": 0, "roll": 30, "yaw": 0}),    # right side down: positive roll
    ("NED", ("east", 90), {"pitch": 0, "roll": 0, "yaw": 90}),     # nose east: yaw 90, as on a compass
    ("NWU", ("pitch", 20), {"pitch": -20, "roll": 0, "yaw": 0}),   # nose up is negative about west
    ("NWU", ("right", 30), {"pitch": 0, "roll": 30, "yaw": 0}),    # right side down: left side up
    ("NWU", ("east", 90), {"pitch": 0, "roll": 0, "yaw": 270}),    # yaw counts from north to west
    ("ENU", ("pitch", 20), {"pitch": -20, "roll": 0, "yaw": 90}),  # nose north: 90 from east
    ("ENU", ("east", 90), {"pitch": 0, "roll": 0, "yaw": 0}),
])
def test_angles_are_those_of_the_frame(frame, turn, angles):
    """A level vehicle that points north, then pitches nose up, rolls to the right or turns to the east."""
    kind, degrees = turn
    axis = {"pitch": (0, -1, 0), "right": (1, 0, 0), "east": (0, 0, -1)}[kind]  # about north, west, up
    q = attitude(5, start=about(axis, degrees))
    accel, mag = sensors(q)
    flip = (1, -1, -1) if frame == "NED" else (1, 1, 1)  # forward, right, down from forward, left, up
    result = model(frame=frame).run(accel * flip, mag * flip, np.zeros_like(accel))
    for name, value in angles.items():
        difference = getattr(result, name)[-1] - value
        assert (difference + 180) % 360 - 180 == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("frame", FRAME_QUATERNIONS)
def test_frames_differ_by_constant_turns_only(frame):
    q = attitude(6, wobble, about((1, 2, 3), 50))
    accel, mag = sensors(q)
    gyro = rates(q) + np.array([0.3, -0.2, 0.4])
    start = model(frame=frame)
    start.reset(FRAME_QUATERNIONS[frame])  # the start attitude of the filter in NWU
    nwu, other = model().run(accel, mag, gyro), start.run(accel, mag, gyro)
    assert rotation_angle(multiply(FRAME_QUATERNIONS[frame], nwu.q_b2n), other.q_b2n)[1:].max() < 1e-9
    for c, v in (nwu.c_n2b, nwu.earth), (other.c_n2b, other.earth):
        assert np.einsum("nij,nj->ni", c, v)== pytest.approx(accel, abs=1e-9)
    assert other.linear == pytest.approx(nwu.linear, abs=1e-9)


def test_linear_acceleration_is_without_gravity():
    q = attitude(10, start=about((1, 2, 3), 70))
    push = np.zeros((len(q), 3))
    push[-20:] = (1, 2, 3)
    accel, mag = sensors(q, acceleration=push)
    result = model().run(accel, mag, np.zeros_like(accel))
    assert result.linear[-21] == pytest.approx(np.zeros(3), abs=1e-6)
    # By then the low-pass contains 0.2 s of it, about 3 %, which rotates the attitude by less than 0.1°.
    assert result.linear[-1] == pytest.approx(matrix_from_quaternion(q[-1]) @ (1, 2, 3), abs=0.15)
    assert result.earth[-1] == pytest.approx((1, 2, 3 + G), abs=0.05)


def test_bias_is_learnt_at_rest():
    bias = np.array([0.8, -0.5, 0.3])
    q = attitude(10, start=about((1, 2, 3), 40))
    accel, mag = sensors(q)
    result = model().run(accel, mag, np.zeros_like(accel) + bias)
    assert not result.status["at_rest"][:RATE_HZ].any()
    assert result.status["at_rest"][4 * RATE_HZ:].all()
    assert result.bias_deg_s[-1] == pytest.approx(bias, abs=1e-3)


def test_bias_is_learnt_in_motion():
    bias = np.array([0.8, -0.5, 0.3])
    q = attitude(40, lambda t: wobble(t) / 6)
    accel, mag = sensors(q)
    result = model().run(accel, mag, rates(q) + bias)
    assert not result.status["at_rest"].any()
    # The time constant is Kp/Ki = 12.5 s: after three of them 5 % of the horizontal bias remain.
    assert np.linalg.norm((result.bias_deg_s[-1] - bias)[:2]) < 0.1 * np.linalg.norm(bias[:2])


def test_a_steady_turn_is_no_rest():
    q = attitude(10, lambda t: (0, 0, 10))
    accel, mag = sensors(q)
    result = model().run(accel, mag, rates(q))
    assert not result.status["at_rest"][RATE_HZ:].any()
    assert np.abs(result.bias_deg_s).max() < 0.01


def test_a_disturbed_field_is_rejected_and_used_again():
    q = attitude(40, wobble)
    accel, clean = sensors(q)
    _, disturbed = sensors(q, field=FIELD + np.array([0, 15, 10]))
    t = np.arange(len(q)) / RATE_HZ
    off = (t > 10) & (t < 25)
    result = model().run(accel, np.where(off[:, None], disturbed, clean), rates(q))
    assert result.status["magnetometer_rejected"][off][1:].all()
    assert not result.status["magnetometer_rejected"][~off].any()
    assert attitude_errors(result.q_b2n, q).heading[5 * RATE_HZ:].max() < 0.5


def test_a_field_that_stays_different_becomes_the_reference():
    q = attitude(60, wobble)
    accel, mag = sensors(q)
    stronger = np.where((np.arange(len(q)) > 10 * RATE_HZ)[:, None], 1.3, 1.0)
    result = model().run(accel, mag * stronger, rates(q))
    assert result.status["magnetometer_rejected"][11 * RATE_HZ]
    assert not result.status["magnetometer_rejected"][-1]


def test_motion_that_averages_out_does_not_tilt():
    q = attitude(30, wobble)
    t = np.arange(len(q)) / RATE_HZ
    accel, mag = sensors(q, acceleration=8 * np.stack([np.sin(9 * t), np.cos(7 * t), np.sin(5 * t)], axis=1)
                         * (t > 5)[:, None])
    result = model().run(accel, mag, rates(q))
    assert attitude_errors(result.q_b2n, q).inclination.max() < 1.5


def broken(kind, accel, mag, gyro):
    """Sensors that fail from 10 s to 15 s."""
    accel, mag, gyro = accel.copy(), mag.copy(), gyro.copy()
    period = np.full(len(accel), 1 / RATE_HZ)
    span = slice(10 * RATE_HZ, 15 * RATE_HZ)
    if kind == "saturated accelerometer":
        accel[span] = np.clip(accel[span] * 100, -157, 157)
    elif kind == "saturated gyro":
        gyro[span] = np.clip(gyro[span] * 1e4, -2000, 2000)
    elif kind == "stuck accelerometer":
        accel[span] = accel[span.start]
    elif kind == "stuck gyro":
        gyro[span] = gyro[span.start]
    elif kind == "stuck magnetometer":
        mag[span] = mag[span.start]
    elif kind == "no accelerometer":
        accel[span] = 0
    elif kind == "no magnetometer":
        mag[span] = 0
    elif kind == "no period":
        period[span] = 0
    elif kind == "nonsense period":
        period[span] = np.tile([-1.0, 1e30, 1e-30, 0.05], len(accel))[:5 * RATE_HZ]
    elif kind == "not a number":
        accel[span], mag[span.start], gyro[span.start + 1] = np.nan, np.inf, -np.inf
    elif kind == "huge":
        accel[span], mag[span] = 1e200, 1e200
    return accel, mag, gyro, period


FAULTS = {"saturated accelerometer": "range_exceeded", "saturated gyro": "range_exceeded", "stuck accelerometer": "",
          "stuck gyro": "", "stuck magnetometer": "magnetometer_rejected", "no accelerometer": "accelerometer_missing",
          "no magnetometer": "magnetometer_missing", "no period": "", "nonsense period": "range_exceeded",
          "not a number": "refused", "huge": "refused"}


@pytest.mark.parametrize("kind", FAULTS)
def test_faults_pass(kind):
    """Five seconds of bad input, then half a minute of motion: all numbers stay finite, and the filter recovers.

    After a gyro fault the heading error may have any value. It falls at 2·Km = 11 deg/s down to 90°, and
    then by a factor of e in 1/Km = 10 s: from 180° to about 12° in 30 s.
    """
    q = attitude(45, lambda t: wobble(t) / 3)
    accel, mag = sensors(q)
    accel, mag, gyro, period = broken(kind, accel, mag, rates(q))
    result = model().run(accel, mag, gyro, period_s=period)
    assert all(np.isfinite(part).all() for part in result[:-1])
    assert np.linalg.norm(result.q_b2n, axis=1) == pytest.approx(1, abs=1e-12)
    errors = attitude_errors(result.q_b2n, q)
    assert errors.inclination[-1] < 1
    assert errors.total[-1] < (15 if "gyro" in kind else 3)
    if flag := FAULTS[kind]:
        assert result.status[flag][10 * RATE_HZ:15 * RATE_HZ].any()
        assert not result.status[flag][16 * RATE_HZ:].any()


def test_periods_may_change_from_sample_to_sample():
    q = attitude(20, wobble, about((1, 0, 0), 30))
    keep = np.sort(np.random.default_rng(3).choice(len(q), len(q) // 2, replace=False))
    accel, mag = (samples[keep] for samples in sensors(q))
    period = np.diff(keep, prepend=keep[0] - 1) / RATE_HZ
    result = model().run(accel, mag, rates(q[keep]) / RATE_HZ / period[:, None], period_s=period)
    assert rotation_angle(result.q_b2n, q[keep])[5 * RATE_HZ:].max() < 0.2


def test_a_magnetometer_that_is_slower_corrects_as_much():
    q = attitude(30, lambda t: (0, 0, 10))
    accel, mag = sensors(q)
    gyro = rates(q) + np.array([0, 0, 0.5])
    valid = np.arange(len(q)) % 10 == 0
    ends = [attitude_errors(model(bias_gain=0).run(accel, mag, gyro, mag_valid=mask).q_b2n, q).heading[-RATE_HZ:].mean()
            for mask in (np.ones(len(q), dtype=bool), valid)]
    assert ends[0] == pytest.approx(0.5 / 0.1, rel=0.1)  # where bias and correction balance
    assert ends[1] == pytest.approx(ends[0], rel=0.02)


def test_without_magnetometer_heading_is_the_gyros():
    q = attitude(20, wobble)
    accel, _ = sensors(q)
    result = model(magnetometer=False).run(accel, None, rates(q) + np.array([0, 0, 0.5]))
    errors = attitude_errors(result.q_b2n, q)
    assert errors.inclination[5 * RATE_HZ:].max() < 1.2  # 0.5 deg/s over 0.5/s is one degree
    assert errors.heading[-1] > 2
    assert not result.status["magnetometer_missing"].any()


def test_status_has_all_flags():
    q = attitude(1)
    result = model().run(*sensors(q), np.zeros((len(q), 3)))
    assert set(result.status) == set(STATUS)


@pytest.mark.parametrize(("change", "message"), [
    ({"period_s": 0}, "Sample period must be positive, not 0"),
    ({"frame": "NEU"}, "Frame must be one of NWU, ENU, NED, not 'NEU'"),
    ({"axes": {"a": ("+x", "+x", "+z")}}, "Axes must name x, y and z once each with a sign, not .*"),
])
def test_wrong_parameters(change, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        model(**change)
