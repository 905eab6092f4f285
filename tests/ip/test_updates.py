"""A core behind its bus over 10,000 updates in Verilator, and its synthesis for several families."""

import numpy as np
import pytest

from strapdown.cores import CONFIGS, QUATERNION_J2, THESIS, THESIS_X8, axi_core
from strapdown_lab.report.measure import core_circuit
from strapdown_lab.synthesis import FAMILIES, synthesise
from strapdown_sim.cache import Cache
from strapdown_sim.drivers.bus import OKAY, READ, REQUEST, WAIT, WRITE, answer_words, sample_words

pytestmark = pytest.mark.ip

UPDATES = 10_000
BATCH = 500
"""Updates whose requests go through the pipe at once."""
SEED = 15


def samples(top, count):
    """Words of samples with the magnitudes of sensors, and of their answers; some are refused."""
    system, rng = top.component.system, np.random.default_rng(SEED)
    inputs = {port: rng.standard_normal(count) * 10 ** rng.uniform(-3, 3, count) for port in system.input_ports}
    inputs[system.input_ports[3]][rng.random(count) < 0.01] = np.inf
    result, _ = system.run(top.component.program.schedule.pool, inputs)
    assert result["refused"].any()
    return sample_words(top, inputs), answer_words(top, result)


def requests(*rows):
    """Requests to the driver of the bus, of tuples: operation, address, word."""
    return np.array([(operation, 0b1111, address, word) for operation, address, word in rows], REQUEST)


@pytest.mark.parametrize("stalls", [0, 30])
def test_updates_by_register(make_bus, stalls):
    """Each update: all inputs, start, a snapshot, all outputs and the status."""
    top, model = make_bus(THESIS)
    table = top.component.table
    rows, answers = samples(top, UPDATES)
    control, commands = table["CONTROL"].address, table["CONTROL"]
    inputs = [register.address for word in table.samples for register in word.registers]
    outputs = [*(register.address for word in table.outputs for register in word.registers),
               table["SNAPSHOT_STATUS"].address]
    after = requests((WRITE, control, commands["start"].mask), (WAIT, 0, top.latency + 5),
                     (WRITE, control, commands["snapshot"].mask), *((READ, address, 0) for address in outputs))
    with model.run(seed=SEED, stalls=stalls) as bus:
        for first in range(0, UPDATES, BATCH):
            batch = [np.concatenate([requests(*((WRITE, address, word) for address, word in zip(
                inputs, row, strict=True))), after]) for row in rows[first:first + BATCH].tolist()]
            found = bus.transact(np.concatenate(batch)).reshape(BATCH, -1)[:, -len(outputs):]
            assert (found["code"] == OKAY).all()
            assert np.array_equal(found["word"], answers[first:first + BATCH])
        assert bus.read(table["UPDATES"].address) == (OKAY, UPDATES)


@pytest.mark.parametrize("stalls", [0, 30])
def test_updates_by_stream(make_bus, stalls):
    """All samples in one packet: each answer comes once, in order."""
    top, model = make_bus(THESIS)
    table = top.component.table
    rows, answers = samples(top, UPDATES)
    with model.run(seed=SEED, stalls=stalls) as bus:
        bus.write(table["CONTROL"].address, table["CONTROL"]["stream"].mask)
        for first in range(0, UPDATES, BATCH):
            bus.send(rows[first:first + BATCH], [rows[:BATCH].size - 1] if first + BATCH == UPDATES else [])
            words, last, _ = bus.get(answers[:BATCH].size)
            assert np.array_equal(words.reshape(BATCH, -1), answers[first:first + BATCH])
            assert last.sum() == (first + BATCH == UPDATES)
        assert bus.get(1, limit=2 * top.latency)[0].size == 0
        assert bus.read(table["UPDATES"].address) == (OKAY, UPDATES)


@pytest.mark.parametrize("stalls", [0, 60])
def test_updates_of_several_channels_by_stream(make_bus, stalls):
    """Samples of all channels follow each other; each answer has the channel of its sample."""
    top, model = make_bus(THESIS_X8)
    table, channels = top.component.table, top.component.channels
    rows, answers = samples(top, UPDATES // channels)
    # Each channel gets the same samples; a refused update shows the outputs of the channel before.
    rows, answers = np.repeat(rows, channels, axis=0), np.repeat(answers, channels, axis=0)
    with model.run(seed=SEED, stalls=stalls) as bus:
        bus.write(table["CONTROL"].address, table["CONTROL"]["stream"].mask)
        for first in range(0, len(rows), channels):
            for channel in range(channels):
                bus.send(rows[first + channel], channel=channel)
            words, _, found = bus.get(channels * table.answer_words)
            assert found.tolist() == np.repeat(range(channels), table.answer_words).tolist()
            assert np.array_equal(words.reshape(channels, -1), answers[first:first + channels])
        assert bus.read(table["UPDATES"].address) == (OKAY, len(rows))


@pytest.mark.parametrize("family", ["7-series", "ECP5", "Gowin"])
def test_yosys_synthesises_it(family, tmp_path):
    (chosen,) = (each for each in FAMILIES if each.name == family)
    core = axi_core(CONFIGS[QUATERNION_J2.name])
    found = synthesise(chosen, core_circuit(core, QUATERNION_J2), core.component.name, Cache(tmp_path), place=False)
    assert found["fits"]
    assert found["ff"] > 1000
