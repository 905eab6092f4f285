"""The navigation kernel in float64 against the reference navigator and the truth."""

from functools import partial
from itertools import product

import numpy as np
import pytest

from strapdown.algorithms import sins
from strapdown.cores import SINS, SINS_DAMPED, sins_top
from strapdown.kernel.numeric import Float64
from strapdown.kernel.system import leaves
from strapdown_sim.errors import quaternion_from_matrix, rotation_angle
from strapdown_sim.reference.sins import Navigator, coarse_alignment, platform_from_geodetic, rest_errors, rotation
from strapdown_sim.stimuli.flight import SOURCE_EARTH, Change, Flight, at_rest
from strapdown_sim.stimuli.pole import DISTANCES_DEG

RNG = np.random.default_rng(2)
FLIGHT = Flight(
    duration_s=300, latitude_deg=45.75, longitude_deg=126.65, height_m=3000, track_deg=30, speed_m_s=200,
    angle_of_attack_deg=2, changes=(Change("track_deg", 10, 60, 80), Change("climb_deg", 60, 20, 5),
                                    Change("speed_m_s", 100, 60, -60), Change("track_deg", 150, 120, -200)))


def quaternion(c_b2n):
    """Quaternion of a matrix, by the eigenvector of its trace form."""
    c = np.asarray(c_b2n)
    form = np.zeros((4, 4))
    form[0, 0] = np.trace(c)
    form[0, 1:] = form[1:, 0] = c[2, 1] - c[1, 2], c[0, 2] - c[2, 0], c[1, 0] - c[0, 1]
    form[1:, 1:] = c + c.T - np.trace(c) * np.eye(3)
    return np.linalg.eigh(form)[1][:, -1]


ZERO = {"omega": np.zeros(3), "f": np.zeros(3), "load": 0.0, "align": 0.0, "place": np.zeros(2), "start_v": np.zeros(3),
        "start_h": 0.0, "start_q": np.zeros(4), "altitude": 0.0}


def bound(system, **values):
    """Inputs of updates; zero by default."""
    values = ZERO | values
    return system.bind(**{name: values[name] for name in system.inputs})


def loaded(system, omega, f, **start):
    """Inputs of updates from samples, shapes (N, ..., 3); the first update loads a start."""
    load = np.zeros((len(omega), *(1 for _ in omega.shape[1:-1])))
    load[0] = 1.0
    return bound(system, omega=omega, f=f, load=load, **start)


