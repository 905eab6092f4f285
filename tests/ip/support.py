"""The driver in C, compiled and run against the model of a core behind its bus."""

import json
import socket
import subprocess
from pathlib import Path

import numpy as np

from strapdown.ip import python_map
from strapdown.ip.package import driver_files, linux_files, register_files

HERE = Path(__file__).parent
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
DRIVER = ("-D_POSIX_C_SOURCE=200809L", "-Os")
"""Flags for drivers and for the programs around them."""


def tool(*command):
    """What a tool prints; it must succeed without a warning."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def build(table, folder, sources, *flags, compiler="gcc", program="run.c"):
    """A program of the driver and of files in its folder or this one; returns its path, and that of the object."""
    for name, text in (driver_files(table) | linux_files(table) | register_files(table)).items():
        (folder / name).write_text(text, encoding="utf-8")
    flags = [*STRICT, *DRIVER, *flags, f"-I{folder}", f"-I{HERE}", f'-DCORE_HEADER="{table.name}.h"',
             f"-DCORE_MAP={table.name.upper()}_MAP"]
    tool(compiler, *flags, "-c", folder / "strapdown.c", "-o", folder / "strapdown.o")
    tool(compiler, *flags, "-o", folder / "run", folder / "strapdown.o",
         *(folder / name if (folder / name).exists() else HERE / name for name in (program, *sources)))
    return folder / "run", folder / "strapdown.o"


def run(program, model, words, *, before=(), **options):
    """What a program of ``build`` writes to standard output as words, and its finished process.

    ``before`` are the first words of its command line; ``options`` are those of ``BusModel.command``.
    """
    ours, theirs = socket.socketpair()
    with ours, theirs, subprocess.Popen(model.command(**options), stdin=theirs, stdout=theirs) as process:
        theirs.close()
        done = subprocess.run([*map(str, before), str(program), str(ours.fileno())], pass_fds=[ours.fileno()],
                              input=np.asarray(words, "<u4").tobytes(), capture_output=True, check=False)
        ours.close()
        assert process.wait() == 0
    return np.frombuffer(done.stdout[:len(done.stdout) // 4 * 4], "<u4"), done


def assert_answers(words, answers):
    """The words that tests/ip/run.c writes are those of answers, shape (N, words), and tell no error."""
    assert words[0] == 0
    rows = words[1:].reshape(len(answers), -1)
    outputs, (number, status, started, waited, read, flags) = rows[:, :-6], rows[:, -6:].T
    assert np.array_equal(outputs, answers[:, :-1])
    assert np.array_equal(status, answers[:, -1])
    assert np.array_equal(number, np.arange(1, len(answers) + 1))
    assert not started.any()
    assert not waited.any()
    return read.astype(np.int32), flags


def prepare_board(folder, top, model, recording, **options):
    """Files for tests/ip/board.py: the recording, numbers by port; the map; and the command line of the model."""
    np.savez(folder / "recording.npz", **recording)
    (folder / "model.json").write_text(json.dumps(model.command(**options)), encoding="utf-8")
    (folder / f"{top.component.table.name}_map.py").write_text(python_map.text(top.component.table), encoding="ascii")


def on_board(root, folder, task, *arguments):
    """Run a task of tests/ip/board.py in the environment of PYNQ; returns the arrays that it wrote, if any."""
    done = subprocess.run([root / ".venv-pynq/bin/python", HERE / "board.py", task, folder, *map(str, arguments)],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(np.load(folder / "answers.npz")) if (folder / "answers.npz").exists() else {}
