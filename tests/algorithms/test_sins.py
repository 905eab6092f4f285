"""The navigation kernel in float64 against the reference navigator and the truth."""

import numpy as np
import pytest

from strapdown.algorithms import sins
from strapdown.cores import SINS, SINS_DAMPED, sins_top
from strapdown.kernel.numeric import Float64
from strapdown.kernel.system import leaves
from strapdown_sim.reference.sins import Navigator, coarse_alignment, platform_from_geodetic, rest_errors
from strapdown_sim.stimuli.flight import SOURCE_EARTH, Change, Flight, at_rest

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


def start_inputs(system, *, latitude, longitude, height=0.0, velocity=(0, 0, 0), c_b2n=None, align=0.0):
    """Inputs of an update that loads a start, angles in rad."""
    q = (0, 0, 0, 0) if c_b2n is None else quaternion(c_b2n)
    names = ("in_lat", "in_lon", "in_veast", "in_vnorth", "in_vup", "in_height",
             "in_q0", "in_q1", "in_q2", "in_q3", "in_load", "in_align")
    values = (np.degrees(latitude), np.degrees(longitude), *velocity, height, *q, 1.0, align)
    return dict.fromkeys(system.input_ports, 0.0) | dict(zip(names, values, strict=True)) | (
        {"in_altitude": height} if "in_altitude" in system.input_ports else {})


def sample(system, omega_b, f_b, altitude=0.0):
    """Inputs of an update that takes a sample."""
    ports = ("in_wx", "in_wy", "in_wz", "in_fx", "in_fy", "in_fz")
    inputs = dict.fromkeys(system.input_ports, 0.0) | dict(zip(ports, (*omega_b.T, *f_b.T), strict=True))
    return inputs | ({"in_altitude": altitude} if "in_altitude" in inputs else {})


def update(system, inputs, state):
    result = system.update_float64(inputs, state)
    return result, {word: result[word] for word in state}


def begin(system, omega_b, f_b, **start):
    """State after a load; the sample that comes with it is the first of the flight, a moment too early."""
    ports = ("in_wx", "in_wy", "in_wz", "in_fx", "in_fy", "in_fz")
    inputs = start_inputs(system, **start) | dict(zip(ports, (*omega_b, *f_b), strict=True))
    return update(system, inputs, dict(system.reset))


@pytest.mark.parametrize("config", [SINS, SINS_DAMPED], ids=lambda config: config.name)
def test_kernel_is_within_a_millionth_of_the_reference_and_near_the_truth(config):
    config = config.model_copy(update={"sample_rate_hz": 10.0})
    omega_b, f_b, truth = FLIGHT.sample(config.period_s)
    # A short flight of the same start tells the attitude at its beginning.
    before = Flight(1, track_deg=FLIGHT.track_deg, speed_m_s=200, angle_of_attack_deg=2).sample(1)[2]
    system = sins_top(config)
    latitude, longitude = np.radians(FLIGHT.latitude_deg), np.radians(FLIGHT.longitude_deg)
    _, state = begin(system, omega_b[0], f_b[0], latitude=latitude, longitude=longitude, height=FLIGHT.height_m,
                     velocity=before.velocity_m_s[0], c_b2n=before.c_b2n[0])
    navigator = Navigator(SOURCE_EARTH, config.period_s, before.c_b2n[0], platform_from_geodetic(latitude, longitude),
                          before.velocity_m_s[0], np.float64(FLIGHT.height_m), damping_s=config.damping_s or None)
    for k in range(len(omega_b)):
        result, state = update(system, sample(system, omega_b[k], f_b[k], truth.height_m[k]), state)
        navigator.step(omega_b[k], f_b[k], truth.height_m[k])
    told = navigator.navigation()
    radius, distance = SOURCE_EARTH.radius_m, FLIGHT.distance()
    kernel = np.radians([result["out_latitude"], result["out_longitude"]])
    assert abs(kernel[0] - told.latitude) * radius < 1e-6 * distance
    assert abs(kernel[1] - told.longitude) * radius < 1e-6 * distance
    assert abs(result["out_height"] - told.height_m) < 1e-6 * distance
    for port, expected in zip(("pitch", "roll", "heading"), told[:3], strict=True):
        # A millionth of the distance over the earth's radius is 1e-8 rad; tilts make positions at g·t²/2.
        assert np.radians(result[f"out_{port}"]) == pytest.approx(expected, abs=1e-8)
    velocity = [result[f"out_v{name}"] for name in ("east", "north", "up")]
    np.testing.assert_allclose(velocity, told.velocity_m_s, rtol=0, atol=1e-4)
    # And neither is far from where the aircraft is, at a fifth of the source's rate.
    assert abs(kernel[0] - truth.latitude[-1]) * radius < 1
    assert abs(kernel[1] - truth.longitude[-1]) * radius < 1


