import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown import __version__
from strapdown.cli import main
from strapdown.cores import ATTITUDE_CORES, CONFIGS
from strapdown_sim.replay import Replay


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_runs_as_a_module():
    done = subprocess.run([sys.executable, "-m", "strapdown", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"strapdown, version {__version__}\n"


@pytest.mark.parametrize("command", [
    "", "list", "generate", "operators", "link", "replay", "monitor", "design", "schedule", "explain"])
def test_help(command):
    result = run(*filter(None, [command, "--help"]))
    assert result.exit_code == 0
    assert result.output.startswith("Usage:")


def test_list_names_all_configurations_and_modules():
    output = run("list").output
    assert all(name in output for name in (*CONFIGS, *ATTITUDE_CORES))


def test_generate_writes_verilog_json_and_waivers(tmp_path):
    result = run("generate", "--config", "mahony", "--set", "kp=2", "--module", "INS_gyro", "--output", tmp_path)
    assert result.exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["INS_gyro.json", "INS_gyro.v", "INS_gyro.vlt"]
    description = json.loads((tmp_path / "INS_gyro.json").read_text(encoding="utf-8"))
    assert description["configuration"]["kp"] == 2
    assert description["command_line"] == "strapdown generate --config mahony --set kp=2 --module INS_gyro"


@pytest.mark.parametrize(("arguments", "message"), [
    (["generate", "--set", "kp=-1"], "strapdown: configuration thesis: kp must be greater than or equal to 0, "
                                     "not '-1'"),
    (["generate", "--set", "kp"], "strapdown: --set takes FIELD=VALUE, as in --set kp=1, not 'kp'"),
    (["generate", "--set", "name=x"], "strapdown: the fields name and pool cannot be changed by --set"),
    (["generate", "--set", "description=x\nwire live;"],
     "strapdown: configuration thesis: description must be one line without control characters, "
     "not 'x\\nwire live;'\n"),
    (["generate", "--set", "description=a\u2028b"],
     "strapdown: configuration thesis: description must be one line without control characters, not 'a\\u2028b'\n"),
    (["generate", "--config", "thesiss"], "strapdown: no configuration is called 'thesiss': choose from thesis, "),
    (["generate", "INS_topp"], "strapdown: no module or configuration is called 'INS_topp': 'strapdown list' shows"),
    (["generate", "mahony", "--config", "thesis"], "strapdown: mahony already names a configuration: omit --config"),
    (["generate", "INS_acc", "--module", "INS_top"], "strapdown: INS_acc is not a configuration: choose from thesis, "),
    (["generate", "--module", "INS_acc", "--module", "SINS_top"],
     "strapdown: no configuration has all of INS_acc, SINS_top: name one with --config"),
    (["generate", "--config", "flight", "--module", "INS_top"],
     "strapdown: configuration flight has INS_flight, not INS_top"),
    (["generate", "absent.py:CORE"], "strapdown: there is no file absent.py"),
    (["schedule", "INS_atan", "--output", "schedule.gif"], "strapdown: --output takes a .png or .svg file, not "),
    (["explain", "INS_acc", "--cycle", "9999"], "strapdown: INS_acc has cycles 0 to "),
    (["explain", "INS_acc", "--line", "attitude"], "strapdown: --line takes FILE:LINE or FILE:FUNCTION, as in "
                                                   "--line attitude.py:47, not 'attitude'"),
    (["explain", "INS_acc", "--line", "attitude.py:1"], "strapdown: no operation of INS_acc comes from attitude.py:1"),
])
def test_user_errors_are_one_line_and_status_2(arguments, message):
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith(message)
    assert result.stderr.count("\n") == 1


def test_the_command_line_in_the_files_can_be_pasted(tmp_path, monkeypatch):
    """Into a shell, with any characters; it makes the same bytes."""
    description = "it's \"quoted\"; $(false) `false` * Höhe 😀"
    monkeypatch.chdir(tmp_path)
    assert run("generate", "INS_matx", "--set", f"description={description}", "--output", "first").exit_code == 0
    facts = json.loads((tmp_path / "first" / "INS_matx.json").read_text(encoding="utf-8"))
    assert facts["configuration"]["description"] == description
    subprocess.run(["sh", "-c", facts["command_line"]], check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"})
    for name in "INS_matx.v", "INS_matx.json":
        again = tmp_path / "build" / "verilog" / "thesis" / name
        assert again.read_bytes() == (tmp_path / "first" / name).read_bytes()


def test_a_module_needs_no_configuration_if_its_name_tells(tmp_path):
    for arguments, name, module in (
            (["INS_atan"], "thesis", "INS_atan"), (["QUAT_direct"], "quaternion_j2", "QUAT_direct"),
            (["--module", "QUAT_direct"], "quaternion_j2", "QUAT_direct"),
            (["quaternion_j3"], "quaternion_j3", "QUAT_direct")):
        result = run("generate", *arguments, "--output", tmp_path / name)
        assert result.exit_code == 0, result.output
        facts = json.loads((tmp_path / name / f"{module}.json").read_text(encoding="utf-8"))
        assert facts["configuration"]["name"] == name


OWN = """\
from strapdown.cores import MAHONY
SLOW = MAHONY.replace(name="slow", sample_rate_hz=10)
NUMBER = 5
"""


def test_a_configuration_in_a_file_of_ones_own(tmp_path):
    file = tmp_path / "my_core.py"
    file.write_text(OWN, encoding="utf-8")
    result = run("generate", f"{file}:SLOW", "--set", "kp=2", "--module", "INS_atan", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    facts = json.loads((tmp_path / "out" / "INS_atan.json").read_text(encoding="utf-8"))
    assert (facts["configuration"]["sample_rate_hz"], facts["configuration"]["kp"]) == (10, 2)
    # The command names the file, without its path on this machine.
    assert facts["command_line"] == "strapdown generate --config my_core.py:SLOW --set kp=2 --module INS_atan"


@pytest.mark.parametrize(("name", "content", "message"), [
    ("my_core.py", OWN, "my_core.py has no configuration 'NUMBER': docs/kernels.md shows how to write one"),
    ("my_core.py", "import nothing_of_that_name\n",
     "my_core.py cannot be imported: ModuleNotFoundError: No module named 'nothing_of_that_name'"),
    ("my-core.py", OWN, "my-core.py must have a name that Python can import: letters, digits and underscores"),
])
def test_a_file_that_has_no_configuration(tmp_path, name, content, message):
    file = tmp_path / name
    file.write_text(content, encoding="utf-8")
    result = run("generate", f"{file}:NUMBER")
    assert result.exit_code == 2
    assert result.stderr == f"strapdown: {tmp_path}/{message}\n"


MISTAKEN = """\
from strapdown.config import Config
from strapdown.kernel import System, Update


class MistakenConfig(Config):
    def systems(self):
        return {"MISTAKEN": system}


def equations(xp, a):
    if a < 1:
        a = a + 1
    return Update({"b": a})


def system(config):
    return System("MISTAKEN", "a truth test", equations, sections=("ONLY",), start="go", finish="done",
                  inputs={"a": "in_a"}, outputs={"b": "out_b"})


MISTAKEN = MistakenConfig(name="mistaken", description="a truth test", sample_rate_hz=1)
"""


@pytest.mark.parametrize("command", ["generate", "schedule", "explain"])
def test_a_mistake_in_ones_own_kernel_is_one_line(tmp_path, command):
    (tmp_path / "my_core.py").write_text(MISTAKEN, encoding="utf-8")
    result = run(command, f"{tmp_path}/my_core.py:MISTAKEN")
    assert result.exit_code == 2
    assert result.stderr == ("strapdown: my_core.py, line 11: TypeError: a kernel's value is not known while the "
                             "kernel runs: use xp.select\n")


def test_explain_takes_a_module_of_ones_own_file(tmp_path):
    (tmp_path / "my_core.py").write_text(OWN, encoding="utf-8")
    result = run("explain", f"{tmp_path}/my_core.py:SLOW", "--module", "INS_atan")
    assert result.exit_code == 0, result.output
    assert "arctangent: atan2" in result.output


def test_output_that_cannot_be_written_is_a_user_error(tmp_path):
    (tmp_path / "file").touch()
    result = run("generate", "--module", "INS_atan", "--output", tmp_path / "file" / "folder")
    assert result.exit_code == 2
    assert "cannot write to" in result.stderr


def test_unusable_recording_is_a_user_error(tmp_path):
    recording = tmp_path / "flight.csv"
    recording.write_text("Time (s),Colour\n0,1\n", encoding="utf-8")
    result = run("replay", recording, "--output", tmp_path)
    assert result.exit_code == 2
    assert result.stderr.startswith("strapdown: ")
    assert "flight.csv" in result.stderr
    assert result.stderr.count("\n") == 1


def test_explain_shows_the_program():
    assert "arctangent: atan2" in run("explain", "INS_atan").output
    assert "writes input" in run("explain", "INS_matx", "--cycle", "1").output


@pytest.mark.verilator
def test_replay_of_a_csv_file(tmp_path, models):
    """Two seconds of rotation at 30 deg/s about the vertical: the yaw is correct, and all files exist."""
    rows = ["Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
            "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)"]
    rows += [f"{k / 100:.2f},0,0,30,0,0,1" for k in range(200)]
    recording = tmp_path / "turn.csv"
    recording.write_text("\n".join(rows) + "\n", encoding="utf-8")
    result = run("replay", recording, "--config", "mahony", "--output", tmp_path / "out", "--build", models)
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "INS_top.v", "INS_top.json", "INS_top.vlt", "attitude.csv", "summary.json", "attitude.png"}
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["samples"] == 200
    assert summary["sample_rate_hz"] == pytest.approx(100)
    assert summary["bits_differing_from_twin"] == 0
    table = np.genfromtxt(tmp_path / "out" / "attitude.csv", delimiter=",", names=True)
    assert table.dtype.names == ("t", "q0", "q1", "q2", "q3", "pitch", "roll", "yaw")
    # First-order steps rotate by twice the arctangent of half the angle; 200 of them round in the seventh digit.
    yaw = 200 * 2 * np.arctan(np.radians(0.15))
    assert table["yaw"][-1] == pytest.approx(np.degrees(yaw), abs=2e-5)
    assert table["q3"][-1] == pytest.approx(np.sin(yaw / 2), abs=np.radians(2e-5) / 2)
    assert "bits that differ from the twin" in result.output


@pytest.fixture
def table_of(tmp_path, monkeypatch):
    """A function that gives the table at the end of a replay whose summary has more or other values, without the
    replay."""
    recording = tmp_path / "turn.npz"
    np.savez(recording, t=np.arange(9) / 100, fs=100.0, gyro=np.ones((9, 3)), accel=np.tile((0, 0, 9.81), (9, 1)))

    def table(function, values, *options):
        summary = {"recording": "turn", "sample_rate_hz": 100.0, "config": "c", "samples": 9, "cycles_per_update": 50,
                   "microseconds_per_update_at_100_mhz": 0.5, "refused_updates": 0, "updates_by_status": {},
                   "bits_differing_from_twin": 0} | values
        monkeypatch.setattr(f"strapdown_sim.replay.{function}", lambda *given, **more: Replay({}, summary))
        result = run("replay", recording, "--output", tmp_path / "out", "--build", tmp_path / "build", *options)
        assert result.exit_code == 0, result.output
        return dict(re.split(r"  +", line, maxsplit=1) for line in result.stdout.splitlines())

    return table


RECORDED = {"reference": "an estimate", "samples": 9, "heading_known": True, "total_rms": 1.25, "inclination_rms": 0.5,
            "heading_rms": 1.0, "constant_heading_deg": 0.0, "total_rms_with_constant_heading": 1.25}


def test_the_table_has_each_channel(table_of):
    rows = table_of("replay_channels", {"channels": {str(channel): {
        "recording": f"imu {channel}", "against_float64_reference_deg": {"max": 1e-4 * (channel + 1), "rms": 0.0},
        "against_recorded_reference_deg": RECORDED | {"total_rms": 2.0 + channel}} for channel in range(2)}},
        "--config", "thesis_x8")
    for channel in range(2):
        assert rows[f"channel {channel}: largest rotation angle to float64"] == f"0.000{channel + 1}00°, imu {channel}"
        assert rows[f"channel {channel}: rotation angle to an estimate"] == (
            f"RMS {2 + channel}.00°, inclination 0.50°, heading 1.00°")


def test_the_table_says_what_is_in_the_waveform(table_of, tmp_path):
    rows = table_of("replay", {"waves": {"file": "replay.vcd", "updates": [3, 1200], "clock_period_ns": 10,
                                         "from_s": 0.02, "to_s": 12.5, "bytes": 2_340_000}}, "--waves", "0.02:12.5")
    assert rows["waveform"] == "updates 3 to 1,200, t = 0.020000 to 12.500000 s, 2.34 MB"
    path = tmp_path / "out" / "replay.vcd"
    assert rows["open it with"] == f"gtkwave {path}, or surfer {path}"


def test_the_table_compares_a_navigator_with_the_log(table_of):
    track = {"points": 2, "horizontal": {"max": 3.456, "rms": 1.0}, "vertical": {"max": None, "rms": None}}
    rows = table_of("replay", {"against_recorded_position_m": track, "against_recorded_velocity_m_s": track})
    assert rows["largest horizontal difference from the log's position"] == "3.46 m"
    assert rows["largest horizontal difference from the log's velocity"] == "3.46 m/s"
    assert rows["largest vertical difference from the log's velocity"] == "–"