@pytest.mark.parametrize("config", [SINS, SINS_DAMPED], ids=lambda config: config.name)
def test_kernel_is_within_a_millionth_of_the_reference_and_near_the_truth(config):
    config = config.model_copy(update={"sample_rate_hz": 10.0})
    omega_b, f_b, truth = FLIGHT.sample(config.period_s)
    # A short flight from the same start gives the attitude at its beginning.
    before = Flight(1, track_deg=FLIGHT.track_deg, speed_m_s=200, angle_of_attack_deg=2).sample(1)[2]
    system = sins_top(config)
    latitude, longitude = np.radians(FLIGHT.latitude_deg), np.radians(FLIGHT.longitude_deg)
    # The sample with the load is the first sample of the flight, one period too early.
    omega, force, altitude = (np.concatenate([values[:1], values]) for values in (omega_b, f_b, truth.height_m))
    result, _ = system.run_float64(loaded(
        system, omega, force, altitude=altitude, place=(FLIGHT.latitude_deg, FLIGHT.longitude_deg),
        start_h=FLIGHT.height_m, start_v=before.velocity_m_s[0], start_q=quaternion(before.c_b2n[0])))
    told_by_kernel = {name: values[-1] for name, values in system.read(result).items()}
    navigator = Navigator(SOURCE_EARTH, config.period_s, before.c_b2n[0], platform_from_geodetic(latitude, longitude),
                          before.velocity_m_s[0], np.float64(FLIGHT.height_m), damping_s=config.damping_s or None)
    for k in range(len(omega_b)):
        navigator.step(omega_b[k], f_b[k], truth.height_m[k])
    told = navigator.navigation()
    radius, distance = SOURCE_EARTH.radius_m, FLIGHT.distance()
    kernel = np.radians(told_by_kernel["position"])
    assert abs(kernel[0] - told.latitude) * radius < 1e-6 * distance
    assert abs(kernel[1] - told.longitude) * radius < 1e-6 * distance
    assert abs(told_by_kernel["height"] - told.height_m) < 1e-6 * distance
    # A millionth of the distance over the earth's radius is 1e-8 rad; a tilt makes a position error of g·t²/2.
    np.testing.assert_allclose(np.radians(told_by_kernel["attitude"]), told[:3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(told_by_kernel["velocity"], told.velocity_m_s, rtol=0, atol=1e-4)
    # Both are close to the true position, at a fifth of the source's rate.
    assert abs(kernel[0] - truth.latitude[-1]) * radius < 1
    assert abs(kernel[1] - truth.longitude[-1]) * radius < 1


def test_schuler_oscillation_and_growth():
    # Lanes: a gyro bias of 0.05 deg/h about north, a tilt of 0.01 degrees about north; at 45 degrees, heading north.
    config = SINS_DAMPED.model_copy(update={"sample_rate_hz": 0.5, "rate_max_deg_s": 50.0})
    system, latitude = sins_top(config), np.radians(45)
    omega_b, f_b, _ = at_rest(5000, latitude_deg=45).sample(2.0)
    bias, tilt = np.radians(0.05) / 3600, np.radians(0.01)
    # Computed (I − [φ×]): the platform appears rotated by −φ.
    start_q = np.array([(1, 0, 0, 0), (np.cos(tilt / 2), 0, -np.sin(tilt / 2), 0)])
    rates = np.concatenate([[omega_b[:1, None].repeat(2, axis=1)[0]], omega_b[:, None] + [(0, bias, 0), (0, 0, 0)]])
    force = np.concatenate([f_b[:1], f_b])[:, None]
    result, _ = system.run_float64(loaded(system, rates, force, place=(45.0, 0.0), start_q=start_q))
    east = np.stack([result["out_veast"], np.radians(result["out_longitude"])], axis=1)  # time, quantity, lane
    measured = east[250::250]
    times = 500.0 * np.arange(1, len(measured) + 1)
    for lane, error in enumerate(({"gyro_bias": (0, bias, 0)}, {"tilt": (0, tilt, 0)})):
        model = np.array([rest_errors(SOURCE_EARTH, latitude, t, **error)[[3, 6]] for t in times])
        assert (np.abs(measured[:, :, lane] - model).max(axis=0) <= 0.02 * np.abs(model).max(axis=0)).all()


@pytest.mark.parametrize("heading_deg", [0, 90, 179, 270])
def test_alignment_at_rest(heading_deg):
    config = SINS.model_copy(update={"alignment_samples": 10})
    system = sins_top(config)
    flight = at_rest(1, latitude_deg=50, heading_deg=heading_deg, pitch_deg=5)
    omega_b, f_b, truth = flight.sample(config.period_s)
    result, _ = system.run_float64(loaded(system, omega_b[:11], f_b[:11], place=(50.0, np.degrees(0.3)), align=1.0))
    assert result["aligning"].tolist() == 9 * [True] + 2 * [False]
    assert result["navigating"].tolist() == 9 * [False] + 2 * [True]
    assert np.radians(result["out_pitch"][9]) == pytest.approx(truth.pitch[0], abs=1e-9)
    # Heading from earth rate: rounding of f and ω, 1e-16, over Ω·cos L.
    error = np.radians(result["out_heading"][9]) - truth.heading[0]
    assert np.angle(np.exp(1j * error)) == pytest.approx(0, abs=1e-9)
    assert system.read(result)["position"][9] == pytest.approx((50, np.degrees(0.3)), abs=1e-12)
    assert abs(result["out_veast"][10]) < 1e-9


def test_alignment_averages_noise():
    count = 400
    config = SINS.model_copy(update={"alignment_samples": count})
    system = sins_top(config)
    omega_b, f_b, _ = at_rest(count * config.period_s, latitude_deg=30, heading_deg=75).sample(config.period_s)
    omega_b = omega_b + 1e-6 * RNG.standard_normal(omega_b.shape)
    f_b = f_b + 1e-2 * RNG.standard_normal(f_b.shape)
    result, _ = system.run_float64(loaded(system, omega_b[:count], f_b[:count], place=(30.0, 0.0), align=1.0))
    expected = coarse_alignment(f_b.mean(axis=0), omega_b.mean(axis=0))
    matrix = system.read(result, system.state)["t"][-1]
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-11)


def test_every_attitude_can_be_aligned():
    q = RNG.standard_normal((500, 4))
    q = np.concatenate([q, np.eye(4), [[1, 1, 0, 0], [0, 1, -1, 0], [0, 0, 1, 1], [1, 0, 0, -1]]])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    c = np.array(sins.matrix_of_quaternion(Float64(), tuple(q.T))).transpose(2, 0, 1)
    f = np.einsum("kji,j->ki", c, [0, 0, 9.8])
    omega = np.einsum("kji,j->ki", c, [0, 5e-5, 5e-5])
    found = np.stack(sins.alignment_quaternion(Float64(), tuple(f.T), tuple(omega.T)), axis=-1)
    # The chosen column is 4·q·q_i with the largest |q_i|, at least 1/2.
    assert (np.linalg.norm(found, axis=1) > 2 - 1e-9).all()
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs((found * q).sum(axis=1)), 1, atol=1e-12)


