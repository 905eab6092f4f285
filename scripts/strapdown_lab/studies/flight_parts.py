"""The effect of each part of the flight filter on recordings: one part left out, or one value changed.

The script writes docs/report/flight_parts.json and the table in docs/flight.md. It takes some minutes. The argument is
the folder of the recordings.
"""

import json
import sys
from itertools import groupby
from pathlib import Path

import numpy as np

from strapdown.cores import FLIGHT, FLIGHT_6AXIS, ins_flight
from strapdown.kernel.native import NativeTwin
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector
from strapdown.kernel.pool import Pool
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.errors import attitude_errors, match_reference, rms
from strapdown_sim.recordings import read_recording

__all__ = ["FIGURES", "PARTS", "measured", "parts_digest", "parts_table"]

NEVER = 1e6
"""A time in seconds that no recording reaches, and a noise with which nothing is learnt."""

PARTS = {
    "all": {},
    "without earth-frame low-pass (τ = 1 ms)": {"acceleration_time": 0.001},
    "without trust (w = 1)": {"field_tolerance": 1e6},
    "with a reference that does not change while the field is rejected": {"field_recovery_time": NEVER},
    "without bias at rest": {"rest_time": NEVER},
    "without bias in motion": {"bias_noise": NEVER},
    "without any bias": {"rest_time": NEVER, "bias_noise": NEVER},
    "τ 2 s": {"acceleration_time": 2.0}, "τ 4 s": {"acceleration_time": 4.0},
    "W 1": {"bias_noise": 1.0}, "W 3.5": {"bias_noise": 3.5},
    "P_0 1 deg/s": {"bias_deviation": 1.0}, "P_0 5 deg/s": {"bias_deviation": 5.0},
    "ε 0.3": {"bias_learning": 0.3}, "ε 1": {"bias_learning": 1.0},
    "t_r 3 s": {"ramp_time": 3.0}, "t_r 12 s": {"ramp_time": 12.0},
    "k 1": {"heading_weighting": 1.0}, "k 6": {"heading_weighting": 6.0},
    "γ 0.12": {"field_tolerance": 0.12}, "γ 0.20": {"field_tolerance": 0.20},
    "Km 0.05": {"magnetometer_gain": 0.05}, "Km 0.2": {"magnetometer_gain": 0.2},
}
"""Maps the name of each variant to the fields that differ from FLIGHT."""

POOL = Pool(operators=(Adder(), Multiplier(), Divider(), Selector()))
"""The compiled twin has no arctangent, and the attitude does not depend on it."""

FLIGHTS = "ins_quad_horizontal_11", "ins_quad_vertical_17"
FIGURES = "total, 9 axes", "inclination, 9 axes", *(f"inclination, {name}" for name in FLIGHTS)


def parts_digest():
    """Digest of the equations and of all values that the study uses."""
    return equations_digest(ins_flight(FLIGHT), POOL) + equations_digest(ins_flight(FLIGHT_6AXIS), POOL)


def scores(recordings, changes):
    """RMS errors in degrees of a variant: recording to total and inclination."""
    def kind(recording):
        return recording.mag is not None, recording.sample_rate_hz

    errors = {}
    for (magnetometer, rate), group in groupby(sorted(recordings, key=kind), kind):
        config = (FLIGHT if magnetometer else FLIGHT_6AXIS).replace(sample_rate_hz=rate, **changes)
        system = ins_flight(config)
        twin = NativeTwin(system, POOL)
        for recording in group:
            sensors = {"a": recording.accel, "m": recording.mag, "g": recording.gyro_deg_s}
            result, _ = twin.run(system.bind(**{name: sensors[name] for name in system.inputs}))
            match = match_reference(recording, system.read(result)["q"].astype(float))
            error = attitude_errors(match.q_est, match.q_ref)
            errors[recording.name] = {"total": rms(error.total), "inclination": rms(error.inclination)}
    return errors


def measured(recordings, variants, progress=print):
    """Figures of FIGURES of each variant, a dict of names to changes, in degrees."""
    nine = [recording.name for recording in recordings if recording.mag is not None]
    figures = {}
    for name, changes in variants.items():
        errors = scores(recordings, changes)
        means = (float(np.mean([errors[stem][kind] for stem in nine])) for kind in ("total", "inclination"))
        figures[name] = dict(zip(FIGURES, [*means, *(errors[stem]["inclination"] for stem in FLIGHTS)], strict=True))
        progress(name, *(f"{value:.2f}" for value in figures[name].values()))
    return figures


def parts_table(result):
    """The figures as a Markdown table."""
    return markdown_table(["", "total:", "inclination:", "flight 11:", "flight 17:"], [
        [name, *(f"{figures[figure]:.2f}" for figure in FIGURES)] for name, figures in result["parts"].items()])


def main():
    """Measure, and write the JSON file and the table."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "recordings"
    recordings = [recording for recording in map(read_recording, sorted(folder.glob("*.npz")))
                  if recording.reference is not None and recording.reference.valid.any()]
    result = {"equations_sha256": parts_digest(), "parts": measured(recordings, PARTS)}
    (ROOT / "docs" / "report" / "flight_parts.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "flight.md", {"parts": parts_table(result)})


if __name__ == "__main__":
    main()
