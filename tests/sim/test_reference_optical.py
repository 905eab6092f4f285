"""The reference of the optical attitude sensor against published values and statements of geometry."""

from math import degrees, radians

import numpy as np
import pytest

from strapdown_sim.instrument.calibration import SET_A, SET_B, Calibration
from strapdown_sim.instrument.image import LineCamera
from strapdown_sim.reference.optical import (
    angles_of_pixels,
    attitude,
    next_exposure,
    pixels_of_angles,
    rotor_axis,
    specific_force_level,
    spot,
    thresholds,
)

CHECKS = (
    (SET_A, (2823.5, 1823.5), (17.744672, 0), (0, 0.304776, 0.952424)),
    (SET_A, (2500.25, 1200.75), (12.219285, -11.524597), (0.199789, 0.207387, 0.957640)),
    (SET_A, (3647, 3647), (30.264416, 34.042887), (-0.559813, 0.417617, 0.715685)),
    (SET_B, (2500.25, 1200.75), (12.168163, -10.853522), (0.188299, 0.207011, 0.960047)),
    (SET_B, (100.5, 3300.125), (-29.140005, 31.498975), (-0.522483, -0.415194, 0.744732)))


@pytest.mark.parametrize(("calibration", "position", "angles", "axis"), CHECKS)
def test_pixels_to_angles(calibration, position, angles, axis):
    found = angles_of_pixels(*position, calibration)
    np.testing.assert_allclose(np.degrees(found), angles, rtol=0, atol=6e-7)
    np.testing.assert_allclose(rotor_axis(*found), axis, rtol=0, atol=6e-7)


@pytest.mark.parametrize(("calibration", "angles", "position"), [
    (SET_A, (20, -15), (2960.906982, 1036.656629)), (SET_B, (20, -15), (2969.247341, 955.359198)),
    (SET_B, (-30, 25), (39.875926, 2934.649139))])
def test_angles_to_pixels(calibration, angles, position):
    np.testing.assert_allclose(pixels_of_angles(*np.radians(angles), calibration), position, rtol=0, atol=6e-7)


def test_both_directions_are_inverse():
    glass = Calibration(1823.5, 1830.25, 3.2e-4, -3.1e-4, 0.02, -0.01, 0.00456, 0.006, 0.24)
    roll, pitch = np.meshgrid(*[np.radians(np.linspace(-31, 31, 41))] * 2)
    back = angles_of_pixels(*pixels_of_angles(roll, pitch, glass), glass)
    assert np.abs(np.degrees(back) - np.degrees([roll, pitch])).max() < 1e-10
    there = pixels_of_angles(roll, pitch, glass)
    assert np.abs(np.subtract(pixels_of_angles(*angles_of_pixels(*there, glass), glass), there)).max() < 1e-10


def test_cover_glass_term():
    """The tangent of roll is w: a CCD without tilt."""
    glass = Calibration(1823.5, 1823.5, 3.2e-4, 3.2e-4, c3_r=0.00456)
    assert np.tan(angles_of_pixels(3000, 1823.5, glass)[0]) == pytest.approx(0.376723, abs=6e-7)


def test_specific_force_in_the_level_frame():
    found = specific_force_level(radians(20), radians(-15), (1, 2, -9))
    np.testing.assert_allclose(found, (2.977776, 4.957567, -7.249509), rtol=0, atol=6e-7)


def last_of_a_turn(axis, angles):
    """Attitude against a rotor axis in L, as the second update of a run that carries the axis to it."""
    # Without gravity along it, one update with k·T = 1 moves (0, 0, 1) by f × z; the rest is normalisation.
    raw = np.divide(axis, axis[2])
    f_l = np.array([-raw[1], raw[0], 0.0])
    measured = np.radians([(0, 0), angles])
    f_b = np.array([(0, 0, 0), f_l])
    return attitude(*measured.T, f_b, np.zeros(2), k=1.0, period_s=1.0)


@pytest.mark.parametrize(("angles", "wanted"), [
    ((20, -15), (21.186424, -13.283596)), ((0, 0), (1.145992, 1.719475))])
def test_attitude_against_a_tilted_axis(angles, wanted):
    found = last_of_a_turn((0.03, -0.02, 0.99935), angles)
    np.testing.assert_allclose(np.degrees([found.roll[-1], found.pitch[-1]]), wanted, rtol=0, atol=6e-7)


