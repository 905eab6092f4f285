"""The float64 reference against the thesis's tables and against physical statements."""

import numpy as np
import pytest

from strapdown_sim.errors import angle_difference
from strapdown_sim.reference.attitude import (
    ComplementaryFilter,
    acc_error,
    alignment,
    axis_matrix,
    euler_angles,
    mag_error,
    matrix_from_euler_angles,
    matrix_from_quaternion,
)
from strapdown_sim.reference.modules import reference_outputs
from strapdown_sim.stimuli.pole import DISTANCES_DEG, angle_error, pole_grid
from strapdown_sim.stimuli.thesis import TABLE_5_7, TABLES

THESIS = {"kp": 10, "ki": 0.5, "period_s": 0.002, "mag_axes": ("+y", "-x", "+z")}
UP, FIELD = np.array([0, 0, 9.81]), np.array([20.0, 0.0, -40.0])  # navigation axes: NWU


def turned(axis, degrees):
    """C_n^b of a body after a right-handed rotation about an axis of NWU."""
    half = np.radians(degrees) / 2
    return matrix_from_quaternion([np.cos(half), *(np.sin(half) * np.eye(3)["xyz".index(axis)])])


@pytest.mark.parametrize("module", TABLES)
def test_tables_5_1_to_5_6(module):
    inputs, printed = TABLES[module]
    result = reference_outputs(module, inputs, **THESIS)
    for name, values in printed.items():
        np.testing.assert_allclose(result[name], values, rtol=0, atol=5e-5)  # printed with four decimals or more


def test_a_module_without_reference_is_told():
    with pytest.raises(ValueError, match=r"^module must be one of INS_acc, .*, INS_atan, not 'INS_top'$"):
        reference_outputs("INS_top", {}, **THESIS)


def test_table_5_7():
    model = ComplementaryFilter(**THESIS)
    for printed in TABLE_5_7:
        attitude = model.update((1, 1, 1), (1, 1, 1), (1, 1, 1))
        assert attitude[1:] == pytest.approx(printed, abs=5e-5)


def test_quaternion_takes_body_to_navigation_and_matrix_back():
    # A quarter turn to the left about up: body x points west.
    c = turned("z", 90)
    assert pytest.approx([0, 1, 0]) == c.T @ [1, 0, 0]
    assert c @ [0, 1, 0] == pytest.approx([1, 0, 0])


@pytest.mark.parametrize(("axis", "name", "body", "points"), [
    ("y", "pitch", 0, (2, -1)),   # pitch > 0: body x has a component down
    ("x", "roll", 1, (2, 1)),     # roll > 0: body y has a component up
    ("z", "yaw", 0, (1, 1)),      # yaw > 0: body x has a component west
])
def test_signs_of_the_angles(axis, name, body, points):
    c = turned(axis, 30)
    angles = dict(zip(("pitch", "roll", "yaw"), euler_angles(c), strict=True))
    assert angles.pop(name) == pytest.approx(30)
    assert list(angles.values()) == pytest.approx([0, 0], abs=1e-12)
    direction = c.T @ np.eye(3)[body]
    component, sign = points
    assert sign * direction[component] == pytest.approx(0.5)


def test_angles_give_the_matrix_back_at_any_pitch():
    angles, q = pole_grid(step_deg=30, distances_deg=(*range(5, 90, 5), *DISTANCES_DEG))
    c = matrix_from_euler_angles(*angles.T)
    assert matrix_from_quaternion(q) == pytest.approx(c, abs=1e-15)
    found = np.stack(euler_angles(c), axis=-1)
    assert angle_error(found, c).max() < 1e-12
    cosine = np.cos(np.radians(angles[:, :1]))
    assert (np.abs(angle_difference(found, angles)) * cosine).max() < 1e-11


