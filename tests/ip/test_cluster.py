"""Jobs on a Dask cluster of two workers on this machine, of which one is killed."""

import csv
import os
import signal
import threading
import time

import dask
import pytest
from click.testing import CliRunner
from distributed import Client, LocalCluster

from strapdown.cli import main
from strapdown_lab.proof import exhaustive
from strapdown_lab.report.measure import measure, operator_design
from strapdown_lab.report.operators import MEASURED
from strapdown_sim.cache import Cache
from strapdown_sim.jobs import JobLostError, completed, outcome, workers

pytestmark = pytest.mark.ip

HEAD = "Time (s)," + ",".join(f"{sensor} {axis} ({unit})" for sensor, unit in (
    ("Gyroscope", "deg/s"), ("Accelerometer", "g"), ("Magnetometer", "uT")) for axis in "XYZ")
COUNT = 6


@pytest.fixture(scope="module")
def cluster():
    """Address of a scheduler with two workers. A job that loses two workers is lost."""
    with (dask.config.set({"distributed.scheduler.allowed-failures": 1}),
          LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as found):
        yield found.scheduler_address


def logs(folder):
    """Logs of a level body, each with a rate of its own, and one that is broken."""
    folder.mkdir()
    for number in range(COUNT):
        rows = [f"{k / (100 + number / 10):.6f},0.1,-0.2,0,0.01,0,1,20,0,-40" for k in range(200)]
        (folder / f"{number}.csv").write_text("\n".join([HEAD, *rows, ""]), encoding="utf-8")
    (folder / "broken.ulg").write_bytes(b"ULog")


def with_runtime(folder, models):
    """A folder for compiled models, which has the common part of those of other tests."""
    (models / "runtime").mkdir(parents=True, exist_ok=True)
    folder.mkdir(parents=True)
    (folder / "runtime").symlink_to(models / "runtime")
    return folder


def test_nothing_is_lost_with_a_worker(cluster, tmp_path, models):
    logs(tmp_path / "logs")
    build = with_runtime(tmp_path / "build", models)
    output, killed = tmp_path / "out", []
    # A busy worker does not answer, so both are asked before.
    with Client(cluster, set_as_default=False) as client:
        pids = client.run(os.getpid)

    def kill():
        with Client(cluster, set_as_default=False) as client:
            while len(list(output.rglob("batch.json"))) < 2:
                time.sleep(0.02)
            while not (busy := [worker for worker, tasks in client.processing().items() if tasks]):
                time.sleep(0.02)
            os.kill(pids[busy[0]], signal.SIGKILL)
            killed.append(busy[0])

    def run(scheduler):
        return CliRunner().invoke(main, ["batch", str(tmp_path / "logs"), "--config", "mahony", "--output", str(output),
                                         "--build", str(build), "--scheduler", scheduler])

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    result = run(cluster)
    killer.join(timeout=10)
    assert killed
    assert result.exit_code == 1, result.output
    with (output / "batch.csv").open(newline="", encoding="utf-8") as file:
        rows = {row["file"]: row for row in csv.DictReader(file)}
    assert {name for name, row in rows.items() if row["error"]} == {"broken.ulg"}
    good = [rows[f"{number}.csv"] for number in range(COUNT)]
    assert [row["bits_differing"] for row in good] == ["0"] * COUNT
    assert [float(row["sample_rate_hz"]) for row in good] == pytest.approx(
        [100 + number / 10 for number in range(COUNT)], rel=1e-4)
    # Many rates, one model.
    assert len([path for path in build.glob("INS_top-*") if path.is_dir()]) == 1
    assert f"not run again                      {COUNT}, which did not change" in run(cluster).output


def test_a_job_that_kills_its_workers_is_lost_alone(cluster):
    with workers(1, cluster) as pool:
        found = {}
        for key, future in completed(pool, eval, (("good", ("2 + 2",)), ("bad", ("__import__('os')._exit(1)",)))):
            try:
                found[key] = outcome(future)
            except JobLostError as error:
                found[key] = str(error)
    assert found["good"] == 4
    assert found["bad"].startswith("each worker that tried it ended")


def test_synthesis_comes_into_the_cache_of_this_machine(cluster, tmp_path):
    entry = next(entry for entry in MEASURED if entry.operator == "compare")
    (row,) = measure([operator_design(entry)], Cache(tmp_path), place=False, scheduler=cluster)
    assert row["xc7"]["lut"] > 0
    assert [path.suffix for path in tmp_path.iterdir() if path.is_dir()] == [".xc7"]
    # The same from the cache, without a cluster.
    assert measure([operator_design(entry)], Cache(tmp_path).as_it_is(), place=False) == [row]


def test_an_exhaustive_run(cluster, tmp_path, models, monkeypatch):
    monkeypatch.setattr(exhaustive, "SHARD", 1 << 16)
    folder = with_runtime(tmp_path / "build" / "exhaustive" / "models", models)
    part = exhaustive.fraction(f"2/{exhaustive.SHARDS}")
    (run,) = exhaustive.check(["from_int32"], part, tmp_path, scheduler=cluster)
    assert (len(run.state["shards"]), run.state["mismatches"]) == (2, 0)
    assert exhaustive.Run("from_int32", folder.parent).state == run.state
