"""Installation by a user: the wheel outside the checkout, and a source distribution that contains its tests."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

WINGS = ("hw", "sim")
"""Folders whose packages are in the wheel."""

HEADER = ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
          "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),"
          "Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT)")


def clean_environment(**changes):
    """The environment without variables that lead Python into the checkout."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return kept | changes


def tracked(root):
    """The checkout's files, as paths relative to it."""
    if not (root / ".git").exists():
        pytest.skip("This is no git checkout, so it is not known which files belong to the project.")
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=root,
                            capture_output=True, text=True, check=True)
    return {name for name in listed.stdout.splitlines() if (root / name).is_file()}


@pytest.fixture(scope="module")
def distributions(root, tmp_path_factory):
    """Wheel and source distribution of the checkout, built from a copy of its files."""
    files, folder = tracked(root), tmp_path_factory.mktemp("dist")
    copy = folder / "strapdown"
    for name in files:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / name, copy / name)
    for kind in "wheel", "sdist":
        build = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
        subprocess.run([sys.executable, "-c", build, str(folder)], cwd=copy, check=True, capture_output=True,
                       env=clean_environment())
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


def test_wheel_holds_every_module_of_generator_and_simulation(root, distributions):
    names = set(zipfile.ZipFile(distributions[0]).namelist())
    wanted = {name.partition("/")[2] for name in tracked(root) if name.startswith(tuple(f"{w}/" for w in WINGS))}
    assert wanted - names == set()
    assert not any(name.startswith(("strapdown_lab", "tests")) for name in names)


def test_source_distribution_holds_what_its_tests_need(root, distributions):
    with tarfile.open(distributions[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {name for name in tracked(root) if not name.startswith(".")} - names == set()


def test_installed_wheel_lists_generates_and_replays(root, distributions, tmp_path):
    """In a new environment, in an empty folder, under a locale that is not UTF-8."""
    environment = clean_environment(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    binary = tmp_path / "venv" / "bin"
    subprocess.run([binary / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
                    "--constraint", root / "constraints.txt", distributions[0]], check=True, env=environment)

    def strapdown(*arguments, status=0):
        done = subprocess.run([binary / "strapdown", *map(str, arguments)], cwd=tmp_path, env=environment,
                              capture_output=True, text=True, encoding="utf-8", check=False)
        assert done.returncode == status, done.stderr
        return done.stderr if status else done.stdout

    assert "INS_top" in strapdown("list")
    strapdown("generate", "--config", "mahony", "--module", "INS_top")
    verilog = tmp_path / "build" / "verilog" / "mahony" / "INS_top.v"
    assert "module INS_top (" in verilog.read_text(encoding="ascii")

    # Templates and sources of drivers are in the wheel; PeakRDL is an extra.
    strapdown("ip", "quaternion_j2", "--no-streams")
    package = tmp_path / "build" / "ip" / "quaternion_j2"
    assert {path.name for path in package.iterdir()} >= {"component.xml", "example.tcl", "drivers", "hdl", "linux"}
    assert list(package.rglob("registers/*.xml")) == []

    rows = [f"{k / 100:.2f},1,2,3,0.01,0.02,1,20,1,-40" for k in range(100)]
    (tmp_path / "flight.csv").write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    strapdown("replay", "flight.csv", "--config", "mahony", "--output", "out")
    attitude = np.genfromtxt(tmp_path / "out" / "attitude.csv", delimiter=",", names=True)
    assert len(attitude) == 100
    assert np.isfinite(attitude["yaw"]).all()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "INS_top.json", "INS_top.v", "INS_top.vlt", "attitude.csv", "attitude.png", "summary.json"]

    assert strapdown("report", status=2) == \
        "strapdown: 'report' needs a checkout of the project: there, 'make setup' installs it\n"
    assert not any(Path(tmp_path).glob("*.egg-info"))