def test_schuler_oscillation_and_growth():
    # Lanes: a gyro bias of 0.05 deg/h about north, a tilt of 0.01 degrees about north; at 45 degrees, heading north.
    config = SINS_DAMPED.model_copy(update={"sample_rate_hz": 0.5, "rate_max_deg_s": 50.0})
    system, latitude = sins_top(config), np.radians(45)
    omega_b, f_b, _ = at_rest(5000, latitude_deg=45).sample(2.0)
    bias, tilt = np.radians(0.05) / 3600, np.radians(0.01)
    inputs = start_inputs(system, latitude=latitude, longitude=0.0, c_b2n=np.eye(3))
    # Computed (I − [φ×]): the platform is seen turned by −φ.
    inputs |= {"in_q0": np.cos([0, tilt / 2]), "in_q2": np.sin([0, -tilt / 2]), "in_q1": 0.0, "in_q3": 0.0}
    _, state = update(system, inputs, dict(system.reset))
    measured = []
    for k in range(len(omega_b)):
        rate = omega_b[k][:, None] + np.array([[0, 0], [bias, 0], [0, 0]])
        result, state = update(system, sample(system, rate.T, np.tile(f_b[k], (2, 1))), state)
        if (k + 1) % 250 == 0:
            measured.append([result["out_veast"], np.radians(result["out_longitude"])])
    measured = np.array(measured)  # time, quantity, lane
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
    result, state = begin(system, omega_b[0], f_b[0], latitude=np.radians(50), longitude=0.3, align=1.0)
    for k in range(1, 10):
        assert result["aligning"]
        assert not result["navigating"]
        result, state = update(system, sample(system, omega_b[k], f_b[k]), state)
    assert result["navigating"]
    assert not result["aligning"]
    assert np.radians(result["out_pitch"]) == pytest.approx(truth.pitch[0], abs=1e-9)
    # Heading from earth rate: rounding of f and ω, 1e-16, over Ω·cos L.
    assert np.angle(np.exp(1j * (np.radians(result["out_heading"]) - truth.heading[0]))) == pytest.approx(0, abs=1e-9)
    assert (result["out_latitude"], result["out_longitude"]) == pytest.approx((50, np.degrees(0.3)), abs=1e-12)
    result, state = update(system, sample(system, omega_b[10], f_b[10]), state)
    assert result["navigating"]
    assert abs(result["out_veast"]) < 1e-9


def test_alignment_averages_noise():
    count = 400
    config = SINS.model_copy(update={"alignment_samples": count})
    system = sins_top(config)
    omega_b, f_b, _ = at_rest(count * config.period_s, latitude_deg=30, heading_deg=75).sample(config.period_s)
    omega_b = omega_b + 1e-6 * RNG.standard_normal(omega_b.shape)
    f_b = f_b + 1e-2 * RNG.standard_normal(f_b.shape)
    result, state = begin(system, omega_b[0], f_b[0], latitude=np.radians(30), longitude=0.0, align=1.0)
    for k in range(1, count):
        result, state = update(system, sample(system, omega_b[k], f_b[k]), state)
    expected = coarse_alignment(f_b.mean(axis=0), omega_b.mean(axis=0))
    matrix = np.array([[result[f"t{row}{column}"] for column in "123"] for row in "123"])
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
    rest, f_b, _ = at_rest(0.1, latitude_deg=10).sample(0.02)
    state = dict(system.reset)
    for k in range(5):
        result, state = update(system, sample(system, rest[k] + 0.1, f_b[k]), state)
        assert not result["aligning"]
        assert not result["navigating"]
    assert (result["out_latitude"], result["out_longitude"], result["out_height"]) == (0, 0, 0)
    assert (result["out_pitch"], result["out_roll"], result["out_heading"]) == (0, 0, 0)
    assert {float(result[f"out_v{name}"]) for name in ("east", "north", "up")} == {0}


