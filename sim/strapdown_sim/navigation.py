"""Recordings for cores that start from given values: quaternion propagation and inertial navigation.

A recording has the axes forward, left, up; a navigator takes right, forward, up, and navigates in east, north, up. The
start comes from the recording: attitude from its own estimate, or level with a heading of zero; place, height and
velocity from its position and velocity.
"""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.config import ConfigError

from .curves import ESTIMATE, GRID, HARDWARE, few
from .errors import conjugate, enu_to_nwu, multiply, spread
from .recordings import Recording, Track
from .recordings.log import quaternion_from_angles, quaternion_from_ned
from .reference.flight import FRAME_QUATERNIONS
from .reference.quaternion import cumulative, increment

__all__ = ["Beside", "Start", "exact_attitude", "has_attitude", "navigated_attitude", "navigation_inputs",
           "position_beside", "start_of", "track_picture", "velocity_beside"]

FLU_TO_RFU = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Vectors in forward, left, up as right, forward, up; and in north, west, up as east, north, up."""

STARTING_S = 0.5
"""Time from the first sample in which the recording's attitude must begin, and whose mean force gives the vertical."""

EARTH_RADIUS_M = 6_371_000.0
"""For distances of a track from another near it."""


class Start(NamedTuple):
    """Attitude at the first sample, body to NWU, scalar first; where it comes from, and whether from the recording."""

    quaternion: np.ndarray
    source: str
    recorded: bool


class Beside(NamedTuple):
    """A track of the log beside that of a core.

    Fields
    ------
    sample : ndarray of int, shape (M,)
        The recording's sample nearest to each point of the log's track.
    recorded : ndarray, shape (M, 3)
        The log's track.
    horizontal, vertical : ndarray, shape (M,)
        Magnitudes of the differences between both at the times of these points, m or m/s.
    """

    sample: np.ndarray
    recorded: np.ndarray
    horizontal: np.ndarray
    vertical: np.ndarray

    def summary(self) -> dict:
        """The differences for ``summary.json``."""
        return {"points": len(self.sample), "horizontal": spread(self.horizontal), "vertical": spread(self.vertical)}


def start_of(recording: Recording) -> Start:
    """Attitude at the first sample: the recording's own, or else level with a heading of zero."""
    first, reference = recording.time_s[0], recording.reference
    if reference is not None:
        near = np.flatnonzero(reference.valid & (reference.time_s <= first + STARTING_S))
        if len(near):
            q = reference.quaternion[near[0]]
            return Start(enu_to_nwu(q) if reference.frame == "ENU" else q, reference.meaning, True)
    force = recording.accel[recording.time_s <= first + STARTING_S].mean(axis=0)
    x, y, z = force / max(float(np.linalg.norm(force)), 1e-9)
    # The shortest turn that makes the force vertical; about x, if it points down.
    level = np.array([1 + z, y, -x, 0.0]) if z > -0.999 else np.array([0.0, 1, 0, 0])
    return Start(level / np.linalg.norm(level), "level, heading zero", False)


def navigation_inputs(recording: Recording, names: Any, module: str) -> dict[str, Any]:
    """Values of a recording for inputs of a core that starts from given values, by the kernel's names.

    Parameters
    ----------
    recording : Recording
    names : container of str
        Inputs that the core has.
    module : str
        Its name, for messages.

    Raises: ConfigError for a navigator, if the recording has no position.
    """
    if "load" not in names:
        return {}
    load = np.zeros(len(recording.time_s))
    load[0] = 1.0
    start, rate = start_of(recording).quaternion, np.radians(recording.gyro_deg_s)
    values: dict[str, Any] = {"load": load, "start": start, "omega": rate, "first": rate, "second": rate}
    if "place" not in names:
        return values
    if recording.position is None:
        raise ConfigError(f"{module} starts from a latitude, and the log has no position: replay a log with GNSS")
    latitude, longitude, height = (
        np.interp(recording.time_s, recording.position.time_s, axis) for axis in recording.position.values.T)
    velocity = np.zeros(3) if recording.velocity is None else np.array([
        np.interp(recording.time_s[0], recording.velocity.time_s, axis) for axis in recording.velocity.values.T])
    # North, west, up and forward, left, up turn alike.
    to_enu = FRAME_QUATERNIONS["ENU"]
    return values | {
        "omega": rate @ FLU_TO_RFU.T, "f": recording.accel @ FLU_TO_RFU.T, "align": 0.0,
        "place": (latitude[0], longitude[0]), "start_v": velocity, "start_h": height[0], "altitude": height,
        "start_q": multiply(multiply(to_enu, start), conjugate(to_enu))}