def four_updates(compensation):
    measured = angles_of_pixels(np.full(4, 2500.25), np.full(4, 1200.75), SET_B)
    return attitude(*measured, np.tile((2, 1, -9.7), (4, 1)), np.full(4, 0.2), k=8e-4, period_s=0.01,
                    compensation=compensation)


@pytest.mark.parametrize(("compensation", "roll", "pitch"), [
    ("none", (12.168163,) * 4, (-10.853522,) * 4),
    ("patent", (12.168163, 12.169890, 12.171618, 12.173345), (-10.853522, -10.852120, -10.850717, -10.849314)),
    ("exact", (12.168163, 12.169894, 12.171628, 12.173366), (-10.853522, -10.852137, -10.850755, -10.849377))])
def test_four_updates(compensation, roll, pitch):
    found = four_updates(compensation)
    np.testing.assert_allclose(np.degrees([found.roll, found.pitch]), [roll, pitch], rtol=0, atol=6e-7)


def test_rotor_axis_after_four_updates():
    np.testing.assert_allclose(four_updates("exact").axis[-1], (7.2353e-5, -8.9184e-5, 0.999999993), rtol=0, atol=6e-10)


def test_attitude_is_the_rotation_from_the_axis_in_the_body_to_that_in_the_level_frame():
    """Holds for each update of a run, without the formulas of the attitude."""
    rng = np.random.default_rng(4)
    measured = np.radians(rng.uniform(-25, 25, (2, 300)))
    told = attitude(*measured, rng.normal((2, -1, -9.8), 1, (300, 3)), rng.normal(0, 0.2, 300), k=0.01, period_s=0.05)
    n = rotor_axis(*measured)
    y = np.cos(told.roll) * n[:, 1] - np.sin(told.roll) * n[:, 2]
    z = np.sin(told.roll) * n[:, 1] + np.cos(told.roll) * n[:, 2]
    level = np.stack([np.cos(told.pitch) * n[:, 0] + np.sin(told.pitch) * z, y,
                      np.cos(told.pitch) * z - np.sin(told.pitch) * n[:, 0]], axis=-1)
    np.testing.assert_allclose(level, told.axis, rtol=0, atol=1e-14)
    assert np.abs(told.axis[:, :2]).max() > 0.1


def test_erection_pulls_the_axis_to_the_vertical():
    """A tilt of the told vertical decays with the time constant, or at the limit, and not in a turn."""
    at_rest = np.zeros(2_000), np.zeros(2_000)
    tilted = np.tile((0.05, 0.0, -9.80665), (2_000, 1))
    options = {"k": 0.0, "period_s": 0.1, "erection_s": 30.0}
    free = attitude(*at_rest, tilted, np.zeros(2_000), erection_limit_deg_min=1e3, **options)
    # f_Lx/g = 0.0051 rad − pitch: a first-order lag.
    assert free.pitch[300] == pytest.approx(0.05 / 9.80665 * (1 - np.exp(-1)), rel=0.01)
    slow = attitude(*at_rest, tilted, np.zeros(2_000), erection_limit_deg_min=0.01, **options)
    assert degrees(slow.pitch[600]) == pytest.approx(0.01, rel=1e-3)
    turning = attitude(*at_rest, tilted, np.full(2_000, radians(1.1)), **options)
    assert np.abs(turning.pitch).max() == 0


def gaussian(centre, *, pixels=512, sigma=6.0, peak=2800, base=100):
    return np.rint(base + peak * np.exp(-((np.arange(pixels) - centre) / sigma) ** 2 / 2)).astype(int)


def test_spot_is_the_centre_of_gravity_above_the_threshold():
    line = gaussian(200.37)
    weight = np.where(line - 100 > 700, line - 800, 0)
    found = spot(line, 100, 700, 1050)
    assert found.position == int(np.floor((weight * np.arange(512)).sum() / weight.sum() * 4096))
    assert found.found
    assert not found.several
    assert not found.edge
    assert (found.peak, found.sum, found.width) == (line.max() - 100, weight.sum(), np.count_nonzero(weight))
    assert (found.saturated, found.black) == (0, 100)


def test_spot_uses_the_largest_sum_and_the_first_of_equals():
    small, large = gaussian(100, sigma=4), gaussian(300, sigma=6)
    found = spot(small + large - 100, 100, 700, 1050)
    assert found.several
    assert found.position == 300 * 4096
    twice = spot(gaussian(100) + gaussian(300) - 100, 100, 700, 1050)
    assert (twice.position, twice.several) == (100 * 4096, True)


