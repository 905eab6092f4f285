"""A flight as light on both sensors, line by line, at the middle of each exposure."""

from collections.abc import Iterable
from dataclasses import fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .calibration import Calibration
from .errors import InstrumentError
from .flights import Flight, body_from_level
from .gyro import Gyro
from .image import LineCamera
from .rays import Instrument, LineSeat

__all__ = ["CAMERA_FIELDS", "Scene", "Truth", "camera_options"]

TABLE_S = 0.001
"""Step of the table of the rotor axis, which is interpolated with cubic splines: nutation takes 25 steps."""

SPOT_UM = 64.0
"""Width of the light on the sensors, sigma: 8 pixels of 8 µm."""

PRNU = 0.02

CAMERA_FIELDS = {field.name: field.type for field in fields(LineCamera)
                 if field.init and field.name not in ("pixels", "seed", "exposure_s")}
"""Fields of LineCamera that can be chosen, and their types."""


class Truth(NamedTuple):
    """The state at some times, shape (N,): positions of both lines, pixels; angles, rad."""

    roll_px: np.ndarray
    pitch_px: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray


def camera_options(words: Iterable[str]) -> dict[str, Any]:
    """Options of a LineCamera from words FIELD=VALUE. Raises: InstrumentError."""
    options: dict[str, Any] = {}
    for word in words:
        name, separator, value = word.partition("=")
        if not separator:
            raise InstrumentError(f"the camera takes FIELD=VALUE, as in prnu=0.02, not {word!r}")
        if name not in CAMERA_FIELDS:
            raise InstrumentError(f"the camera has no field {name!r}: choose from {', '.join(CAMERA_FIELDS)}")
        if CAMERA_FIELDS[name] in (bool, "bool"):
            if value not in ("true", "false"):
                raise InstrumentError(f"{name} of the camera must be true or false, not {value!r}")
            options[name] = value == "true"
            continue
        try:
            options[name] = float(value)
        except ValueError:
            raise InstrumentError(f"{name} of the camera must be a number, not {value!r}") from None
        if not np.isfinite(options[name]) or (options[name] < 0 and name not in ("gradient", "ghost_px")):
            raise InstrumentError(f"{name} of the camera must be a finite number from 0, not {value}")
    return options


class Scene:
    """Light on the roll and the pitch sensor in a flight.

    Parameters
    ----------
    flight : Flight
    pixels, pitch_um : int, float
        Of the sensors, which have their middle under the pivot.
    duration_s : float
        Longest time that is asked for.
    exposure_s : float
        Exposure that gives the camera's peak.
    camera : dict
        Options of LineCamera.
    seed : int
        Of the noise.
    """

    def __init__(self, flight: Flight, *, pixels: int, pitch_um: float, duration_s: float, exposure_s: float,
                 camera: dict | None = None, seed: int = 0) -> None:
        self.flight, self.gyro, self._duration_s = flight, Gyro(), duration_s
        seat = LineSeat(pitch_mm=pitch_um / 1000, n0=(pixels - 1) / 2)
        self._instrument = Instrument(seat, replace(seat))
        options: dict[str, Any] = {"sigma_px": SPOT_UM / pitch_um, "prnu": PRNU} | (camera or {})
        self._cameras = [LineCamera(pixels, exposure_s=exposure_s, seed=seed + ccd, **options) for ccd in range(2)]

    @property
    def calibration(self) -> Calibration:
        """The right words of this instrument."""
        return self._instrument.calibration(self.gyro.k)

    @cached_property
    def _axis(self):
        """The rotor axis in the level frame, a function of time."""
        times = np.arange(0, self._duration_s + 2 * TABLE_S, TABLE_S)
        axis = self.gyro.axis(self.flight, times)
        from scipy.interpolate import CubicSpline

        return CubicSpline(times, axis)

    def at(self, time_s: np.ndarray) -> Truth:
        """The truth at some times, shape (N,). Raises: InstrumentError without scipy."""
        motion = self.flight.at(time_s)
        body = body_from_level(self._axis(time_s), motion.roll, motion.pitch)
        return Truth(*self._instrument.pixels(body), motion.roll, motion.pitch)

    def image(self, line: Any) -> np.ndarray:
        """Pixels of a line: an object with ``ccd``, ``middle_s`` and ``exposure_s``."""
        position = self.at(np.array([line.middle_s]))[line.ccd][0]
        return self._cameras[line.ccd].charge(position, line.exposure_s)
