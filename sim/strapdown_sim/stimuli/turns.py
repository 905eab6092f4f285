"""A sensor that a hand turns and lays down, in a field without iron: ideal samples, noise, and errors of the sensor.

It rests on its six sides and on edges, and makes a full turn about each of its axes from several attitudes, which a
calibration needs. It does not accelerate.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from strapdown_sim.recordings import STANDARD_GRAVITY, Recording, Reference
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.reference.quaternion import cumulative, increment
from strapdown_sim.sensors import SENSORS

__all__ = ["EDGES", "SIDES", "TURNS", "Turn", "turned_by_hand", "with_error"]

STRENGTH_UT, DIP_DEG = 48.0, 65.0
"""Field of the earth, as in the middle of Europe."""


class Turn(NamedTuple):
    """A turn about an axis of the sensor, deg, and a rest after it, s."""

    axis: tuple[float, float, float]
    angle_deg: float
    rest_s: float = 0.0


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

TURNS = (Turn(Z, 0, 12), *(turn for axis in (X, Y, X) for turn in (
    Turn(X, 360), Turn(Y, 360), Turn(Z, 360), Turn(axis, 40))), Turn(X, -80), Turn(Y, -40, 6))
"""A rest, and full turns about all axes from three attitudes."""

SIDES = (*[Turn(X, 90, 6)] * 4, Turn(Y, 90, 6), Turn(Y, 180, 6), Turn(Y, 90, 6))
"""From a level start, rests on all sides."""

EDGES = (Turn(X, 45, 6), Turn(X, 90, 6), Turn(X, -135), Turn(Y, 45, 6), Turn(Y, 90, 6), Turn(Y, -135, 6), Turn(Y, 90),
         Turn(Z, 45, 6), Turn(Z, 90, 6), Turn(Z, -135), Turn(Y, -90, 6))
"""From a level start, rests on edges of all three directions."""


def turned_by_hand(turns: Sequence[Turn], *, rate_hz: float = 100.0, turn_deg_s: float = 60.0,
                   gyro_noise_deg_s: float = 0.1, accel_noise_m_s2: float = 0.02, mag_noise_ut: float = 0.3,
                   seed: int = 1) -> Recording:
    """Samples of a sensor that starts level, with its x axis north.

    Parameters
    ----------
    turns : sequence of Turn
        One after the other; rates rise and fall as a squared sine.
    rate_hz : float
        Samples per second.
    turn_deg_s : float
        Mean rate of a turn.
    gyro_noise_deg_s, accel_noise_m_s2, mag_noise_ut : float
        Standard deviations of white noise.
    seed : int
        Of the noise.

    Returns
    -------
    Recording
        Its reference is the true attitude, to NWU. Field of STRENGTH_UT and DIP_DEG, to the north.
    """
    rates = []
    for turn in turns:
        count = max(round(abs(turn.angle_deg) / turn_deg_s * rate_hz), 1)
        shape = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
        # The mean of the shape is 1/2; a turn by 0 degrees is none.
        speed = 2 * turn.angle_deg * rate_hz / count * shape
        rates += [speed[:, None] * turn.axis, np.zeros((round(turn.rest_s * rate_hz), 3))]
    gyro = np.concatenate(rates)
    q_b2n = cumulative(np.array([1.0, 0.0, 0.0, 0.0]), increment(np.radians(gyro), 1 / rate_hz))
    c_n2b = matrix_from_quaternion(q_b2n)
    dip = np.radians(DIP_DEG)
    field = STRENGTH_UT * np.array([np.cos(dip), 0.0, -np.sin(dip)])
    rng = np.random.default_rng(seed)
    time_s = np.arange(1, len(gyro) + 1) / rate_hz

    def noisy(values, deviation):
        return values + deviation * rng.standard_normal(values.shape)

    return Recording(
        name="turned_by_hand", sample_rate_hz=rate_hz, time_s=time_s, gyro_deg_s=noisy(gyro, gyro_noise_deg_s),
        accel=noisy(c_n2b[:, :, 2] * STANDARD_GRAVITY, accel_noise_m_s2), mag=noisy(c_n2b @ field, mag_noise_ut),
        accel_unit="m/s^2", reference=Reference(
            time_s, q_b2n, np.ones(len(time_s), bool), "NWU", heading_known=True, meaning="true attitude"))


def with_error(recording: Recording, sensor: str, bias: npt.ArrayLike, matrix: np.ndarray | None = None) -> Recording:
    """A recording whose ``sensor``, a key of SENSORS, errs so that matrix (sample − bias) is right."""
    values = getattr(recording, SENSORS[sensor])
    wrong: dict[str, Any] = {
        SENSORS[sensor]: (values if matrix is None else np.linalg.solve(matrix, values.T).T) + np.asarray(bias)}
    return replace(recording, **wrong)
