"""Every command in README and docs runs as written.

Commands are in fenced blocks of ``sh`` or between backquotes. Each must match a rule below, which says how the command
is run. A command without a rule fails, and so does a rule without a command.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores import QUATERNION_J2, make_core
from strapdown.cores.registers import register_table
from strapdown.ip import driver_files
from strapdown.link import NAVIGATION, FrameSender
from strapdown_lab.checkout import ROOT
from strapdown_lab.docs import own_kernel, own_operator
from strapdown_lab.faults.__main__ import main as flips
from strapdown_lab.proof import mutation
from strapdown_lab.proof.__main__ import main as proof
from strapdown_lab.proof.solver import Outcome as Proof
from strapdown_lab.synthesis import Ecp5Placement, Xc7Resources
from strapdown_sim.drivers.faults import FaultModel, Outcome, Verdict
from strapdown_sim.drivers.optical import ANGLES
from strapdown_sim.drivers.pins import Line, PinInterface, PinRun
from strapdown_sim.drivers.storage import REGISTER, Storage
from strapdown_sim.instrument.calibration import SET_B
from strapdown_sim.recordings import STANDARD_GRAVITY
from strapdown_sim.reference.optical import pixels_of_angles
from strapdown_sim.stimuli.turns import TURNS, turned_by_hand

from .twin import TwinModel

PROGRAMS = r"(?:make|strapdown|pip|python -m \S+|scripts/\S+\.(?:py|sh))"


def commands():
    """Maps each command to the documents that contain it."""
    found: dict[str, list[str]] = {}
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        text = page.read_text(encoding="utf-8")
        blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
        inline = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
        for line in [*lines, *(part for part in inline if re.match(rf"{PROGRAMS}(?: |$)", part))]:
            command = " ".join(line.partition("  #")[0].split())
            if command and not command.startswith("#"):
                found.setdefault(command, []).append(page.name)
    return found


# Files in the folder in which a command runs.

FLIGHT = "Time (s)," + ",".join(f"{sensor} {axis} ({unit})" for sensor, unit in (
    ("Gyroscope", "deg/s"), ("Accelerometer", "g"), ("Magnetometer", "uT")) for axis in "XYZ")


def recording():
    """A CSV file of a level sensor at rest, 60 samples at 100 Hz."""
    rows = [f"{k / 100:.3f},0.1,-0.2,0,0.01,0,1,20,0,-40" for k in range(60)]
    return "\n".join([FLIGHT, *rows]) + "\n"


def frames():
    """Bytes in the form of the serial link."""
    sender = FrameSender(NAVIGATION.number, 36, clock_hz=1e8, baud_rate=921_600)
    return b"".join(sender.compute(counter, 0, np.arange(9, dtype="<f4").tobytes()) for counter in range(5))


class SilentPins:
    """Two lines, whose updates give zero, in place of the Verilated circuit."""

    def __init__(self, verilog, modules, build, **options):
        self.interface = PinInterface("bench", tuple(port.name for port in modules["OPT_top"]), ())

    def run(self, actions, image, *, cycles, delay, progress):
        lines = [[Line(ccd, number, 0, 10**9 * number, 10**9 * number + 10**8) for number in range(2)]
                 for ccd in range(2)]
        words = np.array([[image(line) for line in own] for own in lines])
        progress(cycles)
        zero = np.zeros(2, int)
        return PinRun((lines[0], lines[1]), dict.fromkeys((*ANGLES, "out_status", "out_line"), zero) | {
            "cycle": np.array([cycles // 2, cycles])}, words, words, np.array([[0, 1]] * 2), b"", zero, [])


class UpsetNothing:
    """All faults are masked, in place of the Verilated circuit."""

    DRIVER = FaultModel.DRIVER

    def __init__(self, core, verilog, build):
        self.places = [Storage(REGISTER, "INS_top", "early", "INS_top__DOT__early", 1, 1)]

    def verdicts(self, faults, samples, second):
        return [Verdict(Outcome.MASKED, True, 0.0, 0) for _ in faults]


@dataclass
class Place:
    """The folder in which a command runs, and replacements for steps that take minutes."""

    folder: Path
    monkeypatch: pytest.MonkeyPatch

    def invoke(self, program, arguments):
        """Run a click program in this process; returns its output."""
        self.monkeypatch.chdir(self.folder)
        result = CliRunner().invoke(program, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.output

    def stand_in(self, target, value):
        self.monkeypatch.setattr(target, value)


def empty_verilog(component, name, **options):
    return f"module {name}();\nendmodule\n"


# Rules. Each takes the command's words and a Place.

def strapdown(words, place):
    """Run the command itself."""
    (place.folder / "flight.csv").write_text(recording(), encoding="utf-8")
    (place.folder / "recorded.bin").write_bytes(frames())
    page = (ROOT / "docs" / "kernels.md").read_text(encoding="utf-8")
    (place.folder / "my_core.py").write_text(own_kernel(page), encoding="utf-8")
    (place.folder / "my_operator.py").write_text(own_operator(page), encoding="utf-8")
    place.stand_in("strapdown_sim.replay.CoreModel", TwinModel)
    # The Verilog would take most of the time; other tests make and compare it.
    place.stand_in("strapdown.export.verilog.to_verilog", empty_verilog)
    return place.invoke(main, words[1:])


def named(words, place):
    """Only the name of a command, which must have a help text."""
    assert place.invoke(main, [*words[1:], "--help"]).startswith("Usage:")


def calibration(words, place):
    """Points of an instrument whose constants are known."""
    rows = [(r, p) for r in range(-25, 26, 10) for p in range(-25, 26, 10)]
    axis = [(10 * k, 5 * np.cos(0.07 * k), 5 * np.sin(0.07 * k)) for k in range(9)]
    for name, columns, points in (("table", "", rows), ("rest", "time_s,", axis)):
        lines = [",".join(map(str, (*time, *((0.0, 0.0) if time else angles),
                                    *pixels_of_angles(*np.radians(angles), SET_B))))
                 for *time, roll, pitch in points for angles in [(roll, pitch)]]
        (place.folder / f"{name}.csv").write_text("\n".join([f"{columns}roll_deg,pitch_deg,roll_px,pitch_px", *lines]),
                                                  encoding="utf-8")
    place.invoke(main, words[1:])
    assert (place.folder / "build" / "calibration" / "calibration.json").exists()


def sensors(words, place):
    """A sensor that a hand turns."""
    recording = turned_by_hand(TURNS, rate_hz=20)
    rows = np.column_stack([recording.time_s, recording.gyro_deg_s, recording.accel / STANDARD_GRAVITY, recording.mag])
    np.savetxt(place.folder / "turns.csv", rows, delimiter=",", header=FLIGHT, comments="")
    assert "--set magnetometer_bias=" in place.invoke(main, words[1:])
    assert (place.folder / "build" / "calibration" / "set.txt").exists()


def optical(words, place):
    """Run light through the sensor."""
    lines = np.zeros((2, 3, 2048), np.uint16)
    np.savez(place.folder / "lines.npz", roll=lines[0], pitch=lines[1])
    file = place.folder / "build" / "calibration" / "calibration.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({"words": {port: {"value": value} for port, value in SET_B.ports().items()}}),
                    encoding="utf-8")
    place.stand_in("strapdown_sim.drivers.optical.PinDriver", SilentPins)
    # tests/sim/test_optical_command.py draws.
    for picture in "lines", "angles", "exposure", "budget":
        place.stand_in(f"strapdown_sim.optical.{picture}_picture", lambda path, **what: None)
    # The Verilog would take most of the time; other tests make and compare it.
    place.stand_in("strapdown.export.verilog.to_verilog", empty_verilog)
    place.invoke(main, words[1:])
    assert (place.folder / "build" / "optical" / "summary.json").exists()


def external(words, place):
    """The option is known; tests/sim/test_external.py has logs with a velocity."""
    assert "--external" in place.invoke(main, ["replay", "--help"])


def with_names(words, place):
    """Words in capitals are placeholders for names."""
    names = {"DIR": "folder", "NAME": "mahony", "RECORDING": "flight.csv"}
    strapdown([names.get(word, word) for word in words], place)


def batch(words, place):
    """Two logs, by threads of this process, also in place of a cluster; tests/ip/test_cluster.py has one."""
    for name in "flights/a.csv", "flights/b/c.ulg":
        (place.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (place.folder / name).write_text(recording(), encoding="utf-8")

    @contextmanager
    def local(address):
        with ThreadPoolExecutor(1) as executor:
            yield SimpleNamespace(get_executor=lambda: executor, nthreads=dict)

    place.stand_in("strapdown_sim.jobs._Processes", ThreadPoolExecutor)
    place.stand_in("strapdown_sim.jobs._cluster", local)
    assert "bits that differ from the twin     0" in strapdown(words, place)
    assert list(place.folder.rglob("batch.csv"))


def cluster(words, place):
    """Only the names of the options."""
    done = subprocess.run([Path(sys.executable).with_name("dask"), words[1], "--help"], capture_output=True, text=True,
                          check=True)
    assert {word for word in words if word.startswith("--")} <= set(re.findall(r"--[a-z-]+", done.stdout))


def serial(words, place):
    """A recorded stream in place of the serial port, without a display."""
    words = [word for word in words if word != "--live"]
    port = words.index("/dev/ttyUSB0")
    place.stand_in("strapdown_sim.monitor._read_serial", lambda port, rate: (data for data in [frames()]))
    output = strapdown([*words[:port], "recorded.bin", *words[port + 1:]], place)
    assert "5" in output


def report(words, place):
    """The results of the tools are invented; circuits are made, but not simulated."""
    cost = {"lut": 1, "memory_lut": 0, "ff": 1, "dsp": 0, "bram": 0}
    placed = {"lut": 1, "ff": 1, "multiplier": 0, "ebr": 0, "fmax_mhz": 80.0, "fmax_mhz_of_seeds": [80.0],
              "critical": ["a", "b"]}
    place.stand_in("strapdown_lab.report.measure._xc7", lambda design, cache: cost)
    place.stand_in("strapdown_lab.report.measure._ecp5", lambda design, cache: placed)
    place.stand_in("strapdown_lab.report.measure.tool_versions", lambda *packages: dict.fromkeys(packages, "1"))
    place.stand_in("strapdown_lab.report.measure.simulated_cycles",
                   lambda core, path, build: (core.latency, getattr(core.engine, "interval", core.latency)))
    for module in "strapdown.export.verilog", "strapdown_lab.report.measure":
        place.stand_in(f"{module}.to_verilog", empty_verilog)
    place.invoke(main, words[1:])
    assert (place.folder / "build" / "report" / "report.md").exists()


def pools(words, place):
    """The results of the tools are invented, and few pools are scheduled."""
    resources = Xc7Resources(lut=1000, memory_lut=0, ff=1, dsp=2, bram=1)
    placed = Ecp5Placement(lut=1, ff=1, multiplier=0, ebr=0, fmax_mhz=(400.0,), critical=("a", "b"))
    place.stand_in("strapdown_sim.jobs._Processes", ThreadPoolExecutor)
    place.stand_in("strapdown_lab.explore.search.synthesise_xc7", lambda verilog, top, cache: resources)
    place.stand_in("strapdown_lab.explore.search.place_ecp5", lambda verilog, top, cache, seeds: placed)
    place.stand_in("strapdown_lab.report.measure.tool_versions", lambda *packages: dict.fromkeys(packages, "1"))
    place.stand_in("strapdown_lab.explore.search.to_verilog", empty_verilog)
    place.stand_in("strapdown_lab.explore.search.circuit", lambda *given: "")
    page = (ROOT / "docs" / "kernels.md").read_text(encoding="utf-8")
    (place.folder / "my_core.py").write_text(own_kernel(page), encoding="utf-8")
    lines = place.invoke(main, [*words[1:], "--pools", "2", "--jobs", "1"]).splitlines()
    assert lines[-2].startswith("strapdown generate")
    assert (place.folder / lines[-1]).exists()


def xilinx(words, place):
    """A folder with a stand-in for the toolchain, whose results are invented, too."""
    shutil.copytree(ROOT / "tests" / "lab" / "openxc7", place.folder / words[words.index("--xilinx") + 1])
    place.stand_in("strapdown_lab.report.measure._openxc7", lambda toolchain, design, cache: {
        "fmax_mhz": 80.0, "fmax_mhz_of_seeds": [80.0], "critical": ["a", "b"]})
    report([*words, *([] if "--config" in words else ["--config", "quaternion_j2"])], place)
    assert "openXC7" in (place.folder / "build" / "report" / "report.md").read_text(encoding="utf-8")


def compiled(words, place):
    """The compiler of this machine is called in place of the other, which tests/ip/test_arm.py calls."""
    table = register_table(make_core("QUAT_direct", QUATERNION_J2), QUATERNION_J2)
    for name, text in driver_files(table).items():
        (place.folder / name).write_text(text, encoding="utf-8")
    subprocess.run(["gcc", *(word for word in words[1:] if not word.startswith("-mcpu"))], cwd=place.folder, check=True)


def reports(words, place):
    """Reports of a design, which were made by hand."""
    for file in "utilization.rpt", "timing.rpt":
        shutil.copy(ROOT / "tests" / "lab" / "vivado" / file, place.folder)
    assert place.invoke(main, words[1:]).startswith("LUT  ")


def families(words, place):
    """The results of the tools are invented, and no circuit is made; tests/lab/test_families.py makes one."""
    place.stand_in("strapdown_lab.report.families.circuit", lambda variant: (
        {"config": variant.config.name, "operand_memory": "", "module": "TOP", "cycles": 1}, "module TOP();"))
    place.stand_in("strapdown_lab.report.families.synthesise", lambda *given, place, **options: {
        "lut": 1, "ff": 1, "dsp": 0, "bram": 0, "fits": True})
    place.stand_in("strapdown_lab.report.families.tool_versions", lambda *packages: dict.fromkeys(packages, "1"))
    place.invoke(main, words[1:])
    assert "1 / 0 / 0, fits" in (place.folder / "build" / "families" / "families.md").read_text(encoding="utf-8")


def accuracy(words, place):
    """No recording: the command ends with one line. Other tests check the filters."""
    place.monkeypatch.chdir(place.folder)
    place.stand_in("strapdown_lab.studies.accuracy.version", lambda package: "1")
    folders = "recordings", "validation"
    for folder in folders:
        (place.folder / folder).mkdir()
    words = [next((folder for folder in folders if word.endswith(folder)), word) for word in words]
    result = CliRunner().invoke(main, words[1:])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == (
        "strapdown: recordings, validation: no .npz recording with a reference orientation")


def proofs(words, place):
    """Proofs, exhaustive runs and faults are selected, but not run, because that takes hours; other tests run some."""
    asked = []

    def prove(props, build, **options):
        asked.extend(props)
        return [Proof(True, True, 0.0, "") for _ in props]

    def judge(mutants, root, **options):
        asked.extend(mutants)
        return [mutation.Verdict(mutant, True, "") for mutant in mutants]

    def check(names, part, root, **options):
        asked.extend(names)
        return []

    place.stand_in("strapdown_lab.proof.formal.run", prove)
    place.stand_in("strapdown_lab.proof.mutation.run", judge)
    def find(sensors, lines, root, **options):
        asked.extend(sensors)
        return {}, []

    place.stand_in("strapdown_lab.proof.exhaustive.check", check)
    place.stand_in("strapdown_lab.proof.spots.check", find)
    place.stand_in("strapdown_lab.proof.spots.record", lambda entries, root: None)
    place.invoke(proof, words)
    assert asked


def faults(words, place):
    """No bit is flipped: the outcomes are invented, and other tests find some."""
    place.stand_in("strapdown.export.verilog.to_verilog", empty_verilog)
    place.stand_in("strapdown_lab.faults.campaign.FaultModel", UpsetNothing)
    place.invoke(flips, words)
    record = place.folder / "build" / "faults" / "thesis.json"
    assert json.loads(record.read_text(encoding="utf-8"))["faults"] == 10_000


def peers(words, place):
    """No filter is compiled: an empty folder has none. tests/lab/test_peers.py times some."""
    done = subprocess.run([sys.executable, *words[1:-1], place.folder], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"{place.folder} has no folder ")


def make(words, place):
    """Make prints its commands; the project's own commands among them are run by their rules."""
    done = subprocess.run(["make", "--dry-run", "--always-make", *words[1:]], cwd=ROOT, capture_output=True, text=True,
                          check=False, env={key: value for key, value in os.environ.items() if key != "MAKEFLAGS"})
    assert done.returncode == 0, done.stderr
    lines = done.stdout.replace("\\\n", " ").splitlines()
    own = [line for line in lines if re.match(r"\.venv/bin/(?:strapdown|python -m strapdown)", line)]
    assert bool(own) == (words[1] in OWN)
    for index, line in enumerate(own):
        folder = place.folder / str(index)
        folder.mkdir()
        recipe(shlex.split(line), Place(folder, place.monkeypatch))


