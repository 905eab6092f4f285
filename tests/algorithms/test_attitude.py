"""The kernels in float64 against the textbook model, which was written from the source, not from the kernels."""

from functools import partial

import numpy as np
import pytest
from scipy.optimize import root

from strapdown.cores import ATTITUDE_CORES, FLIGHT, MAHONY, THESIS, THESIS_COMPACT
from strapdown_sim.errors import angle_difference
from strapdown_sim.reference.attitude import (
    acc_error,
    euler_angles,
    heading_reversed,
    mag_error,
    matrix_from_quaternion,
    tilt_reversed,
)
from strapdown_sim.stimuli.pole import angle_error, pole_grid, update_at
from strapdown_sim.stimuli.thesis import TABLES
from strapdown_sim.truth import complementary_filter, module_outputs

MODULES = [name for name in ATTITUDE_CORES if name != "INS_top"]
RNG = np.random.default_rng(11)


def random_rotation(count):
    q = RNG.standard_normal((count, 4))
    return module_outputs("INS_matx", {"q": q / np.linalg.norm(q, axis=1, keepdims=True)}, THESIS)["c"]


def of_a_matrix(c):
    """The elements of C that are inputs of INS_euler."""
    return c[..., (0, 0, 0, 1, 2), (0, 1, 2, 2, 2)]


@pytest.mark.parametrize("config", [THESIS, MAHONY], ids=lambda config: config.name)
@pytest.mark.parametrize("name", MODULES)
def test_kernel_is_the_textbook_equation(name, config):
    system = ATTITUDE_CORES[name](config)
    ports = {port: RNG.standard_normal(1000) * 10 for port in system.input_ports}
    inputs = system.read(ports, system.inputs)
    if name == "INS_euler":
        inputs = {"c": of_a_matrix(random_rotation(1000))}
    kernel = system.read(system.update_float64(system.bind(**inputs)))
    expected = module_outputs(name, inputs, config)
    scale = max(np.abs(values).max() for values in expected.values())
    assert kernel.keys() == expected.keys()
    for output, values in expected.items():
        # Both are sums of at most about thirty products in different orders: 2**-52 of the largest term each.
        np.testing.assert_allclose(kernel[output], values, rtol=1e-12, atol=1e-14 * scale)


@pytest.mark.parametrize("name", TABLES)
def test_published_values(name):
    inputs, printed = TABLES[name]
    system = ATTITUDE_CORES[name](THESIS)
    result = system.read(system.update_float64(system.bind(**inputs)))
    for output, values in printed.items():
        np.testing.assert_allclose(result[output], values, rtol=0, atol=5.1e-5)  # half a unit of the fourth decimal


def test_vector_without_length_does_not_correct():
    system = ATTITUDE_CORES["INS_acc"](THESIS)
    assert set(system.update_float64(system.bind(a=np.zeros(3), v=(0.6, 0.0, 0.8))).values()) == {0.0}
    system = ATTITUDE_CORES["INS_mag"](THESIS)
    assert set(system.update_float64(system.bind(m=np.zeros(3), c=random_rotation(1)[0])).values()) == {0.0}


@pytest.mark.parametrize("channels", [1, 8])
@pytest.mark.parametrize(("kp", "ki"), [(10, 0.5), (0.5, 0), (0, 0)])
def test_ins_top_is_the_textbook_filter(channels, kp, ki):
    """Its equations have another order; the reference has that of the thesis."""
    config = THESIS.replace(kp=kp, ki=ki, channels=channels)
    count = 500
    a, m, g = (RNG.standard_normal((count, 3)) * size for size in (9, 40, 300))
    a[100:110], m[105:120] = 0, 0
    system = ATTITUDE_CORES["INS_top"](config)
    result = system.read(system.run_float64(system.bind(a=a, m=m, g=g))[0])
    c, *expected = complementary_filter(config).run(a, m, g)
    np.testing.assert_allclose(result["c"], c, rtol=0, atol=1e-12)
    error = np.abs(angle_difference(result["angles"], np.stack(expected, axis=-1)))
    # Two elements of C that are wrong by 1e-12 turn an angle by sqrt(2) times that, divided by the cosine of the pitch.
    # Near ±90° the reference loses roll and yaw.
    error *= np.cos(np.radians(expected[0]))[:, np.newaxis]
    assert error[np.abs(expected[0]) < 85].max() < np.degrees(np.sqrt(2) * 1e-12)


