"""The code of docs/python.md and docs/bus.md runs as written, and prints the values in its comments."""

import re
import subprocess
import sys

import pytest

HEADER = ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
          "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)")


@pytest.mark.verilator
def test_the_page_runs_from_top_to_bottom(root, tmp_path):
    page = (root / "docs" / "python.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    rows = [f"{k / 256:.6f},0,0,30,0,0,1" for k in range(64)]
    (tmp_path / "flight.csv").write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    modules, cycles, difference, circuit, replayed, adder = done.stdout.splitlines()
    assert modules.endswith("INS_top")
    latency = int(cycles.split()[0])
    # 100 updates of float32 against float64: a thousand roundings of 2**-24 rad at most.
    assert float(difference) < 1000 * 57.3 * 2**-24
    assert circuit == f"{latency} cycles; 0 bits differ from the twin"
    assert replayed.startswith("0 [")
    assert adder == "1.0 5 1"


def test_the_page_on_buses_runs(root, tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (root / "docs" / "bus.md").read_text(encoding="utf-8"), re.DOTALL)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "INS_top_axi 0x100 starts an update with the inputs of the registers\n", done.stderr
