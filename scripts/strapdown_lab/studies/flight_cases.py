"""The flight filter where filters fail: starts in motion, large biases, upside down, a magnet, an hour, fast samples.

The script writes docs/report/flight_cases.json and a table in docs/flight.md. The core's twin runs beside VQF, on the
same samples. The arguments are the folders of the recordings.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strapdown.cores import FLIGHT, FLIGHT_6AXIS, ins_flight
from strapdown.kernel.native import NativeTwin
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.accuracy import TUNED_ON, vqf
from strapdown_lab.studies.equations import equations_digest
from strapdown_lab.studies.flight_parts import POOL
from strapdown_sim.errors import attitude_errors, match_reference, multiply, rms
from strapdown_sim.external import with_external_acceleration
from strapdown_sim.recordings import Recording, Reference, read_recording
from strapdown_sim.reference.attitude import matrix_from_quaternion
from strapdown_sim.stimuli.wander import wander

__all__ = ["cases_digest", "cases_table", "hour", "main", "referenced", "resting", "started", "turned_over"]

STARTS_S = 20, 35, 50
MAGNET = "broad_33_disturbed_attached_magnet_2cm"
MAGNET_STARTS_S = 0, 2, 4, 6, 8
OFFSET_DEG_S = 5.0
HALF_TURN = np.array([0.0, 1.0, 0.0, 0.0])


class Case(NamedTuple):
    """Recordings that are scored together, from ``after_s`` of their time on."""

    recordings: list[Recording]
    after_s: float = 0.0
    external: bool = False


def cases_digest():
    """Digest of the equations and of all values that the study uses."""
    return equations_digest(ins_flight(FLIGHT), POOL) + equations_digest(ins_flight(FLIGHT_6AXIS), POOL)


def started(recording, start_s):
    """A recording without its first ``start_s`` seconds."""
    first = int(np.searchsorted(recording.time_s, recording.time_s[0] + start_s - 1e-6))
    part = slice(first, None)
    return replace(recording, time_s=recording.time_s[part], gyro_deg_s=recording.gyro_deg_s[part],
                   accel=recording.accel[part], mag=None if recording.mag is None else recording.mag[part],
                   reference=_from(recording.reference, recording.time_s[first]))


def _from(reference, time_s):
    """A reference that is valid only from a time on."""
    return replace(reference, valid=reference.valid & (reference.time_s >= time_s))


def turned_over(recording):
    """A recording of a sensor that is mounted upside down."""
    c = matrix_from_quaternion(HALF_TURN)
    mag = None if recording.mag is None else recording.mag @ c.T
    reference = replace(recording.reference, quaternion=multiply(recording.reference.quaternion, HALF_TURN))
    return replace(recording, gyro_deg_s=recording.gyro_deg_s @ c.T, accel=recording.accel @ c.T, mag=mag,
                   reference=reference)


def _recording(name, rate_hz, gyro, accel, mag, quaternion):
    time_s = np.arange(len(gyro)) / rate_hz
    truth = Reference(time_s, quaternion, np.ones(len(gyro), dtype=bool), "NWU", heading_known=True)
    return Recording(name, rate_hz, time_s, gyro, accel, mag, accel_unit="m/s^2", reference=truth)


def hour(seconds=3600.0, rate_hz=50.0, seed=1):
    """An hour of motion of 60 deg/s, with a bias that grows to 1.5·(0.5, -0.5, 0.7) deg/s, and noise of all sensors."""
    motion = wander(seconds, rate_hz, seed)
    rng = np.random.default_rng(seed)
    bias = 1.5 * np.array([0.5, -0.5, 0.7]) * np.linspace(0, 1, len(motion.rate_deg_s))[:, None]
    shape = motion.rate_deg_s.shape
    return _recording("an hour", rate_hz, motion.rate_deg_s + bias + 0.1 * rng.standard_normal(shape),
                      motion.force + 0.05 * rng.standard_normal(shape), motion.field + 0.5 * rng.standard_normal(shape),
                      motion.quaternion)


def resting(seconds=30.0, rate_hz=8000.0, seed=3):
    """Rest with white noise of the gyro of 0.14 mrad/s/√Hz, and a bias."""
    rng = np.random.default_rng(seed)
    count = round(seconds * rate_hz)
    noise = np.degrees(0.14e-3) * np.sqrt(rate_hz)
    gyro = (0.3, -0.2, 0.4) + noise * rng.standard_normal((count, 3))
    accel = (0.0, 0.0, 9.81) + 0.06 * rng.standard_normal((count, 3))
    mag = (20.0, 0.0, -45.0) + 0.3 * rng.standard_normal((count, 3))
    return _recording("rest", rate_hz, gyro, accel, mag, np.tile((1.0, 0.0, 0.0, 0.0), (count, 1)))


def referenced(folders):
    """Recordings of some folders, or of the shared ones, that have a reference."""
    paths = [Path(folder) for folder in folders] or [
        ROOT.parent / "shared" / name for name in ("recordings", "validation")]
    return [recording for folder in paths for recording in map(read_recording, sorted(folder.glob("*.npz")))
            if recording.reference is not None and recording.reference.valid.any()]


def cases(recordings):
    """Maps the title of each case to a Case."""
    broad = [each for each in recordings if each.name.startswith("broad") and each.name != MAGNET]
    quads = [each for each in recordings if each.name.startswith("ins_quad")]
    magnet = [each for each in recordings if each.name == MAGNET]
    rooms = [each for each in recordings if each.name.startswith("tumvi")]
    biased = [replace(each, gyro_deg_s=each.gyro_deg_s + OFFSET_DEG_S * axis) for each in broad for axis in np.eye(3)]
    long = hour()
    found = {
        "six BROAD recordings \\*": Case([each for each in broad if each.name in TUNED_ON]),
        "other BROAD recordings, without the magnet 2 cm away": Case(
            [each for each in broad if each.name not in TUNED_ON]),
        "TUM-VI rooms": Case(rooms),
        "quadrotors": Case(quads), "quadrotors, from 5 s on": Case(quads, 5.0),
        "the same with external acceleration": Case(quads, 5.0, external=True),
        f"all BROAD recordings, started at {', '.join(map(str, STARTS_S))} s, from 10 s after": Case(
            [started(each, start) for each in broad for start in STARTS_S], 10.0),
        "all BROAD recordings, upside down": Case([turned_over(each) for each in broad]),
        "all BROAD recordings, 5 deg/s more on each axis": Case(biased),
        **{f"magnet 2 cm away, first {start} s cut off": Case([started(each, start) for each in magnet])
           for start in MAGNET_STARTS_S},
        "an hour, first ten minutes": Case([replace(long, reference=_until(long.reference, 600.0))]),
        "an hour, from then on": Case([long], 600.0),
        "rest at 8 kHz, after 29 s": Case([resting()], 29.0)}
    return {title: case for title, case in found.items() if case.recordings}


def _until(reference, time_s):
    return replace(reference, valid=reference.valid & (reference.time_s < time_s))


def twin(recording, external):
    """Attitude of the core's twin, sensor to NWU; with the external acceleration from the recording's velocity."""
    config = FLIGHT_6AXIS if recording.mag is None else FLIGHT
    config = config.replace(sample_rate_hz=recording.sample_rate_hz)
    sensors = {"a": recording.accel, "m": recording.mag, "g": recording.gyro_deg_s}
    if external:
        config = config.replace(external_input=True)
        sensors["external"] = with_external_acceleration(recording, config)[0].external
    system = ins_flight(config)
    result, _ = NativeTwin(system, POOL).run(system.bind(**{name: sensors[name] for name in system.inputs}))
    return system.read(result)["q"].astype(float)


def score(case):
    """Mean RMS total and inclination error in degrees of the filters of a Case."""
    figures: dict = {}
    for recording in case.recordings:
        scored = replace(recording, reference=_from(recording.reference, recording.time_s[0] + case.after_s))
        filters = {"flight": twin(recording, case.external)} | ({} if case.external else {"vqf": vqf(recording)})
        for name, quaternion in filters.items():
            match = match_reference(scored, quaternion)
            errors = attitude_errors(match.q_est, match.q_ref)
            figures.setdefault(name, []).append((rms(errors.total), rms(errors.inclination)))
    return {name: dict(zip(("total", "inclination"), np.mean(values, axis=0).tolist(), strict=True))
            for name, values in figures.items()}


def cases_table(result):
    """The figures as a Markdown table."""
    def cell(figures):
        return f"{figures['total']:.2f} / {figures['inclination']:.2f}" if figures else "–"

    filters = "flight", "vqf"
    return markdown_table(["", *(f"{name}:" for name in filters)], [
        [title, *(cell(figures.get(name)) for name in filters)] for title, figures in result["cases"].items()])


def main():
    """Measure, and write the JSON file and the table."""
    recordings = referenced(sys.argv[1:])
    result: dict = {"equations_sha256": cases_digest(), "cases": {}}
    for title, case in cases(recordings).items():
        result["cases"][title] = score(case)
        print(title, result["cases"][title], flush=True)
    (ROOT / "docs" / "report" / "flight_cases.json").write_text(
        json.dumps(result, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "flight.md", {"cases": cases_table(result)})


if __name__ == "__main__":
    main()
