"""The physics of the optical instrument: statements of mechanics and optics, and the sensor's equations against it."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from strapdown_sim.instrument.errors import InstrumentError
from strapdown_sim.instrument.flights import FLIGHTS, GRAVITY_M_S2, Flight, Pulse, Wave, body_from_level
from strapdown_sim.instrument.gyro import Gyro
from strapdown_sim.instrument.observation import observe
from strapdown_sim.instrument.rays import Instrument, LineSeat, measured_angles
from strapdown_sim.reference.optical import angles_of_pixels, attitude, pixels_of_angles, rotor_axis

pytest.importorskip("scipy", reason="scipy is not installed, so the gyro cannot be integrated.")

GRID = np.meshgrid(*[np.radians(np.linspace(-31, 31, 31))] * 2)


# Flights

def test_pulse_returns_to_zero_and_is_the_slope_of_its_integral():
    pulse = Pulse(5, 20, 2, 3.0)
    np.testing.assert_allclose(pulse.value([5, 6, 7, 20, 23, 24, 25, 30]), [0, 1.5, 3, 3, 3, 1.5, 0, 0], atol=1e-12)
    time_s = np.linspace(0, 30, 301)
    slope = (pulse.integral(time_s + 1e-4) - pulse.integral(time_s - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope, pulse.value(time_s), atol=1e-6)
    assert pulse.integral(30) == pytest.approx(3 * 18)


def test_accelerometer_of_the_level_frame_and_of_the_body():
    rest = Flight("rest", 1, roll=(Wave(0.3, 0.0, np.pi / 2),), pitch=(Wave(0.2, 0.0, np.pi / 2),)).at(0.5)
    # At rest the specific force is one g upwards: nose up, it has a part along x; right side down, a part along −y.
    np.testing.assert_allclose(rest.f_b, GRAVITY_M_S2 * np.array(
        [np.sin(0.2), -np.sin(0.3) * np.cos(0.2), -np.cos(0.3) * np.cos(0.2)]), rtol=1e-14)


def test_turns_are_coordinated():
    turn = FLIGHTS["c"]
    middle = turn.at(35.0)
    assert np.degrees(middle.roll) == pytest.approx(23, abs=0.2)
    assert middle.f_b[1] == pytest.approx(0, abs=1e-12)
    assert middle.f_l[1] == pytest.approx(40 * np.radians(6))
    assert np.degrees(turn.at(75.0).heading) == pytest.approx(342)


def test_lines_have_means_over_their_periods():
    lines = FLIGHTS["f"].lines(10.0)
    fine = FLIGHTS["f"].at((np.arange(20_000) + 0.5) / 2_000)
    np.testing.assert_allclose(lines.f_b[:100], fine.f_b.reshape(100, 200, 3).mean(axis=1), atol=1e-6)
    assert lines.time_s[0] == 0.1
    assert lines.roll[99] == pytest.approx(FLIGHTS["f"].at(10.0).roll)
    turn = FLIGHTS["c"].lines(1.0)
    np.testing.assert_allclose(turn.yaw_rate, np.diff(FLIGHTS["c"].at(np.arange(76)).heading), atol=1e-5)


# Gyro

def test_precession_by_gravity():
    """A tilted axis turns about the vertical once in 801 s, from north to west."""
    tilted = Gyro().axis(Flight("rest", 10), [10.0], start=(np.sin(0.1), 0, np.cos(0.1)))[0]
    assert np.arctan2(tilted[1], tilted[0]) == pytest.approx(-2 * np.pi * 10 / 801, rel=1e-3)
    assert tilted[2] == pytest.approx(np.cos(0.1), abs=1e-9)
    above = Gyro(arm_m=-1e-4).axis(Flight("rest", 10), [10.0], start=(np.sin(0.1), 0, np.cos(0.1)))[0]
    assert above[1] == pytest.approx(-tilted[1], rel=1e-3)
    assert Gyro(arm_m=-1e-4, spin_kg_m2_s=-0.05).k == Gyro().k == pytest.approx(8e-4)


def test_nutation():
    """After a sudden acceleration the axis draws loops: with the frequency H/I, and as high as precession predicts."""
    gyro = Gyro()
    assert gyro.nutation_hz == pytest.approx(39.8, abs=0.05)
    time_s = np.arange(1, 2001) / 2_000
    axis = gyro.axis(Flight("jolt", 1, forward=(Pulse(0.1, 10, 1e-4, 3.0),)), time_s)
    # Precession is along −y; across it the loops have the height 2·k·f·I/H. The spline of the forces overshoots.
    assert np.ptp(axis[time_s > 0.2, 1] + gyro.k * 3 * (time_s[time_s > 0.2] - 0.1)) < 1e-4
    loops = axis[:, 0]
    assert np.ptp(loops[time_s < 0.12]) == pytest.approx(2 * gyro.k * 3 * 2e-4 / 0.05, rel=0.1)
    spectrum = np.abs(np.fft.rfft(np.diff(loops[200:], prepend=loops[199])))
    assert np.fft.rfftfreq(1800, 1 / 2_000)[spectrum.argmax()] == pytest.approx(39.8, abs=1.2)


def test_drift_is_in_inertial_space():
    drift = np.radians(0.2) / 60
    turning = Flight("turn", 15, turns=(Pulse(0, 15, 1, np.radians(90) / 14),))
    axis = Gyro(arm_m=0.0, drift_rad_s=drift).axis(turning, [15.0])[0]
    # 90° to the right: what pointed north is now on the left.
    np.testing.assert_allclose(axis[:2], [drift * 15, -drift * 15], rtol=1e-3)


def test_gyro_without_scipy(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    with pytest.raises(InstrumentError) as raised:
        Gyro().axis(FLIGHTS["a"], [1.0])
    assert str(raised.value) == "the gyro needs the package scipy: pip install 'strapdown[optical]'"


# Rays

def test_closed_form_equals_the_rays():
    placed = Instrument(LineSeat(tilt=0.02), LineSeat(distance_mm=25.5, n0=1830.25, tilt=-0.01, aside_mm=0.24 * 25.5))
    for instrument in Instrument(), placed:
        position = instrument.pixels(rotor_axis(*GRID))
        words = instrument.calibration()
        assert np.abs(np.degrees(np.subtract(angles_of_pixels(*position, words), GRID))).max() < 1e-10
        assert np.abs(np.subtract(pixels_of_angles(*GRID, words), position)).max() < 1e-10


def test_gimbal_angles_are_those_of_the_axis():
    assert np.abs(np.subtract(measured_angles(rotor_axis(*GRID)), GRID)).max() < 1e-14


def test_roll_is_blind_to_pitch_and_pitch_needs_roll():
    """With the numbers of source 004's correction: 0.15° at 10°/10°, 3.4° at 30°/30°."""
    instrument = Instrument()
    for degrees, wrong in (10, 0.15), (30, 3.4):
        angle = np.radians(degrees)
        roll, pitch = angles_of_pixels(*instrument.pixels(rotor_axis(angle, angle)), instrument.calibration())
        p_pitch = instrument.pixels(rotor_axis(angle, angle))[1]
        alone = angles_of_pixels(1823.5, p_pitch, instrument.calibration())[1]
        assert roll == pytest.approx(angle, abs=1e-12)
        assert abs(np.degrees(alone - pitch)) == pytest.approx(wrong, rel=0.03)


