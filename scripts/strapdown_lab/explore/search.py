"""Schedules the pools of a grid, synthesises those that may be on the front, places and routes those that are."""

import json
import statistics
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from typing import Any

from strapdown.config import Config
from strapdown.cores import CONFIGS
from strapdown.export.backend import to_verilog
from strapdown.kernel.pool import Pool
from strapdown.tools import ToolError
from strapdown_lab.synthesis import place_ecp5, synthesise_xc7
from strapdown_sim.cache import Cache, digest
from strapdown_sim.jobs import Workers, outcome, submit_cached

from .estimate import estimate
from .front import Row, Wish, expected, front, measured, spread
from .grid import Grid, pool_key, settings_of
from .plan import circuit, planned

__all__ = ["Limits", "Search", "siblings"]

MARGIN = 0.1
"""Share by which the estimate of LUTs may be wrong before a pool is discarded."""


@dataclass(frozen=True)
class Limits:
    """How much is tried.

    Attributes
    ----------
    pools, syntheses, routes : int
        Most pools that are scheduled, synthesised, placed and routed.
    seeds : tuple of int
        Seeds of the placer.
    """

    pools: int = 400
    syntheses: int = 24
    routes: int = 8
    seeds: tuple[int, ...] = (1, 2, 3)


def siblings(config: Config) -> dict[str, Config]:
    """The named configurations that differ from ``config`` in their pool only, by name, and itself."""
    own = set(type(config).model_fields) - {
        "name", "description", "pool", "operand_memory", "side_memory", "microcode"}
    return {config.name: config} | {
        name: other for name, other in CONFIGS.items() if type(other) is type(config)
        and all(getattr(other, each) == getattr(config, each) for each in own) and name != config.name}


