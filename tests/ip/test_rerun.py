"""Recordings for the Rerun viewer, written and read back by rerun-sdk in an environment of its own."""

import subprocess

import numpy as np
import pytest

from .support import HERE

SECONDS = 4

# A run with everything that a log can have: time since 1970, gaps, a third axis that points down, tracks.
WRITE = """
import sys
from pathlib import Path
import numpy as np
from strapdown_sim.page import Curve, Panel
from strapdown_sim.rerun_log import write_rerun

time_s = 1.7e9 + np.arange(100) / 10
values = np.where(np.arange(100) % 3 == 0, np.arange(100.0), np.nan)
quaternion = np.tile([0.6, 0, 0, 0.8], (100, 1))
quaternion[:5] = np.nan
write_rerun(Path(sys.argv[1]), title="a run", time_s=time_s, frame="NED",
            panels=[Panel("height (m)", [Curve("log, own", values, points=True), Curve("line", -values)])],
            status={"at_rest": (np.arange(100) >= 20) & (np.arange(100) < 50)}, gaps=[(1.7e9 + 1, 1.7e9 + 1.5)],
            attitudes={"hardware": quaternion, "log": np.full((100, 4), np.nan)},
            tracks={"hardware": (time_s[:3], np.array([[48.0, 11.0], [48.1, 11.0], [48.1, 11.2]]))})
"""


@pytest.fixture
def python(root):
    return root / ".venv-rerun/bin/python"


def done(*command):
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def columns(python, path):
    """Columns by entity and name, read by rerun-sdk."""
    done(python, HERE / "read_rerun.py", path)
    return dict(np.load(path.with_suffix(".npz")))


@pytest.mark.ip
def test_replay(root, python, x_imu_recording, tmp_path, models):
    out = tmp_path / "out"
    done(root / ".venv-rerun/bin/strapdown", "replay", x_imu_recording, "--config", "mahony", "--to", SECONDS,
         "--rerun", "--output", out, "--build", models)
    found = columns(python, out / "replay.rrd")
    table = np.genfromtxt(out / "attitude.csv", delimiter=",", names=True)
    time_ns = np.rint(1e9 * table["t"]).astype(int)
    quaternion = np.stack([table[f"q{index}"] for index in (1, 2, 3, 0)], axis=-1)
    # The file has six decimals of the time, and Rerun binary32 of the quaternion.
    assert np.abs(found["/attitude/hardware|t"] - time_ns).max() <= 500
    assert np.abs(found["/attitude/hardware|Transform3D:quaternion"][:, 0] - quaternion).max() < 2e-7
    for name in "roll", "pitch", "yaw":
        entity = rf"/curves/{name}\ \(\u{{00B0}}\)/hardware"
        assert np.abs(found[f"{entity}|Scalars:scalars"][:, 0] - table[name]).max() <= 5e-7
        assert np.array_equal(found[f"{entity}|t"], found["/attitude/hardware|t"])
    # The device's own estimate comes at half of the rate of 256 Hz.
    own = np.flatnonzero(np.isin(found["/attitude/hardware|t"], found["/attitude/log|t"]))
    assert len(own) == len(found["/attitude/log|t"]) == pytest.approx(SECONDS * 128, abs=2)
    log = found["/attitude/log|Transform3D:quaternion"][:, 0]
    # The angle of the rotation between both is the total error, which has a curve. It is more than 1 degree, where an
    # error of 2e-7 in the product of both makes 2 * 2e-7 / sin(0.5 degrees) = 0.003 degrees.
    angle = 2 * np.degrees(np.arccos(np.minimum(np.abs(np.vecdot(log, quaternion[own])), 1)))
    total = next(values for name, values in found.items()
                 if "/total" in name and name.endswith("|Scalars:scalars"))[:, 0]
    assert total == pytest.approx(angle, abs=0.01)
    assert found["/status/refused|Scalars:scalars"].tolist() == [[0], [0]]
    assert found["/__properties|RecordingInfo:name"][0, 0].startswith("00033_CalInertialAndMag: INS_top")


@pytest.mark.ip
def test_everything_that_a_log_can_have(python, tmp_path):
    path = tmp_path / "replay.rrd"
    done(python, "-c", WRITE, path)
    found = columns(python, path)
    first = 1_700_000_000 * 10**9
    entity = r"/curves/height\ \(m\)/log\,\ own"
    assert found[f"{entity}|t|type"].tolist() == ["timestamp[ns]"]
    assert found[f"{entity}|t"].tolist() == [first + k * 10**8 for k in range(0, 100, 3)]
    assert found[f"{entity}|Scalars:scalars"][:, 0].tolist() == list(range(0, 100, 3))
    assert f"{entity}|SeriesPoints:names" in found
    assert r"/curves/height\ \(m\)/line|SeriesLines:names" in found
    assert len(found["/attitude/hardware|t"]) == 95
    assert "/attitude/log|t" not in found
    assert found["/attitude/hardware|Transform3D:quaternion"][0, 0] == pytest.approx([0, 0, 0.8, 0.6])
    # In north, east, down: east, north and up.
    assert found["/attitude/directions|Arrows3D:vectors"][0].tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    assert found["/status/at_rest|t"].tolist() == [first + k * 10**8 for k in (0, 20, 50, 99)]
    assert found["/status/at_rest|Scalars:scalars"][:, 0].tolist() == [0, 1, 0, 0]
    assert found["/gaps|TextLog:text"].tolist() == [["gap of 500 ms, filled in"]]
    assert found["/gaps|t"].tolist() == [first + 10**9]
    places = [[48.0, 11.0], [48.1, 11.0], [48.1, 11.2]]
    assert found["/track/hardware|GeoPoints:positions"][:, 0].tolist() == places
    assert found["/track/hardware/line|GeoLineStrings:line_strings"][0, 0].tolist() == places