@pytest.mark.parametrize(("apart", "several"), [(5, False), (6, True)])
def test_spot_run_ends_after_five_dark_pixels(apart, several):
    line = np.zeros(128, int)
    line[[40, 40 + apart]] = 1000, 1001
    found = spot(line, 0, 40, 80)
    assert found.several == several
    assert found.width == (1 if several else apart + 1)


def test_spot_is_not_as_wide_as_the_largest_width():
    """Background light is no spot. A run that is cut goes on as another one."""
    line = np.zeros(2048, int)
    line[100:1123] = 1000
    assert spot(line, 0, 40, 80)[:4] == (True, 611 * 4096, 1000, 1023)
    line[1123] = 1000
    assert not spot(line, 0, 40, 80).found
    line[1124:1200] = 1000
    assert spot(line, 0, 40, 80)[:4] == (True, int(1161.5 * 4096), 1000, 76)


def test_spot_missing():
    line = np.full(128, 100)
    line[50] = 180
    assert spot(line, 100, 40, 80) == (False, 0, 0, 0, 0, 0, False, False, 100, 80, False)
    line[50] = 181
    assert spot(line, 100, 40, 80).found


def test_peak_of_a_line():
    """It counts outside of runs too, and is not negative."""
    line = np.full(128, 100)
    line[[3, 4, 90]] = 4000, 4095, 130
    assert spot(line, 90, 4000, 4000)[-2:] == (4005, True)
    assert spot(line, 4095, 40, 80)[-2:] == (0, True)


@pytest.mark.parametrize("ambient", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("gradient", [0.0, 0.1, 0.2])
def test_line_is_found_in_background_light(ambient, gradient):
    """From 1/40 to 40 times the right exposure; the rules of black level, thresholds and exposure work together."""
    for place, factor in (500, 1.0), (1500, 1 / 40), (2500, 40.0):
        camera = LineCamera(3648, ambient=ambient, gradient=gradient, prnu=0.02)
        exposure, black, levels = int(100_000 * factor), 0, thresholds(0)
        for _ in range(14):
            found = spot(camera.charge(place, exposure * 1e-9), black, *levels)
            black, levels = found.black, thresholds(found.line_peak)
            exposure = next_exposure(exposure, found.line_peak, found.line_saturated, 1_000, 7_400_000)
        assert found.position / 4096 == pytest.approx(place, abs=2)


@pytest.mark.parametrize("end", [0, 127])
def test_spot_at_an_edge(end):
    line = np.zeros(128, int)
    line[end] = 4000
    found = spot(line, 0, 40, 80)
    assert (found.edge, found.saturated, found.position) == (True, 1, end * 4096)


def test_black_is_the_least_mean_of_blocks():
    line = np.concatenate([np.full(64, 300), np.full(63, 200), [263], np.full(64, 400)])
    assert spot(line, 0, 4095, 4095).black == 200


@pytest.mark.parametrize(("peak", "wanted"), [(0, (40, 80)), (163, (40, 80)), (1000, (250, 375)), (4095, (1023, 1534))])
def test_thresholds(peak, wanted):
    assert thresholds(peak) == wanted


@pytest.mark.parametrize(("peak", "saturated", "wanted"), [
    (3900, 2, 501), (3201, 0, 876), (3200, 0, 1001), (2000, 0, 1001), (1999, 0, 1251), (650, 0, 1251), (649, 0, 2002),
    (0, 0, 2002)])
def test_next_exposure(peak, saturated, wanted):
    assert next_exposure(1001, peak, saturated, 10, 10_000) == wanted


def test_exposure_settles_in_eight_lines():
    """From 1/40 to 40 times the right one; the peak is limited by saturation."""
    for factor in np.geomspace(1 / 40, 40, 81):
        exposure = round(100_000 * factor)
        for _ in range(8):
            light = 2600 * exposure / 100_000
            exposure = next_exposure(exposure, int(min(light, 3995)), light >= 3900, 100, 10_000_000)
        assert 2_000 <= 2600 * exposure / 100_000 <= 3_200


def test_exposure_stays_in_its_range():
    assert next_exposure(100, 3900, 1, 80, 1000) == 80
    assert next_exposure(800, 0, 0, 80, 1000) == 1000