@pytest.mark.parametrize("zero", [0.0, -0.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_at_the_pole_the_roll_is_zero(sign, zero):
    yaw = np.radians(60)
    c = [[zero, zero, -sign], [-np.sin(yaw), np.cos(yaw), zero], [sign * np.cos(yaw), sign * np.sin(yaw), zero]]
    assert euler_angles(c) == pytest.approx((sign * 90, 0, 60), abs=1e-12)


def test_a_body_at_rest_that_points_right_has_no_error():
    for axis in "xyz":
        c = turned(axis, 40)
        assert acc_error(c @ UP, c) == pytest.approx(np.zeros(3), abs=1e-12)
        assert mag_error(c @ FIELD, c) == pytest.approx(np.zeros(3), abs=1e-12)
        assert alignment(c @ UP, c @ FIELD) == pytest.approx(c)


@pytest.mark.parametrize("axis", "xyz")
def test_a_wrong_start_is_corrected(axis):
    """At rest, 20 degrees from the filter's start: the filter rotates towards the truth, never away."""
    truth = turned(axis, 20)
    model = ComplementaryFilter(kp=2, ki=0, period_s=0.01)
    before = 20.0
    for _ in range(50):
        for _ in range(100):
            model.update(truth @ UP, truth @ FIELD, (0, 0, 0))
        cosine = (np.trace(model.c_n2b @ truth.T) - 1) / 2
        angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        assert angle <= before
        before = angle
    assert before < 0.01


@pytest.mark.parametrize(("rate", "name"), [((0, 30, 0), "pitch"), ((30, 0, 0), "roll"), ((0, 0, 30), "yaw")])
def test_rates_turn_the_angles_of_their_axes(rate, name):
    model = ComplementaryFilter(kp=0, ki=0, period_s=0.001)
    for _ in range(1000):
        attitude = model.update((0, 0, 0), (0, 0, 0), rate)
    # First-order steps of 0.03 degrees rotate by twice the arctangent of half the angle.
    assert getattr(attitude, name) == pytest.approx(1000 * 2 * np.degrees(np.arctan(np.radians(0.015))), abs=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("sensor", range(3))
def test_an_update_that_is_not_finite_is_refused(bad, sensor):
    model = ComplementaryFilter(**THESIS)
    sample = [np.array(vector) for vector in ((0.1, 0.2, 9.7), (20.0, 3.0, -40.0), (1.0, 2.0, 3.0))]
    model.update(*sample)
    before = model.q_b2n.copy(), model.c_n2b.copy(), model.integral.copy()
    sample[sensor][1] = bad
    model.update(*sample)
    for old, new in zip(before, (model.q_b2n, model.c_n2b, model.integral), strict=True):
        assert (old == new).all()


def test_a_sensor_without_length_does_not_correct():
    c = turned("x", 25)
    assert acc_error(np.zeros(3), c).tolist() == [0, 0, 0]
    assert mag_error(np.zeros(3), c).tolist() == [0, 0, 0]


def test_run_is_update_by_update():
    rng = np.random.default_rng(5)
    accel, mag, gyro = rng.standard_normal((3, 20, 3))
    one, other = ComplementaryFilter(**THESIS), ComplementaryFilter(**THESIS)
    whole = one.run(accel, mag, gyro)
    for k in range(20):
        step = other.update(accel[k], mag[k], gyro[k])
        assert (whole.c_n2b[k] == step.c_n2b).all()
        assert whole.yaw[k] == step.yaw


def test_magnetometer_axes_of_the_thesis():
    # Body x = +sensor y, body y = -sensor x, body z = +sensor z.
    assert (axis_matrix(THESIS["mag_axes"]) @ [1, 2, 3]).tolist() == [2, -1, 3]


@pytest.mark.parametrize("axes", [("+x", "+x", "+z"), ("x", "y", "z"), ("+x", "+y")])
def test_wrong_axes(axes):
    with pytest.raises(ValueError, match=r"^Axes must name x, y and z once each with a sign, not "):
        axis_matrix(axes)


def test_wrong_period():
    with pytest.raises(ValueError, match=r"^Sample period must be positive, not 0$"):
        ComplementaryFilter(kp=1, ki=0, period_s=0)