def test_before_a_load_nothing_moves():
    system = sins_top(SINS)
    omega_b, f_b, _ = at_rest(0.1, latitude_deg=10).sample(0.02)
    result, _ = system.run_float64(bound(system, omega=omega_b + 0.1, f=f_b))
    assert not result["aligning"].any()
    assert not result["navigating"].any()
    assert not any(values.any() for values in system.read(result).values())


@pytest.mark.parametrize(("port", "limit"), [("in_wy", np.radians(400)), ("in_fx", 160.0)])
def test_out_of_range_is_told(port, limit):
    system = sins_top(SINS)
    inputs = bound(system) | {port: np.array([0.999, 1.001]) * limit}
    assert system.update_float64(inputs, system.reset)["out_of_range"].tolist() == [False, True]


@pytest.mark.parametrize(("longitude", "shown"), [(-120.3, -120.3), (239.5, -120.5), (-200.0, 160.0)])
def test_a_load_shows_the_start_position(longitude, shown):
    system = sins_top(SINS)
    inputs = bound(system, load=1.0, place=(45.3, longitude), start_v=(3.0, 4.0, 5.0), start_q=(1, 0, 0, 0))
    result = system.update_float64(inputs, system.reset)
    told, state = system.read(result), system.read(result, system.state)
    assert (*told["position"], told["wander"]) == (45.3, shown, 0)
    assert told["velocity"].tolist() == [3, 4, 5]
    assert not result["out_of_range"]
    # The state has the same values: at rest over the ground the next update gives them again, within rounding.
    at_rest = system.bind_state(**state | {"v": np.zeros(3), "half": np.zeros(3)})
    result = system.update_float64(bound(system, place=(1e300, 0.0)), at_rest)
    assert system.read(result)["position"] == pytest.approx((45.3, shown), abs=1e-13)


@pytest.mark.parametrize(("angles", "expected"), [
    ((90.0, 360.0), False), ((-90.0, -360.0), False), ((90.1, 0.0), True), ((0.0, -360.5), True)])
def test_a_start_angle_out_of_range_is_told(angles, expected):
    system = sins_top(SINS)
    inputs = bound(system, load=(1.0, 0.0), place=angles, start_q=(1, 0, 0, 0))
    assert system.update_float64(inputs, system.reset)["out_of_range"].tolist() == [expected, False]


def test_position_matrix_stays_orthonormal():
    c = sins.start_position(Float64(), 37.0, 16.0)
    transport = (3e-5, -2e-5)
    for _ in range(2000):
        c = sins.position_matrix(Float64(), c, transport, 1.0)
    c = np.array(c)
    # Third order of the rotation, (4e-5)³ per update, and rounding.
    np.testing.assert_allclose(c @ c.T, np.eye(3), rtol=0, atol=2000 * 1e-13)


def test_curvatures_are_the_ellipsoids():
    latitude, wander, h = RNG.uniform(-1.5, 1.5, 100), RNG.uniform(-3, 3, 100), RNG.uniform(0, 10_000, 100)
    v = RNG.uniform(-300, 300, (100, 3))
    c = platform_from_geodetic(latitude, 0.3, wander)
    rows = tuple(tuple(c[:, i, j] for j in range(3)) for i in range(3))
    spin, transport = sins.earth_and_transport_rate(Float64(), rows, tuple(v.T), h, sins.SOURCE_EARTH)
    east = np.cos(wander) * v[:, 0] - np.sin(wander) * v[:, 1]
    north = np.sin(wander) * v[:, 0] + np.cos(wander) * v[:, 1]
    meridian, prime = SOURCE_EARTH.radii(latitude)
    about = -north / (meridian + h), east / (prime + h)
    expected = (np.cos(wander) * about[0] + np.sin(wander) * about[1],
                -np.sin(wander) * about[0] + np.cos(wander) * about[1])
    # The approximations of the docstring: 3e-8 of the curvature, (h/R)³ of it, and 3·(h/R)²·e'² of the difference.
    bound = 6e-8 * np.linalg.norm(v[:, :2], axis=1) / 6.3e6
    for got, want in zip(transport, expected, strict=True):
        assert (np.abs(got - want) <= bound).all()
    np.testing.assert_allclose(spin[2], SOURCE_EARTH.rate_rad_s * np.sin(latitude), rtol=1e-12)


