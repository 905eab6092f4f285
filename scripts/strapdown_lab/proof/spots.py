"""Runs the Verilated spot finder over random lines, against the rule in C++."""

import datetime
import json
import os
import subprocess
from importlib.resources import files
from typing import Any, ClassVar

from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.blocks import PIXEL_WIDTH, SENSORS, SpotFinder
from strapdown.cli.progress import progress_bars
from strapdown.export.backend import to_verilog
from strapdown.markdown import markdown_table
from strapdown_sim.cache import digest
from strapdown_sim.drivers.verilated import Interface, VerilatedModel
from strapdown_sim.jobs import outcome, remade, workers

__all__ = ["SpotRun", "check", "table"]

SHARD = 20_000
"""Lines that one process runs."""


class FinderPorts(wiring.Component):
    """A spot finder with flat ports, none of which is a keyword of Verilog or C++."""

    LINE: ClassVar = {"valid": 1, "first": 1, "last": 1, "pixel": PIXEL_WIDTH}
    LEVELS = ("black", "lo", "hi")
    RESULTS = ("finish", "found", "position", "peak", "width", "sum", "saturated", "several", "edge", "black_next",
               "line_peak", "line_saturated")

    def __init__(self, finder):
        self._finder = finder
        self._results = {"touches" if name == "edge" else name: Value.cast(getattr(finder, name))
                         for name in self.RESULTS}
        super().__init__({**{name: In(width) for name, width in self.LINE.items()},
                          **dict.fromkeys(self.LEVELS, In(PIXEL_WIDTH)),
                          **{name: Out(len(value)) for name, value in self._results.items()}})

    @property
    def interface(self):
        """The ports, for a driver."""
        return Interface("finder", (*self.LINE, *self.LEVELS), tuple(self._results), reset="rst", reset_active=1)

    def elaborate(self: Any, platform: object) -> Module:
        m = Module()
        m.submodules.finder = finder = self._finder
        pixels = finder.pixels
        m.d.comb += [pixels.valid.eq(self.valid), pixels.p.first.eq(self.first), pixels.p.last.eq(self.last),
                     pixels.p.pixel[0].eq(self.pixel),
                     *(getattr(finder, name).eq(getattr(self, name)) for name in self.LEVELS),
                     *(getattr(self, name).eq(value) for name, value in self._results.items())]
        return m


class SpotRun(VerilatedModel):
    """A Verilated spot finder for lines of a sensor, with C++ code that makes random lines and the expected results.

    Parameters
    ----------
    sensor : str
        Name in SENSORS.
    build : Path
        Folder for the model.
    finder : SpotFinder or None
        The finder; None means that of the sensor, with the usual parameters.
    """

    DRIVER = files(__package__) / "spots.cpp"
    FLAGS = "-O2", "-march=native"

    def __init__(self, sensor, build, finder=None):
        self._made = sensor, build, finder
        self.pixels = SENSORS[sensor].pixels
        self.finder = finder or SpotFinder(self.pixels)
        ports = FinderPorts(self.finder)
        build.mkdir(parents=True, exist_ok=True)
        source = build / f"spots_{sensor}.v"
        source.write_text(to_verilog(ports, "finder"), encoding="utf-8")
        driver = self.DRIVER.read_text(encoding="utf-8")
        self.circuit = digest(source.read_text(encoding="utf-8") + driver)[:16]
        super().__init__(source, ports.interface, build / "models")

    def __reduce__(self):
        return remade, (SpotRun, *self._made)

    def check(self, seed, lines):
        """Check random lines: numbers of mismatches, of lines with a spot, and with several; and the first mismatches.

        Raises: RuntimeError if ``finish`` does not come when it should.
        """
        finder = self.finder
        numbers = seed, lines, finder.line, finder.gap, finder.width_max, finder.latency
        result = subprocess.run([self._executable, *map(str, numbers)], capture_output=True, text=True, check=False)
        if result.returncode:
            raise RuntimeError(f"spot finder, seed {seed}: {result.stdout or result.returncode}")
        *rows, mismatches, counts = result.stdout.splitlines()
        return (int(mismatches), *map(int, counts.split())), rows


def check(sensors, lines, root, *, jobs=2, scheduler=None):
    """Run ``lines`` random lines of each sensor; returns the entry of docs/spots.json for each, and mismatches.

    ``jobs`` and ``scheduler`` are those of ``strapdown_sim.jobs.workers``; a worker makes the models again.
    """
    entries, examples = {}, []
    with progress_bars() as progress:
        for sensor in sensors:
            run = SpotRun(sensor, root / "build" / "spots")
            sizes = [min(SHARD, lines - first) for first in range(0, lines, SHARD)]
            task = progress.add_task(f"{sensor}, lines", total=lines)
            totals = [0, 0, 0]
            with workers(jobs, scheduler, threads=True) as pool:
                tried = [pool.executor.submit(run.check, seed, size) for seed, size in enumerate(sizes, 1)]
                for size, future in zip(sizes, tried, strict=True):
                    counts, rows = outcome(future)
                    totals = [total + count for total, count in zip(totals, counts, strict=True)]
                    examples += [f"{sensor}: {row}" for row in rows]
                    progress.advance(task, size)
            entries[sensor] = {"circuit": run.circuit, "lines": lines, "mismatches": totals[0], "found": totals[1],
                               "several": totals[2]}
    return entries, examples[:10]


def record(entries, root):
    """Enter runs in docs/spots.json. A run that is not longer than the one of the same circuit there is not entered."""
    path = root / "docs" / "spots.json"
    stored = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True,
                            check=False, env=os.environ | {"LC_ALL": "C"}).stdout.strip()
    for sensor, entry in entries.items():
        old = stored.get(sensor, {"circuit": None, "lines": 0})
        if old["circuit"] != entry["circuit"] or old["lines"] < entry["lines"]:
            stored[sensor] = {**entry, "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
                              "commit": commit}
    path.write_text(json.dumps(dict(sorted(stored.items())), indent=2) + "\n", encoding="utf-8")


def table(stored):
    """The rows of docs/spots.json as a Markdown table."""
    if not stored:
        return "No run is entered yet."
    return markdown_table(
        ["sensor", "lines:", "with a spot:", "with several:", "mismatches:", "date", "commit"],
        [[f"`{sensor}`", *(f"{entry[key]:,}" for key in ("lines", "found", "several", "mismatches")), entry["date"],
          f"`{entry['commit']}`"] for sensor, entry in stored.items()])
