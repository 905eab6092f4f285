"""The monitor on streams that these tests make from the document of the frame, with all kinds of damage."""

import binascii
import csv
import errno
import os
import resource
import signal
import subprocess
import sys
import time
import tty
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.backends.backend_agg import FigureCanvasAgg

from strapdown.cli import main
from strapdown.link import FrameDecoder
from strapdown_sim.monitor import monitor, read_port

from ..frames import COUNT, assert_frames, numbers_of_frames


def frame(counter, status, numbers, dtype="<f8"):
    """A frame, byte by byte."""
    payload = np.asarray(numbers, dtype=dtype).tobytes()
    body = bytes((len(payload), 1, counter & 0xFF, counter >> 8, status)) + payload
    return b"\xeb\x90" + body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big")


@pytest.fixture(scope="module")
def numbers():
    return numbers_of_frames()


@pytest.fixture
def frames(numbers):
    return [frame(counter, counter % 32, row) for counter, row in enumerate(numbers)]


def table(path):
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return header, rows


def assert_table(path, wanted, numbers):
    header, rows = table(path)
    assert header == ["Frame", "Status", "Latitude (deg)", "Longitude (deg)", "Height above the ellipsoid (m)",
                      "Velocity east (m/s)", "Velocity north (m/s)", "Velocity up (m/s)", "Pitch (deg)", "Roll (deg)",
                      "True heading (deg)"]
    assert [(int(row[0]), int(row[1])) for row in rows] == [(index - wanted[0], index % 32) for index in wanted]
    np.testing.assert_array_equal(np.array([row[2:] for row in rows], dtype=float).view(np.uint64),
                                  numbers[list(wanted)].view(np.uint64))


def test_file_to_csv_and_picture(frames, numbers, tmp_path):
    recording, output, plot = (tmp_path / name for name in ("line.bin", "out/nav.csv", "out/nav.png"))
    damaged = frames[7][:40] + bytes((frames[7][40] ^ 4,)) + frames[7][41:]
    recording.write_bytes(b"noise" + b"".join([*frames[:7], damaged, *frames[8:20], *frames[21:]]))
    result = CliRunner().invoke(main, ["monitor", str(recording), "--output", str(output), "--plot", str(plot)])
    assert result.exit_code == 0, result.output
    assert result.output == f"{output}  38 frames, 2 lost, 1 CRC errors, 0 restarts, 86 bytes skipped\n"
    assert_table(output, [*range(7), *range(8, 20), *range(21, COUNT)], numbers)
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_live(frames, numbers, tmp_path, monkeypatch):
    """The figure has the curves; a canvas without a window replaces the window, because there may be no display."""
    plt.switch_backend("agg")
    monkeypatch.setattr(FigureCanvasAgg, "required_interactive_framework", "none")
    pauses = []
    monkeypatch.setattr(plt, "pause", pauses.append)
    data = b"".join(frames)
    monitor((data[start:start + 1000] for start in range(0, len(data), 1000)), tmp_path / "nav.csv", live=True)
    assert len(pauses) == -(-len(data) // 1000)
    for axes, column in zip(plt.gcf().axes, numbers.T, strict=True):
        np.testing.assert_array_equal(axes.lines[0].get_data(), [np.arange(COUNT), column])
    plt.close()


def test_pseudo_terminal(frames, numbers, tmp_path):
    """A terminal with its present settings, in another process, with bytes that arrive while it reads, until Ctrl-C."""
    master, slave = os.openpty()
    tty.setraw(slave)
    output = tmp_path / "nav.csv"
    with subprocess.Popen([sys.executable, "-m", "strapdown", "monitor", os.ttyname(slave), "--output", str(output)],
                          stdout=subprocess.PIPE, text=True,
                          # Ctrl-C may be ignored if the tests run in the background.
                          preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL)) as process:
        data = b"".join(frames)
        for start in range(0, len(data), 500):
            os.write(master, data[start:start + 500])
        # The received frames are in the file before the end.
        limit = time.monotonic() + 30
        while not (output.exists() and len(output.read_text(encoding="utf-8").splitlines()) == COUNT + 1):
            assert time.monotonic() < limit
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[0] == \
            f"{output}  {COUNT} frames, 0 lost, 0 CRC errors, 0 restarts, 0 bytes skipped\n"
    os.close(slave)
    os.close(master)
    assert process.returncode == 0
    assert_table(output, range(COUNT), numbers)


