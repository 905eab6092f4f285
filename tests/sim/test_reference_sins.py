"""The reference navigator against true flights, physical statements and textbook error formulas."""

import numpy as np
import pytest

from strapdown_sim.reference.sins import Navigator, coarse_alignment, platform_from_geodetic, rest_errors, rotation
from strapdown_sim.stimuli.flight import SOURCE_EARTH, Flight, airliner, at_rest

schuler_s = 2 * np.pi * np.sqrt(SOURCE_EARTH.radius_m / SOURCE_EARTH.gravity_m_s2)


def position_error(navigation, truth, earth):
    """Distance from the truth over ground, m."""
    meridian, prime = earth.radii(truth.latitude)
    return np.hypot((navigation.latitude - truth.latitude) * (meridian + truth.height_m),
                    (navigation.longitude - truth.longitude) * (prime + truth.height_m) * np.cos(truth.latitude))


def test_schuler_period_is_84_minutes():
    assert schuler_s / 60 == pytest.approx(84.4, abs=0.3)


def test_rotation_is_rodrigues():
    np.testing.assert_allclose(rotation([0, 0, np.pi / 2]) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_array_equal(rotation(np.zeros(3)), np.eye(3))


@pytest.mark.parametrize("wander_deg", [-120])
def test_error_free_flight_stays_within_ten_metres_for_an_hour(wander_deg):
    # At 5 Hz, ten times slower than the source: errors of second order in the period are a hundred times larger.
    flight, period = airliner(), 0.2
    omega_b, f_b, truth = flight.sample(period)
    wander = np.radians(wander_deg)
    start = Flight(1, latitude_deg=flight.latitude_deg, track_deg=flight.track_deg).sample(1)[2].c_b2n[0]
    navigator = Navigator(
        flight.earth, period, rotation([0, 0, -wander]) @ start,
        platform_from_geodetic(np.radians(flight.latitude_deg), np.radians(flight.longitude_deg), wander),
        np.zeros(3), np.float64(flight.height_m), damping_s=100.0)
    every = slice(4, None, 5)
    told = []
    for k in range(len(omega_b)):
        navigator.step(omega_b[k], f_b[k], truth.height_m[k])
        if k % 5 == 4:
            told.append(navigator.navigation())
    told = type(told[0])(*(np.stack(values) for values in zip(*told, strict=True)))
    truth = type(truth)(*(values[every] for values in truth))
    assert position_error(told, truth, flight.earth).max() < 10
    # The angles do not depend on the direction of the platform.
    np.testing.assert_allclose(told.pitch, truth.pitch, rtol=0, atol=1e-5)
    np.testing.assert_allclose(told.roll, truth.roll, rtol=0, atol=1e-5)
    np.testing.assert_allclose(np.angle(np.exp(1j * (told.heading - truth.heading))), 0, atol=1e-5)
    np.testing.assert_allclose(told.velocity_m_s[:, :2], truth.velocity_m_s[:, :2], rtol=0, atol=0.02)
    assert abs(told.wander[0] - wander) < 1e-6


def at_rest_with_errors(latitude_deg, duration_s, *, tilt=(0, 0, 0), gyro_bias=(0, 0, 0)):
    """Navigation after ``duration_s`` at rest, heading north, with a tilt and biases; 1 s samples."""
    omega_b, f_b, truth = at_rest(duration_s, latitude_deg=latitude_deg).sample(1.0)
    latitude = np.radians(latitude_deg)
    navigator = Navigator(SOURCE_EARTH, 1.0, rotation(-np.asarray(tilt, float)), platform_from_geodetic(latitude, 0.0),
                          np.zeros(3), np.float64(0), damping_s=100.0)
    return navigator.run(omega_b + gyro_bias, f_b, truth.height_m)


@pytest.mark.parametrize("latitude_deg", [0, 45])
@pytest.mark.parametrize("error", ["tilt", "gyro_bias"])
def test_errors_at_rest_are_the_textbooks(latitude_deg, error):
    # 0.05 deg/h, or 0.01 degrees, about the north axis.
    size = np.array([0, np.radians(0.05) / 3600 if error == "gyro_bias" else np.radians(0.01), 0])
    duration = 6000
    told = at_rest_with_errors(latitude_deg, duration, **{error: size})
    times = np.arange(500, duration + 1, 500)
    model = np.array([rest_errors(SOURCE_EARTH, np.radians(latitude_deg), t, **{error: size}) for t in times])
    eastward, longitude = told.velocity_m_s[times - 1, 0], told.longitude[times - 1]
    for measured, expected in (eastward, model[:, 3]), (longitude, model[:, 6]):
        assert np.abs(measured - expected).max() <= 0.02 * np.abs(expected).max()
    if latitude_deg == 0:
        # At the equator the east channel is independent: a pendulum of Schuler's period.
        phase = 2 * np.pi * times / schuler_s
        g, radius = SOURCE_EARTH.gravity_m_s2, SOURCE_EARTH.radius_m
        if error == "tilt":
            velocity = -size[1] * np.sqrt(g * radius) * np.sin(phase)
            distance = -size[1] * radius * (1 - np.cos(phase))
        else:
            velocity = size[1] * radius * (1 - np.cos(phase))
            distance = size[1] * radius * (times - schuler_s / (2 * np.pi) * np.sin(phase))
        assert np.abs(eastward - velocity).max() <= 0.02 * np.abs(velocity).max()
        assert np.abs(longitude * radius - distance).max() <= 0.02 * np.abs(distance).max()


def test_wander_and_heading_have_the_stated_signs():
    # Eastward on the northern hemisphere: a platform without rotation about the vertical rotates clockwise from north.
    flight = Flight(600, latitude_deg=60, track_deg=90, speed_m_s=250)
    omega_b, f_b, truth = flight.sample(0.5)
    c = flight.sample(0.5)[2].c_b2n[0]
    navigator = Navigator(flight.earth, 0.5, c, platform_from_geodetic(np.radians(60), 0.0), np.array([250.0, 0, 0]),
                          np.float64(0))
    told = navigator.run(omega_b, f_b)
    turned = truth.longitude[-1] * np.sin(np.radians(60))
    # The meridians converge: north rotates anticlockwise relative to the platform, the platform clockwise from north.
    assert told.wander[-1] == pytest.approx(-turned, rel=1e-3)
    assert np.degrees(told.heading[-1]) == pytest.approx(90, abs=1e-3)


def test_coarse_alignment_finds_attitude_from_two_vectors():
    flight = at_rest(1, latitude_deg=50, heading_deg=200, pitch_deg=5)
    omega_b, f_b, truth = flight.sample(1.0)
    np.testing.assert_allclose(coarse_alignment(f_b[0], omega_b[0]), truth.c_b2n[0], rtol=0, atol=1e-12)


def test_a_free_vertical_channel_diverges_and_a_damped_one_does_not():
    omega_b, f_b, truth = at_rest(1200, latitude_deg=45).sample(1.0)
    errors = {}
    for damping in (None, 100.0):
        navigator = Navigator(SOURCE_EARTH, 1.0, np.eye(3), platform_from_geodetic(np.radians(45), 0.0), np.zeros(3),
                              np.float64(10.0), damping_s=damping)
        errors[damping] = navigator.run(omega_b, f_b, truth.height_m).height_m[-1]
    # 10 m too high, gravity is 3e-5 m/s² too small: h = 10·cosh(t·sqrt(gravity_height)).
    assert errors[None] == pytest.approx(10 * np.cosh(1200 * np.sqrt(SOURCE_EARTH.gravity_height)), rel=0.01)
    assert abs(errors[100.0]) < 0.02
