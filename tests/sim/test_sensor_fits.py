"""Fits of the errors of sensors against errors that are known."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.cores import FLIGHT_6AXIS
from strapdown_sim.magnetometer import directions
from strapdown_sim.recordings import STANDARD_GRAVITY, read_recording
from strapdown_sim.sensor_fits import (
    NO_ELLIPSOID,
    FitError,
    at_rest,
    fit_accelerometer,
    fit_ellipsoid,
    fit_gyro,
    fit_magnetometer,
)
from strapdown_sim.stimuli.turns import EDGES, SIDES, STRENGTH_UT, TURNS, Turn, X, Y, Z, turned_by_hand, with_error
from strapdown_sim.truth import flight_filter

pytest.importorskip("scipy", reason="scipy is not installed, so nothing can be fitted.")

SOFT = np.array([[1.05, 0.02, -0.01], [0.02, 0.97, 0.03], [-0.01, 0.03, 0.99]])
SOFT /= np.cbrt(np.linalg.det(SOFT))
HARD = 6.0, -4.0, 9.0
SCALES = np.array([[1.01, 0.002, -0.004], [0.002, 0.985, 0.003], [-0.004, 0.003, 1.005]])
OFFSET = 0.1, -0.2, 0.15


def misses(fit, bias, matrix):
    """Errors of the nine parameters, in standard deviations."""
    upper = np.triu_indices(3)
    return np.concatenate([(fit.bias - bias) / fit.bias_deviation,
                           (fit.matrix - matrix)[upper] / fit.matrix_deviation[upper]])


def test_hard_and_soft_iron():
    """Errors as large as their deviations, which are those of 0.3 µT in some hundred directions."""
    found = [fit_magnetometer(with_error(turned_by_hand(TURNS, rate_hz=50, seed=seed), "magnetometer", HARD, SOFT))
             for seed in range(4)]
    every = np.array([misses(fit, HARD, SOFT) for fit in found])
    assert 0.6 < np.sqrt(np.mean(every**2)) < 1.5
    assert np.abs(every).max() < 4.5
    for fit in found:
        np.testing.assert_allclose(fit.matrix, fit.matrix.T)
        assert fit.magnitude == pytest.approx(STRENGTH_UT, abs=0.1)
        assert fit.residual == pytest.approx(0.3 / STRENGTH_UT, rel=0.1)
        assert fit.bias_deviation.max() < 0.05
        assert not fit.diagonal


def test_bias_and_matrix_of_the_accelerometer():
    """Rests on sides and edges. Deviations come from four directions more than parameters: half of the errors are below
    0.74 of them, as Student's distribution says."""
    recordings = [turned_by_hand((*SIDES, *EDGES), rate_hz=50, seed=seed) for seed in range(4)]
    found = [fit_accelerometer(with_error(recording, "accelerometer", OFFSET, SCALES)) for recording in recordings]
    every = np.array([misses(fit, OFFSET, SCALES) for fit in found])
    assert 0.3 < np.median(np.abs(every)) < 1.5
    for fit in found:
        # A rest has some 30 samples of 0.02 m/s².
        np.testing.assert_allclose(fit.bias, OFFSET, atol=6 * 0.02 / np.sqrt(30))
        np.testing.assert_allclose(fit.matrix, SCALES, atol=6 * 0.002 / np.sqrt(30))
        assert fit.magnitude == STANDARD_GRAVITY


def test_six_sides_tell_bias_and_scales():
    scales = np.diag([1.01, 0.985, 1.005])
    fit = fit_accelerometer(with_error(turned_by_hand(SIDES), "accelerometer", OFFSET, scales))
    assert fit.diagonal
    assert fit.bias_deviation is None
    np.testing.assert_allclose(fit.bias, OFFSET, atol=0.01)
    np.testing.assert_allclose(fit.matrix, scales, atol=0.001)


def test_bias_of_the_gyro():
    """White noise of 0.1 deg/s: 0.1/√n after n samples, and the deviation says so."""
    for seed in range(4):
        fit = fit_gyro(with_error(turned_by_hand([Turn(Z, 0, 30), Turn(X, 90, 30)], seed=seed), "gyro",
                                  (0.5, -0.3, 0.2)))
        assert fit.rests == 2
        assert 45 < fit.rest_s < 60
        noise = 0.1 / np.sqrt(100 * fit.rest_s)
        assert np.abs(fit.bias - (0.5, -0.3, 0.2)).max() < 4 * noise
        assert np.all((fit.bias_deviation > noise / 2) & (fit.bias_deviation < 4 * noise))


def test_rests_that_differ_raise_the_deviation():
    """A bias that changes between rests is not known better than by half of its change."""
    recording = turned_by_hand([Turn(Z, 0, 20), Turn(X, 90, 20)])
    drift = np.where(recording.time_s > 20, 0.2, 0.0)[:, None]
    fit = fit_gyro(replace(recording, gyro_deg_s=recording.gyro_deg_s + drift))
    np.testing.assert_allclose(fit.bias_deviation, 0.1, atol=0.01)


def test_a_steady_turn_is_no_rest():
    """The second rest turns by 1 deg/s, which the deviations from running means do not show."""
    recording = turned_by_hand([Turn(Z, 0, 20), Turn(X, 90, 12)])
    turn = np.where(recording.time_s > 20, 1.0, 0.0)[:, None] * (0, 0, 1)
    fit = fit_gyro(replace(recording, gyro_deg_s=recording.gyro_deg_s + turn))
    assert fit.rests == 1
    assert np.abs(fit.bias).max() < 0.02


