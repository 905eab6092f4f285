"""Many logs through one core: which files are logs, the table, the page, and what is not run again.

The software twin stands in for the Verilated circuit, except in one test; tests/ip/test_cluster.py has a Dask cluster.
"""

import csv
import json
import re
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cli.common import configuration
from strapdown.cores import MAHONY, make_core
from strapdown.export import write_core
from strapdown_sim import batch, replay
from strapdown_sim.batch import COLUMNS, find_logs, replay_batch, write_table
from strapdown_sim.drivers.storage import unfilled
from strapdown_sim.jobs import JobLostError, JobsError, workers
from strapdown_sim.recordings import Choice, RecordingError, read_recording

from ..twin import TwinModel

UNITS = {"Gyroscope": "deg/s", "Accelerometer": "g", "Magnetometer": "uT"}
LEVEL = {"Gyroscope": (0.1, -0.2, 0), "Accelerometer": (0.01, 0, 1), "Magnetometer": (20, 0, -40)}


def table(*sensors, rate=100.0, count=60, time="Time (s)"):
    """Text of a level body at rest."""
    head = [time, *(f"{sensor} {axis} ({UNITS[sensor]})" for sensor in sensors for axis in "XYZ")]
    scale = 1e6 if "us" in time else 1
    rows = [",".join(f"{value:.9g}" for value in (scale * k / rate, *(number for sensor in sensors
                                                                     for number in LEVEL[sensor])))
            for k in range(count)]
    return "\n".join([",".join(head), *rows]) + "\n"


def phone(folder):
    """A folder of one file for each sensor."""
    for name, unit in ("Gyroscope", "rad/s"), ("Accelerometer", "m/s^2"):
        rows = [f"{k / 100},0,0,{9.81 * (unit[0] == 'm')}" for k in range(60)]
        text = "\n".join([f'"Time (s)","X ({unit})","Y ({unit})","Z ({unit})"', *rows, ""])
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    (folder / "Metadata.csv").write_text("device,version\na,1\nb,2\n", encoding="utf-8")


def topics(folder, prefix):
    """A ULog file as tables of topics, two of which have a gyro."""
    imu = "timestamp_sample", *(f"delta_{of}[{k}]" for of in ("angle", "velocity") for k in range(3)), \
        "delta_angle_dt", "delta_velocity_dt"
    for topic, columns, row in (
            ("sensor_combined", [f"{of}[{k}]" for of in ("gyro_rad", "accelerometer_m_s2") for k in range(3)],
             [0, 0, 0, 0, 0, -9.81]),
            ("vehicle_imu", imu, [0, 0, 0, 0, 0, 0, -0.0981, 10_000, 10_000])):
        lines = [",".join(["timestamp", *columns])]
        for k in range(60):
            lines.append(",".join(map(str, [10_000 * k, *(row if len(row) == 6 else [10_000 * k, *row[1:]])])))
        (folder / f"{prefix}_{topic}_0.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")


