"""The package in FuseSoC: lint, both simulators, synthesis, the scripts for the vendors, and the generator."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from strapdown_sim.drivers.toolchain import verilator_environment, verilator_root

from .tcl import run as run_tcl
from .test_bench import PASS

pytestmark = pytest.mark.ip


@pytest.fixture(scope="module")
def fusesoc(root):
    """A function that runs FuseSoC with folders of cores in a folder, and returns the process."""
    tools = [root / ".venv-fusesoc" / "bin", verilator_root() / "bin", Path(sys.executable).parent]
    environment = verilator_environment() | {
        "PATH": os.pathsep.join([*map(str, tools), os.environ["PATH"]]), "MAKEFLAGS": ""}

    def run(folder, libraries, *words):
        roots = [word for library in libraries for word in ("--cores-root", library)]
        return subprocess.run(["fusesoc", *roots, "run", *words], cwd=folder, capture_output=True, text=True,
                              check=False, env=environment)
    return run


def target(fusesoc, package, folder, *words):
    """Runs a target of a package, which must succeed; returns all that was printed."""
    done = fusesoc(folder, [package.folder], *words, str(package.places.vlnv))
    printed = done.stdout + done.stderr
    assert done.returncode == 0, printed
    return printed


def test_lint(fusesoc, package, tmp_path):
    assert "%Warning" not in target(fusesoc, package, tmp_path, "--target=lint")


def test_lint_fails_without_the_rules_that_the_verilog_breaks(fusesoc, package, tmp_path):
    changed = package.copy(tmp_path)
    changed.change("strapdown.core", "filesets: [rtl, lint]", "filesets: [rtl]")
    done = fusesoc(tmp_path, [changed.folder], "--target=lint", str(package.places.vlnv))
    assert done.returncode != 0
    assert "%Warning-PROCASSINIT" in done.stdout + done.stderr


@pytest.mark.parametrize("tool", ["icarus", "verilator"])
def test_simulation(fusesoc, package, tmp_path, tool):
    assert PASS in target(fusesoc, package, tmp_path, "--target=sim", f"--tool={tool}").splitlines()


def test_synthesis(fusesoc, package, tmp_path):
    target(fusesoc, package, tmp_path, "--target=synth")
    (netlist,) = (tmp_path / "build").rglob("synth-yosys/*.json")
    assert "LUT6" in netlist.read_text(encoding="utf-8")


@pytest.mark.parametrize("tool", ["vivado", "ise"])
def test_scripts_of_the_vendors(fusesoc, package, tmp_path, tool):
    target(fusesoc, package, tmp_path, "--setup", f"--target={tool}")
    script = min((tmp_path / "build").rglob(f"{tool}-{tool}/*.tcl"), key=lambda path: len(path.name))
    status, errors, calls = run_tcl(package, script, folder=script.parent)
    assert (status, errors) == (0, "")
    verilog = f"src/{str(package.places.vlnv).replace(':', '_')}/{package.places.verilog}"
    assert verilog in calls
    assert f"set_property top {package.places.name} " in calls or f"project set top {package.places.name}" in calls
    (script.parent / verilog).unlink()
    assert run_tcl(package, script, folder=script.parent)[:2] == (2, f"there is no file {verilog}")


USER = """CAPI=2:
name: user:board:top:1.0

filesets:
  generator:
    depend: [strapdown:navigation:generator]

generate:
  ins:
    generator: strapdown
    parameters: {%s}

targets:
  lint:
    default_tool: verilator
    generate: [ins]
    filesets: [generator]
    toplevel: QUAT_direct_axi
    tools:
      verilator: {mode: lint-only}
"""


def generated(fusesoc, package, folder, parameters):
    """A design of a user, whose core the generator makes from parameters."""
    library = folder / "library"
    library.mkdir()
    for file in "generator.core", "fusesoc_generator.py":
        (library / file).write_bytes((package.folder / file).read_bytes())
    (library / "user.core").write_text(USER % parameters, encoding="utf-8")
    return fusesoc(folder, [library], "--target=lint", "user:board:top")


def test_generator(fusesoc, package, tmp_path):
    done = generated(fusesoc, package, tmp_path, "config: quaternion_j2, set: [sample_rate_hz=250], streams: false")
    assert done.returncode == 0, done.stdout + done.stderr
    (verilog,) = (tmp_path / "build").rglob("lint-verilator/src/*/hdl/QUAT_direct_axi.v")
    text = verilog.read_text(encoding="utf-8")
    assert "strapdown ip quaternion_j2 --set sample_rate_hz=250 --no-streams" in text
    assert "s_axis_tdata" not in text


def test_generator_names_a_parameter_that_does_not_exist(fusesoc, package, tmp_path):
    done = generated(fusesoc, package, tmp_path, "config: quaternion_j2, stream: false")
    assert done.returncode != 0
    assert "the generator has no parameter 'stream': choose config, set, streams or errors" in done.stdout + done.stderr