def test_state_has_a_reset_for_every_word():
    for config in (SINS, SINS_DAMPED):
        system = sins_top(config)
        assert sorted(system.reset) == sorted(leaves(system.state))


def matrix_from_angles(pitch, roll, grid_heading):
    """C_b^p from angles in rad, shape (...); the grid heading is anticlockwise."""
    zero = np.zeros(np.shape(pitch))
    return (rotation(np.stack([zero, zero, grid_heading], -1)) @ rotation(np.stack([pitch, zero, zero], -1))
            @ rotation(np.stack([zero, roll, zero], -1)))


def difference_deg(a, b):
    """Angle of the rotation between two matrices."""
    return rotation_angle(quaternion_from_matrix(a), quaternion_from_matrix(b))


def near_the_poles():
    """C_b^p near a pitch of ±90° and, in another order, C_e^p near the earth's poles."""
    steep, turn = (np.radians([sign * (90 - d) for sign, d in product((1, -1), DISTANCES_DEG)]),
                   np.radians([10.0, 100.0, 190.0, 280.0]))
    first, second, third = (values.ravel() for values in np.meshgrid(steep, turn, turn, indexing="ij"))
    t = matrix_from_angles(first, second, third)
    other = RNG.permutation(len(first))
    return t, platform_from_geodetic(first[other], second[other], third[other])


@pytest.mark.parametrize("numbers", ["float64", "twin"])
def test_angles_give_attitude_and_position_back_near_their_poles(numbers):
    system = sins_top(SINS)
    t, c = near_the_poles()
    q = quaternion_from_matrix(t.swapaxes(-1, -2))
    update = system.update_float64 if numbers == "float64" else partial(system.update_twin, SINS.pool)
    result = update(bound(system), system.bind_state(q=q, c=c, left=-1.0))
    state, told = system.read(result, system.state), system.read(result)
    pitch, roll, heading = np.radians(told["attitude"].T)
    wander = np.radians(told["wander"])
    assert difference_deg(matrix_from_angles(pitch, roll, -heading - wander), state["t"]).max() < 1e-9
    # A centimetre from the earth's pole, 2**-53 rad divided by 2**-30 rad.
    assert difference_deg(platform_from_geodetic(*np.radians(told["position"].T), wander), state["c"]).max() < 1e-5
    undefined = np.hypot(state["t"][:, 2, 0], state["t"][:, 2, 2]) < 2.0**-50
    assert undefined.any()
    assert (roll[undefined] == 0).all()


def test_the_references_angles_give_attitude_and_position_back_near_their_poles():
    t, c = near_the_poles()
    told = Navigator(SOURCE_EARTH, 1.0, t, c, np.zeros((len(t), 3)), np.zeros(len(t))).navigation()
    assert difference_deg(matrix_from_angles(told.pitch, told.roll, -told.heading - told.wander), t).max() < 1e-12
    assert difference_deg(platform_from_geodetic(told.latitude, told.longitude, told.wander), c).max() < 1e-12


@pytest.mark.parametrize("latitude_deg", [90, -90])
def test_a_start_at_the_earths_pole_keeps_longitude_heading_and_velocity(latitude_deg):
    system = sins_top(SINS)
    longitude, heading, spin = 60.0, 30.0, SOURCE_EARTH.rate_rad_s * np.sign(latitude_deg)
    half = np.radians(heading) / 2
    omega, f = np.tile((0, 0, spin), (3, 1)), np.tile((0, 0, float(SOURCE_EARTH.gravity(np.pi / 2, 0.0))), (3, 1))
    result, _ = system.run_float64(loaded(system, omega, f, place=(latitude_deg, longitude),
                                          start_q=(np.cos(half), 0, 0, -np.sin(half)), start_v=(1e-3, 2e-3, 0)))
    told = system.read(result)
    assert told["position"] == pytest.approx(np.tile((latitude_deg, longitude), (3, 1)), abs=1e-4)
    assert told["attitude"] == pytest.approx(np.tile((0, 0, heading), (3, 1)), abs=1e-4)
    assert told["velocity"] == pytest.approx(np.tile((1e-3, 2e-3, 0), (3, 1)), abs=1e-6)