def recipe(words, place):
    """A line of the Makefile that calls a command of the project."""
    match [Path(words[0]).name, *words[1:]]:
        case ["strapdown", "replay", _, *rest]:
            strapdown(["strapdown", "replay", "flight.csv", *rest], place)
        case ["strapdown", "report", *rest]:
            # The complete report would still take minutes.
            report(["strapdown", "report", "--only", "add", "--config", "quaternion_j2", *rest], place)
        case ["strapdown", "compare", *rest]:
            # tests/lab/test_compare.py runs the command.
            assert place.invoke(main, ["compare", *rest, "--help"]).startswith("Usage:")
        case ["strapdown", "families", *rest]:
            families(["strapdown", "families", "--family", "7-series", "--config", "quaternion_j2", *rest], place)
        case ["strapdown", "accuracy", *rest]:
            accuracy(["strapdown", "accuracy", *rest], place)
        case ["strapdown", *rest]:
            strapdown(["strapdown", *rest], place)
        case ["python", "-m", "strapdown_lab.proof", "document"]:
            # The text is compared in tests/lab/proof/test_document.py.
            assert place.invoke(proof, ["document", "--help"]).startswith("Usage:")
        case ["python", "-m", "strapdown_lab.proof", *rest]:
            proofs(rest, place)
        case ["python", "-m", "strapdown_lab.faults", *rest]:
            faults(rest, place)
        case ["python", "-m", "strapdown_lab.studies.optical" | "strapdown_lab.studies.optical_pins"
              | "strapdown_lab.studies.flight_cases" | "strapdown_lab.studies.flight_cross"
              | "strapdown_lab.studies.flight_magnet" | "strapdown_lab.studies.peers", *_]:
            # tests/lab measures some of their figures.
            pass
        case ["python", "-m", "strapdown_lab.docs"]:
            # tests/test_readme.py and tests/lab compare its output.
            pass
        case other:
            raise AssertionError(f"no rule for {other}")


