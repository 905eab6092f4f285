"""The kernel of the optical attitude sensor: check values of its specification, and the independent reference."""

import numpy as np
import pytest

from strapdown.algorithms import optical
from strapdown.cores import OPTICAL_ERECTED, OPTICAL_TCD1304, counted, opt_attitude, opt_update, placed
from strapdown.kernel.numeric import Float64
from strapdown_sim.instrument.calibration import SET_A, SET_B
from strapdown_sim.reference.optical import angles_of_pixels, attitude, pixels_of_angles

XP = Float64()
RNG = np.random.default_rng(14)
HALF_OF_THE_LAST_DIGIT = 5e-7
EXACT, PATENT, NONE = (OPTICAL_TCD1304.replace(compensation=name) for name in ("exact", "patent", "none"))


def bound(system, calibration, **values):
    """Inputs of a system for a Calibration of the simulator; those that it lacks are left out."""
    pairs = {name: [getattr(calibration, f"{name}_{ccd}") for ccd in "rp"] for name in ("n0", "scale", "tilt", "c3")}
    values |= pairs | {"h": calibration.h, "k": calibration.k}
    return system.bind(**{name: values[name] for name in system.inputs})


def light(calibration, px):
    """The Light of positions, shape (2, ...)."""
    w = [optical.slope(px[index], getattr(calibration, f"n0_{ccd}"), getattr(calibration, f"scale_{ccd}"),
                       getattr(calibration, f"c3_{ccd}")) for index, ccd in enumerate("rp")]
    return optical.light(XP, w, (calibration.tilt_r, calibration.tilt_p), calibration.h)


@pytest.mark.parametrize(("calibration", "px", "angles", "axis"), [
    (SET_A, (2823.5, 1823.5), (17.744672, 0), (0, 0.304776, 0.952424)),
    (SET_A, (2500.25, 1200.75), (12.219285, -11.524597), (0.199789, 0.207387, 0.957640)),
    (SET_A, (3647, 3647), (30.264416, 34.042887), (-0.559813, 0.417617, 0.715685)),
    (SET_B, (2500.25, 1200.75), (12.168163, -10.853522), (0.188299, 0.207011, 0.960047)),
    (SET_B, (100.5, 3300.125), (-29.140005, 31.498975), (-0.522483, -0.415194, 0.744732))])
def test_measured_angles_and_rotor_axis_are_the_check_values(calibration, px, angles, axis):
    seen = light(calibration, px)
    assert np.degrees(optical.measured_angles(XP, seen)) == pytest.approx(angles, abs=HALF_OF_THE_LAST_DIGIT)
    told = np.array((-seen.A, seen.B * seen.a / seen.r, seen.B * seen.b / seen.r))
    assert told / np.linalg.norm(told) == pytest.approx(axis, abs=HALF_OF_THE_LAST_DIGIT)


def test_the_cubic_correction_is_the_check_value():
    assert optical.slope(3000, 1823.5, 3.2e-4, 0.00456) == pytest.approx(0.376723, abs=HALF_OF_THE_LAST_DIGIT)


def test_specific_force_in_the_level_frame_is_the_check_value():
    roll, pitch = (optical.Turn(np.sin(angle), np.cos(angle)) for angle in np.radians((20, -15)))
    assert optical.level((1, 2, -9), roll, pitch) == pytest.approx((2.977776, 4.957567, -7.249509),
                                                                   abs=HALF_OF_THE_LAST_DIGIT)


@pytest.mark.parametrize(("measured", "angles"), [((20, -15), (21.186424, -13.283596)), ((0, 0), (1.145992, 1.719475))])
def test_angles_of_a_rotor_axis_are_the_check_values(measured, angles):
    seen = light(SET_A, pixels_of_angles(*np.radians(measured), SET_A))
    axis = np.array((0.03, -0.02, 0.99935))
    told, turns = optical.angles_of_rotor(XP, seen, axis / np.linalg.norm(axis))
    assert np.degrees(told) == pytest.approx(angles, abs=HALF_OF_THE_LAST_DIGIT)
    expected = [turn(angle) for angle in told for turn in (np.sin, np.cos)]
    assert np.ravel(turns) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(("config", "angles"), [
    (PATENT, ((12.168163, -10.853522), (12.169890, -10.852120), (12.171618, -10.850717), (12.173345, -10.849314))),
    (EXACT, ((12.168163, -10.853522), (12.169894, -10.852137), (12.171628, -10.850755), (12.173366, -10.849377))),
    (NONE, 4 * ((12.168163, -10.853522),))], ids=lambda value: getattr(value, "compensation", ""))
def test_four_updates_are_the_check_values(config, angles):
    system = opt_attitude(config.replace(sensor_clock_hz=2e6, line_clocks=20_000))
    px = np.tile((2500.25, 1200.75), (4, 1))
    result, state = system.run_float64(bound(system, SET_B, px=px, f=(2, 1, -9.7), yaw_rate=0.2))
    assert system.read(result)["angles"] == pytest.approx(np.array(angles), abs=HALF_OF_THE_LAST_DIGIT)
    if config is EXACT:
        assert [state[word] for word in ("nx", "ny", "nz")] == pytest.approx(
            (7.2353e-5, -8.9184e-5, 0.999999993), abs=5e-10)