def test_rest_has_no_more_weight_than_motion():
    """An hour of rest on one side, as a thousand repeats of its samples, with a field that is wrong there."""
    samples = with_error(turned_by_hand(TURNS), "magnetometer", HARD, SOFT).mag
    alone = fit_ellipsoid(samples)
    rest = np.repeat(samples[:1], 50_000, axis=0) + 0.3 * np.random.default_rng(5).standard_normal((50_000, 3))
    together = fit_ellipsoid(np.concatenate([samples, rest]))
    np.testing.assert_allclose(together.bias, alone.bias, atol=0.1)
    np.testing.assert_allclose(together.matrix, alone.matrix, atol=0.003)


def test_spikes_are_left_out():
    recording = with_error(turned_by_hand(TURNS), "magnetometer", HARD, SOFT)
    spiked = recording.mag.copy()
    spiked[::97] = (200.0, -150.0, 300.0)
    fit = fit_magnetometer(replace(recording, mag=spiked))
    np.testing.assert_allclose(fit.bias, HARD, atol=0.1)
    np.testing.assert_allclose(fit.matrix, SOFT, atol=0.003)


@pytest.mark.parametrize("offset", [(150.0, 0, 0), (-40, 60, 100)])
def test_hard_iron_larger_than_the_field(offset):
    fit = fit_magnetometer(with_error(turned_by_hand(TURNS), "magnetometer", offset, SOFT))
    np.testing.assert_allclose(fit.bias, offset, atol=0.1)


@pytest.mark.parametrize("bias", [(0, 0, 0), (0.7, -1.0, 0.5)])
def test_rests_are_those_of_the_flight_filter(bias):
    """The definition is the same; the filter knows the gravity of its attitude, and differs where a rest begins."""
    recording = with_error(turned_by_hand(SIDES, rate_hz=50), "gyro", bias)
    config = FLIGHT_6AXIS.replace(sample_rate_hz=50)
    status = flight_filter(config).run(recording.accel, None, recording.gyro_deg_s).status
    found = at_rest(recording)
    assert found.sum() > 200
    assert np.mean(found != status["at_rest"]) < 0.01


MISSING = "of 150 directions, which do not tell its errors: the sensor was turned by"


@pytest.mark.parametrize(("turns", "message"), [
    ([Turn(Z, 360), Turn(Z, 360)], f"{MISSING} 120° about x, 120° about y and 360° about z; turn it by full turns "
                                   "about x and y too"),
    ([Turn(X, 360), Turn(X, 360)], "turn it by full turns about y and z too"),
    ([Turn(X, 5), Turn(Y, 10)], "turn it by full turns about x, y and z too")])
def test_directions_that_do_not_tell(turns, message):
    with pytest.raises(FitError) as raised:
        fit_magnetometer(with_error(turned_by_hand(turns), "magnetometer", (4, 2, 9)))
    assert message in str(raised.value)


@pytest.mark.filterwarnings("error")
def test_a_sensor_that_says_one_value():
    """Its only sample is also the middle of its samples, which has no direction from there."""
    lying = turned_by_hand([Turn(Z, 0, 10)], mag_noise_ut=0)
    with pytest.raises(FitError) as raised:
        fit_magnetometer(lying)
    assert str(raised.value) == ("the field came from one direction, which does not tell its errors; turn the sensor "
                                 "by full turns about x, y and z")


def test_refusals():
    rotating = turned_by_hand([Turn(Z, 360), Turn(X, 360)])
    for fit, recording, message in (
            (fit_magnetometer, replace(rotating, mag=None), "the recording has no magnetometer"),
            (fit_magnetometer, replace(rotating, mag=np.where(rotating.time_s[:, None] < 0.08, rotating.mag, 0)),
             "7 samples are too few"),
            (fit_gyro, rotating, "there is no rest that is long enough; let the sensor lie still for 10 s"),
            (fit_accelerometer, turned_by_hand(SIDES[:3]), "3 attitudes at rest do not tell its errors; let the sensor "
             "rest for 6 s on each of its six sides, and on three edges for a full matrix"),
            (fit_accelerometer, turned_by_hand([Turn(Z, 0, 6)]), "one attitude at rest does not tell its errors; let "
             "the sensor rest for 6 s on each of its six sides, and on three edges for a full matrix"),
            (fit_accelerometer, rotating, "it was never at rest; let the sensor rest for 6 s on each of its six "
             "sides, and on three edges for a full matrix")):
        with pytest.raises(FitError) as raised:
            fit(recording)
        assert str(raised.value) == message


def test_a_magnet_that_is_taken_away(shared_recordings):
    """The magnet is on the sensor from 8 to 62 s: alone, this time is on an ellipsoid; with the rest it is on none."""
    path = shared_recordings / "broad_34_disturbed_attached_magnet_3cm.npz"
    with pytest.raises(FitError) as raised:
        fit_magnetometer(read_recording(path))
    assert str(raised.value) == NO_ELLIPSOID
    fit = fit_magnetometer(read_recording(path, start_s=12, stop_s=60))
    clean = fit_magnetometer(read_recording(shared_recordings / "broad_02_undisturbed_slow_rotation_B.npz"))
    assert np.linalg.norm(fit.bias) == pytest.approx(14, abs=1)
    assert np.linalg.norm(clean.bias) < 0.6
    # The same room and the same sensor.
    assert fit.magnitude == pytest.approx(clean.magnitude, rel=0.01)
    assert fit.residual == pytest.approx(clean.residual, rel=0.2)
    assert directions(read_recording(path, start_s=12, stop_s=60).mag - fit.bias).cells == pytest.approx(
        fit.directions, abs=2)
