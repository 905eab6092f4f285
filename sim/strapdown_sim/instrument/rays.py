"""Rays of the two fans of light, through a cover glass, to the line CCDs.

The lasers sit on the rotor's frame, at the pivot. Each fan is a sheet of rays about the rotor axis; the ray is searched
that ends on the CCD's line of pixels. Body axes, lengths in mm. Nothing here knows the formulas of the core.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .calibration import Calibration

__all__ = ["Instrument", "LineSeat", "measured_angles"]


@dataclass(frozen=True)
class LineSeat:
    """Place of one CCD.

    Attributes
    ----------
    pitch_mm : float
        Pixel pitch, measured across the rotor axis.
    distance_mm : float
        From the pivot to the CCD, along z.
    n0 : float
        Pixel at the middle of the CCD's line.
    tilt : float
        Slope of the line towards z.
    aside_mm : float
        Sideways place of the line.
    glass_mm, index : float
        Thickness of the cover glass and its refractive index.
    turn : float
        Angle by which the sheet of light is turned about the rotor axis, rad.
    """

    pitch_mm: float = 0.008
    distance_mm: float = 25.0
    n0: float = 1823.5
    tilt: float = 0.0
    aside_mm: float = 0.0
    glass_mm: float = 0.0
    index: float = 1.5
    turn: float = 0.0


@dataclass(frozen=True)
class Instrument:
    """Both CCDs: ``roll`` lies along y, ``pitch`` along −x."""

    roll: LineSeat = LineSeat()
    pitch: LineSeat = LineSeat()

    def pixels(self, axis: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Positions of both lines for rotor axes in the body (..., 3), pixels: two arrays (...)."""
        axis = np.asarray(axis, float)
        # The inner gimbal axis is across the outer one, x, and the rotor axis.
        inner = _unit(np.cross(axis, [1.0, 0.0, 0.0]))
        across = np.cross(inner, axis)
        return (_place(self.roll, axis, across, along=[0.0, 1.0, 0.0], side=[1.0, 0.0, 0.0]),
                _place(self.pitch, axis, inner, along=[-1.0, 0.0, 0.0], side=[0.0, 1.0, 0.0]))

    def calibration(self, k: float = 0.0) -> Calibration:
        """The words of an instrument without cover glass."""
        return Calibration(self.roll.n0, self.pitch.n0, self.roll.pitch_mm / self.roll.distance_mm,
                           self.pitch.pitch_mm / self.pitch.distance_mm, self.roll.tilt, self.pitch.tilt,
                           h=self.pitch.aside_mm / self.pitch.distance_mm, k=k)


def measured_angles(axis: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Roll and pitch of the body against the rotor, rad: the angles of the outer and the inner gimbal."""
    x, y, z = np.moveaxis(np.asarray(axis, float), -1, 0)
    return np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))


def _place(seat, axis, spread, along, side):
    """Pixel at which the sheet of rays about ``axis`` that spreads along ``spread`` crosses the line."""
    along, side = np.array(along), np.array(side)
    line = _unit(along + seat.tilt * np.array([0.0, 0.0, 1.0]))
    normal = np.cross(line, side) * np.sign(np.cross(line, side)[2])
    spread = np.cos(seat.turn) * spread + np.sin(seat.turn) * np.cross(axis, spread)
    middle = seat.distance_mm * np.array([0.0, 0.0, 1.0]) + seat.aside_mm * side

    def landing(angle):
        """Where the ray at an angle to the axis lands, measured from the middle of the line."""
        ray = np.cos(angle)[..., None] * axis + np.sin(angle)[..., None] * spread
        point = ray * ((middle @ normal) / (ray @ normal))[..., None]
        if seat.glass_mm:
            # In the glass the ray is steeper by Snell's law: it lands nearer to its foot on the glass.
            flat = ray - (ray @ normal)[..., None] * normal
            sine = np.linalg.norm(flat, axis=-1, keepdims=True)
            saved = sine / np.sqrt(1 - sine**2) - (sine / seat.index) / np.sqrt(1 - (sine / seat.index) ** 2)
            point = point - seat.glass_mm * saved * flat / np.where(sine, sine, 1)
        return point - middle

    # Secant steps bring the distance from the line to zero.
    old, new = np.full(axis.shape[:-1], -0.1), np.full(axis.shape[:-1], 0.1)
    off_old, off_new = landing(old) @ side, landing(new) @ side
    for _ in range(12):
        change = off_new - off_old
        step = np.where(change, off_new * (new - old) / np.where(change, change, 1), 0)
        old, new, off_old = new, new - step, off_new
        off_new = landing(new) @ side
    return seat.n0 + (landing(new) @ along) / seat.pitch_mm


def _unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