OWN = {"demo", "verilog", "ip", "report", "families", "compare", "peers", "formal", "exhaustive", "spots", "mutants",
       "faults", "accuracy", "docs"}
"""Targets whose recipes call commands of the project; others call tools, which `make -n` shows."""

RULES = {
    r"make help": lambda words, place: subprocess.run(words, cwd=ROOT, check=True, capture_output=True),
    r"make \w+.*": make,
    r"strapdown(?: calibrate)?(?: \w+)?": named,
    r"strapdown monitor /dev/ttyUSB0 .*": serial,
    r"strapdown monitor .*": strapdown,
    r"strapdown explore .*": pools,
    r"strapdown report --vivado .*": reports,
    r"strapdown report --xilinx .*": xilinx,
    r"strapdown report .*": report,
    r"strapdown families .*": families,
    r"strapdown (?:operators DIR|replay RECORDING .*|inspect RECORDING)": with_names,
    r"strapdown replay .* --external .*": external,
    r"strapdown (?:generate|replay|inspect|explain|schedule|design|link|operators|ip) .*": strapdown,
    r"strapdown batch .*": batch,
    r"dask .*": cluster,
    r"strapdown calibrate sensors .*": sensors,
    r"strapdown calibrate optical .*": calibration,
    r"strapdown optical(?: .*)?": optical,
    r"python -m strapdown_lab\.proof .*": lambda words, place: proofs(words[3:], place),
    r"python -m strapdown_lab\.faults": lambda words, place: place.invoke(flips, ["--help"]),
    r"python -m strapdown_lab\.studies\.peers FOLDER": peers,
    r"scripts/\S+\.py": lambda words, place: (ROOT / words[0]).read_text(encoding="utf-8"),
    r"arm-linux-gnueabihf-gcc .*": compiled,
    # A test builds the wheel and installs it: tests/test_package.py.
    r"pip (?:wheel|install).*": lambda words, place: None,
}
"""Maps patterns of whole commands to the functions that run them; the first match is used."""