def test_turned_sheets_of_light():
    """A turn by ζ adds ζ·sin θ to roll and −ζ·sin γ to pitch, to first order."""
    turn, words = np.radians(0.2), Instrument().calibration()
    for roll, pitch in np.radians([(0, 30), (30, 0), (-20, 20)]):
        turned = Instrument(LineSeat(turn=turn), LineSeat(turn=turn)).pixels(rotor_axis(roll, pitch))
        found = np.subtract(angles_of_pixels(*turned, words), (roll, pitch))
        assert found == pytest.approx([turn * np.sin(pitch), -turn * np.sin(roll)], rel=0.25, abs=1e-5)


def test_cover_glass_is_a_cubic_term():
    """0.7 mm make 0.015° at 30° with the best scale, and 0.0006° with the cubic term too."""
    angle = np.radians(np.linspace(-30, 30, 61))
    glass = LineSeat(glass_mm=0.7)
    position = Instrument(glass, glass).pixels(rotor_axis(angle, 0))[0] - 1823.5
    words = Instrument().calibration()
    for columns, left in ((position,), 0.015), ((position, position**3), 0.0006):
        scale, *cubic = np.linalg.lstsq(np.stack(columns, axis=-1), np.tan(angle))[0]
        fitted = replace(words, scale_r=scale, c3_r=cubic[0] / scale**3 if cubic else 0.0)
        error = np.degrees(angles_of_pixels(position + 1823.5, 1823.5, fitted)[0] - angle)
        assert 0.7 * left < np.abs(error).max() <= left
    assert fitted.c3_r == pytest.approx(0.00456, rel=0.01)


# The sensor's equations in flight

@pytest.mark.parametrize(("letter", "none", "exact"), [
    ("b", (0.903, 2.602), (0.0005, 0.0001)), ("d", (2.619, 1.506), (0.0005, 0.0007)), ("e", (0.0, 0.0), (0.0011, 0.0))])
def test_errors_in_flight(letter, none, exact):
    """Largest errors of roll and pitch, degrees, as published; published digits end at 0.0001°."""
    seen = observe(FLIGHTS[letter])
    lines, words = seen.lines, Instrument().calibration(Gyro().k)
    measured = angles_of_pixels(seen.roll_px, seen.pitch_px, words)
    for compensation, wanted in ("none", none), ("exact", np.add(np.multiply(exact, 4 / 3), 5e-5)):
        told = attitude(*measured, lines.f_b, lines.yaw_rate, k=words.k, period_s=0.01, compensation=compensation)
        largest = np.degrees([np.abs(told.roll - lines.roll).max(), np.abs(told.pitch - lines.pitch).max()])
        if compensation == "none":
            np.testing.assert_allclose(largest, wanted, rtol=0.1, atol=1e-4)
        else:
            assert (largest <= wanted).all()


def test_centre_of_mass_above_the_pivot():
    """The signs of k and of the rotor's precession belong together."""
    seen = observe(replace(FLIGHTS["a"], duration_s=20), gyro=Gyro(arm_m=-1e-4), rate_hz=50)
    lines = seen.lines
    told = attitude(seen.roll, seen.pitch, lines.f_b, lines.yaw_rate, k=-8e-4, period_s=0.02)
    assert np.degrees(np.abs(seen.roll).max()) > 1.5
    assert np.degrees(np.abs(told.roll).max()) < 0.001


def test_axis_in_the_body():
    axis = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(body_from_level(axis, 0.3, 0.2), rotor_axis(0.3, 0.2), atol=1e-15)