@pytest.mark.parametrize("channels", [1, 8])
@pytest.mark.parametrize("size", [1e-3, 1.0, 300.0])
def test_a_vertical_field_does_not_turn_the_heading(channels, size):
    """|m|² - hz² may be rounded to a negative number; bx does not become a NaN."""
    config = MAHONY.replace(channels=channels)
    system = ATTITUDE_CORES["INS_top"](config)
    c = random_rotation(1000)
    s = np.broadcast_to([1.0, 1, 0, 0], (1000, 4))
    still = system.bind(a=np.zeros((1000, 3)), m=-size * c[:, :, 2], g=np.zeros((1000, 3)))
    # The state of several channels has the first and the last column of C.
    state = system.bind_state(c=c if channels == 1 else c[:, :, ::2], s=s)
    result = system.update_twin(config.engine_pool, still, state)
    assert not result["refused"].any()
    # hz/|m| is 1 within 2**-22, so bx/|m| is below 2**-10.5: times the gain and T/2, an angle below 2**-20 rad.
    assert np.abs(system.read(result)["c"] - np.eye(3)).max() < 2.0**-20


@pytest.mark.parametrize(("channels", "least"), [(1, 2.0**-23.5), (8, 2.0**-24)])
def test_a_turn_below_half_a_last_place_is_lost(channels, least):
    """Half a turn times 1/sqrt(2), or 1 for several channels, against half of 2**-24, the last place below these."""
    config = MAHONY.replace(kp=0, ki=0, channels=channels)
    system = ATTITUDE_CORES["INS_top"](config)
    for share in (0.9, 1.1):
        rate = np.degrees(share * least / config.period_s)
        inputs = system.bind(a=np.tile([0, 0, 1.0], (20, 1)), m=[1.0, 0, 0], g=[0, rate, 0])
        pitch = system.read(system.run(config.engine_pool, inputs)[0])["angles"][-1, 0]
        # Above it, each turn is rounded to a last place: with one channel to nearly twice its size.
        assert abs(pitch) < 1e-5 if share < 1 else abs(pitch) > 20 * np.degrees(least) - 1e-5


def test_an_update_rounds_the_attitude_once():
    """The error of n turns is that of n roundings, not of all sums and products that make a turn."""
    count, runs, rng = 2000, 4, np.random.default_rng(3)
    config = THESIS.replace(kp=0, ki=0)
    system = ATTITUDE_CORES["INS_top"](config)
    still = {"a": np.tile([0, 0, 1.0], (count, 1)), "m": np.tile([1.0, 0, 0], (count, 1))}
    ratios = []
    for _ in range(runs):
        inputs = system.bind(g=300 * rng.standard_normal((count, 3)), **still)
        twin, truth = (system.read(run[0])["c"].astype(float)
                       for run in (system.run(config.engine_pool, inputs), system.run_float64(inputs)))
        angle = np.linalg.norm(twin - truth, axis=(1, 2)) / np.sqrt(2)
        ratios.append(angle**2 / np.arange(1, count + 1))
    # A number f·2**e with f from 1 to 2 is rounded with a variance of (2**(e - 23))²/12, a part (2**-23/f)²/12 of its
    # square. The mean of 1/f² is 3/(8·ln 2) if f is spread evenly in the logarithm. A rotation by an angle moves s by
    # half of it, and three of four directions at s are rotations. Three roundings in each update would be √3 of it.
    expected = 2.0**-23 * np.sqrt(4 * 3 / 4 / 12 * 3 / (8 * np.log(2)))
    assert np.sqrt(np.mean(ratios)) < expected


def reversed_bits(a_b, m_b, c_n2b):
    """The bits ``tilt_reversed`` and ``heading_reversed`` of INS_top at matrices of shape (N, 3, 3), shape (2, N)."""
    system = ATTITUDE_CORES["INS_top"](MAHONY)
    state = system.bind_state(s=np.broadcast_to([1.0, 1, 0, 0], (len(c_n2b), 4)), c=c_n2b)
    result = system.update_float64(system.bind(a=a_b, m=m_b, g=np.zeros_like(a_b)), state)
    return np.stack([result["tilt_reversed"], result["heading_reversed"]])


