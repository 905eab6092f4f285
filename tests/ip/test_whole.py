"""A whole recording through the driver in C, and through the class for PYNQ by registers and by DMA.

Each attitude file is that of ``strapdown replay``, byte for byte.
"""

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores import MAHONY
from strapdown.device import from_words
from strapdown_sim.drivers.bus import answer_words, sample_words
from strapdown_sim.recordings import read_recording
from strapdown_sim.replay import for_recording, port_inputs, write_attitude

from .support import assert_answers, build, on_board, prepare_board, run

pytestmark = pytest.mark.ip

LEAST_SAMPLES = 5000


@pytest.fixture(scope="module")
def whole(x_imu_recording, make_bus, tmp_path_factory):
    """The recording, its core behind a bus, its model, its samples by port, and the attitude file of a replay."""
    folder = tmp_path_factory.mktemp("replay")
    result = CliRunner().invoke(main, ["replay", str(x_imu_recording), "--config", "mahony", "--output", str(folder)],
                                catch_exceptions=False)
    assert result.exit_code == 0, result.output
    recording = read_recording(x_imu_recording)
    assert len(recording.time_s) >= LEAST_SAMPLES
    config = for_recording(MAHONY, recording)
    return recording, *make_bus(config), port_inputs(recording, config), (folder / "attitude.csv").read_bytes()


def attitude(recording, top, words, folder):
    """The attitude file of words of answers."""
    table = top.component.table
    ports = tuple((word.port, 0, len(word.registers), word.format) for word in table.outputs)
    write_attitude(folder / "attitude.csv", recording, top.component.system.read(from_words(ports, words[:, :-1])))
    return (folder / "attitude.csv").read_bytes()


def test_driver_in_c(whole, tmp_path):
    recording, top, model, inputs, expected = whole
    result, _ = top.component.system.run(top.component.program.schedule.pool, inputs)
    answers = answer_words(top, result)
    program, _ = build(top.component.table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, sample_words(top, inputs), seed=31, stalls=10)
    assert (done.returncode, done.stderr) == (0, b"")
    assert_answers(words, answers)
    rows = words[1:].reshape(len(answers), -1)
    assert attitude(recording, top, rows[:, :answers.shape[1]], tmp_path) == expected


@pytest.mark.parametrize("task", [("register",), ("dma", 14)], ids=["registers", "dma"])
def test_class_for_pynq(whole, root, tmp_path, task):
    recording, top, model, inputs, expected = whole
    prepare_board(tmp_path, top, model, inputs, seed=32, stalls=10)
    words = on_board(root, tmp_path, *task)["words"]
    assert attitude(recording, top, words, tmp_path) == expected
