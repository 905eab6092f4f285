"""Error figures for known rotations."""

import numpy as np
import pytest

from strapdown_sim import errors
from strapdown_sim.recordings import Recording, Reference

RNG = np.random.default_rng(17)


def about(axis, degrees):
    half = np.radians(degrees) / 2
    return np.concatenate([[np.cos(half)], np.sin(half) * np.eye(3)["xyz".index(axis)]])


def random_quaternions(count):
    q = RNG.standard_normal((count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def rotate(q, v):
    return errors.multiply(errors.multiply(q, [0, *v]), errors.conjugate(q))[1:]


def matrix_of(q):
    """Navigation to body, column by column, by rotating the axes of the navigation frame."""
    return np.stack([rotate(errors.conjugate(q), axis) for axis in np.eye(3)], axis=-1)


def test_product_turns_one_after_the_other():
    # First a quarter turn about x, then one about z: y moves to z and stays there.
    assert rotate(errors.multiply(about("z", 90), about("x", 90)), [0, 1, 0]) == pytest.approx([0, 0, 1])


def test_enu_is_expressed_in_nwu():
    # A sensor whose axes are those of ENU has its y axis to the north, which is x of NWU, and x to the east, -y.
    q = errors.enu_to_nwu([1.0, 0, 0, 0])
    assert rotate(q, [0, 1, 0]) == pytest.approx([1, 0, 0])
    assert rotate(q, [1, 0, 0]) == pytest.approx([0, -1, 0])


def test_quaternion_from_matrix_for_all_divisors():
    special = [about(axis, angle) for axis in "xyz" for angle in (0, 1e-6, 90, 179.999, 180)]
    for q in [*special, *random_quaternions(100)]:
        assert abs(np.dot(errors.quaternion_from_matrix(matrix_of(q)), q)) == pytest.approx(1, abs=1e-12)


def test_quaternions_of_a_movement_do_not_jump():
    matrices = np.stack([matrix_of(about("y", angle)) for angle in range(0, 1000, 10)])
    q = errors.quaternion_from_matrix(matrices)
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.99).all()
    assert q[0] == pytest.approx([1, 0, 0, 0])


@pytest.mark.parametrize("size", [1e-9, 1.0, 120.0])
def test_errors_of_known_turns(size):
    q_ref = random_quaternions(50)
    heading = errors.attitude_errors(errors.multiply(about("z", size), q_ref), q_ref)
    assert heading.total == pytest.approx(size, rel=1e-6)
    assert heading.heading == pytest.approx(size, rel=1e-6)
    assert heading.inclination == pytest.approx(0, abs=1e-6)
    tilt = errors.attitude_errors(errors.multiply(about("x", size), q_ref), q_ref)
    assert tilt.total == pytest.approx(size, rel=1e-6)
    assert tilt.inclination == pytest.approx(size, rel=1e-6)
    assert tilt.heading == pytest.approx(0, abs=1e-6)


def test_sign_of_a_quaternion_does_not_matter():
    q1, q2 = random_quaternions(2)
    assert errors.rotation_angle(q1, q2) == pytest.approx(errors.rotation_angle(-q1, q2))


def test_constant_heading_is_removed():
    q_ref = random_quaternions(200)
    q_est = errors.multiply(about("z", 130), q_ref)
    fitted = errors.remove_constant_heading(q_est, q_ref)
    assert errors.attitude_errors(fitted, q_ref).total == pytest.approx(0, abs=1e-6)


def test_reference_is_matched_in_time_and_frame():
    q_ref = random_quaternions(3)
    reference = Reference(np.array([0.1, 0.3, 0.5]), q_ref, np.array([True, False, True]), "ENU", True)
    recording = Recording("r", 10.0, np.arange(6) / 10, None, None, np.zeros((6, 3)), "g", reference)
    q_est = np.repeat(errors.enu_to_nwu(q_ref), 2, axis=0)
    match = errors.match_reference(recording, q_est)
    assert match.sample.tolist() == [1, 5]
    assert errors.rotation_angle(match.q_est, match.q_ref) == pytest.approx(0, abs=1e-6)


def test_angle_difference_is_wrapped():
    assert errors.angle_difference([359, 1, 180, 0], [1, 359, 0, 180]).tolist() == [-2, 2, -180, -180]


def test_rms():
    assert errors.rms([3, 4, 0, 0]) == 2.5


def test_a_reference_with_another_heading_is_compared_with_it_and_without():
    turned = np.array([np.cos(0.2), 0, 0, np.sin(0.2)])
    estimate = np.tile([1.0, 0, 0, 0], (5, 1))
    time_s = np.arange(5) / 10
    reference = Reference(time_s=time_s, quaternion=np.tile(turned, (5, 1)), valid=np.ones(5, bool), frame="NWU",
                          heading_known=False)
    recording = Recording("r", 10.0, time_s, np.zeros((5, 3)), np.ones((5, 3)), np.ones((5, 3)), "g", reference)
    match = errors.match_reference(recording, estimate)
    assert errors.attitude_errors(match.q_est, match.q_ref).total == pytest.approx(0, abs=1e-9)
    assert errors.attitude_errors(match.q_est, match.q_given).heading == pytest.approx(np.degrees(0.4))
    assert match.turned
    shared = errors.match_reference(recording, estimate, shared_heading=True)
    assert errors.attitude_errors(shared.q_est, shared.q_ref).heading == pytest.approx(np.degrees(0.4))
    assert not shared.turned
