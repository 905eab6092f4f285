"""Puts single faults into copies of the package and runs their tests on them."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

from strapdown.markdown import markdown_table
from strapdown_sim.jobs import outcome, workers

from .mutants import MUTANTS, Mutant

__all__ = ["Verdict", "misplaced", "mutated", "run", "table"]

TIME_LIMIT = 900
"""Seconds for the tests of one fault; this also detects a circuit that never finishes."""


@dataclass(frozen=True)
class Verdict:
    """Result of the tests for a fault: ``killed`` if a test failed, and the first test that failed."""

    mutant: Mutant
    killed: bool
    by: str


def misplaced(package):
    """Faults whose fragment does not occur exactly once in the package's sources: (mutant, count)."""
    counts = ((mutant, (package / mutant.file).read_text(encoding="utf-8").count(mutant.fragment))
              for mutant in MUTANTS)
    return [(mutant, count) for mutant, count in counts if count != 1]


def mutated(text, mutant):
    """A source file with the fault. Raises: ValueError unless the fragment occurs exactly once."""
    if (count := text.count(mutant.fragment)) != 1:
        raise ValueError(f"{mutant.file} contains this {count} times, not once: {mutant.fragment}")
    return text.replace(mutant.fragment, mutant.replacement)


def run(mutants, root, *, jobs=2, scheduler=None, baseline=True, report=lambda verdict: None):
    """Try faults, several at a time; returns their verdicts.

    ``jobs`` and ``scheduler`` are those of ``strapdown_sim.jobs.workers``; a worker needs the checkout ``root``.
    Without ``baseline`` the tests are assumed to pass without a fault.
    Raises: RuntimeError if the tests for a fault fail without it, or if no test is selected.
    """
    with workers(jobs, scheduler, threads=True) as pool:
        selections = sorted({(mutant.test_file, mutant.select) for mutant in mutants}) if baseline else []
        sound = {pool.executor.submit(_sound, tests, root): tests for tests in selections}
        for tried in as_completed(sound):
            if (result := outcome(tried)).returncode:
                raise RuntimeError(f"tests/{sound[tried][0]} must pass without a fault:\n{result.stdout[-3000:]}")
        judged = [pool.executor.submit(_judge, mutant, root) for mutant in mutants]
        for verdict in as_completed(judged):
            report(outcome(verdict))
    return [verdict.result() for verdict in judged]


def _scratch(root):
    """A folder for copies."""
    folder = root / "build" / "mutants"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _sound(tests, root):
    with tempfile.TemporaryDirectory(dir=_scratch(root)) as folder:
        return _pytest(_copy(root, Path(folder), root / "build" / "sim" / "verilated"), *tests)


def _judge(mutant, root):
    with tempfile.TemporaryDirectory(dir=_scratch(root)) as folder:
        copy = _copy(root, Path(folder))
        source = copy / "hw" / "strapdown" / mutant.file
        source.write_text(mutated(source.read_text(encoding="utf-8"), mutant), encoding="utf-8")
        try:
            result = _pytest(copy, mutant.test_file, mutant.select)
        except subprocess.TimeoutExpired:
            return Verdict(mutant, True, f"no end within {TIME_LIMIT} s")
    # Status 1 means that a test failed or had an error; other values mean that pytest itself failed.
    if result.returncode not in (0, 1):
        output = (result.stdout + result.stderr)[-3000:]
        raise RuntimeError(f"pytest ended with status {result.returncode}:\n{output}")
    failed = [line for line in result.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return Verdict(mutant, result.returncode == 1, failed[0].split(" - ")[0] if failed else "")


def _copy(root, folder, models=None):
    """A separate folder with the sources and tests; compiled models are shared only without a fault."""
    for part in "hw", "tests":
        shutil.copytree(root / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(root / "pyproject.toml", folder)
    verilated = folder / "build" / "sim" / "verilated"
    if models:
        verilated.parent.mkdir(parents=True)
        models.mkdir(parents=True, exist_ok=True)
        verilated.symlink_to(models)
    else:
        # Verilator's runtime is the same for all.
        verilated.mkdir(parents=True)
        runtime = root / "build" / "sim" / "verilated" / "runtime"
        runtime.mkdir(parents=True, exist_ok=True)
        (verilated / "runtime").symlink_to(runtime)
    return folder


def _pytest(folder, tests, select):
    # The path comes before the installed package, which has no fault.
    environment = os.environ | {"PYTHONPATH": str(folder / "hw"), "PYTHONDONTWRITEBYTECODE": "1"}
    arguments = ["-x", "-q", "-p", "no:cacheprovider", *(["-k", select] if select else []), f"tests/{tests}"]
    return subprocess.run([sys.executable, "-m", "pytest", *arguments], cwd=folder, env=environment,
                          capture_output=True, text=True, timeout=TIME_LIMIT, check=False)


def table():
    """The number of faults in each file, as a Markdown table."""
    counts = Counter((mutant.file, mutant.test_file) for mutant in MUTANTS)
    return markdown_table(["source", "faults:", "detected by"], [
        *([f"`{file}`", count, f"`{tests}`"] for (file, tests), count in counts.items()), ["all", counts.total(), ""]])
