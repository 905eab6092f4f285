"""Flights with a known truth, for the optical attitude sensor.

Axes: forward, right, down; the level frame L has the vehicle's heading. Heading is positive to the right. The
acceleration of the vehicle is given in L, the specific force is what an accelerometer at the gyro measures. The earth
does not turn.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["FLIGHTS", "GRAVITY_M_S2", "Flight", "Lines", "Motion", "Pulse", "Wave", "body_from_level",
           "level_from_body"]

GRAVITY_M_S2 = 9.80665

TCD1304_HZ = 2e6 / 14_800
"""Lines per second of a TCD1304 at its preset."""


class Pulse(NamedTuple):
    """A quantity that rises to ``size``, stays, and returns to zero in ``duration_s``; rise and fall are cosines."""

    start_s: float
    duration_s: float
    rise_s: float
    size: float

    def value(self, time_s):
        """Value, shape of ``time_s``."""
        return self.size * (self._rise(self._since(time_s)) - self._rise(self._since(time_s) - self._plateau))

    def integral(self, time_s):
        """Integral of the value from the beginning."""
        return self.size * self.rise_s * (
            self._area(self._since(time_s)) - self._area(self._since(time_s) - self._plateau))

    def later(self, start_s):
        """The pulse on a clock that begins ``start_s`` later."""
        return self._replace(start_s=self.start_s - start_s)

    def _since(self, time_s):
        return (np.asarray(time_s, float) - self.start_s) / self.rise_s

    @property
    def _plateau(self):
        return self.duration_s / self.rise_s - 1

    @staticmethod
    def _rise(x):
        return (1 - np.cos(np.pi * np.clip(x, 0, 1))) / 2

    @staticmethod
    def _area(x):
        inside = np.clip(x, 0, 1)
        return (inside - np.sin(np.pi * inside) / np.pi) / 2 + np.maximum(x - 1, 0)


class Wave(NamedTuple):
    """``size``·sin(2π·``hz``·t + ``phase``)."""

    size: float
    hz: float
    phase: float = 0.0

    def value(self, time_s):
        """Value, shape of ``time_s``."""
        return self.size * np.sin(2 * np.pi * self.hz * np.asarray(time_s, float) + self.phase)

    def later(self, start_s):
        """The wave on a clock that begins ``start_s`` later."""
        return self._replace(phase=self.phase + 2 * np.pi * self.hz * start_s)


class Motion(NamedTuple):
    """The vehicle at some times, shape (...): angles in rad, yaw rate in rad/s, specific force in m/s², (..., 3).

    ``f_l`` is in L, ``f_b`` in body axes.
    """

    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray
    yaw_rate: np.ndarray
    f_l: np.ndarray
    f_b: np.ndarray


class Lines(NamedTuple):
    """A flight as the sensor sees it, one row a line, shape (N,) or (N, 3).

    ``time_s`` is the end of each line period; roll, pitch and heading (rad) are those of that time; ``f_b`` and
    ``yaw_rate`` are means over the line period.
    """

    time_s: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray
    f_b: np.ndarray
    yaw_rate: np.ndarray


@dataclass(frozen=True)
class Flight:
    """A flight: sums of pulses and waves.

    Attributes
    ----------
    title : str
    duration_s, rate_hz : float
        Length; line rate at which its errors are published.
    roll, pitch : tuple
        Angles, rad; roll comes on top of the bank of coordinated turns.
    forward, right : tuple
        Acceleration in L, m/s², without that of turns.
    turns : tuple of Pulse
        Yaw rate, rad/s.
    speed_m_s : float
        Speed in the turns, which are coordinated: no side force.
    """

    title: str
    duration_s: float
    rate_hz: float = 100.0
    roll: tuple = ()
    pitch: tuple = ()
    forward: tuple = ()
    right: tuple = ()
    turns: tuple[Pulse, ...] = ()
    speed_m_s: float = 0.0

    def at(self, time_s: ArrayLike) -> Motion:
        """The vehicle at the times ``time_s``, s, shape (...)."""
        times = np.asarray(time_s, float)

        def total(parts):
            return sum((part.value(times) for part in parts), np.zeros(times.shape))

        yaw_rate = total(self.turns)
        centripetal = self.speed_m_s * yaw_rate
        roll = total(self.roll) + np.arctan2(centripetal, GRAVITY_M_S2)
        pitch = total(self.pitch)
        heading = sum((turn.integral(times) for turn in self.turns), np.zeros(times.shape))
        f_l = np.stack([total(self.forward), total(self.right) + centripetal,
                        np.full(times.shape, -GRAVITY_M_S2)], axis=-1)
        return Motion(roll, pitch, heading, yaw_rate, f_l, body_from_level(f_l, roll, pitch))

    def later(self, start_s: float) -> "Flight":
        """The rest of the flight, from ``start_s`` on: time 0 is there."""
        def rest(parts):
            return tuple(part.later(start_s) for part in parts)

        return replace(self, duration_s=self.duration_s - start_s, roll=rest(self.roll), pitch=rest(self.pitch),
                       forward=rest(self.forward), right=rest(self.right), turns=rest(self.turns))

    def lines(self, rate_hz: float | None = None) -> Lines:
        """All whole line periods of the flight, by default at ``self.rate_hz``."""
        rate_hz = rate_hz or self.rate_hz
        end = np.arange(1, int(self.duration_s * rate_hz + 1e-6) + 1) / rate_hz
        node, weight = np.polynomial.legendre.leggauss(4)
        inside = self.at(end[:, None] + (node - 1) / (2 * rate_hz))
        now = self.at(end)
        return Lines(end, now.roll, now.pitch, now.heading, np.einsum("n,knj->kj", weight / 2, inside.f_b),
                     inside.yaw_rate @ weight / 2)


def body_from_level(v, roll, pitch):
    """Vectors in L as vectors in body axes: pitch about y, then roll about x."""
    x, y, z = np.moveaxis(v, -1, 0)
    x, z = np.cos(pitch) * x - np.sin(pitch) * z, np.sin(pitch) * x + np.cos(pitch) * z
    return np.stack([x, np.cos(roll) * y + np.sin(roll) * z, np.cos(roll) * z - np.sin(roll) * y], axis=-1)


def level_from_body(v, roll, pitch):
    """Vectors in body axes as vectors in L."""
    x, y, z = np.moveaxis(v, -1, 0)
    y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
    return np.stack([np.cos(pitch) * x + np.sin(pitch) * z, y, np.cos(pitch) * z - np.sin(pitch) * x], axis=-1)


def _turns(count, angle_deg, rate_deg_s, rise_s, duration_s):
    """Equal turns with equal straight legs between them."""
    each = angle_deg / rate_deg_s + rise_s
    leg = (duration_s - count * each) / (count + 1)
    return tuple(Pulse(leg + (leg + each) * k, each, rise_s, np.radians(rate_deg_s)) for k in range(count))


FLIGHTS = {
    "a": Flight("3 m/s² forward for 20 s, level", 60, forward=(Pulse(5, 20, 1, 3.0),)),
    "b": Flight("3 m/s² sideways for 20 s, level", 60, right=(Pulse(5, 20, 1, 3.0),)),
    "c": Flight("coordinated turn of 342°, bank 23°", 75, TCD1304_HZ, turns=(Pulse(5, 60, 3, np.radians(6)),),
                speed_m_s=40.0),
    "d": Flight("take-off with 4 m/s², climb at 12°", 90, forward=(Pulse(2, 15, 1, 4.0),),
                pitch=(Pulse(10, 200, 7, np.radians(12)),)),
    "e": Flight("pitch of 25° for 60 s, no acceleration", 85, pitch=(Pulse(3, 76, 8, np.radians(25)),)),
    "f": Flight("±25° at 0.1 and 0.07 Hz, 2 m/s²", 90, TCD1304_HZ, roll=(Wave(np.radians(25), 0.1),),
                pitch=(Wave(np.radians(25), 0.07),), forward=(Wave(2.0, 0.032),),
                right=(Wave(2.0, 0.021, np.pi / 2),)),
    "g": Flight("five turns of 120°, 600 s", 600, 20.0, turns=_turns(5, 120, 1.5, 5, 600), speed_m_s=56.0),
}
"""Flights by letter."""
