"""A magnet 2 cm away: what the field says about the heading there, and what filters make of it.

The script writes docs/report/flight_magnet.json and two tables in docs/flight.md. It takes some minutes. The parameters
of the product are not changed by it. The arguments are the folders of the recordings.
"""

import json
import sys

import numpy as np

from strapdown.cores import FLIGHT, ins_flight
from strapdown.kernel.native import NativeTwin
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.accuracy import TUNED_ON, vqf
from strapdown_lab.studies.flight_cases import MAGNET, MAGNET_STARTS_S, cases_digest, referenced, started
from strapdown_lab.studies.flight_parts import POOL
from strapdown_sim.errors import attitude_errors, enu_to_nwu, match_reference, rms
from strapdown_sim.reference.attitude import matrix_from_quaternion

__all__ = ["earth_field", "first_directions", "magnet_tables", "main", "mean_so_far"]

PAST = "broad_28_disturbed_stationary_magnet_A"
"""A recording that begins beside a magnet which does not move with the sensor."""

CASES = {**{f"magnet 2 cm away, from {start} s": (MAGNET, start) for start in (*MAGNET_STARTS_S, 35)},
         **{f"magnet that stands still, from {start} s": (PAST, start) for start in (0, 8)}}
"""Maps each title to a recording and the first seconds that are cut off."""

FIRST_S = 1, 2, 4, 8, 16
"""Times over which the first field is averaged."""

SEARCHED = ("magnetometer_gain", "field_tolerance", "field_time", "field_recovery_time", "heading_weighting",
            "ramp_time")
FACTOR, SETS, SEED = 3.0, 150, 1
"""The search tries random sets, each parameter within this factor of its default."""

MEANS = {f"mean of {time} s, no rejection": {
    "field_tolerance": 1e3, "magnetometer_gain": 1 / time, "heading_weighting": 1.0, "ramp_time": float(time)}
    for time in (20, 40)}
"""Parameters with which the filter takes the mean of the whole field."""


def earth_field(recording):
    """Field in NWU with the reference attitude, shape (N, 3); before it is valid the body rests in its first one."""
    reference = recording.reference
    place = np.searchsorted(reference.time_s[reference.valid], recording.time_s + 1e-6) - 1
    q = reference.quaternion[reference.valid][np.maximum(place, 0)]
    q = enu_to_nwu(q) if reference.frame == "ENU" else q
    return np.einsum("nji,nj->ni", matrix_from_quaternion(q), recording.mag)


def direction(field):
    """Angle of horizontal fields from north, degrees, from the west positive, shape (...)."""
    return np.degrees(np.arctan2(field[..., 1], field[..., 0]))


def mean_so_far(recording):
    """RMS heading error of the mean of the field so far, with the attitude known but for a constant heading."""
    error = direction(np.cumsum(earth_field(recording), axis=0))
    scored = np.isin(recording.time_s, recording.reference.time_s[recording.reference.valid])
    return rms(error[scored])


def first_directions(recording):
    """Direction of the mean field over each of FIRST_S, and strength and dip (degrees) of the first second's mean."""
    field, elapsed = earth_field(recording), recording.time_s - recording.time_s[0]
    means = {time: field[elapsed < time].mean(axis=0) for time in FIRST_S}
    x, y, z = means[1]
    return {"directions": [float(direction(mean)) for mean in means.values()],
            "strength": float(np.linalg.norm(means[1])), "dip": float(np.degrees(np.arctan2(-z, np.hypot(x, y))))}


def total(recording, quaternion):
    """RMS total error in degrees."""
    match = match_reference(recording, quaternion)
    return rms(attitude_errors(match.q_est, match.q_ref).total)


class Twin:
    """The core's twin, whose parameters of the heading are inputs."""

    def __init__(self, rate_hz):
        self._system = ins_flight(FLIGHT.replace(sample_rate_hz=rate_hz, inputs=SEARCHED))
        self._twin = NativeTwin(self._system, POOL)

    def total(self, recording, changes):
        """RMS total error in degrees with some parameters changed."""
        given = {"a": recording.accel, "m": recording.mag, "g": recording.gyro_deg_s}
        given |= {name: getattr(FLIGHT, name) for name in SEARCHED} | changes
        result, _ = self._twin.run(self._system.bind(**{name: given[name] for name in self._system.inputs}))
        return total(recording, self._system.read(result)["q"].astype(float))


def searched(twin, recordings):
    """The set with the smallest largest error on some recordings, of SETS random ones."""
    rng = np.random.default_rng(SEED)
    sets = [{name: float(getattr(FLIGHT, name) * factor) for name, factor in zip(
        SEARCHED, FACTOR**rng.uniform(-1, 1, len(SEARCHED)), strict=True)} for _ in range(SETS)]
    return min(sets, key=lambda each: max(twin.total(recording, each) for recording in recordings))


def measured(recordings):
    """Figures of each of CASES, and of the mean of the tuned recordings; and the set that the search found."""
    named = {each.name: each for each in recordings}
    cut = {title: started(named[name], start) for title, (name, start) in CASES.items()}
    six = [each for each in recordings if each.name in TUNED_ON]
    twin = Twin(named[MAGNET].sample_rate_hz)
    found = searched(twin, [cut[f"magnet 2 cm away, from {start} s"] for start in MAGNET_STARTS_S])
    variants = {"flight": {}, **MEANS, "best of the search": found}
    errors = {title: {"vqf": total(each, vqf(each)), "mean so far, true attitude": mean_so_far(each),
                      **{name: twin.total(each, changes) for name, changes in variants.items()}}
              for title, each in cut.items()}
    errors["mean of the six BROAD recordings \\*"] = {
        "vqf": float(np.mean([total(each, vqf(each)) for each in six])),
        "mean so far, true attitude": float(np.mean([mean_so_far(each) for each in six])),
        **{name: float(np.mean([twin.total(each, changes) for each in six])) for name, changes in variants.items()}}
    return {"searched": found, "first": {title: first_directions(each) for title, each in cut.items()},
            "errors": errors}


def magnet_tables(result):
    """The figures as Markdown tables, by the name of their block."""
    names = list(next(iter(result["errors"].values())))
    return {
        "magnet, first field": markdown_table(
            ["", "strength, µT:", "dip, °:", *(f"first {time} s, °:" for time in FIRST_S)],
            [[title, f"{row['strength']:.1f}", f"{row['dip']:.1f}", *(f"{value:.1f}" for value in row["directions"])]
             for title, row in result["first"].items()]),
        "magnet, errors": markdown_table(
            ["", *(f"{name}:" for name in names)],
            [[title, *(f"{row[name]:.2f}" for name in names)] for title, row in result["errors"].items()])}


def main():
    """Measure, and write the JSON file and the tables."""
    result = {"equations_sha256": cases_digest(), **measured(referenced(sys.argv[1:]))}
    (ROOT / "docs" / "report" / "flight_magnet.json").write_text(
        json.dumps(result, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "flight.md", magnet_tables(result))


if __name__ == "__main__":
    main()
