"""The example in docs/kernels.md: a core in a user's file, with all commands; and the same core inside the tree."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_lab import docs
from strapdown_lab.checkout import block

RATE_HZ = 100
FIELD_NWU, GRAVITY = np.array([20.0, 0, -40]), 9.8
HEADER = ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
          "Accelerometer X (m/s^2),Accelerometer Y (m/s^2),Accelerometer Z (m/s^2),"
          "Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT)")


@pytest.fixture(scope="module")
def page(root):
    return (root / "docs" / "kernels.md").read_text(encoding="utf-8")


@pytest.fixture
def folder(page, tmp_path, monkeypatch):
    """A folder outside the checkout with my_core.py in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_core.py").write_text(docs.own_kernel(page), encoding="utf-8")
    return tmp_path


@pytest.fixture
def my_core(folder):
    """The file as a module."""
    spec = importlib.util.spec_from_file_location("my_core", folder / "my_core.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def attitudes(count):
    """Random rotation matrices, body to north-west-up, shape (count, 3, 3)."""
    q = np.random.default_rng(7).standard_normal((count, 4))
    q0, q1, q2, q3 = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.moveaxis(np.array([
        [1 - 2 * (q2 * q2 + q3 * q3), 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2)],
        [2 * (q1 * q2 + q0 * q3), 1 - 2 * (q1 * q1 + q3 * q3), 2 * (q2 * q3 - q0 * q1)],
        [2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), 1 - 2 * (q1 * q1 + q2 * q2)]]), -1, 0)


def test_heading_and_tilt_are_those_of_the_rotation(my_core):
    r = attitudes(2000)
    # The time constant is so short that the gain of the low-pass is 1.
    config = my_core.COMPASS.replace(time_constant_s=1e-4)
    system = my_core.compass(config)
    result, _ = system.run(config.pool, system.bind(a=r[:, 2] * GRAVITY, m=np.einsum("nij,i->nj", r, FIELD_NWU)))
    outputs = system.read(result)
    north, west = r[:, 0, 0], r[:, 1, 0]
    # About twenty roundings of 2**-24, magnified by at most 1/0.1 where body x is steep, are 0.0007 degrees.
    flat = np.hypot(north, west) > 0.1
    heading = np.degrees(np.arctan2(-west, north)) % 360
    difference = (outputs["heading"] - heading + 180) % 360 - 180
    assert np.abs(difference[flat]).max() < 1e-3
    tilt = np.degrees(np.arccos(np.clip(r[:, 2, 2], -1, 1)))
    assert np.abs(outputs["tilt"] - tilt).max() < 1e-3
    assert not result["field_vertical"].any()


def test_low_pass_and_steep_field(my_core):
    system = my_core.compass(my_core.COMPASS)
    # Level for one sample, then nose down for the time constant of half a second.
    count = 50
    a = [[0, 0, GRAVITY], *[[GRAVITY, 0, 0]] * count]
    result, state = system.run(my_core.COMPASS.pool, system.bind(a=a, m=[0, 0, -40]))
    left = np.exp(-count / RATE_HZ / my_core.COMPASS.time_constant_s)
    np.testing.assert_allclose([state[f"up_{axis}"] for axis in "xyz"], [GRAVITY * (1 - left), 0, GRAVITY * left],
                               rtol=1e-5)
    assert result["field_vertical"][0]
    assert not result["field_vertical"][-1]


@pytest.mark.verilator
def test_every_command_of_the_section(page, folder, root):
    rows = [f"{k / RATE_HZ:.2f},0,0,0,{a},{b},{c},{x},{y},{z}" for k, ((a, b, c), (x, y, z)) in enumerate(zip(
        attitudes(100)[:, 2] * GRAVITY, attitudes(100)[:, 0] * 40, strict=True))]
    (folder / "flight.csv").write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    section = page[page.index("\n## A kernel of your own\n"):]
    commands = re.findall(r"^strapdown (.*?)(?:\s+#.*)?$", re.search(r"```sh\n(.*?)```", section, re.DOTALL)[1],
                          re.MULTILINE)
    assert len(commands) == 6
    printed = {}
    for command in commands:
        result = CliRunner().invoke(main, command.split(), catch_exceptions=False)
        assert result.exit_code == 0, result.output
        printed[command] = result.output
    verilog = (folder / "build" / "verilog" / "compass" / "COMPASS_top.v").read_text(encoding="ascii")
    assert "//   heading: Heading of body x: atan2(|up| east_x, north_x)" in verilog
    assert str(folder) not in verilog
    assert "my_core.py:" in printed["explain my_core.py:COMPASS --cycle 20"]
    assert json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))["bits_differing_from_twin"] == 0
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "COMPASS_top.json", "COMPASS_top.v", "COMPASS_top.vlt", "outputs.csv", "outputs.png", "summary.json"]
    table = np.genfromtxt(folder / "out" / "outputs.csv", delimiter=",", names=True)
    assert table.dtype.names == ("t", "heading", "tilt")
    assert len(table) == 100


def test_printed_lines_are_those_of_this_commit(page):
    assert block(page, "compass")[1].strip() == docs.compass_block()


def test_twin_in_python(page, folder):
    code = re.search(r"```python\n(from my_core import.*?)```", page, re.DOTALL)[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    # First north; then the field points to body y (left), so the body points east.
    heading = [float(number) for number in re.findall(r"[\d.]+", done.stdout.partition("]")[0])]
    assert heading == pytest.approx([0, 90], abs=1e-4)


def test_the_same_inside_the_tree(page, folder, root):
    """The two blocks as files of the package, and one line in the catalogue, give the same circuit."""
    tree = folder / "tree" / "strapdown"
    shutil.copytree(root / "hw" / "strapdown", tree, ignore=shutil.ignore_patterns("__pycache__"))
    equations, system = docs.own_kernel(page).split("\n\n\nfrom pydantic", maxsplit=1)
    (tree / "algorithms" / "compass.py").write_text(equations + "\n", encoding="utf-8")
    (tree / "cores" / "compass.py").write_text(
        "import math\nfrom strapdown.algorithms.compass import compass_update, heading, tilt, vertical\n"
        f"from pydantic{system}", encoding="utf-8")
    catalogue = tree / "cores" / "catalogue.py"
    text = catalogue.read_text(encoding="utf-8")
    assert text.count("SINS_DAMPED, ") == 1
    catalogue.write_text(text.replace("SINS_DAMPED, ", "SINS_DAMPED, COMPASS, ").replace(
        "from .core import", "from .compass import COMPASS\nfrom .core import", 1), encoding="utf-8")
    for target, path in ("compass", {"PYTHONPATH": str(tree.parent)}), ("my_core.py:COMPASS", {}):
        subprocess.run([sys.executable, "-m", "strapdown", "generate", target, "--output", target.partition(".")[0]],
                       cwd=folder, env=os.environ | path, check=True, capture_output=True)
    inside, own = (re.sub(r"^//.*\n", "", Path(name, "COMPASS_top.v").read_text(encoding="ascii"), flags=re.MULTILINE)
                   for name in ("compass", "my_core"))
    assert inside == own
