"""The float64 reference of the flight filter against physical statements."""

import numpy as np
import pytest

from strapdown.cores import FLIGHT
from strapdown_sim.errors import attitude_errors, conjugate, multiply, rotation_angle
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.flight import ALIGNMENTS, FRAME_QUATERNIONS, STATUS, FlightFilter

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
    """At rest in any attitude, also upside down or facing south: right after the samples with full weight."""
    q = attitude(7, start=start)
    accel, mag = sensors(q)
    result = model().run(accel, mag, np.zeros_like(accel))
    assert rotation_angle(result.q_b2n, q)[3 * ALIGNMENTS:].max() < 0.01
    assert result.status["starting"][:6 * RATE_HZ].all()
    assert not result.status["starting"][-1]


@pytest.mark.parametrize("tilt", [178.2, 179, 179.9, 180])
def test_a_start_upside_down_in_noise_has_the_right_heading(tilt):
    """Four samples must find the vertical before the heading is aligned; noise of 0.02 m/s² tilts by 0.1°."""
    rng = np.random.default_rng(1)
    for azimuth in range(0, 360, 60):
        about_axis = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0
        q = attitude(1, start=about(about_axis, tilt))
        accel, mag = sensors(q)
        result = model().run(accel + 0.02 * rng.standard_normal(accel.shape), mag, np.zeros_like(accel))
        # A tilt error of 0.1° to 0.3° turns the heading by that times the tangent of the dip, 2.25.
        assert rotation_angle(result.q_b2n, q)[3 * ALIGNMENTS:].max() < 1


@pytest.mark.parametrize("wrong", [90, -90, 179, 180])
def test_a_wrong_yaw_is_right_after_the_first_field_samples(wrong):
    q = attitude(1)
    accel, mag = sensors(q)
    start = model()
    start.reset(about((0, 0, 1), wrong), aligned=True)
    errors = rotation_angle(start.run(accel, mag, np.zeros_like(accel)).q_b2n, q)
    assert errors[0] == pytest.approx(abs(wrong))
    assert errors[ALIGNMENTS:].max() < 0.01


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
    q = attitude(40, wobble)
    accel, mag = sensors(q)
    result = model().run(accel, mag, rates(q) + bias)
    assert not result.status["at_rest"].any()
    assert np.linalg.norm(result.bias_deg_s[-1] - bias) < 0.25 * np.linalg.norm(bias)


def test_motion_without_bias_invents_none():
    """Acceleration looks like a bias at first; its noise W gives 1.87/√60 = 0.24 deg/s after a minute."""
    q = attitude(60, wobble)
    t = np.arange(len(q)) / RATE_HZ
    accel, mag = sensors(q, acceleration=3 * np.stack([np.sin(3 * t), np.cos(2 * t), np.sin(5 * t)], axis=1))
    result = model().run(accel, mag, rates(q))
    assert np.linalg.norm(result.bias_deg_s[-1]) < 0.24


def test_a_bias_beyond_the_limit_is_clipped_and_told():
    q = attitude(30, wobble)
    accel, mag = sensors(q)
    result = model(bias_limit=1.0).run(accel, mag, np.add(rates(q), (2.0, 0.0, 0.0)))
    lengths = np.linalg.norm(result.bias_deg_s, axis=1)
    assert lengths.max() <= 1 + 1e-9
    assert result.status["bias_clipped"].any()
    np.testing.assert_array_equal(lengths[result.status["bias_clipped"]] > 1 - 1e-9, True)


@pytest.mark.parametrize("rate_hz", [500, 8000])
def test_white_noise_of_the_gyro_does_not_hide_rest(rate_hz):
    rng = np.random.default_rng(3)
    count = 4 * rate_hz
    noise = np.degrees(0.14e-3) * np.sqrt(rate_hz)
    gyro = (0.3, -0.2, 0.4) + noise * rng.standard_normal((count, 3))
    result = model(period_s=1 / rate_hz).run(np.tile(UP, (count, 1)), np.tile(FIELD, (count, 1)), gyro)
    assert result.status["at_rest"][-1]
    # The gyro's average over 0.5 s has a noise of 0.14 mrad/s: 0.008 deg/s.
    assert result.bias_deg_s[-1] == pytest.approx((0.3, -0.2, 0.4), abs=0.04)