def test_reversed_is_more_than_90_degrees():
    a, m, c = RNG.standard_normal((1000, 3)), RNG.standard_normal((1000, 3)), random_rotation(1000)
    expected = np.stack([tilt_reversed(a, c), heading_reversed(m, c)])
    assert (reversed_bits(a, m, c) == expected).all()
    assert 400 < expected.sum() / 2 < 600


def equilibrium(a, m, start):
    """What a solver that begins at the matrix ``start`` finds: (matrix, error vector)."""
    def attitude(turn):
        q = np.append(1, turn)
        return matrix_from_quaternion(q / np.linalg.norm(q)) @ start

    def error(turn):
        c = attitude(turn)
        return acc_error(a, c) + mag_error(m, c)

    found = root(error, np.zeros(3), tol=1e-12)
    return attitude(found.x), found.fun


def test_every_wrong_attitude_without_an_error_is_reversed():
    """A solver looks for attitudes at which the error vector is zero: right ones and false equilibria."""
    right, wrong = 0, []
    for truth, start, dip in zip(random_rotation(200), random_rotation(200), RNG.uniform(-80, 80, 200), strict=True):
        a, m = truth[:, 2], truth @ (np.cos(np.radians(dip)), 0, -np.sin(np.radians(dip)))
        c, error = equilibrium(a, m, start)
        if np.abs(error).max() > 1e-10:
            continue
        if np.abs(c - truth).max() < 1e-6:
            right += 1
        else:
            wrong.append((a, m, c))
    assert right > 20
    assert len(wrong) > 20
    assert reversed_bits(*map(np.array, zip(*wrong, strict=True))).any(axis=0).all()


@pytest.mark.parametrize(("c11", "c12", "yaw"), [
    (1.0, 0.0, 0.0), (1.0, -0.0, 0.0), (0.0, 1.0, 90.0), (-1.0, 0.0, 180.0), (-1.0, -0.0, 180.0), (0.0, -1.0, 270.0),
    (1.0, -1e-9, 0.0), (1.0, -1e-30, 0.0), (1.0, -1e-5, 360 - np.degrees(1e-5))])
def test_yaw_is_in_0_to_360(c11, c12, yaw):
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    inputs = system.bind(c=(c11, c12, 0.0, 0.0, 1.0))
    assert system.update_float64(inputs)["out_yaw"] == pytest.approx(yaw, abs=1e-9)
    twin = system.update_twin(THESIS.pool, inputs)["out_yaw"]
    assert 0 <= twin < 360
    assert twin == pytest.approx(yaw, abs=2.0**-15)  # one unit in the last place below 360


@pytest.mark.parametrize("c13", [1.0, -1.0, 1 + 2.0**-23, -1 - 2.0**-23])
def test_gimbal_lock(c13):
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    result = system.update_float64(system.bind(c=(0.0, 0.0, c13, 0.0, 0.0)))
    assert result["out_pitch"] == pytest.approx(np.copysign(90.0, -c13))


GRID = {"INS_top": THESIS, "INS_flight": FLIGHT.replace(frame="NED")}


def in_float64(name, config, q):
    """Angles and matrix of INS_top or INS_flight at the attitudes q."""
    system = config.systems()[name](config)
    return update_at(q, system, system.update_float64)


def in_twin(name, config, q):
    """The same in the bits of the circuit."""
    system = config.systems()[name](config)
    return update_at(q, system, partial(system.update_twin, config.pool))


def roll_is_zero(name, c):
    """Where INS_flight gives a roll of zero: the cosine of the pitch is below 2**-21, the matrix's rounding error."""
    return (name == "INS_flight") & (np.hypot(c[:, 1, 2], c[:, 2, 2]) < 2.0**-21)


