"""Jobs in processes and threads of this machine; tests/ip/test_cluster.py has a Dask cluster."""

import math
import os
import time
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from strapdown_sim import jobs
from strapdown_sim.cache import Cache
from strapdown_sim.jobs import JobLostError, JobsError, Workers, completed, outcome, remade, submit_cached, workers


def test_processes_of_their_own():
    with workers(2) as pool:
        found = {key: outcome(future) for key, future in completed(
            pool, math.sqrt, ((number, (number,)) for number in (4, 9)))}
        assert outcome(pool.executor.submit(os.getpid)) != os.getpid()
    assert found == {4: 2, 9: 3}


def test_an_error_of_a_job_is_its_own():
    with workers(1, threads=True) as pool:
        (_, future), = completed(pool, math.sqrt, [("a", (-1,))])
        with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
            outcome(future)


def test_a_killed_process_ends_in_one_line():
    def run():
        with workers(1) as pool:
            for _, future in completed(pool, os._exit, ((number, (1,)) for number in range(9))):
                outcome(future)

    with pytest.raises(JobsError, match=r"^a worker process was killed, .* the same command continues from here, with "
                                        r"--jobs 1 in less memory$"):
        run()


def test_few_tasks_are_taken_at_a_time():
    taken = []

    def tasks():
        for number in range(20):
            taken.append(number)
            yield number, (number,)

    with workers(2, threads=True) as pool:
        running = completed(pool, float, tasks())
        first, _ = next(running)
        # Two for each worker, and the one that is taken next.
        assert len(taken) <= 5
        assert sorted([first, *(key for key, _ in running)]) == taken == list(range(20))


def test_jobs_that_have_not_begun_are_left_after_an_interrupt():
    begun = []

    def job():
        begun.append(1)
        time.sleep(0.2)

    def interrupted():
        with workers(1, threads=True) as pool:
            for _ in range(9):
                pool.executor.submit(job)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(begun) < 9


def failed(error):
    future: Future = Future()
    future.set_exception(error)
    return future


def test_a_lost_job_and_a_lost_scheduler():
    # As distributed calls it.
    killed = type("KilledWorker", (Exception,), {})
    with pytest.raises(JobLostError, match=r"^each worker that tried it ended: perhaps it needs more memory"):
        outcome(failed(killed("task", None, 4, [])))
    cancelled: Future = Future()
    cancelled.cancel()
    with pytest.raises(JobsError, match=r"^the connection to the scheduler is lost; finished jobs are kept"):
        outcome(cancelled)


def test_without_dask_one_line_names_the_command(monkeypatch):
    monkeypatch.setattr(jobs, "find_spec", lambda name: None)
    with pytest.raises(JobsError) as error, workers(1, "tcp://127.0.0.1:1"):
        pass
    assert str(error.value) == "--scheduler needs dask.distributed: pip install 'strapdown[cluster]'"


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nothing://a"])
def test_no_scheduler_answers(monkeypatch, address):
    monkeypatch.setattr(jobs, "WAITING_S", 0.5)
    with pytest.raises(JobsError, match=rf"^no Dask scheduler answers at {address}: [^\n]+$"), workers(1, address):
        pass


class Client(SimpleNamespace):
    """A client of a cluster whose only worker has another version."""

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def run(self, function):
        return {"tcp://a:1": function() | {"strapdown": "0.0.1"}}


class Bare(Client):
    def run(self, function):
        raise ModuleNotFoundError("No module named 'strapdown_sim'")


def test_a_worker_without_the_packages_is_refused(monkeypatch):
    monkeypatch.setattr("distributed.Client", lambda *address, **options: Bare())
    with pytest.raises(JobsError) as error, workers(1, "tcp://a:2"):
        pass
    assert str(error.value) == ("a worker of tcp://a:2 cannot run jobs: No module named 'strapdown_sim'; install the "
                                "same strapdown there")


def test_a_worker_with_other_packages_is_refused(monkeypatch):
    monkeypatch.setattr("distributed.Client", lambda *address, **options: Client())
    with pytest.raises(JobsError, match=r"^worker tcp://a:1 has strapdown 0\.0\.1, and this machine has \S+: install "
                                        r"the same there$"), workers(1, "tcp://a:2"):
        pass


def test_objects_are_made_again_once():
    assert remade(SimpleNamespace) is remade(SimpleNamespace)


def length(text, cache):
    """A flow of two results, a file and a folder."""
    def folder(path):
        path.mkdir()
        (path / "inner").write_text(text, encoding="utf-8")

    copy = cache.file({"text": text}, ".folder", folder)
    counted = cache.file({"of": text}, ".txt", lambda path: path.write_text(
        str(len((copy / "inner").read_text(encoding="utf-8"))), encoding="utf-8"))
    return int(counted.read_text(encoding="utf-8"))


def test_results_of_another_machine_come_into_the_cache(tmp_path):
    asked = []

    class Counting(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            asked.append(function)
            return super().submit(function, *arguments)

    cache = Cache(tmp_path / "own")
    with Counting(1) as executor:
        pool = Workers(executor, 1, remote=True)
        assert submit_cached(pool, cache, length, "four").result() == 4
        # The second time nothing runs.
        assert submit_cached(pool, cache, length, "four").result() == 4
        assert len(asked) == 1
        with pytest.raises(TypeError):
            submit_cached(pool, cache, length, 4).result()
    assert length("four", cache.as_it_is()) == 4
