"""Samples for a core whose bits are flipped: from a recording, or from a generated flight."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapdown.config import Config
from strapdown.cores import Core
from strapdown_lab.studies.inertial import car_leg
from strapdown_sim.errors import quaternion_from_matrix
from strapdown_sim.recordings import read_recording
from strapdown_sim.reference.attitude import axis_matrix
from strapdown_sim.stimuli.flight import Change, Flight

__all__ = ["ATTITUDE_RECORDING", "GENERATED", "POSITION_RECORDING", "Samples", "samples_of"]

ATTITUDE_RECORDING, POSITION_RECORDING = "broad_02_undisturbed_slow_rotation_B", "ins_drive_first_half"
"""Recordings for cores with attitude only, and for navigators."""

GENERATED = "generated flight"
"""Source of samples without a recording."""

FIRST_S, STEP_S = 12.0, 4.0
"""Where the samples of the first channel begin in the recording, and by how much later those of each other one."""

FIELD_UT = np.array([0.0, 20.0, -40.0])
"""Magnetic field of the generated flight, east, north, up."""

RFU_TO_FLU = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


class Samples(NamedTuple):
    """Numbers for the input ports of a core, each of shape (N, channels), and the name of their source."""

    source: str
    ports: dict[str, np.ndarray]


def samples_of(core: Core, config: Config, count: int, recordings: Path | None) -> Samples:
    """Samples in the order of time for a core's inputs, the start values of a navigator in the first one.

    Parameters
    ----------
    core : Core
        The main module of ``config``.
    config : Config
    count : int
        Samples of each channel.
    recordings : Path or None
        Folder with ATTITUDE_RECORDING and POSITION_RECORDING. Without the folder or the recording, the samples
        come from a generated flight.

    Raises: RecordingError for a recording that cannot be used.
    """
    system, channels, navigator = core.system, core.engine.channels, "place" in core.system.inputs
    name = POSITION_RECORDING if navigator else ATTITUDE_RECORDING
    path = recordings / f"{name}.npz" if recordings else None
    if path is None or not path.exists():
        name, values = GENERATED, _generated(config, count, channels)
    elif navigator:
        values = _drive(path, config, count)
    else:
        values = _recorded(path, config, count, channels)
    load = np.zeros((count, channels))
    load[0] = 1
    # A replay's constants, and the start of a quaternion.
    values = config.constant_inputs() | {"load": load, "align": 0.0, "start": (1.0, 0.0, 0.0, 0.0)} | values
    if "m" in values:
        values["m"] = values["m"] @ axis_matrix(getattr(config, "magnetometer_axes", ("+x", "+y", "+z")))
    bound = system.bind(**{name: values[name] for name in system.inputs})
    return Samples(name, {port: np.broadcast_to(numbers, (count, channels)) for port, numbers in bound.items()})


def _recorded(path, config, count, channels):
    """Sensors of an attitude core, by the kernels' names: different parts of a recording for the channels."""
    recording = read_recording(path)
    first = recording.time_s[0] + FIRST_S + STEP_S * np.arange(channels)
    wanted = first + np.arange(count)[:, None] * config.period_s

    def sampled(vectors):
        return np.stack([np.interp(wanted, recording.time_s, axis) for axis in vectors.T], axis=-1)

    gyro = sampled(recording.gyro_deg_s)
    return {"a": sampled(recording.accel), "m": sampled(recording.mag), "g": gyro, "omega": np.radians(gyro)}


def _drive(path, config, count):
    """Sensors and start values of a navigator, by the kernel's names: a car that starts."""
    leg: Any = car_leg(path, 60)
    each = round(config.period_s / leg.period_s)
    omega, force = (vectors[:count * each].reshape(count, each, 1, 3).mean(axis=1)
                    for vectors in (leg.omega_b, leg.f_b))
    return {"omega": omega, "f": force, "place": (np.degrees(leg.latitude), 0.0), "start_v": leg.velocity_m_s,
            "start_h": leg.height_m, "start_q": leg.q_b2n, "altitude": leg.height_m}


def _generated(config, count, channels):
    """Sensors and start values, by the kernels' names: a flight with turns, each channel in another course."""
    duration = count * config.period_s
    flights = [Flight(duration_s=duration, latitude_deg=45, height_m=1000, track_deg=40.0 * channel, speed_m_s=60,
                      changes=tuple(Change(what, begin * duration, 0.3 * duration, by) for what, begin, by in (
                          ("track_deg", 0.05, 50), ("climb_deg", 0.2, 10), ("track_deg", 0.45, -70),
                          ("climb_deg", 0.6, -15)))) for channel in range(channels)]
    omegas, forces, truth = zip(*(flight.sample(config.period_s) for flight in flights), strict=True)
    omega, force = np.stack(omegas, axis=1), np.stack(forces, axis=1)
    c_b2n = np.stack([each.c_b2n for each in truth], axis=1)
    start = truth[0]
    gyro = np.degrees(omega @ RFU_TO_FLU.T)
    return {"a": force @ RFU_TO_FLU.T, "g": gyro, "m": (FIELD_UT @ c_b2n) @ RFU_TO_FLU.T, "omega": omega, "f": force,
            "place": (45.0, 0.0), "start_v": start.velocity_m_s[0], "start_h": 1000.0,
            "start_q": quaternion_from_matrix(start.c_b2n[0].T), "altitude": 1000.0}
