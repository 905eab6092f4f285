"""Runs all 2**32 operands of operators with one 32-bit operand through their Verilated circuits."""

import datetime
import json
import math
import os
import subprocess
from concurrent.futures import as_completed
from fractions import Fraction
from importlib.resources import files
from typing import Any

from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.cli.progress import progress_bars
from strapdown.export.backend import to_verilog
from strapdown.files import written_whole
from strapdown.markdown import markdown_table
from strapdown_lab.operators import OPERATORS
from strapdown_sim.cache import digest
from strapdown_sim.drivers.verilated import Interface, VerilatedModel
from strapdown_sim.jobs import outcome, remade, workers

__all__ = ["RUNS", "Run", "table"]

SHARD = 1 << 22
SHARDS = (1 << 32) // SHARD

RUNS = {run.name: run for entry in OPERATORS for run in entry.full_runs}
"""The operators that can be run, by the names that select them."""


class Lanes(wiring.Component):
    """Parallel copies of an operator, started together. They make the overhead of the simulator small.

    ``modes`` maps members of the operator to constants.

    Members ``operand_<n>``, ``result_<n>``; ``start``; ``done``, one bit per copy.
    """

    COUNT = 4

    def __init__(self, make, modes):
        self._copies, self._modes = [make() for _ in range(self.COUNT)], modes
        super().__init__({**{name: In(32) for name in self.operands}, "start": In(1),
                          **{name: Out(len(Value.cast(self.operator.result))) for name in self.results},
                          "done": Out(self.COUNT)})

    @property
    def operator(self):
        """One of the copies."""
        return self._copies[0]

    @property
    def operands(self):
        """Names of the operands' ports."""
        return tuple(f"operand_{lane}" for lane in range(self.COUNT))

    @property
    def results(self):
        """Names of the results' ports."""
        return tuple(f"result_{lane}" for lane in range(self.COUNT))

    def elaborate(self: Any, platform: object) -> Module:
        m = Module()
        for lane, (op, operand, result) in enumerate(zip(self._copies, self.operands, self.results, strict=True)):
            m.submodules[f"lane_{lane}"] = op
            port = Value.cast(op.operand if hasattr(op, "operand") else op.a)
            m.d.comb += [port.eq(getattr(self, operand)), op.start.eq(self.start),
                         getattr(self, result).eq(Value.cast(op.result)), self.done[lane].eq(op.done),
                         *(getattr(op, member).eq(value) for member, value in self._modes.items())]
        return m


class ExhaustiveModel(VerilatedModel):
    """Verilated copies of an operator, with C++ code that generates operands and expected results."""

    DRIVER = files(__package__) / "exhaustive.cpp"
    # The model runs for a long time, and only on this machine.
    FLAGS = "-O2", "-march=native"

    def check(self, subject, op, first, count):
        """See ``Run.check``.

        Raises: RuntimeError if ``done`` does not come when it should.
        """
        result = subprocess.run(
            [self._executable, subject.expectation, str(int(not op.format.gradual)), str(op.latency),
             str(op.interval), str(first), str(count)], capture_output=True, text=True, check=False)
        if result.returncode:
            raise RuntimeError(f"{subject.meaning}, from operand {first:#x}: {result.stdout or result.returncode}")
        *rows, number = result.stdout.splitlines()
        return int(number), rows