def rule_of(command):
    return next((pattern for pattern in RULES if re.fullmatch(pattern, command)), None)


def test_every_command_has_a_rule_and_every_rule_a_command():
    used = {command: rule_of(command) for command in commands()}
    assert [command for command, pattern in used.items() if pattern is None] == []
    assert set(RULES) == set(used.values())


def test_commands_are_found():
    found = commands()
    assert found.keys() >= {"make demo", "strapdown explain INS_top --cycle 100", "strapdown monitor"}
    assert "README.md" in found["make test"]


@cache
def targets():
    """Targets of the Makefile, with their descriptions."""
    return dict(re.findall(r"^([a-z-]+):.*## (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def test_every_target_is_explained():
    """`make help` lists the targets that documents name."""
    named = {command.split()[1] for command in commands() if command.startswith("make ")}
    assert named <= {*targets(), "help"}


@pytest.mark.parametrize("command", commands())
def test_command(command, tmp_path, monkeypatch):
    rule = rule_of(command)
    if rule is None:
        pytest.fail(f"no rule runs {command!r}, in {', '.join(commands()[command])}")
    if command.startswith("make ") and shutil.which("make") is None:
        pytest.skip("make is not installed.")
    RULES[rule](shlex.split(command), Place(tmp_path, monkeypatch))
