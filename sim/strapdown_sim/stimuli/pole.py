"""Attitudes on a grid towards a pitch of ±90°, where roll and yaw are rotations about the same axis.

Roll and yaw have no separate errors there. Angles are judged by the rotation between the attitude that they describe
and the attitude that they come from.
"""

from itertools import product

import numpy as np

from strapdown_sim.errors import conjugate, multiply, quaternion_from_matrix, rotation_angle
from strapdown_sim.reference.attitude import matrix_from_euler_angles

__all__ = ["DISTANCES_DEG", "angle_error", "inputs_through", "pole_grid", "update_at"]

DISTANCES_DEG = (10.0, 1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0)
"""Distances of the pitch from ±90°."""


def pole_grid(*, step_deg, distances_deg=DISTANCES_DEG):
    """Attitudes on a grid of roll and yaw, at each distance from both poles.

    Parameters
    ----------
    step_deg : float
        Step of roll, from -180, and of yaw, from 0.
    distances_deg : sequence of float
        Distances of the pitch from 90 and -90 degrees.

    Returns
    -------
    angles : ndarray, shape (N, 3)
        Pitch, roll, yaw, degrees.
    q_b2n : ndarray, shape (N, 4)
        Unit quaternions, body to navigation, scalar first.
    """
    turn = np.arange(0.0, 360.0, step_deg)
    angles = np.array([(sign * (90 - distance), roll - 180, yaw) for sign, distance, roll, yaw in product(
        (1, -1), distances_deg, turn, turn)])
    about = [np.stack([np.cos(half), *np.sin(half) * np.eye(3)[axis][:, None]], axis=-1)
             for half, axis in zip(np.radians(angles).T / 2, (1, 0, 2), strict=True)]
    return angles, multiply(multiply(about[2], about[0]), about[1])


def angle_error(angles, c_n2b):
    """Rotation from the attitude of pitch, roll and yaw to that of a matrix.

    Parameters
    ----------
    angles : ndarray, shape (..., 3)
        Pitch, roll, yaw, degrees.
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, navigation to body.

    Returns
    -------
    ndarray, shape (...)
        Degrees in [0, 180].
    """
    described = matrix_from_euler_angles(*np.moveaxis(np.asarray(angles, dtype=float), -1, 0))
    return rotation_angle(quaternion_from_matrix(described), quaternion_from_matrix(c_n2b))


def _state_of(q_b2n, system):
    """The state of INS_top or INS_flight at attitudes, as for ``System.bind_state``."""
    q0, q1, q2, q3 = np.moveaxis(q_b2n, -1, 0)
    return {"q": q_b2n} if "q" in system.state else {"s": np.stack([q0 - q2, q0 + q2, q1 + q3, q1 - q3], axis=-1)}


def _attitude_of(state, system):
    """The unit quaternion of a state by words: the inverse of ``_state_of``."""
    state = system.read(state, system.state)
    if "q" in state:
        return state["q"]
    a, b, d1, d2 = state["s"].astype(float)
    q = np.array([a + b, d1 + d2, b - a, d1 - d2])
    return q / np.linalg.norm(q)


def update_at(q_b2n, system, update):
    """Angles and matrix of INS_top or INS_flight after an update that does not rotate.

    Parameters
    ----------
    q_b2n : ndarray, shape (N, 4)
        Attitudes before the update, unit quaternions.
    system : System
    update : callable
        ``update(inputs, state)``: ``system.update_float64``, or ``system.update_twin`` with its pool.

    Returns
    -------
    angles : ndarray, shape (N, 3)
        Pitch, roll, yaw, degrees.
    c_n2b : ndarray, shape (N, 3, 3)
        Direction cosine matrices.
    """
    still = dict.fromkeys("amg", np.zeros(3))
    result = system.read(update(system.bind(**still), system.bind_state(**_state_of(q_b2n, system))))
    return result["angles"].astype(float), result["c"].astype(float)


def inputs_through(q_b2n, system, config):
    """Inputs that take a core to attitudes, one after another, from reset, by the gyro alone.

    Parameters
    ----------
    q_b2n : ndarray, shape (N, 4)
        Attitudes, unit quaternions.
    system : System
        INS_top or INS_flight. The rates are computed from the state of its twin, so that errors do not accumulate.
    config : Config
        Its configuration.

    Returns
    -------
    dict
        Maps each input port to its values in 2 N updates, as from ``System.bind``: two updates for each attitude. The
        second one corrects the error of a large rotation.
    """
    rates, state = [], system.bind_state()
    others = {"a": np.zeros(3), "m": np.zeros(3)} | config.constant_inputs()
    for attitude in np.repeat(q_b2n, 2, axis=0):
        turn = multiply(conjugate(_attitude_of(state, system)), attitude)
        # A core rotates by the half-angle tangent T/2·rate.
        turn = turn[1:] / np.copysign(max(abs(turn[0]), 1e-3), turn[0])
        rates.append(np.degrees(2 * turn / config.period_s))
        result = system.update_twin(config.pool, system.bind(**others, g=rates[-1]), state)
        state = {word: result[word] for word in system.reset}
    values = others | {"g": rates}
    return {port: np.broadcast_to(values, len(rates)) for port, values in system.bind(**values).items()}
