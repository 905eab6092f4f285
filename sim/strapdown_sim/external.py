"""Acceleration of a recording from its GNSS velocity, as an input of the flight filter."""

from dataclasses import replace
from typing import Any

import numpy as np

from strapdown.config import Config, ConfigError
from strapdown.cores import main_module

from .errors import conjugate, enu_to_nwu, multiply
from .recordings import Recording
from .recordings.log import interpolated
from .reference.attitude import matrix_from_quaternion
from .reference.flight import FRAME_QUATERNIONS
from .truth import REFERENCES

__all__ = ["LONGEST_GAP_S", "with_external_acceleration"]

LONGEST_GAP_S = 1.5
"""Longest time between two velocities, and from a sample to the middle of two, in s."""

START_S, TURNING_S = 2.0, 60.0
"""Time from the first sample in which headings are compared with the recording's, or else with the velocity."""

FITS = 4
"""Number of fits of the heading to the velocity."""


def with_external_acceleration(recording: Recording, config: Config) -> tuple[Recording, dict[str, Any]]:
    """A recording with ``external``, the change of its velocity, in the navigation axes of a configuration.

    The mean acceleration between two velocities is that of the middle; between the middles it is interpolated, so it is
    what a vehicle knows half a GNSS interval later. It is zero where there is no velocity for LONGEST_GAP_S. North of
    the filter without magnetometer is arbitrary: the velocity is then turned by the angle between the filter's heading
    and the recording's own in the first two seconds, or, without one, by the angle that fits the filter's accelerations
    of the first minute best.

    Parameters
    ----------
    recording : Recording
    config : Config
        As from ``for_recording``, with an ``external_input``.

    Returns
    -------
    (Recording, dict)
        The dict is for a summary: what the acceleration comes from, and the angle in degrees, anticlockwise.

    Raises: ConfigError for a recording without velocity, or a core without the input.
    """
    module = main_module(config)
    if "external_input" in config.model_fields_set and not getattr(config, "external_input", False):
        raise ConfigError(f"configuration {config.name}: external_input must be true for an external acceleration")
    if "external_input" not in type(config).model_fields:
        raise ConfigError(f"{module} takes no external acceleration: replay it with a configuration of INS_flight")
    if recording.velocity is None or len(recording.velocity.time_s) < 2:
        raise ConfigError(f"{recording.name} has no velocity for an external acceleration: leave out --external, or "
                          "replay a log with GNSS")
    external = _change(recording, _nwu(recording.velocity.values))
    angle = 0.0 if getattr(config, "magnetometer", True) else _heading(recording, config, external)
    return replace(recording, external=_in_frame(external, angle, config)), {
        "from": "velocity", "turned_deg": float(np.degrees(angle))}


def _in_frame(nwu, angle, config):
    """Vectors in NWU, turned anticlockwise by an angle in rad, in the navigation axes of a configuration."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = nwu.T
    turned = np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
    return turned @ matrix_from_quaternion(FRAME_QUATERNIONS[config.frame])


def _nwu(enu):
    """East, north, up as north, west, up."""
    east, north, up = np.asarray(enu, float).T
    return np.stack([north, -east, up], axis=-1)


def _change(recording, velocity):
    """Acceleration at each sample, m/s²: on straight lines between the middles of pairs of velocities."""
    time_s = recording.velocity.time_s
    step = np.diff(time_s)
    near = step < LONGEST_GAP_S
    middle, change = (time_s[1:] - step / 2)[near], np.diff(velocity, axis=0)[near] / step[near, None]
    if not len(middle):
        return np.zeros((len(recording.time_s), 3))
    behind = np.clip(np.searchsorted(middle, recording.time_s) - 1, 0, len(middle) - 1)
    ahead = np.minimum(behind + 1, len(middle) - 1)
    distance = np.minimum(np.abs(recording.time_s - middle[behind]), np.abs(recording.time_s - middle[ahead]))
    return np.where(distance[:, None] < LONGEST_GAP_S, interpolated(recording.time_s, middle, change), 0.0)


def _heading(recording, config, external):
    """Angle, anticlockwise, from the recording's north to that of the filter without magnetometer, rad."""
    sample = slice(0, int(np.searchsorted(recording.time_s, recording.time_s[0] + TURNING_S)))
    period = None if recording.period_s is None else recording.period_s[sample]

    def run(known):
        return REFERENCES[main_module(config)](config).run(
            recording.accel[sample], None, recording.gyro_deg_s[sample], period_s=period, external=known)

    to_frame = FRAME_QUATERNIONS[config.frame]
    reference = recording.reference
    if reference is not None and reference.heading_known:
        near = reference.valid & (reference.time_s <= recording.time_s[0] + START_S)
        if near.any():
            found = run(None).q_b2n
            index = np.clip(np.searchsorted(recording.time_s, reference.time_s[near]), 0, len(found) - 1)
            known = reference.quaternion[near]
            known = enu_to_nwu(known) if reference.frame == "ENU" else known
            w, _, _, z = multiply(multiply(conjugate(to_frame), found[index]), conjugate(known)).T
            return float(np.angle(np.sum((w + 1j * z) ** 2)))
    # Accelerations tilt the filter until it gets them, so the angle is found step by step.
    angle, turned = 0.0, None
    for _ in range(FITS):
        earth = run(turned).earth @ matrix_from_quaternion(to_frame).T
        (ax, ay, _), (bx, by, _) = earth.T, external[sample].T
        angle = float(np.angle(np.sum((ax + 1j * ay) * (bx - 1j * by))))
        turned = _in_frame(external[sample], angle, config)
    return angle
