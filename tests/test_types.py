"""The type checker covers all three packages: wrong calls are errors, correct calls are not."""

import re
import subprocess
import sys

HEAD = """\
from pathlib import Path

import numpy as np

from strapdown.cores import QUATERNION_J2, THESIS, make_core, system_of
from strapdown.kernel.native import NativeTwin
from strapdown_lab.report.measure import measure
from strapdown_lab.studies import accuracy
from strapdown_lab.synthesis import synthesise_xc7
from strapdown_sim.cache import Cache
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel
from strapdown_sim.drivers.verilated import Interface, VerilatedModel
from strapdown_sim.recordings import read_recording
from strapdown_sim.replay import replay

core = make_core("INS_top", THESIS)
system = system_of("INS_top", THESIS)
recording = read_recording("flight.csv", sample_rate_hz=100)
numbers = {"in_p": np.zeros(3)}
"""

RIGHT = """\
replay(recording, THESIS, "out", build=Path("build"), command="").summary["samples"]
read_recording(Path("flight.csv"), reference="device.csv").time_s
CoreModel(core, "INS_top.v", "build").update(numbers)["cycles"]
StreamModel(core, Path("INS_top_x8.v"), "build").update(np.arange(3), numbers, idle=2)
VerilatedModel("a.v", Interface("a", ("x",), ("y",)), "build").transact(numbers, limit=5)
system.run(THESIS.pool, numbers)[0]["out_pitch"]
NativeTwin(system, THESIS.pool).run(numbers)[1]
measure([], Cache("build"), place=False)
accuracy.measure("recordings", progress=print)
"""

WRONG = """\
replay(1, nonsense=2)
replay(1, THESIS, "out", build="build", command="")
replay(recording, "thesis", "out", build="build", command="")
replay(recording, THESIS, "out", build="build", command="").nonsense
read_recording(1)
read_recording("flight.csv", rate=100)
make_core(THESIS, "INS_top")
CoreModel("INS_top", "INS_top.v", "build")
CoreModel(core, "INS_top.v", "build").update(numbers, on_progress=print)
StreamModel(core, 1, "build")
VerilatedModel("a.v", "a", "build")
VerilatedModel("a.v", Interface("a", ("x",), ("y",)), "build").transact(numbers, limit="5")
system.run(QUATERNION_J2, numbers)
NativeTwin(THESIS, THESIS.pool)
measure(Cache("build"), [])
synthesise_xc7("module a; endmodule", "a", "build")
accuracy.measure(1)
"""


def test_wrong_calls_are_errors_and_right_ones_are_not(root, tmp_path):
    source = tmp_path / "calls.py"
    source.write_text(HEAD + RIGHT + WRONG, encoding="utf-8")
    done = subprocess.run([sys.executable, "-m", "mypy", "--config-file", root / "pyproject.toml", source], cwd=root,
                          capture_output=True, text=True, check=False)
    lines = source.read_text(encoding="utf-8").splitlines()
    found = {lines[int(line) - 1] for line in re.findall(r"calls\.py:(\d+): error", done.stdout)}
    assert found == set(WRONG.splitlines()), done.stdout + done.stderr
    assert not re.search(r"^(?!.*calls\.py).*: error", done.stdout, re.MULTILINE), done.stdout
