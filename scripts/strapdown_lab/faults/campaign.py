"""A campaign: faults drawn from all bits of a core, their verdicts, kept from run to run, and the figures of them."""

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from strapdown.config import Config
from strapdown.cores import Core, main_module, make_core
from strapdown.export import without_comments, write_core
from strapdown_sim.cache import digest
from strapdown_sim.drivers.faults import HORIZON, Fault, FaultModel, Outcome, Verdict
from strapdown_sim.drivers.storage import Storage
from strapdown_sim.jobs import outcome, remade, workers

from .samples import samples_of

__all__ = ["Campaign", "NothingChosenError", "Upsets", "drawn", "figures", "harmful"]

WARM_S, WINDOW_S = 4, 4
"""Time before the first fault, in which a filter settles, and time in which the faults lie."""

BATCH = 250
"""Faults of one run of a model."""

KEPT = re.compile(r"(\d+),(\d+),([01]),([\d.e+]+),(\d+)\n")
"""A line of the file of verdicts."""


class Upsets:
    """The main module of a configuration with the model whose bits are flipped. On a worker it is made again.

    Parameters
    ----------
    config : Config
    build : Path
        Folder for the core's Verilog.
    models : Path
        Folder for compiled models.
    make_core : callable
        As ``strapdown.cores.make_core``; may cache cores.

    Attributes
    ----------
    core : Core
    circuit : str
        Digest of its Verilog.
    model : FaultModel
    """

    def __init__(self, config: Config, build: Path, models: Path, make_core: Callable[..., Core] = make_core) -> None:
        self._made = config, build, models
        self.core = make_core(main_module(config), config)
        # The command of the header does not matter: comments make no model.
        path = write_core(self.core, config, build / "verilog" / config.name, "")
        self.circuit = digest(without_comments(path.read_text(encoding="utf-8")))
        self.model = FaultModel(self.core, path, models)

    def __reduce__(self):
        return remade, (Upsets, *self._made)

    def verdicts(self, faults: Sequence[Fault], samples: dict[str, np.ndarray], second: int) -> list[Verdict]:
        """See ``FaultModel.verdicts``."""
        return self.model.verdicts(faults, samples, second)


@dataclass(frozen=True)
class Campaign:
    """Faults of the main module of a configuration.

    Parameters
    ----------
    config : Config
    count : int
        Number of faults. More faults of the same seed begin with the same ones.
    seed : int
    only : str
        A regular expression that the names of registers and memories must match; empty for all.
    recordings : Path or None
        Folder of the recordings; see ``samples_of``.
    """

    config: Config
    count: int
    seed: int
    only: str = ""
    recordings: Path | None = None

    def run(self, build: str | os.PathLike, *, make_core: Callable[..., Core] = make_core, models: Path | None = None,
            jobs: int = 1, scheduler: str | None = None,
            progress: Callable[[int], object] | None = None) -> dict[str, Any]:
        """Find the verdict of each fault, and return the figures as JSON values; see ``figures``.

        Verdicts are kept in a file in ``build``, from which an interrupted campaign continues.

        Parameters
        ----------
        build : path-like
            Folder for the core's Verilog and the file of verdicts.
        make_core : callable
            As ``strapdown.cores.make_core``; may cache cores.
        models : Path or None
            Folder for compiled models; ``build`` by default.
        jobs, scheduler
            See ``strapdown_sim.jobs.workers``; a worker makes the model again.
        progress : callable or None
            Called with the number of faults that have been added to those with a verdict.

        Raises: NothingChosenError; SimulatorMissingError, ToolError; RecordingError; JobsError.
        """
        build, config = Path(build), self.config
        progress = progress or (lambda count: None)
        upsets = Upsets(config, build, models or build / "models", make_core)
        model = upsets.model
        second = round(config.sample_rate_hz)
        rounds = range(WARM_S * second, (WARM_S + WINDOW_S) * second)
        samples = samples_of(upsets.core, config, rounds.stop + HORIZON + second + 3, self.recordings)
        faults = drawn(model.places, self.count, self.seed, rounds, self.only)
        key = digest(upsets.circuit, samples.source, model.DRIVER.read_text(encoding="utf-8"), str(HORIZON),
                     str(self.seed), self.only)[:16]
        file = build / f"{config.name}-{key}.csv"
        verdicts = {number: verdict for number, verdict in _kept(file).items() if number < self.count}
        progress(len(verdicts))
        missing = [number for number in range(self.count) if number not in verdicts]

        batches = [missing[first:first + BATCH] for first in range(0, len(missing), BATCH)]
        with workers(jobs, scheduler, threads=True) as pool:
            running = {pool.executor.submit(
                upsets.verdicts, [faults[number] for number in numbers], samples.ports, second): numbers
                for numbers in batches}
            for done in as_completed(running):
                found = dict(zip(running[done], outcome(done), strict=True))
                _keep(file, found)
                verdicts |= found
                progress(len(found))
        ordered = [verdicts[number] for number in range(self.count)]
        return {"config": config.name, "module": upsets.core.system.name, "verilog_sha256": upsets.circuit,
                "samples": samples.source, "seed": self.seed, **figures(model.places, faults, ordered)}


