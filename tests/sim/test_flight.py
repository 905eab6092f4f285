"""The flight generator against physical statements and against numerical derivatives."""

import numpy as np
import pytest

from strapdown_sim.stimuli.flight import SOURCE_EARTH, WGS84, Change, Flight, at_rest, sensor_errors

FLIGHT = Flight(
    duration_s=60, latitude_deg=40, longitude_deg=-20, height_m=1000, track_deg=70, speed_m_s=150,
    angle_of_attack_deg=3,
    changes=(Change("track_deg", 5, 30, 60), Change("speed_m_s", 10, 20, 40), Change("climb_deg", 15, 10, 6)))


def test_at_rest_sensors_feel_gravity_and_the_turning_earth():
    omega_b, f_b, truth = at_rest(1, latitude_deg=30, heading_deg=90).sample(0.5)
    spin = SOURCE_EARTH.rate_rad_s
    # Heading east: body x (right) points south, y (forward) east.
    np.testing.assert_allclose(omega_b[0], spin * np.array([-np.cos(np.pi / 6), 0, np.sin(np.pi / 6)]), atol=1e-19)
    np.testing.assert_allclose(f_b[0], [0, 0, 9.7803 + 0.051799 / 4], atol=1e-14)
    assert np.degrees(truth.heading[0]) == pytest.approx(90)


def test_nose_up_is_positive_pitch_and_right_side_down_positive_roll():
    _, f_b, truth = at_rest(1, latitude_deg=0, pitch_deg=10).sample(1)
    assert f_b[0, 1] > 0
    assert truth.pitch[0] == pytest.approx(np.radians(10))
    _, _, truth = FLIGHT.sample(0.1)
    middle = truth.time_s.searchsorted(20)
    assert truth.roll[middle] > 0.1  # turning right
    assert truth.c_b2n[middle, 2, 0] < 0  # the right wing points down


def test_a_turn_has_no_side_force_but_coriolis():
    flight = Flight(duration_s=60, speed_m_s=200, latitude_deg=45, changes=(Change("track_deg", 0, 60, 40),))
    _, f_b, truth = flight.sample(0.1)
    assert truth.roll.max() > np.radians(20)
    # The bank is that of a level turn over a flat earth at rest; the Coriolis term is 2·Ω·v = 0.03 m/s², that of the
    # vertical's rotation v²/R.
    assert np.abs(f_b[:, 0]).max() < 0.05


def test_truth_is_consistent_with_itself():
    step = 0.01
    _, _, truth = FLIGHT.sample(step)
    meridian, prime = FLIGHT.earth.radii(truth.latitude)
    moved = np.stack([np.gradient(truth.longitude, step) * (prime + truth.height_m) * np.cos(truth.latitude),
                      np.gradient(truth.latitude, step) * (meridian + truth.height_m),
                      np.gradient(truth.height_m, step)], axis=-1)
    # A central difference: step²/6 of the third derivative, about 5 m/s³.
    np.testing.assert_allclose(moved[1:-1], truth.velocity_m_s[1:-1], rtol=0, atol=5e-4)
    assert FLIGHT.distance() == pytest.approx(np.linalg.norm(truth.velocity_m_s, axis=1).sum() * step, rel=1e-4)


def test_rates_turn_the_body_as_the_truth_says():
    step = 0.001
    omega_b, f_b, truth = FLIGHT.sample(step)
    c, v, latitude = truth.c_b2n, truth.velocity_m_s, truth.latitude
    meridian, prime = FLIGHT.earth.radii(latitude)
    meridian, prime = meridian + truth.height_m, prime + truth.height_m
    spin = FLIGHT.earth.rate_rad_s * np.stack([0 * latitude, np.cos(latitude), np.sin(latitude)], -1)
    transport = np.stack([-v[:, 1] / meridian, v[:, 0] / prime, v[:, 0] * np.tan(latitude) / prime], -1)
    turned = np.swapaxes(c[:-1], -1, -2) @ c[1:]
    rate = np.stack([turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0],
                     turned[:, 1, 0] - turned[:, 0, 1]], -1) / (2 * step)
    nav = np.einsum("kji,kj->ki", c, spin + transport)
    # Rounding of the elements of C, 1e-16/step, and second order of the step.
    np.testing.assert_allclose(omega_b[1:], rate + (nav[1:] + nav[:-1]) / 2, rtol=0, atol=1e-7)
    # Newton: v̇ = f + g − (2·spin + transport) × v.
    f_n = np.einsum("kij,kj->ki", c, f_b)
    gravity = np.stack([0 * latitude, 0 * latitude, FLIGHT.earth.gravity(latitude, truth.height_m)], -1)
    expected = f_n - gravity - np.cross(2 * spin + transport, v)
    # Sensors give means over an interval, the truth is at its end: half a step of the third derivative.
    np.testing.assert_allclose((v[1:] - v[:-1]) / step, expected[1:], rtol=0, atol=5e-3)


def test_quadrature_has_converged():
    coarse, fine = FLIGHT.sample(0.1, nodes=3), FLIGHT.sample(0.1, nodes=6)
    assert np.abs(coarse[2].latitude - fine[2].latitude).max() * 6.4e6 < 1e-6
    assert np.abs(coarse[0] - fine[0]).max() < 1e-12
    assert np.abs(coarse[1] - fine[1]).max() < 1e-9


def test_earths():
    # Polar radius and gravity of WGS 84, and the source's formula for g.
    assert WGS84.radii(np.pi / 2)[0] == pytest.approx(6_399_593.6, abs=0.1)
    assert WGS84.gravity(np.pi / 2, 0) == pytest.approx(9.8321849, abs=2e-4)
    assert SOURCE_EARTH.gravity(0.0, 1000.0) == pytest.approx(9.7803 - 0.003086)


def test_sensor_errors_have_the_size_asked_for():
    count = 200_000
    error = sensor_errors(count, 0.02, constant=3.0, white=0.5, correlation_s=1.0, seed=1)
    # White noise and Markov process, each of 0.5; the process gives about count·T/2τ = 2000 independent values.
    assert np.abs(error.mean(axis=0) - 3.0).max() < 5 * 0.5 / np.sqrt(2000)
    np.testing.assert_allclose(error.std(axis=0), 0.5 * np.sqrt(2), rtol=0.1)
    ahead = error[50:] - 3.0
    correlation = (ahead * (error[:-50] - 3.0)).mean(axis=0) / 0.25
    np.testing.assert_allclose(correlation, np.exp(-1), atol=0.15)
