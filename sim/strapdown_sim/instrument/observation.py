"""What the optical sensor sees in a flight: the lines' positions, from the rotor's motion and the rays of light."""

from typing import NamedTuple

import numpy as np

from .flights import Flight, Lines, body_from_level
from .gyro import Gyro
from .rays import Instrument, measured_angles

__all__ = ["Observation", "observe"]


class Observation(NamedTuple):
    """A flight as ``Lines``; at the end of each line period, shape (N,):

    ``roll_px`` and ``pitch_px``, the positions of both lines; ``roll`` and ``pitch``, the angles of the body against
    the rotor, rad.
    """

    lines: Lines
    roll_px: np.ndarray
    pitch_px: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray


def observe(flight: Flight, *, gyro: Gyro | None = None, instrument: Instrument | None = None,
            rate_hz: float | None = None) -> Observation:
    """Observe a flight; by default an ideal instrument, at the flight's own line rate.

    Raises: InstrumentError without scipy.
    """
    lines = flight.lines(rate_hz)
    axis = (gyro or Gyro()).axis(flight, lines.time_s)
    seen = body_from_level(axis, lines.roll, lines.pitch)
    return Observation(lines, *(instrument or Instrument()).pixels(seen), *measured_angles(seen))