@pytest.mark.parametrize("name", GRID)
def test_angles_give_the_matrix_back_at_any_pitch(name):
    _, q = pole_grid(step_deg=30)
    angles, c = in_float64(name, GRID[name], q)
    assert angle_error(angles, c).max() < 2.0**-15  # a yaw less than this below zero becomes zero
    angles, c = angles[angles[:, 2] > 0], c[angles[:, 2] > 0]
    # With a roll of 180° the pitch lies as far on the other side of the pole.
    rounded = roll_is_zero(name, c)
    assert rounded.any() == (name == "INS_flight")
    assert (angles[rounded, 1] == 0).all()
    allowed = np.where(rounded, 2 * np.degrees(np.hypot(c[:, 1, 2], c[:, 2, 2])), 0) + 1e-12
    assert (angle_error(angles, c) < allowed).all()
    # The reference has other equations. Roll and yaw have errors of some 2**-52 rad/cos(pitch), but their sum at a
    # pitch of -90° and their difference at 90° have not.
    pitch, roll, yaw = euler_angles(c)
    sign, cosine = np.sign(pitch), np.hypot(c[:, 1, 2], c[:, 2, 2])
    assert np.abs(angles[:, 0] - pitch).max() < 1e-12
    assert np.abs(angle_difference(angles[:, 1] - sign * angles[:, 2], roll - sign * yaw)).max() < 1e-11
    for own, other in (angles[:, 1], roll), (angles[:, 2], yaw):
        assert (np.abs(angle_difference(own, other)) * cosine)[(cosine > 1e-12) & ~rounded].max() < 1e-11


@pytest.mark.parametrize(("name", "config"), [*GRID.items(), ("INS_top", THESIS_COMPACT)],
                         ids=lambda value: getattr(value, "name", value))
def test_the_twins_angles_give_the_matrix_back_at_any_pitch(name, config):
    given, q = pole_grid(step_deg=30)
    angles, c = in_twin(name, config, q)
    # An ulp of yaw is 2**-15 degrees, and a yaw less than this below zero becomes zero.
    assert angle_error(angles, c).max() < 1e-4
    assert ((angles[:, 2] >= 0) & (angles[:, 2] < 360)).all()
    # INS_top adds 2**-50 to A and B.
    at_pole = roll_is_zero(name, c) | (np.abs(c[:, 1:, 2]) <= 2.0**-48).all(axis=-1)
    assert at_pole.sum() > 200
    assert name != "INS_flight" or (angles[at_pole, 1] == 0).all()
    side = np.where(given[:, 0] > 0, -1, 1)
    found, turned = (side * roll + yaw for _, roll, yaw in (angles.T, given.T))
    assert np.abs(angle_difference(found[at_pole], turned[at_pole])).max() < 1e-4


def surplus_at_the_pole(name, angles):
    """What has to be zero at a pitch of ±90°: the roll of INS_flight; half the turn of INS_top is roll, half is yaw."""
    pitch, roll, yaw = angles.T
    return roll if name == "INS_flight" else angle_difference(yaw, -np.sign(pitch) * roll)


@pytest.mark.parametrize("run", [in_float64, in_twin])
@pytest.mark.parametrize("tiny", [0.0, -0.0, 1e-8, 1e-12, 1e-17, -1e-20, 1e-28, -1e-33, 1e-37, 1e-44])
@pytest.mark.parametrize("down", [1.0, -1.0])
def test_tiny_elements_at_the_pole_do_not_change_the_yaw_alone(run, tiny, down):
    """c23 goes through all magnitudes while c33 is zero: roll and yaw always give the matrix."""
    half = np.float32(np.sqrt(0.5))
    q = np.array([(half, tiny, down * half, other) for other in (0.0, -0.0, tiny, -tiny)], np.float32).astype(float)
    for name, config in GRID.items():
        angles, c = run(name, config, q)
        assert angle_error(angles, c).max() < 1e-4
        assert angles[:, 0] == pytest.approx(down * 90, abs=1e-4)
        if abs(tiny) < 1e-22:
            # INS_top adds 2**-50 to A or B.
            assert np.abs(surplus_at_the_pole(name, angles)).max() < 1e-4


def test_ins_euler_has_the_error_that_its_header_states():
    """Its yaw is lost at the pole: five elements of C do not contain it."""
    _, q = pole_grid(step_deg=30)
    c = module_outputs("INS_matx", {"q": q}, THESIS)["c"].astype(np.float32).astype(float)
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    angles = system.read(system.update_twin(THESIS.pool, system.bind(c=of_a_matrix(c))))["angles"].astype(float)
    cosine = np.hypot(c[:, 1, 2], c[:, 2, 2])
    error = angle_error(angles, c)
    assert (error * cosine < 1e-5 + 1e-4 * cosine).all()
    assert error.max() > 90