@dataclass
class Search:
    """A search of the pools of a kernel.

    Attributes
    ----------
    configured : callable
        Makes the configuration, also in a worker.
    config, module : Config, str
        The configuration, and its module.
    grid : Grid
    cache : Cache
        Stores all results.
    schedulers, tools : Workers
        Where schedules are made, and where the tools run.
    limits : Limits
    wish : Wish
    place : bool
        False for no place and route.
    progress : callable
        Called with a stage, the number of its jobs that are done, and the number of all.
    rows : list of dict
        The pools, as JSON values: ``pool``, its parameters; ``settings``, the changes of the configuration that make
        it; ``names`` of configurations that have it; ``cycles``, ``latency``; ``estimate``; ``verilog_sha256``, the
        digest of the circuit, and ``xc7`` after synthesis; ``ecp5`` after place and route; ``failed``, the error of a
        tool in one line. A pool that failed stays a row, and no tool gets it again.
    refused : int
        Number of pools that the engine refuses.
    """

    configured: Callable[[], Config]
    config: Config
    module: str
    grid: Grid
    cache: Cache
    schedulers: Workers
    tools: Workers
    limits: Limits = Limits()
    wish: Wish = field(default_factory=Wish)
    place: bool = True
    progress: Callable[[str, int, int], object] = lambda stage, done, total: None
    rows: list[Row] = field(default_factory=list, init=False)
    refused: int = field(default=0, init=False)
    _pools: dict[str, Pool] = field(default_factory=dict, init=False)
    _names: dict[str, list[str]] = field(default_factory=dict, init=False)
    _units: dict[tuple, Future] = field(default_factory=dict, init=False)
    _done: dict[str, int] = field(default_factory=dict, init=False)
    _all: dict[str, int] = field(default_factory=dict, init=False)

    def run(self) -> None:
        """All stages. Raises: JobsError, ToolMissingError, ToolError."""
        self._schedule(self._starts())
        if self.grid.size() <= self.limits.pools:
            self._schedule(self.grid)
        else:
            self._walk()
        self._synthesise(front(self.working, expected, MARGIN), self.limits.syntheses)
        if self.place:
            self._route(front([row for row in self.working if "xc7" in row], expected), self.limits.routes)

    @property
    def working(self) -> list[Row]:
        """Rows that no tool has failed on."""
        return [row for row in self.rows if "failed" not in row]

    @property
    def named(self) -> list[Row]:
        """Of these, the rows that are those of configurations."""
        return [row for row in self.working if row["names"]]

    @property
    def complete(self) -> list[Row]:
        """Rows that all tools have measured."""
        return [row for row in self.rows if ("ecp5" if self.place else "xc7") in row]

    # Schedules.

    def _starts(self) -> Iterator[Pool]:
        base = self.grid.base
        for name, other in siblings(self.config).items():
            self._names.setdefault(pool_key(other.engine_pool), []).append(name)
            yield base if name == self.config.name else other.engine_pool

    def _walk(self) -> None:
        """Goes from the pools on the front to their neighbours, until all neighbours are known."""
        walked: set[str] = set()
        while len(self._pools) < self.limits.pools:
            best = [row for row in front(self.working, expected) if row["key"] not in walked]
            if not best:
                return
            fresh: dict[str, Pool] = {}
            room = self.limits.pools - len(self._pools)
            for row in spread(best, len(best), expected):
                walked.add(row["key"])
                fresh |= {key: pool for pool in self.grid.neighbours(self._pools[row["key"]])
                          if (key := pool_key(pool)) not in self._pools}
                if len(fresh) >= room:
                    break
            self._schedule(list(fresh.values())[:room])

    def _schedule(self, pools: Iterable[Pool]) -> None:
        """Adds a row for each new pool that the engine takes."""
        running = []
        for pool in pools:
            key = pool_key(pool)
            if key in self._pools:
                continue
            self._pools[key] = pool
            settings = settings_of(pool, self.grid.base)
            job = submit_cached(self.schedulers, self.cache, planned, self.configured, self.module, settings)
            running.append((key, pool, settings, self._counted("schedules", job)))
        found = []
        for key, pool, settings, job in running:
            plan = outcome(job)
            if "refused" in plan:
                self.refused += 1
                continue
            found.append((key, pool, settings, plan))
            for kind in {*plan["units"]}:
                self._measure_unit(pool, kind)
        for key, pool, settings, plan in found:
            row = {"key": key, "pool": json.loads(key), "settings": settings, "names": self._names.get(key, []),
                   "cycles": plan["cycles"], "latency": plan["latency"],
                   "units": {kind: plan["units"].count(kind) for kind in dict.fromkeys(plan["units"])}}
            self.rows.append(row)
            try:
                units = {kind: outcome(self._measure_unit(pool, kind)) for kind in row["units"]}
            except ToolError as error:
                row["failed"] = error.line
            else:
                row["estimate"] = estimate(plan, units)

    def _measure_unit(self, pool: Pool, kind: str) -> Future:
        """Job with the resources of an operator alone."""
        operator = next(each for each in pool.operators if each.name == kind)
        timing = tuple((each.name, getattr(operator, each.name)) for each in fields(operator) if each.name != "count")
        if (key := (kind, timing)) not in self._units:
            component = operator.make(pool.format)
            top = type(component).__name__
            self._units[key] = self._counted("operators", submit_cached(
                self.tools, self.cache, partial(_unit, place=self.place), to_verilog(component, top), top))
        return self._units[key]

    # Tools.

    def _synthesise(self, rows, number):
        chosen = self._chosen(rows, number)
        texts = [(row, self.schedulers.executor.submit(circuit, self.configured, self.module, row["settings"]))
                 for row in chosen]
        running = []
        for row, text in texts:
            row["verilog"] = outcome(text)
            row["verilog_sha256"] = digest(row["verilog"])
            running.append((row, self._counted("synthesis", submit_cached(
                self.tools, self.cache, synthesise_xc7, row["verilog"], self.module))))
        for row, job in running:
            try:
                row["xc7"] = asdict(outcome(job))
            except ToolError as error:
                row["failed"] = error.line

    def _route(self, rows, number):
        flow = partial(place_ecp5, seeds=self.limits.seeds)
        running = [(row, self._counted("place and route", submit_cached(
            self.tools, self.cache, flow, row["verilog"], self.module))) for row in self._chosen(rows, number)]
        for row, job in running:
            try:
                row["ecp5"] = outcome(job).row()
            except ToolError as error:
                row["failed"] = error.line

    def _chosen(self, rows, number):
        """A sample of rows: configurations, then those that meet the wish as far as is known, then all."""
        fit = [row for row in rows if self.wish.limits and self.wish.met(expected(row), MARGIN)]
        first = [*self.named, *spread(fit, number, expected)]
        unique = list({row["key"]: row for row in first}.values())[:max(number, len(self.named))]
        return spread(rows, number, expected, unique)

    def _counted(self, stage, job):
        """The job, counted in the progress of a stage."""
        self._all[stage] = self._all.get(stage, 0) + 1
        self._done.setdefault(stage, 0)

        def done(_):
            self._done[stage] += 1
            self.progress(stage, self._done[stage], self._all[stage])

        job.add_done_callback(done)
        return job

    # Result.

    def result(self) -> dict[str, Any]:
        """The figures as JSON values; ``front`` of a row says whether it is on the front of those that all tools have
        measured."""
        best = {row["key"] for row in front(self.complete, measured)}
        rows = [{name: value for name, value in row.items() if name not in ("verilog", "key")} |
                {"front": row["key"] in best} for row in self.rows]
        rows.sort(key=lambda row: ("failed" in row, row["cycles"] if "failed" in row else
                                   (measured(row) if "xc7" in row else expected(row))["time"]))
        return {"config": self.config.name, "module": self.module,
                "base": {name: getattr(value, "value", value) for name, value in self.grid.base.parameters.items()},
                "axes": {name: [getattr(value, "value", value) for value in values]
                         for name, values in self.grid.axes.items()},
                "grid": self.grid.size(), "scheduled": len(self._pools), "refused": self.refused,
                "left": self._left(), "errors": self._errors(), "pools": rows}

    def _left(self):
        """Pools that the estimates put on the front, but that no tool has measured."""
        done = {row["key"] for row in self.complete}
        return sum(row["key"] not in done for row in front(self.working, expected))

    def _errors(self):
        """Errors of the estimates, as shares: the median, and the largest in magnitude."""
        found = {}
        for name, pairs in {
                "lut": [(row["estimate"]["lut"], row["xc7"]["lut"]) for row in self.rows if "xc7" in row],
                "mhz": [(row["estimate"]["mhz"], row["ecp5"]["fmax_mhz"]) for row in self.rows if "ecp5" in row]
        }.items():
            if shares := [guess / true - 1 for guess, true in pairs]:
                found[name] = {"median": statistics.median(shares), "largest": max(shares, key=abs)}
        return found


def _unit(verilog, top, cache, *, place):
    resources = asdict(synthesise_xc7(verilog, top, cache))
    return resources | ({"mhz": place_ecp5(verilog, top, cache, seeds=(1,)).fmax_mhz[0]} if place else {})
