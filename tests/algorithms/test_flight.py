"""The flight filter's kernel in float64 against the reference, which was written from the equations, not the kernel."""

import numpy as np
import pytest

from strapdown.algorithms.flight import FRAMES, field_correction, tilt_correction
from strapdown.cores import FLIGHT, FLIGHT_6AXIS
from strapdown.cores.flight import ins_flight
from strapdown.kernel.numeric import Float64
from strapdown_sim.errors import rotation_angle
from strapdown_sim.reference.flight import STATUS
from strapdown_sim.truth import flight_filter

RATE_HZ = 100


def samples(seconds, seed=5):
    """Sensors of a body at rest, in rotation and in vibration, with disturbed fields and missing data."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    moving = (t > 4)[:, None]
    gyro = (0.5, -0.3, 0.2) + moving * 200 * np.sin(np.outer(t, (1.3, 1.7, 0.9)))
    gyro += 0.05 * rng.standard_normal((len(t), 3))
    accel = np.array([1.0, -2.0, 9.5]) + moving * rng.standard_normal((len(t), 3)) * 2
    mag = np.array([18.0, 5.0, -44.0]) + moving * 4 * np.cos(np.outer(t, (0.7, 1.1, 0.5)))
    mag[t > 8] *= 1.5
    for vector in accel, mag:
        vector[(rng.random(len(t)) < 0.02) & (t > 4)] = 0
    accel[(rng.random(len(t)) < 0.01) & (t > 4)] *= 40
    gyro[(t > 9) & (t < 9.1), 1] = -2100
    mag[t > 11] = mag[-1]
    return accel, mag, gyro


CALIBRATION = {
    "accelerometer_bias": "0.1,-0.2,0.3", "accelerometer_matrix": "1.01,0.02,0,0,0.99,-0.01,0.03,0,1.02",
    "gyro_bias": "0.5,0,-0.4", "gyro_matrix": "1,0.01,-0.01,0,1.02,0,0.02,0,0.98",
    "magnetometer_bias": "3,-2,5", "magnetometer_matrix": "1.1,0.05,0,0.05,0.9,0,0,0,1",
    "magnetic_declination": "-12.5"}


def run_kernel(config, accel, mag, gyro, **more):
    """The kernel in float64, update by update: outputs and status by name, shape (N, ...)."""
    system = ins_flight(config)
    values = {"a": accel, "m": mag, "g": gyro} | more
    with np.errstate(all="ignore"):
        result, _ = system.run_float64(system.bind(**{name: values[name] for name in system.inputs}))
    return system.read(result) | {name: result[name] for name in system.status}


def compare(kernel, truth):
    """The kernel's two approximations are far below 0.001°; an error in an equation would be larger.

    The weight of the field's reference is x - x²/2 in place of 1 - exp(-x): a relative error of x²/6 = 1e-3 at
    most in the ramp. A rotation is too small by 2/15·y⁵, 1e-9 rad at 2° per sample.
    """
    assert rotation_angle(kernel["q"], truth.q_b2n).max() < 1e-3
    assert np.abs(kernel["c"] - truth.c_n2b).max() < 2e-5
    for name, expected in ("bias", truth.bias_deg_s), ("earth", truth.earth), ("linear", truth.linear):
        assert np.abs(kernel[name] - expected).max() <= 2e-5 * max(np.abs(expected).max(), 1)
    for name in STATUS[:-1]:
        if name in kernel:
            # A threshold may be reached one sample earlier or later.
            assert np.count_nonzero(kernel[name] != truth.status[name]) <= 2, name


@pytest.mark.parametrize("frame", FRAMES)
def test_kernel_is_the_reference(frame):
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, frame=frame, rest_rate=3.0, ramp_time=2.0)
    accel, mag, gyro = samples(14)
    truth = flight_filter(config).run(accel, mag, gyro)
    for name in "at_rest", "magnetometer_rejected", "accelerometer_missing", "range_exceeded", "magnetometer_stuck":
        assert truth.status[name].any(), name
    compare(run_kernel(config, accel, mag, gyro), truth)


def test_6_axes_and_turned_sensors():
    config = FLIGHT_6AXIS.replace(sample_rate_hz=RATE_HZ, accelerometer_axes="-y,+x,+z", gyro_axes="+z,-y,+x")
    accel, mag, gyro = samples(8)
    compare(run_kernel(config, accel, mag, gyro), flight_filter(config).run(accel, None, gyro))


def test_turned_magnetometer_that_is_slower():
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, magnetometer_axes="+y,-x,+z", mag_valid_input="true")
    accel, mag, gyro = samples(8)
    valid = np.arange(len(mag)) % 7 == 3
    compare(run_kernel(config, accel, mag, gyro, mag_valid=valid.astype(float)),
            flight_filter(config).run(accel, mag, gyro, mag_valid=valid))


@pytest.mark.parametrize("frame", FRAMES)
def test_calibration_declination_and_external_acceleration(frame):
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, frame=frame, external_input=True, accelerometer_axes="-y,+x,+z",
                            magnetometer_axes="+y,-x,+z", **CALIBRATION)
    accel, mag, gyro = samples(10)
    t = np.arange(len(accel)) / RATE_HZ
    external = np.sin(np.outer(t, (0.5, 0.8, 1.1))) * (t > 3.0)[:, None]
    truth = flight_filter(config).run(accel, mag, gyro, external=external)
    assert truth.status["external_used"].sum() == len(accel) - 301
    compare(run_kernel(config, accel, mag, gyro, external=external), truth)


def test_calibration_at_run_time():
    constant = FLIGHT.replace(sample_rate_hz=RATE_HZ, **CALIBRATION)
    config = constant.replace(inputs=tuple(CALIBRATION))
    accel, mag, gyro = samples(6)
    truth = flight_filter(constant).run(accel, mag, gyro)
    compare(run_kernel(config, accel, mag, gyro, **config.constant_inputs()), truth)


def test_a_repeated_field_is_not_new():
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, stale_field=True)
    accel, mag, gyro = samples(8)
    mag = mag[np.arange(len(mag)) // 5 * 5]
    truth = flight_filter(config).run(accel, mag, gyro)
    assert truth.status["magnetometer_missing"].sum() > 0.75 * len(mag)
    compare(run_kernel(config, accel, mag, gyro), truth)


def test_a_bias_beyond_the_limit_is_clipped():
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, bias_limit=1.0, rest_time=100.0)
    accel, mag, _ = samples(14)
    accel[:], mag[:] = accel[0], mag[0]
    gyro = np.tile((0.9, 0.9, 0.0), (len(accel), 1))
    truth = flight_filter(config).run(accel, mag, gyro)
    assert truth.status["bias_clipped"].any()
    assert np.linalg.norm(truth.bias_deg_s, axis=1).max() == pytest.approx(1, abs=1e-9)
    kernel = run_kernel(config, accel, mag, gyro)
    # The kernel shortens to first order: 1.5 times the square of what one update adds.
    assert np.abs(kernel["bias"] - truth.bias_deg_s).max() < 1e-4
    assert np.count_nonzero(kernel["bias_clipped"] != truth.status["bias_clipped"]) <= 2


def test_period_and_gains_as_inputs():
    names = ("magnetometer_gain", "acceleration_time", "ramp_time", "bias_noise", "bias_drift", "heading_weighting",
             "field_tolerance", "rest_rate", "gyro_range")
    config = FLIGHT.replace(sample_rate_hz=RATE_HZ, period_input=True, inputs=names)
    accel, mag, gyro = samples(8)
    period = np.random.default_rng(1).uniform(0.004, 0.016, len(accel))
    kernel = run_kernel(config, accel, mag, gyro, **config.constant_inputs() | {"period": period})
    truth = flight_filter(config).run(accel, mag, gyro, period_s=period)
    # Weights are too small by a relative error below x²/6, with x = 0.016 s/0.5 s at most: 2e-4 of a few degrees.
    assert rotation_angle(kernel["q"], truth.q_b2n).max() < 5e-3


@pytest.mark.parametrize("period", [0.0, -1.0, 1e30, 0.1, 1e-12])
def test_any_period_is_survived(period):
    config = FLIGHT.replace(period_input=True)
    accel, mag, gyro = samples(1)
    kernel = run_kernel(config, accel, mag, gyro, period=period)
    assert all(np.isfinite(values).all() for values in kernel.values())
    assert kernel["range_exceeded"].all() == (period in (-1.0, 1e30))


@pytest.mark.parametrize("angle", [0, 1e-6, 30, 90, 119, 120, 150, 179, 180])
def test_tilt_is_the_tangent_of_half_the_angle(angle):
    """Exact up to 120°; beyond, the direction is still correct, and the correction is never more than twice √3."""
    low = (7 * np.sin(np.radians(angle)), 0.0, 7 * np.cos(np.radians(angle)))
    (x, y), length = tilt_correction(Float64(), low, FRAMES["NWU"], aligning=False)
    assert length == pytest.approx(7)
    if angle <= 120:
        assert (x, y) == pytest.approx((0, -np.tan(np.radians(angle) / 2)), abs=1e-12)
    else:
        assert 0 < np.hypot(x, y) <= 2
        assert y <= 0


@pytest.mark.parametrize(("frame", "north"), [("NWU", (1, 0)), ("ENU", (0, 1)), ("NED", (1, 0))])
@pytest.mark.parametrize("angle", [-180, -120, -90, -20, 0, 20, 90, 120, 179])
def test_heading_is_the_tangent_of_half_the_angle(frame, north, angle):
    turn = np.radians(angle)
    x, y = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ north
    tangent, weight, *_ = field_correction(
        Float64(), (x, y, 2.0), (1.0, -2.0 if frame == "NED" else 2.0), FRAMES[frame], FLIGHT.parameters)
    if abs(angle) != 180:
        assert tangent == pytest.approx(np.clip(-np.tan(turn / 2), -1, 1))
    assert abs(tangent) <= 1
    assert weight == pytest.approx(1)