def test_a_turn_after_rest_is_no_bias():
    """A turn of 3 deg/s, as an aircraft flies it, with the specific force of rest."""
    q = np.concatenate([attitude(10), attitude(30, lambda t: (0, 0, 3))])
    accel, mag = sensors(q)
    result = model().run(accel, mag, rates(q))
    assert result.status["at_rest"][9 * RATE_HZ]
    assert not result.status["at_rest"][12 * RATE_HZ:].any()
    assert np.abs(result.bias_deg_s).max() < 0.3


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
          "stuck gyro": "", "stuck magnetometer": "magnetometer_stuck", "no accelerometer": "accelerometer_missing",
          "no magnetometer": "magnetometer_missing", "no period": "", "nonsense period": "range_exceeded",
          "not a number": "refused", "huge": "refused"}
MISLEADING = "saturated accelerometer", "stuck gyro", "no period", "nonsense period", "not a number", "huge"
"""Faults after which the tilt looks like a bias at first."""


@pytest.mark.parametrize("kind", FAULTS)
def test_faults_pass(kind):
    """Five seconds of bad input, then half a minute of motion: all numbers stay finite, and the filter recovers.

    After a gyro fault that is not told the heading error may have any value. It falls at 2·Km = 11 deg/s down to 90°,
    and then by a factor of e in 1/Km = 10 s: from 180° to about 12° in 30 s.
    """
    q = attitude(45, lambda t: wobble(t) / 3)
    accel, mag = sensors(q)
    accel, mag, gyro, period = broken(kind, accel, mag, rates(q))
    result = model().run(accel, mag, gyro, period_s=period)
    assert all(np.isfinite(part).all() for part in result[:-1])
    assert np.linalg.norm(result.q_b2n, axis=1) == pytest.approx(1, abs=1e-12)
    errors = attitude_errors(result.q_b2n, q)
    assert errors.inclination[-1] < (5 if kind in MISLEADING else 1)
    assert errors.total[-1] < (15 if kind in MISLEADING else 3)
    if flag := FAULTS[kind]:
        assert result.status[flag][10 * RATE_HZ:15 * RATE_HZ].any()
        # The tilt recovers for three seconds from a rate beyond the range.
        assert not result.status[flag][(19 if kind == "saturated gyro" else 16) * RATE_HZ:].any()


@pytest.mark.parametrize("angle", [60, 120, 150, 178, 180])
def test_a_vertical_that_is_lost_is_found(angle):
    """The body turns over, and the gyro does not see it: no attitude error is an equilibrium."""
    q = attitude(30)
    q[15 * RATE_HZ:] = about((1, 2, 0), angle)
    accel, mag = sensors(q)
    errors = attitude_errors(model().run(accel, mag, np.zeros_like(accel)).q_b2n, q)
    assert errors.inclination[15 * RATE_HZ] > angle - 1
    assert errors.inclination[-1] < 2


@pytest.mark.parametrize("seconds", [0.03, 0.2])
def test_after_a_rate_beyond_the_range_the_tilt_recovers_in_a_second(seconds):
    """A rotation of 40° about x is lost: full scale is 32767/16.4 deg/s. The body is at rest afterwards."""
    count = round(seconds * RATE_HZ)
    limit = 32767 / 16.4
    spin = np.zeros(15 * RATE_HZ)
    spin[10 * RATE_HZ:10 * RATE_HZ + count] = limit + 40 / seconds
    q = np.array([about((1, 0, 0), angle) for angle in np.cumsum(spin) / RATE_HZ])
    accel, mag = sensors(q)
    gyro = np.zeros_like(accel)
    gyro[:, 0] = np.minimum(spin, limit)
    result = model().run(accel, mag, gyro)
    errors = attitude_errors(result.q_b2n, q)
    end = 10 * RATE_HZ + count
    assert errors.inclination[end - 1] > 15
    assert errors.inclination[end + RATE_HZ] < 5
    assert result.status["range_exceeded"][10 * RATE_HZ:end + RATE_HZ].all()
    assert not result.status["range_exceeded"][:10 * RATE_HZ].any()
    assert not result.status["range_exceeded"][-1]


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sensor", ["accel", "gyro"])
def test_each_axis_is_out_of_range_from_0_9989_on(axis, sensor):
    q = attitude(1)
    samples = dict(zip(("accel", "mag", "gyro_deg_s"), (*sensors(q), np.zeros((len(q), 3))), strict=True))
    name, limit = {"accel": ("accel", 157.0), "gyro": ("gyro_deg_s", 2000.0)}[sensor]
    for part, told in ((0.9988, False), (0.999, True), (-0.999, True)):
        changed = samples[name].copy()
        changed[-1, axis] = part * limit
        result = model().run(**samples | {name: changed})
        assert result.status["range_exceeded"][-1] == told