def has_attitude(inputs: Any, outputs: Any) -> bool:
    """Whether a core with these inputs and outputs, by the kernel's names, propagates an attitude from a start."""
    return "load" in inputs and ("e" in outputs or "attitude" in outputs)


def navigated_attitude(outputs: Mapping[str, np.ndarray]) -> np.ndarray:
    """Attitude of a core that propagates one, by the kernel's names of its outputs: sensor to NWU, shape (N, 4)."""
    if "e" in outputs:
        return outputs["e"].astype(float)
    pitch, roll, heading = outputs["attitude"].astype(float).T
    return quaternion_from_ned(quaternion_from_angles(roll, pitch, heading))


def exact_attitude(recording: Recording) -> np.ndarray:
    """Attitude after each sample in float64, from the start by exact rotations at one rate, shape (N, 4)."""
    start = start_of(recording).quaternion
    turns = increment(np.radians(recording.gyro_deg_s[1:]), 1 / recording.sample_rate_hz)
    return np.concatenate([start[None], cumulative(start, turns)])


def position_beside(recording: Recording, latitude: np.ndarray, longitude: np.ndarray, height: np.ndarray) -> Beside:
    """A track (degrees, m, at all samples) beside the recording's position; differences in m."""
    sample, known, (north, east, up) = _beside(recording, recording.position, (latitude, longitude, height))
    meters = np.radians(1) * EARTH_RADIUS_M
    return Beside(sample, known, meters * np.hypot(north, east * np.cos(np.radians(known[:, 0]))), np.abs(up))


def velocity_beside(recording: Recording, velocity: np.ndarray) -> Beside:
    """A velocity (east, north, up, m/s, shape (N, 3)) beside that of the recording; differences in m/s."""
    sample, known, (east, north, up) = _beside(recording, recording.velocity, velocity.T)
    return Beside(sample, known, np.hypot(east, north), np.abs(up))


def _beside(recording: Recording, track: Track | None, axes: Any) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Nearest samples and values of a track during the recording, and by how much axes at all samples differ there."""
    assert track is not None, "a core is only compared with what the recording has"
    inside = (track.time_s >= recording.time_s[0]) & (track.time_s <= recording.time_s[-1])
    wanted, known = track.time_s[inside], track.values[inside]
    index = np.interp(wanted, recording.time_s, np.arange(len(recording.time_s)))
    return np.rint(index).astype(int), known, [
        np.interp(wanted, recording.time_s, values) - own for values, own in zip(axes, known.T, strict=True)]


def track_picture(path: str | os.PathLike, *, title: str, recording: Recording, latitude: np.ndarray,
                  longitude: np.ndarray) -> None:
    """Draw a track over that of the recording, seen from above, m from the start; equal data give equal bytes."""
    place, meters = recording.position, np.radians(1) * EARTH_RADIUS_M
    assert place is not None, "a navigator is only run on a recording with position"
    scale = np.cos(np.radians(latitude[0]))
    figure = Figure(figsize=(7.0, 7.0), dpi=120, layout="constrained")
    axes = figure.subplots()
    for x, y, label, colour, width in (
            (place.values[:, 1], place.values[:, 0], "recorded position", ESTIMATE, 3),
            (longitude, latitude, "hardware", HARDWARE, 1)):
        axes.plot(meters * scale * (x - longitude[0]), meters * (y - latitude[0]), label=label, color=colour,
                  linewidth=width, marker="." if few(x) else None)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.set_title(title, loc="left", fontsize="medium", fontweight="bold", parse_math=False)
    axes.grid(color=GRID, linewidth=0.6)
    axes.legend(frameon=False)
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
