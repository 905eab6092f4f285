"""Whole recordings through the circuit."""

import json

import pytest

from strapdown.cores import MAHONY
from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_sim.recordings import read_recording
from strapdown_sim.replay import replay

# float32 is good to 2**-24; Kp = 0.5 forgets an error in two seconds, some 600 updates of ten
# roundings each. If all of them went one way it would be 600·10·2**-24 rad = 0.02 degrees; they
# do not, and the requirement is half of that.
LARGEST_DEG = 0.01


def check(recording, folder, models, **options):
    result = replay(recording, MAHONY, folder, build=models, command=(), **options)
    summary = result.summary
    assert summary["samples"] == len(recording.time_s) == len(result.quaternion)
    assert summary["bits_differing_from_twin"] == 0
    assert summary["refused_updates"] == 0
    assert summary["against_float64_reference_deg"]["max"] <= LARGEST_DEG
    return summary


@pytest.mark.verilator
def test_x_imu_recording(x_imu_recording, tmp_path, models, root):
    summary = check(read_recording(x_imu_recording), tmp_path, models, html=True)
    assert summary["samples"] == 12_626
    assert summary["sample_rate_hz"] == 256
    # `make demo` runs the same; its table in the README must be correct.
    page = (tmp_path / "replay.html").read_text(encoding="utf-8")
    assert "<th>bits that differ from the twin</th><td>0</td>" in page
    written = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert block((root / "README.md").read_text(encoding="utf-8"), "demo")[1].strip() == docs.demo_block(written)


@pytest.mark.verilator
def test_80_seconds_at_286_hz(shared_recordings, tmp_path, models):
    summary = check(read_recording(shared_recordings / "broad_02_undisturbed_slow_rotation_B.npz"), tmp_path, models)
    assert summary["samples"] == 22_857
    assert summary["against_recorded_reference_deg"]["samples"] > 10_000