def test_external_acceleration_keeps_a_turn_from_tilting():
    """A minute of a level turn with 30° of bank: without it the bank is lost, with it the error stays below 0.2°."""
    bank = np.interp(np.arange(75 * RATE_HZ) / RATE_HZ, (10, 13), (0, 30))
    heading = np.cumsum(6.0 * bank / 30) / RATE_HZ
    q = np.array([multiply(about((0, 0, 1), turn), about((1, 0, 0), -lean)) for turn, lean in zip(
        heading, bank, strict=True)])
    # In a turn to the left, with the left side down, the acceleration points to the left.
    angle = np.radians(heading)
    pull = G * np.tan(np.radians(bank))[:, None] * np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    accel, mag = sensors(q, acceleration=pull)
    gyro = rates(q)
    with_it, without = (attitude_errors(model().run(accel, mag, gyro, external=external).q_b2n, q).inclination
                        for external in (pull, None))
    assert with_it.max() < 0.2
    assert without[-1] > 20


def test_a_stuck_field_is_not_followed():
    """A quarter turn with a constant field: followed, it would turn the heading by 90°."""
    q = np.concatenate([attitude(10), attitude(3, lambda t: (0, 0, 30)),
                        np.tile(about((0, 0, 1), 90), (RATE_HZ * 60, 1))])
    accel, mag = sensors(q)
    mag[10 * RATE_HZ:] = mag[0]
    result = model().run(accel, mag, rates(q))
    assert attitude_errors(result.q_b2n, q).heading[-1] < 5
    assert result.status["magnetometer_stuck"][-1]
    assert not result.status["magnetometer_stuck"][:10 * RATE_HZ].any()


def test_declination_turns_the_heading_to_true_north():
    q = attitude(5, start=about((0, 0, 1), 40))
    accel, mag = sensors(q)
    for frame in FRAME_QUATERNIONS:
        plain, true = (model(frame=frame, magnetic_declination=angle).run(accel, mag, np.zeros_like(accel))
                       for angle in (0.0, 10.0))
        # Magnetic north is 10° east of true north, so the body points 10° further east than it seemed to.
        east = 1 if frame == "NED" else -1
        assert (true.yaw[-1] - plain.yaw[-1] - 10 * east + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)


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
    fixed = {"bias_noise": 1e6, "rest_time": 1e6}
    ends = [attitude_errors(model(**fixed).run(accel, mag, gyro, mag_valid=mask).q_b2n, q).heading[-RATE_HZ:].mean()
            for mask in (np.ones(len(q), dtype=bool), valid)]
    assert ends[0] == pytest.approx(0.5 / 0.1, rel=0.1)  # where bias and correction balance
    assert ends[1] == pytest.approx(ends[0], rel=0.02)


def test_without_magnetometer_heading_is_the_gyros():
    q = attitude(20, wobble)
    accel, _ = sensors(q)
    result = model(magnetometer=False).run(accel, None, rates(q) + np.array([0, 0, 0.5]))
    errors = attitude_errors(result.q_b2n, q)
    assert errors.inclination[5 * RATE_HZ:].max() < 1.2
    assert errors.heading[-1] > 1
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