def test_serial_port(frames, numbers):
    pytest.importorskip("serial", reason="pyserial is not installed, so no serial port is opened.")
    master, slave = os.openpty()
    chunks = read_port(os.ttyname(slave), 921_600)
    assert next(chunks) == b""
    os.write(master, b"".join(frames))
    decoder, found = FrameDecoder(), []
    limit = time.monotonic() + 30
    while len(found) < COUNT:
        assert time.monotonic() < limit
        found += decoder.feed(next(chunks))
    chunks.close()
    os.close(slave)
    os.close(master)
    assert_frames(found, range(COUNT), numbers)


def test_terminal_ends_when_the_other_side_is_closed(frames, numbers):
    master, slave = os.openpty()
    tty.setraw(slave)
    chunks = read_port(os.ttyname(slave))
    assert next(chunks) == b""
    os.close(slave)
    os.write(master, frames[0])
    decoder = FrameDecoder()
    assert_frames(decoder.feed(next(chunks)), [0], numbers)
    os.close(master)
    assert list(chunks) == []


def test_terminal_that_is_gone_keeps_what_came(frames, numbers, tmp_path, monkeypatch):
    (tmp_path / "line.bin").write_bytes(frames[0])
    read = os.read

    def unplugged(descriptor, count):
        data = read(descriptor, count)
        if not data:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return data

    with monkeypatch.context() as patch:
        patch.setattr(os, "read", unplugged)
        monitor(read_port(tmp_path / "line.bin"), tmp_path / "nav.csv")
    assert_table(tmp_path / "nav.csv", [0], numbers)


def test_bytes_without_a_frame_are_an_error(tmp_path, monkeypatch):
    """A file of before stays, and no empty one is made."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "line.bin").write_bytes(np.random.default_rng(2).bytes(5000))
    (tmp_path / "nav.csv").write_text("of before", encoding="utf-8")
    for output in "nav.csv", "other.csv":
        result = CliRunner().invoke(main, ["monitor", "line.bin", "--output", output, "--plot", "nav.png"])
        assert result.exit_code == 2
        assert result.output == \
            "strapdown: no frame was found in 5000 bytes: are they of SINS_uart or OPT_top, at this baud rate?\n"
    assert {path.name for path in tmp_path.iterdir()} == {"line.bin", "nav.csv"}
    assert (tmp_path / "nav.csv").read_text(encoding="utf-8") == "of before"


def test_a_full_disk_leaves_whole_rows(frames, numbers, tmp_path):
    """Files may grow to 1,500 bytes: the rows before are there, in every bit."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            monitor((data for data in frames), tmp_path / "nav.csv")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    text = (tmp_path / "nav.csv").read_text(encoding="utf-8")
    assert 1200 < len(text) <= 1500
    assert text.endswith("\n")
    assert_table(tmp_path / "nav.csv", range(text.count("\n") - 1), numbers)


def test_a_full_device_is_one_line(frames, tmp_path):
    (tmp_path / "line.bin").write_bytes(frames[0])
    result = CliRunner().invoke(main, ["monitor", str(tmp_path / "line.bin"), "--output", "/dev/full"])
    assert result.exit_code == 2
    assert result.stderr == "strapdown: cannot write to /dev/full: No space left on device\n"


@pytest.mark.parametrize(("arguments", "message"), [
    (["absent.bin"], "cannot open absent.bin: No such file or directory"),
    (["."], "cannot read .: Is a directory"),
    (["line.bin", "--output", "line.bin"], "--output would overwrite line.bin, which is read"),
    (["line.bin", "--output", "line.bin/nav.csv"], "cannot write to line.bin/nav.csv: "),
    (["line.bin", "--live"], "--live needs a display, but none is available"),
])
def test_errors_are_one_line_and_write_nothing(frames, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    data = b"".join(frames)
    (tmp_path / "line.bin").write_bytes(data)
    result = CliRunner().invoke(main, ["monitor", *arguments])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"strapdown: {message}")
    assert result.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["line.bin"]
    assert (tmp_path / "line.bin").read_bytes() == data


def test_serial_port_without_pyserial(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "serial", None)
    result = CliRunner().invoke(main, ["monitor", "/dev/ttyUSB0", "--baud", "921600"])
    assert result.exit_code == 2
    assert result.stderr == "strapdown: --baud needs the package pyserial: pip install 'strapdown[monitor]'\n"