@pytest.mark.parametrize(("port", "limit"), [("in_wy", np.radians(400)), ("in_fx", 160.0)])
def test_out_of_range_is_told(port, limit):
    system = sins_top(SINS)
    quiet = dict.fromkeys(system.input_ports, 0.0)
    for factor, expected in ((0.999, False), (1.001, True)):
        assert system.update_float64(quiet | {port: factor * limit}, dict(system.reset))["out_of_range"] == expected


@pytest.mark.parametrize(("longitude", "shown"), [(-120.3, -120.3), (239.5, -120.5), (-200.0, 160.0)])
def test_a_load_shows_the_start_position(longitude, shown):
    system = sins_top(SINS)
    inputs = start_inputs(system, latitude=0.0, longitude=0.0, c_b2n=np.eye(3), velocity=(3.0, 4.0, 5.0))
    result, state = update(system, inputs | {"in_lat": 45.3, "in_lon": longitude}, dict(system.reset))
    assert (result["out_latitude"], result["out_longitude"], result["out_wander"]) == (45.3, shown, 0)
    assert [result[f"out_v{name}"] for name in ("east", "north", "up")] == [3, 4, 5]
    assert not result["out_of_range"]
    # And the state has it: at rest over the ground the next update shows the same, but for rounding.
    result, _ = update(system, sample(system, np.zeros(3), np.zeros(3)) | {"in_lat": 1e300}, state | {
        f"v{axis}": 0.0 for axis in "xyz"} | {f"half_{axis}": 0.0 for axis in "xyz"})
    assert result["out_latitude"] == pytest.approx(45.3, abs=1e-13)
    assert result["out_longitude"] == pytest.approx(shown, abs=1e-13)


@pytest.mark.parametrize(("angles", "expected"), [
    ((90.0, 360.0), False), ((-90.0, -360.0), False), ((90.1, 0.0), True), ((0.0, -360.5), True)])
def test_a_start_angle_out_of_range_is_told(angles, expected):
    system = sins_top(SINS)
    inputs = start_inputs(system, latitude=0.0, longitude=0.0, c_b2n=np.eye(3))
    inputs |= dict(zip(("in_lat", "in_lon"), angles, strict=True))
    assert update(system, inputs, dict(system.reset))[0]["out_of_range"] == expected
    assert not update(system, inputs | {"in_load": 0.0}, dict(system.reset))[0]["out_of_range"]


def test_position_matrix_stays_orthonormal():
    c = sins.start_position(Float64(), 37.0, 16.0)
    transport = (3e-5, -2e-5)
    for _ in range(2000):
        c = sins.position_matrix(Float64(), c, transport, 1.0)
    c = np.array(c)
    # Third order of the turn, (4e-5)³ an update, and rounding.
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
    # What the docstring leaves out: 3e-8 of the curvature, (h/R)³ of it, and 3·(h/R)²·e'² of the difference.
    bound = 6e-8 * np.linalg.norm(v[:, :2], axis=1) / 6.3e6
    for got, want in zip(transport, expected, strict=True):
        assert (np.abs(got - want) <= bound).all()
    np.testing.assert_allclose(spin[2], SOURCE_EARTH.rate_rad_s * np.sin(latitude), rtol=1e-12)


def test_state_has_a_reset_for_every_word():
    for config in (SINS, SINS_DAMPED):
        system = sins_top(config)
        assert sorted(system.reset) == sorted(leaves(system.state))