def test_the_angles_of_the_next_update_are_expected():
    """With the rotor at rest: the first update moves nothing on, the later ones by the last change of their angles."""
    system, angles = opt_attitude(EXACT), np.radians([(10, -20), (10.2, -20.3), (10.5, -20.2)])
    px = np.stack(pixels_of_angles(*angles.T, SET_A), axis=-1)
    for count, expected in (1, angles[0]), (2, 2 * angles[1] - angles[0]), (3, 2 * angles[2] - angles[1]):
        _, state = system.run_float64(bound(system, SET_A, px=px[:count], f=(0, 0, 0), yaw_rate=0))
        found = [[state[f"{turn}_{axis}"] for turn in ("sine", "cosine")] for axis in ("roll", "pitch")]
        # To the first order: half the square of a change of 0.3° is 1.4e-5.
        assert np.array(found) == pytest.approx(np.stack((np.sin(expected), np.cos(expected)), axis=-1),
                                                abs=1e-12 if count == 1 else 1.4e-5)


def flight(count):
    """A run with turns: positions, specific force and yaw rate; the axis of the rotor is drawn away by degrees."""
    t = np.arange(count) / 135
    measured = np.radians([25 * np.sin(0.9 * t) + RNG.normal(0, 0.01, count), 20 * np.cos(0.6 * t)])
    f = np.stack([3 * np.sin(0.2 * t), 4 + np.cos(0.3 * t), -9.8 + np.sin(2 * t)], axis=-1)
    yaw_rate = np.where(t % 8 < 4, 0.15, 0.01)
    return measured, np.stack(pixels_of_angles(*measured, SET_B), axis=-1), f, yaw_rate


@pytest.mark.parametrize("config", [EXACT, PATENT, NONE, OPTICAL_ERECTED],
                         ids=lambda config: f"{config.name}-{config.compensation}")
def test_a_run_is_that_of_the_reference_and_the_twin_is_near(config):
    measured, px, f, yaw_rate = flight(1500)
    system = opt_attitude(config)
    inputs = bound(system, SET_B, px=px, f=f, yaw_rate=yaw_rate)
    result = system.read(system.run_float64(inputs)[0])
    expected = attitude(*measured, f, yaw_rate, k=SET_B.k, period_s=config.period_s, compensation=config.compensation,
                        erection_s=config.erection_s)
    assert np.abs(result["measured"] - np.degrees(angles_of_pixels(*px.T, SET_B)).T).max() < 1e-10
    angles = np.degrees((expected.roll, expected.pitch)).T
    assert np.abs(result["angles"] - angles).max() < 1e-8
    assert config is NONE or np.abs(angles - result["measured"]).max() > 1
    twin = system.read(system.run(config.engine_pool, inputs)[0])
    for name in "angles", "measured":
        assert np.abs(twin[name] - result[name]).max() < 0.0005


@pytest.mark.parametrize("config", [EXACT, PATENT, NONE, OPTICAL_ERECTED],
                         ids=lambda config: f"{config.name}-{config.compensation}")
def test_the_update_of_the_whole_takes_integers_and_sums(config):
    count = 200
    _, px, f, yaw_rate = flight(count)
    position = np.round(px * 4096).astype(int)
    samples = np.full(count, 37)
    samples[100:] = 0
    f[100:], yaw_rate[100:] = 0, 0
    alone, whole = opt_attitude(config), opt_update(config)
    expected = alone.read(alone.run_float64(bound(alone, SET_B, px=position / 4096, f=f, yaw_rate=yaw_rate))[0])
    result = whole.read(whole.run_float64(bound(
        whole, SET_B, position=placed(position), counted_peak=counted((2500, 1700)), cycles=counted(12_345),
        samples=counted(samples), f=samples[:, None] * f, yaw_rate=samples * yaw_rate))[0])
    for name in "angles", "measured":
        assert np.abs(result[name] - expected[name]).max() < 1e-10
    assert (result["px"] == position / 4096).all()
    assert (result["peak"] == (2500, 1700)).all()
    assert result["exposure"] == pytest.approx(123.45)


def test_a_spot_that_was_never_seen_stands_at_angle_zero():
    system = opt_update(EXACT)
    result = system.read(system.update_float64(bound(
        system, SET_B, position=placed((-1, -4096)), counted_peak=counted((0, 0)), cycles=counted(1000),
        samples=counted(0), f=(0, 0, 0), yaw_rate=0), system.reset))
    assert result["px"].tolist() == [SET_B.n0_r, SET_B.n0_p]
    assert np.abs(np.concatenate((result["angles"], result["measured"]))).max() < 1e-13


def test_angles_do_not_move_on_from_a_spot_that_was_never_seen():
    """Samples do not count until both spots were seen in the line before."""
    system, px = opt_update(EXACT), np.array((2500.25, 1200.75))
    seen = placed(np.stack(((-1, -1), 4096 * px)).astype(int))
    _, state = system.run_float64(bound(
        system, SET_A, position=seen, counted_peak=counted((0, 0)), cycles=counted(1000),
        samples=counted((0, 0)), f=(0, 0, 0), yaw_rate=0))
    roll, pitch = angles_of_pixels(*px, SET_A)
    found = [state[f"{turn}_{axis}"] for axis in ("roll", "pitch") for turn in ("sine", "cosine")]
    assert found == pytest.approx([np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)], abs=1e-12)
