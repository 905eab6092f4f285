"""The Python of docs/software.md runs as written; tests/ip/test_arm.py runs its programs in C."""

import ast
import re
import sys

import numpy as np
import pytest

from strapdown.cores import THESIS
from strapdown.ip import python_map
from strapdown.uio import Uio
from strapdown_sim.drivers.bus import OKAY

FLIGHT = ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
          "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)")


@pytest.fixture
def blocks(root):
    """The Python of the page: for Linux, and for a recording."""
    page = (root / "docs" / "software.md").read_text(encoding="utf-8")
    found = [re.sub(r"^ +", "", block, flags=re.MULTILINE) if block.startswith("   ") else block
             for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL)]
    assert len(found) == 2
    return found


def test_linux(blocks, make_bus, tmp_path, monkeypatch, capsys):
    """The device is the circuit."""
    top, model = make_bus(THESIS)

    class Circuit(Uio):
        def __init__(self, path, map):
            assert path == "/dev/uio0"
            self.open(map)

        def read(self, offset):
            response, word = bus.read(offset)
            assert response == OKAY
            return word

        def write(self, offset, value):
            assert bus.write(offset, value) == OKAY

        def interrupt(self, timeout_s):
            return bus.interrupt(limit=1000)[0]

    (tmp_path / "INS_top_axi_map.py").write_text(python_map.text(top.component.table), encoding="ascii")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "INS_top_axi_map", raising=False)
    monkeypatch.setattr("strapdown.uio.Uio", Circuit)
    with model.run(stalls=20) as bus:
        exec(blocks[0], found := {})
    inputs = dict.fromkeys(top.component.system.input_ports, 0.0) | {
        "in_accz": 9.81, "in_magx": 20.0, "in_magz": -40.0, "in_gyrox": 0.1}
    twin, _ = top.component.system.run(top.component.program.schedule.pool,
                                       {port: [number] for port, number in inputs.items()})
    assert found["update"].outputs["out_pitch"] == twin["out_pitch"][0]
    assert capsys.readouterr().out == f"1 () {twin['out_pitch'][0]!s}\n"


def test_recording(blocks, tmp_path, monkeypatch):
    rows = [f"{index / 256:.6f},0,0,30,0,0,1" for index in range(64)]
    (tmp_path / "flight.csv").write_text("\n".join([FLIGHT, *rows]) + "\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    exec(blocks[1], {})
    found = np.load("recording.npz")
    assert found["in_gyroz"].tolist() == [30.0] * 64
    assert len(found) == 9


def test_files_for_a_board_are_read_by_its_python(root):
    """Python 3.10, whose grammar is older than that of this package."""
    for name in "device.py", "pynq.py", "uio.py", "__init__.py":
        source = (root / "hw/strapdown" / name).read_text(encoding="utf-8")
        ast.parse(source, feature_version=(3, 10))


def test_files_are_in_the_package(root, package):
    """Each file that the page names, with the name of another core."""
    page = (root / "docs" / "software.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^\| file .*?\n\n", page, re.MULTILINE | re.DOTALL)
    rows = [re.findall(r"`([^`]+)`", line.split("|")[1]) for line in table.splitlines()[2:] if line]
    assert len(rows) == 5
    for first, *others in rows:
        for name in (first, *(f"{first.rpartition('/')[0]}/{other}" for other in others)):
            assert (package.folder / name.replace("INS_top_axi", "QUAT_direct_axi")).is_file(), name