@pytest.fixture
def logs(tmp_path):
    """A folder of logs, of parts of logs, and of files that are none."""
    folder = tmp_path / "logs"
    for inner in "bike", "phone", ".git":
        (folder / inner).mkdir(parents=True)
    every = tuple(UNITS)
    for name, text in {
        "level.csv": table(*every), "bike/level.csv": table(*every, rate=99.7),
        # An x-IMU3: the magnetometer has a file and a clock of its own.
        "a_Inertial.csv": table("Gyroscope", "Accelerometer", time="Timestamp (us)"),
        "a_Magnetometer.csv": table("Magnetometer", rate=20, count=12, time="Timestamp (us)"),
        "alone_Magnetometer.csv": table("Magnetometer", time="Timestamp (us)"),
        "linear.csv": table(*every).replace(",1,20", ",0.01,20"),
        "README.md": "# Logs\n\n| log | rate |\n| --- | ---: |\n| level | 100 |\n", ".git/level.csv": table(*every),
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "plot.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    (folder / "broken.ulg").write_bytes(b"\0\1\2")
    phone(folder / "phone")
    topics(folder, "ulog")
    return folder


class Twin(TwinModel):
    """Counts the runs."""

    runs = 0

    def update(self, inputs, **options):
        type(self).runs += 1
        return super().update(inputs, **options)


@pytest.fixture
def twin(monkeypatch, make_core):
    monkeypatch.setattr(Twin, "runs", 0)
    monkeypatch.setattr(replay, "CoreModel", Twin)
    monkeypatch.setattr("strapdown_sim.jobs._Processes", ThreadPoolExecutor)
    # Cores, Verilog and pictures would take most of the time.
    monkeypatch.setattr(replay, "make_core", make_core)
    monkeypatch.setattr(batch, "make_core", make_core)
    monkeypatch.setattr("strapdown.export.verilog.to_verilog", lambda top, name, **options: f"module {name};\n")
    monkeypatch.setattr(replay, "attitude_picture", lambda path, **drawn: path.write_bytes(b""))
    return Twin


def command(logs, output, *words):
    return CliRunner().invoke(main, ["batch", str(logs), "--config", "mahony", "--jobs", "1", "--output", str(output),
                                     *words], catch_exceptions=False)


def rows_of(output):
    with (output / "batch.csv").open(newline="", encoding="utf-8") as file:
        return {row["file"]: row for row in csv.DictReader(file)}


GOOD = ["a_Inertial.csv", "bike/level.csv", "level.csv", "phone", "ulog_sensor_combined_0.csv"]
BAD = ["alone_Magnetometer.csv", "broken.ulg", "linear.csv"]


def test_a_batch(logs, tmp_path, twin):
    output = tmp_path / "logs" / "out"
    result = command(logs, output, "--html")
    assert result.exit_code == 1
    rows = rows_of(output)
    assert sorted(rows) == sorted(GOOD + BAD)
    assert [name for name, row in rows.items() if row["error"]] == BAD
    # What a single replay says.
    for name in BAD:
        with pytest.raises(RecordingError) as error:
            read_recording(logs / name)
        assert rows[name]["error"] == str(error.value)
        assert f"strapdown: {name}: {error.value}" in result.stderr.splitlines()
    assert "strapdown: note: 2 files (README.md, plot.png): no recordings, left out" in result.stderr.splitlines()
    assert "logs                               5 of 8 went in" in result.output.splitlines()
    assert rows["bike/level.csv"] | {"wall_s": "", "float64_max_deg": ""} == dict.fromkeys(rows["level.csv"], "") | {
        "file": "bike/level.csv", "format": "table of text", "duration_s": rows["bike/level.csv"]["duration_s"],
        "samples": "60", "sample_rate_hz": rows["bike/level.csv"]["sample_rate_hz"], "gaps_bridged": "0",
        "mag_rate_hz": rows["bike/level.csv"]["mag_rate_hz"], "samples_filled": "0", "refused_updates": "0",
        "bits_differing": "0"}
    assert float(rows["bike/level.csv"]["sample_rate_hz"]) == pytest.approx(99.7)
    assert float(rows["bike/level.csv"]["duration_s"]) == pytest.approx(59 / 99.7)
    assert float(rows["a_Inertial.csv"]["mag_rate_hz"]) == pytest.approx(20, rel=0.01)
    for name in GOOD:
        folder = output / "logs" / name
        assert {"attitude.csv", "attitude.png", "INS_top.v", "summary.json"} <= {file.name for file in folder.iterdir()}
        assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["samples"] == 60
    lines = (output / "batch.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2 + len(rows)
    page = (output / "batch.html").read_text(encoding="utf-8")
    assert '<a href="logs/bike/level.csv/">bike/level.csv</a>' in page
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', page)
    assert twin.runs == len(GOOD)


def test_only_what_changed_runs_again(logs, tmp_path, twin):
    output = tmp_path / "out"
    for name in BAD:
        (logs / name).unlink()
    first = command(logs, output)
    assert first.exit_code == 0, first.output
    assert twin.runs == len(GOOD)
    table_before = (output / "batch.csv").read_bytes()
    again = command(logs, output)
    assert again.exit_code == 0
    assert "not run again                      5, which did not change" in again.output.splitlines()
    assert twin.runs == len(GOOD)
    assert (output / "batch.csv").read_bytes() == table_before

    # A file beside a log is a part of it; so is a file of a folder.
    with (logs / "a_Magnetometer.csv").open("a", encoding="utf-8") as file:
        file.write("600000,20,0,-40\n")
    (logs / "phone" / "Accelerometer.csv").write_text(
        (logs / "phone" / "Accelerometer.csv").read_text(encoding="utf-8").replace("9.81", "9.82"), encoding="utf-8")
    assert command(logs, output).exit_code == 0
    assert twin.runs == len(GOOD) + 2
    # Other options, another configuration.
    assert command(logs, output, "--to", "0.4").exit_code == 0
    assert rows_of(output)["level.csv"]["samples"] == "41"
    assert command(logs, output, "--set", "kp=1").exit_code == 0
    assert twin.runs == 3 * len(GOOD) + 2
    (output / "logs" / "level.csv" / "batch.json").write_text("{", encoding="utf-8")
    assert command(logs, output, "--set", "kp=1").exit_code == 0
    assert twin.runs == 3 * len(GOOD) + 3


def test_results_are_kept_when_the_workers_are_lost(logs, tmp_path, twin, monkeypatch):
    ended = []

    def lost(future):
        if ended:
            raise JobsError("a worker process was killed")
        ended.append(future)
        return future.result()

    with monkeypatch.context() as patch:
        patch.setattr(batch, "outcome", lost)
        result = command(logs, tmp_path / "out")
    assert (result.exit_code, result.stderr.splitlines()[-1]) == (2, "strapdown: a worker process was killed")
    assert len(list((tmp_path / "out").rglob("batch.json"))) == 1
    assert "not run again                      1, which did not change" in command(
        logs, tmp_path / "out").output.splitlines()


def test_a_log_that_kills_its_workers_is_a_row(logs, tmp_path, twin, monkeypatch):
    def deadly(future):
        raise JobLostError("each worker that tried it ended")

    monkeypatch.setattr(batch, "outcome", deadly)
    assert command(logs, tmp_path / "out").exit_code == 1
    assert {row["error"] for name, row in rows_of(tmp_path / "out").items() if name in GOOD} == {
        "each worker that tried it ended"}


def test_an_error_of_the_core_is_a_row(logs, tmp_path, twin, monkeypatch):
    def broken(self, inputs, **options):
        raise RuntimeError("the model of INS_top ended early, status 1\nand more")

    monkeypatch.setattr(twin, "update", broken)
    result = command(logs / "bike", tmp_path / "out")
    assert result.exit_code == 1
    assert result.stderr.splitlines()[-1] == (
        "strapdown: level.csv: RuntimeError: the model of INS_top ended early, status 1")


def test_a_log_without_what_the_core_needs_is_a_row(logs, tmp_path, twin):
    """The line of a single replay, without a position for a navigator."""
    result = CliRunner().invoke(main, ["batch", str(logs / "bike"), "--config", "sins", "--jobs", "1", "--output",
                                       str(tmp_path / "out")])
    assert result.exit_code == 1
    (row,) = rows_of(tmp_path / "out").values()
    single = CliRunner().invoke(main, ["replay", str(logs / "bike" / "level.csv"), "--config", "sins", "--output",
                                       str(tmp_path / "single")])
    assert single.stderr.splitlines()[-1] == f"strapdown: {row['error']}"


def test_errors_of_the_user(tmp_path, monkeypatch):
    def line(*words):
        result = CliRunner().invoke(main, ["batch", *words, "--output", str(tmp_path / "out")])
        assert result.exit_code == 2
        return result.stderr.splitlines()[-1]

    (tmp_path / "empty").mkdir()
    assert line(str(tmp_path / "empty")) == f"strapdown: {tmp_path / 'empty'}: no logs of a known format"
    (tmp_path / "level.csv").write_text(table(*UNITS), encoding="utf-8")
    assert line(str(tmp_path), "--config", "optical_tcd1304") == (
        "strapdown: OPT_top has other inputs than a recording: 'strapdown optical' runs it")
    assert line(str(tmp_path / "*.ulg")) == f"strapdown: no file matches '{tmp_path}/*.ulg'"
    monkeypatch.setattr("strapdown_sim.jobs.find_spec", lambda name: None)
    assert line(str(tmp_path), "--scheduler", "tcp://127.0.0.1:1") == (
        "strapdown: --scheduler needs dask.distributed: pip install 'strapdown[cluster]'")
    monkeypatch.setattr("strapdown_sim.page.html.find_spec", lambda name: None)
    assert line(str(tmp_path), "--html") == "strapdown: a page in HTML needs plotly: pip install 'strapdown[html]'"
    assert not (tmp_path / "out").exists()


def test_which_files_may_be_logs(tmp_path):
    for name in ("kitti/oxts/data/0.txt", "MH_01/mav0/imu0/data.csv", "MH_01/mav0/cam0/data.csv", "bag/metadata.yaml",
                 "bag/bag_0.db3", "data/notes.txt", "a/b.csv", "out/logs/b.csv/attitude.csv", ".hidden/c.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(" ".join(["1"] * 30) if "kitti" in name else "a,b\n", encoding="utf-8")
    found = find_logs([str(tmp_path)], tmp_path / "out")
    assert found == ({name: tmp_path / name for name in ("MH_01", "a/b.csv", "bag", "data/notes.txt", "kitti")}, [])
    # A pattern, a file twice, and one log by itself.
    assert list(find_logs([f"{tmp_path}/**/*.csv", str(tmp_path / "a" / "b.csv")], tmp_path / "out").logs) == [
        "MH_01/mav0/cam0/data.csv", "MH_01/mav0/imu0/data.csv", "a/b.csv"]
    assert list(find_logs([str(tmp_path / "bag")], tmp_path / "out").logs) == ["bag"]
    assert find_logs([str(tmp_path / "*.ulg")], tmp_path / "out") == ({}, [str(tmp_path / "*.ulg")])


def test_cores_that_differ_in_constants_share_a_model(tmp_path):
    """The unfilled texts are equal, and the ROM of each core is that which the model gets."""
    texts, words = [], []
    for rate in 100.0, 99.7:
        config = MAHONY.replace(sample_rate_hz=rate)
        core = make_core("INS_top", config)
        verilog = write_core(core, config, tmp_path, "").read_text(encoding="utf-8")
        words.append(core.engine.program.constant_words)
        texts.append(unfilled(verilog, words[-1]))
        with pytest.raises(ValueError, match="0 tables have the constants of the engine, not one"):
            unfilled(verilog, words[-1][:-1])
    assert words[0] != words[1]
    assert texts[0] == texts[1]


@pytest.mark.verilator
def test_one_model_for_two_rates(tmp_path, models):
    """In a process of its own, with the Verilated circuit: two rates, one compiled model, no bit off the twin."""
    for folder in tmp_path / "build", models / "runtime":
        folder.mkdir(parents=True, exist_ok=True)
    (tmp_path / "build" / "runtime").symlink_to(models / "runtime")
    for rate in 100.0, 99.7:
        (tmp_path / f"{rate}.csv").write_text(table(*UNITS, rate=rate), encoding="utf-8")
    with workers(1) as pool:
        found = replay_batch(find_logs([str(tmp_path / "*.csv")], tmp_path / "out").logs,
                             partial(configuration, "mahony", ()), tmp_path / "out", choice=Choice({}, {}),
                             build=tmp_path / "build", command=(), pool=pool)
    assert [row["bits_differing"] for row in found.rows] == [0, 0]
    assert len([path for path in (tmp_path / "build").iterdir() if path.is_dir() and path.name != "runtime"]) == 1
    write_table(found, tmp_path / "out", MAHONY)
    assert list(rows_of(tmp_path / "out")) == ["100.0.csv", "99.7.csv"]
    assert set(rows_of(tmp_path / "out")["99.7.csv"]) == {column.key for column in COLUMNS}
