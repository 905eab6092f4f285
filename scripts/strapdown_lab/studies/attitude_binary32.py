"""The difference between the angles of the attitude core and the same equations in float64, on real recordings.

The script writes docs/report/attitude_binary32.json and the table in docs/cores.md. It takes some minutes. The argument
is the folder of the recordings.
"""

import json
import sys
from pathlib import Path

import numpy as np

from strapdown.cores import THESIS, THESIS_X8, main_module, system_of
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.errors import angle_difference, rms
from strapdown_sim.recordings import read_recording
from strapdown_sim.replay import for_recording

__all__ = ["FORMS", "digests", "table"]

FORMS = {"one channel": THESIS, "several channels": THESIS_X8}
"""The two orders of the equations, each with the operators of a configuration."""

ANGLES = "pitch", "roll", "yaw"

STEEP_DEG = 85.0
"""Pitch from which roll and yaw are not judged one by one."""


def system_for(config):
    """The system of the main module of a configuration."""
    return system_of(main_module(config), config)


def digests():
    """Digest of the equations of each form."""
    return {name: equations_digest(system_for(config), config.engine_pool) for name, config in FORMS.items()}


def differences(config, recording):
    """RMS difference of pitch, roll and yaw between twin and float64, degrees."""
    config = for_recording(config.replace(magnetometer_axes=("+x", "+y", "+z")), recording)
    system = system_for(config)
    inputs = system.bind(a=recording.accel, m=recording.mag, g=recording.gyro_deg_s)
    twin, truth = (system.read(run[0])["angles"].astype(float)
                   for run in (system.run(config.engine_pool, inputs), system.run_float64(inputs)))
    judged = np.abs(truth[:, 0]) < STEEP_DEG
    return {name: rms(difference)
            for name, difference in zip(ANGLES, angle_difference(twin, truth)[judged].T, strict=True)}


def table(result):
    """The results as a Markdown table."""
    names = list(result["equations_sha256"])
    return markdown_table(
        ["recording", *(f"{name}: {angle}:" for name in names for angle in ANGLES)],
        [[f"`{recording}`", *(f"{1e5 * row[name][angle]:.1f}" for name in names for angle in ANGLES)]
         for recording, row in result["recordings"].items()])


def main(folder):
    """Measure, and write the JSON file and the table."""
    recordings = [each for each in map(read_recording, sorted(Path(folder).glob("*.npz"))) if each.mag is not None]
    result = {"equations_sha256": digests(), "recordings": {
        recording.name: {name: differences(config, recording) for name, config in FORMS.items()}
        for recording in recordings}}
    (ROOT / "docs" / "report" / "attitude_binary32.json").write_text(
        json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "cores.md", {"attitude binary32": table(result)})


if __name__ == "__main__":
    main(sys.argv[1])