class NothingChosenError(ValueError):
    """No register or memory has a name that matches. The message is one line."""


def _kept(file):
    """Verdicts by the number of their fault; a line that was not written to its end does not count."""
    if not file.exists():
        return {}
    return {int(number): Verdict(Outcome(int(outcome)), restored == "1", float(error), int(updates))
            for number, outcome, restored, error, updates in KEPT.findall(file.read_text(encoding="utf-8"))}


def _keep(file, verdicts):
    with file.open("a", encoding="utf-8") as lines:
        lines.writelines(f"{number},{verdict.outcome.value},{verdict.restored:d},{verdict.error!r},{verdict.updates}\n"
                         for number, verdict in verdicts.items())


def drawn(places: Sequence[Storage], count: int, seed: int, rounds: range, only: str = "") -> list[Fault]:
    """Faults of equal probability for each bit and each time, from the places whose name matches ``only``.

    Raises: NothingChosenError if there is none.
    """
    chosen = [index for index, place in enumerate(places) if re.search(only, place.name)]
    if not chosen:
        raise NothingChosenError(f"no register or memory matches {only!r}")
    ends = np.cumsum([places[index].bits for index in chosen])
    # One generator for each column, so that more faults begin with the same ones.
    which, when, time = (np.random.default_rng([seed, column]) for column in range(3))
    faults = []
    for bit, round_, part in zip(which.integers(ends[-1], size=count).tolist(),
                                 when.integers(rounds.start, rounds.stop, size=count).tolist(),
                                 time.random(count).tolist(), strict=True):
        order = int(np.searchsorted(ends, bit, side="right"))
        place = places[chosen[order]]
        row, column = divmod(bit - int(ends[order]) + place.bits, place.width)
        faults.append(Fault(chosen[order], row, column, round_, part))
    return faults


def figures(places: Sequence[Storage], faults: Sequence[Fault], verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Figures of faults and their verdicts, as JSON values.

    Returns
    -------
    dict
        ``bits`` of the core and number of ``faults``; for each place with a fault its name, kind, bits, faults,
        ``outcomes``, and those ``lasting`` after a reset, each as name of the outcome to number; and the faults that
        are ``harmful``, with their place, row, bit, round, time and outcome.
    """
    by_place: dict[int, list[Verdict]] = {}
    for fault, verdict in zip(faults, verdicts, strict=True):
        by_place.setdefault(fault.place, []).append(verdict)
    return {
        "bits": sum(place.bits for place in places),
        "faults": len(faults),
        "places": [{
            "place": places[index].name, "kind": places[index].kind, "bits": places[index].bits, "faults": len(found),
            "outcomes": _counted(verdict.outcome for verdict in found),
            "lasting": _counted(verdict.outcome for verdict in found if not verdict.restored),
        } for index, found in sorted(by_place.items())],
        "harmful": [{**fault._asdict(), "place": places[fault.place].name, "outcome": verdict.outcome.name}
                    for fault, verdict in zip(faults, verdicts, strict=True) if verdict.outcome >= Outcome.STUCK],
    }


def _counted(outcomes: Iterable[Outcome]) -> dict[str, int]:
    counts = Counter(outcomes)
    return {outcome.name: counts[outcome] for outcome in Outcome if counts[outcome]}


def harmful(report: dict[str, Any], config: Config) -> list[dict]:
    """The faults of a report that its core must not have: a core that never starts again may be stuck."""
    allowed = set() if config.restart_after else {Outcome.STUCK.name}
    return [fault for fault in report["harmful"] if fault["outcome"] not in allowed]