class Run:
    """The exhaustive check of one operator, with its progress.

    Progress is stored in ``build/exhaustive/<name>.json`` after every shard. An interrupted run continues
    from there, unless the circuit or the expectations have changed.
    """

    def __init__(self, name, build):
        self._build = build
        self.name, self.subject = name, RUNS[name]
        build.mkdir(parents=True, exist_ok=True)
        source = build / f"{name}.v"
        lanes = Lanes(self.subject.make, self.subject.modes)
        self.operator = lanes.operator
        source.write_text(to_verilog(lanes, "lanes"), encoding="utf-8")
        driver = ExhaustiveModel.DRIVER.read_text(encoding="utf-8")
        self.circuit = digest(source.read_text(encoding="utf-8") + driver)[:16]
        interface = Interface("lanes", lanes.operands, lanes.results, start="start", finish="done",
                              reset="rst", reset_active=1)
        self._model = ExhaustiveModel(source, interface, build / "models")
        self._file = build / f"{name}.json"
        self.state: dict[str, Any] = {"circuit": self.circuit, "shards": [], "mismatches": 0, "examples": []}
        if self._file.exists():
            stored = json.loads(self._file.read_text(encoding="utf-8"))
            if stored["circuit"] == self.circuit:
                self.state = stored

    def __reduce__(self):
        return remade, (Run, self.name, self._build)

    @property
    def complete(self):
        """True if every operand has been tried."""
        return len(self.state["shards"]) == SHARDS

    def remaining(self, fraction):
        """Shards that remain for a part of all operands, evenly spread."""
        wanted = math.ceil(SHARDS * fraction)
        done = set(self.state["shards"])
        return [shard for shard in (index * SHARDS // wanted for index in range(wanted)) if shard not in done]

    def check(self, first, count):
        """Checks operands from ``first`` on: (number of mismatches, the first mismatch as text).

        ``count`` is a multiple of ``Lanes.COUNT``.
        """
        return self._model.check(self.subject, self.operator, first, count)

    def keep(self, shard, mismatches, rows):
        """Store what ``check`` returns for the operands of a shard."""
        self.state["shards"].append(shard)
        self.state["mismatches"] += mismatches
        self.state["examples"] = (self.state["examples"] + rows)[:10]
        with written_whole(self._file) as partial:
            partial.write_text(json.dumps(self.state) + "\n", encoding="utf-8")


def fraction(text):
    """A part of all operands, for example 1/256. Raises: ValueError unless it is above 0 and at most 1."""
    value = Fraction(text)
    if not 0 < value <= 1:
        raise ValueError(text)
    return value


def check(names, part, root, *, jobs=2, scheduler=None):
    """Run the chosen operators to the end; returns the runs. Complete runs are entered in docs/exhaustive.json.

    ``jobs`` and ``scheduler`` are those of ``strapdown_sim.jobs.workers``; a worker makes the models again.
    """
    runs, commit = [], _commit(root)
    with progress_bars() as progress:
        for name in names:
            run = Run(name, root / "build" / "exhaustive")
            shards = run.remaining(part)
            task = progress.add_task(f"{name}, shards", total=len(shards))
            with workers(jobs, scheduler, threads=True) as pool:
                tried = {pool.executor.submit(run.check, shard * SHARD, SHARD): shard for shard in shards}
                for future in as_completed(tried):
                    run.keep(tried[future], *outcome(future))
                    progress.advance(task)
            if run.complete:
                _record(run, root, commit)
            runs.append(run)
    return runs


def _commit(root):
    """The commit of the sources, before an entry in docs/exhaustive.json changes them.

    For a continued run it is the commit of the last start.
    """
    return subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True,
                          check=False, env=os.environ | {"LC_ALL": "C"}).stdout.strip()


def _record(run, root, commit):
    """Enter a complete run in docs/exhaustive.json."""
    path = root / "docs" / "exhaustive.json"
    record = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    entry = {"operator": run.subject.meaning, "latency": run.operator.latency, "circuit": run.circuit,
             "operands": len(run.state["shards"]) * SHARD, "mismatches": run.state["mismatches"]}
    # A run that was already complete keeps its date.
    if {key: record.get(run.name, {}).get(key) for key in entry} != entry:
        record[run.name] = {**entry, "date": datetime.datetime.now(datetime.UTC).date().isoformat(), "commit": commit}
        path.write_text(json.dumps(dict(sorted(record.items())), indent=2) + "\n", encoding="utf-8")


def table(record):
    """The rows of docs/exhaustive.json as a Markdown table."""
    if not record:
        return "No run is entered yet."
    return markdown_table(["operator", "operands:", "mismatches:", "date", "commit"], [
        [entry["operator"], f"{entry['operands']:,}", f"{entry['mismatches']:,}", entry["date"], f"`{entry['commit']}`"]
        for entry in record.values()])
