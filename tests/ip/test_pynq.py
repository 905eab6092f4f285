"""The class for PYNQ on the real ``pynq``, in its own environment, whose device is the circuit: tests/ip/board.py."""

import json

import numpy as np
import pytest

from strapdown.cores import CONFIGS, THESIS, OpticalConfig, main_module
from strapdown.ip.places import Places
from strapdown_sim.drivers.bus import answer_words

from .support import on_board, prepare_board

pytestmark = pytest.mark.ip

SAMPLES = 200


@pytest.fixture
def board(make_bus, root, tmp_path):
    """Runs a task of board.py on samples of which some are refused; returns what it wrote, and the twin's answers."""
    top, model = make_bus(THESIS)
    system, rng = top.component.system, np.random.default_rng(21)
    recording = {port: rng.normal(size=SAMPLES).astype(np.float32) for port in system.input_ports}
    recording["in_accx"][[3, 60]] = np.nan
    result, _ = system.run(top.component.program.schedule.pool, recording)
    prepare_board(tmp_path, top, model, recording, seed=12, stalls=20)
    return lambda *task: (on_board(root, tmp_path, *task), answer_words(top, result))


def test_updates_by_register(board):
    found, answers = board("register")
    assert np.array_equal(found["words"], answers)
    assert np.array_equal(found["numbers"], np.arange(1, SAMPLES + 1))


@pytest.mark.parametrize(("length_width", "transfers"), [
    (14, [SAMPLES * 36]),
    # 2^10 - 1 bytes hold 19 answers of 52 bytes.
    (10, [19 * 36] * 10 + [10 * 36]),
])
def test_a_recording_by_dma(board, length_width, transfers):
    found, answers = board("dma", length_width)
    assert found["transfers"].tolist() == transfers
    assert np.array_equal(found["words"], answers)


def test_notebook(board, root):
    """The code of the notebook, with a stand-in for the overlay."""
    found, answers = board("notebook", root / "docs" / "attitude.ipynb")
    assert np.array_equal(found["words"], answers)
    told = [line.split() for line in str(found["told"]).splitlines()]
    assert [words[0] for words in told[:3]] == ["pitch", "roll", "yaw"]
    assert ["refused", "2", "of", str(SAMPLES), "updates"] in told


def test_errors(board, tmp_path):
    board("errors")
    told = json.loads((tmp_path / "told.json").read_text(encoding="utf-8"))
    cores = {main_module(config) for config in CONFIGS.values()
             if not isinstance(config, OpticalConfig) and config.channels == 1}
    assert {str(Places(f"{core}_axi").vlnv) for core in cores} <= set(told.pop("bound"))
    assert told == {
        "IDENTITY": "DriverError: there is no core at this address: IDENTITY reads 0x50525453",
        "VERSION": "DriverError: the map is for version 0x00000000 of the registers, and the core has 0x00010000",
        "CONFIGURATION": "DriverError: the core was generated with another configuration than INS_top_axi_map.py: use "
                         "the map from the folder of its package",
        "parameter": "TypeError: INS_top_axi has no parameter 'kp': it has none",
        "channel": "DriverError: INS_top_axi has no channel 1: it has 1",
        "sample": "KeyError: 'in_accy'",
        "busy": "DriverError: the core is busy, or takes its samples from the stream",
        "late": "DriverError: the update did not finish",
        "dma": "DriverError: the DMA engine moves at most 31 bytes at once, and a sample or an answer has 52: raise "
               "its c_sg_length_width",
        "channels": "DriverError: INS_top_axi has several channels, which this DMA engine cannot tell apart",
        "streams": "DriverError: INS_top_axi was generated without streams",
    }
