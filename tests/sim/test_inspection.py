"""``strapdown inspect``: facts of the streams of a log, what a replay would use, and the picture."""

import os

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_sim.inspection import inspect
from strapdown_sim.recordings import Log, Stream
from strapdown_sim.recordings.merge import saturated

NAMES = [f"{name} {axis} ({unit})" for name, unit in (("Gyroscope", "deg/s"), ("Accelerometer", "g"),
                                                     ("Magnetometer", "uT")) for axis in "XYZ"]


def log(tmp_path, **changes):
    time_s = np.delete(np.arange(100) / 100, [30, 31])
    values = {"gyro": np.tile([1.0, 2, 3], (98, 1)), "accel": np.tile([0, 0, 9.8], (98, 1)),
              "mag": np.tile([30.0, 0, -40], (98, 1))} | changes
    return Log(tmp_path / "flight.csv", "made here", tuple(
        Stream(kind, "imu", time_s, numbers) for kind, numbers in values.items()))


def test_facts(tmp_path):
    rates = np.tile([1.0, 2, 3], (98, 1))
    rates[10:13, 0], rates[40, 1] = 1999.94, np.nan
    gyro, accel, mag = inspect(log(tmp_path, gyro=rates))
    assert gyro.samples == 97
    assert gyro.rate_hz == pytest.approx(96 / 0.99)
    # Two samples are missing, and one has no number.
    assert (gyro.lost, accel.lost) == (3, 2)
    assert accel.longest_gap_s == pytest.approx(0.03)
    assert gyro.highest.tolist() == [1999.94, 2, 3]
    assert (gyro.saturated, accel.saturated) == (3, 0)
    assert mag.length == pytest.approx((50, 0))


@pytest.mark.parametrize(("kind", "largest", "often", "expected"), [
    ("gyro", 1999.94, 3, True), ("gyro", 245.0, 3, True), ("gyro", 1999.94, 2, False), ("gyro", 90.0, 40, False),
    ("accel", 16 * 9.80665 * 32767 / 32768, 3, True), ("accel", 9.8, 50, False)])
def test_saturation(kind, largest, often, expected):
    values = np.random.default_rng(1).normal(size=(60, 3))
    values[:often, 1] = -largest
    assert saturated(kind, values).sum() == (often if expected else 0)


def csv(path, rows, names=NAMES):
    text = [",".join(["Time (s)", *names]), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


def run(*words):
    return CliRunner().invoke(main, ["inspect", *map(str, words)])


def test_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = csv(tmp_path / "flight.csv", [[k / 100, 1, 2, 3, 0, 0, 1, 30 + k // 5 % 7, 0, -40] for k in range(100)
                                         if k != 40])
    result = run(path)
    assert result.exit_code == 0, result.output
    lines = [" ".join(line.split()) for line in result.output.splitlines()]
    for line in ("format table of text", "gyro gyroscope, in deg/s", "samples 99, 98.99 Hz", "gaps 1 samples lost, "
                                                                                             "longest gap 20 ms",
                 "range 1 to 1, 2 to 2, 3 to 3 deg/s", "replay would use 100 samples, 100 Hz",
                 "period of each sample", "magnetometer 20 samples", "gaps, bridged 1",
                 "strapdown: note: magnetometer: 20 samples, 20 Hz; each is used once",
                 "picture build/inspect/flight.png"):
        assert line in lines
    assert any(line.startswith("field strength 51.") for line in lines)
    assert (tmp_path / "build/inspect/flight.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", [b"gr\xf6\xdfe.csv", "größe 1.csv".encode(), b"a $x^ b$_{.csv"])
def test_names_of_files(tmp_path, monkeypatch, name):
    """A name that is not in the encoding of the system, one with umlauts, and one that looks like mathematics."""
    monkeypatch.chdir(tmp_path)
    path = csv(tmp_path / os.fsdecode(name), [[k / 100, 1, 2, 3, 0, 0, 1] for k in range(9)], NAMES[:6])
    result = run(path)
    assert result.exit_code == 0, result.output
    assert len(list((tmp_path / "build/inspect").iterdir())) == 1


def test_a_stream_of_one_sample(tmp_path):
    path = csv(tmp_path / "flight.csv", [[time, 1, 2, 3, 0, 0, 1] for time in (0, "")], NAMES[:6])
    result = run(path, "--picture", tmp_path / "a.png")
    assert "samples  1\n" in result.output
    assert "nan" not in result.output
    assert (tmp_path / "a.png").exists()


def test_a_log_that_replay_refuses_is_shown_all_the_same(tmp_path):
    path = csv(tmp_path / "flight.csv", [[k / 100 + 60 * (k > 50), k, 2, 3, 0, 0, 1] for k in range(100)], NAMES[:6])
    result = run(path, "--picture", tmp_path / "a.png")
    assert result.exit_code == 2
    assert "samples" in result.output
    assert f"strapdown: replay would refuse it: {path}: line 53: gap of 60 s after 0.5 s; replay a part without it: " \
           "--to 0.5 is the longest" in " ".join(result.output.split())
    assert (tmp_path / "a.png").exists()
    assert run(path, "--to", 0.5, "--picture", tmp_path / "a.png").exit_code == 0


def test_facts_are_shown_where_no_picture_can_be_written(tmp_path):
    path = csv(tmp_path / "flight.csv", [[k / 100, 1, 2, 3, 0, 0, 1] for k in range(9)], NAMES[:6])
    result = run(path, "--picture", path / "a.png")
    assert result.exit_code == 2
    assert "replay would use  9 samples, 100 Hz" in result.output
    assert f"strapdown: cannot write to {path / 'a.png'}: " in result.output


def test_errors_of_options(tmp_path):
    path = csv(tmp_path / "flight.csv", [[k / 100, 1, 2, 3, 0, 0, 1] for k in range(9)], NAMES[:6])
    result = run(path, "--columns", "gyro_x")
    assert result.exit_code == 2
    assert "--columns takes QUANTITY=NAME, as in --columns gyro_x=wx:dps, not 'gyro_x'" in result.output
    (tmp_path / "bad").write_bytes(b"\0\1\2")
    assert "not a log of a known format" in run(tmp_path / "bad").output
