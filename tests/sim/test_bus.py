"""The driver of buses: cores behind it equal the twin, and it finds slaves that break the rules of AXI."""

from pathlib import Path

import numpy as np
import pytest

from strapdown.cores import QUATERNION_J2
from strapdown_sim.drivers.bus import OKAY, SLVERR, BusInterface, BusModel, answer_words, sample_words
from strapdown_sim.drivers.toolchain import SimulatorMissingError

UPDATES = 60


@pytest.fixture(scope="module")
def core(make_bus):
    """A core behind its bus: Top and BusModel."""
    return make_bus(QUATERNION_J2)


@pytest.fixture(scope="module")
def samples(core):
    """Words of samples and of their answers, from the twin."""
    top, _ = core
    system, rng = top.component.system, np.random.default_rng(8)
    inputs = {port: rng.normal(size=UPDATES) for port in system.input_ports} | {"in_load_en": np.zeros(UPDATES)}
    inputs[system.input_ports[0]][5] = np.nan
    result, _ = system.run(top.component.program.schedule.pool, inputs)
    return sample_words(top, inputs), answer_words(top, result)


def register(core, name):
    """Address of a register of a core."""
    return core[0].component.table[name].address


@pytest.mark.parametrize("stalls", [0, 40])
def test_updates_by_register(core, samples, stalls):
    table = core[0].component.table
    rows, answers = samples
    inputs = [register.address for word in table.samples for register in word.registers]
    outputs = [register.address for word in table.outputs for register in word.registers]
    with core[1].run(seed=2, stalls=stalls) as bus:
        for row, answer in zip(rows, answers, strict=True):
            for address, word in zip(inputs, row.tolist(), strict=True):
                assert bus.write(address, word) == OKAY
            assert bus.write(register(core, "CONTROL"), table["CONTROL"]["start"].mask) == OKAY
            while bus.read(register(core, "STATUS"))[1] & table["STATUS"]["busy"].mask:
                pass
            bus.write(register(core, "CONTROL"), table["CONTROL"]["snapshot"].mask)
            assert [bus.read(address) for address in outputs] == [(OKAY, word) for word in answer[:-1].tolist()]
            assert bus.read(register(core, "SNAPSHOT_STATUS")) == (OKAY, answer[-1])


@pytest.mark.parametrize("stalls", [0, 40])
def test_updates_by_stream(core, samples, stalls):
    table = core[0].component.table
    rows, answers = samples
    with core[1].run(seed=3, stalls=stalls) as bus:
        bus.write(register(core, "CONTROL"), table["CONTROL"]["stream"].mask)
        bus.send(rows, [rows.size - 1])
        words, last, _ = bus.get(answers.size)
        assert np.array_equal(words.reshape(answers.shape), answers)
        assert np.flatnonzero(last).tolist() == [answers.size - 1]
        assert bus.get(1, limit=1000)[0].size == 0


def test_accesses(core):
    """Byte strobes, accesses that are refused, interrupt, and reset."""
    table = core[0].component.table
    with core[1].run() as bus:
        assert bus.write(register(core, "SCRATCH"), 0x11223344) == OKAY
        assert bus.write(register(core, "SCRATCH"), 0xAABBCCDD, strobes=0b0110) == OKAY
        assert bus.read(register(core, "SCRATCH")) == (OKAY, 0x11BBCC44)
        assert bus.write(register(core, "IDENTITY"), 0) == SLVERR
        assert bus.wait(5)[0] == 0
        bus.write(register(core, "INTERRUPT_ENABLE"), table["INTERRUPT_ENABLE"]["bad_access"].mask)
        level, cycle = bus.interrupt()
        assert (level, bus.wait(10)) == (1, (1, cycle + 10))
        bus.reset(2)
        assert bus.read(register(core, "SCRATCH")) == (OKAY, 0)
        assert bus.interrupt(limit=10)[0] == 0


RULES = {
    0: "unknown operation 81",
    1: "an answer to a write did not stay",
    2: "an answer to a read did not stay",
    3: "an answer to a read did not stay",
    4: "an answer to no write",
    5: "an answer to no read",
    6: "no answer to a read",
    7: "an output depends on an input of the same cycle",
    8: "a response is neither OKAY nor SLVERR",
    9: "a word of the answer stream did not stay",
    10: "an offer during a reset",
}
"""Faults of faulty_slave.v, and the rules that they break."""


@pytest.fixture(scope="module")
def faulty(models):
    """The model of faulty_slave.v."""
    interface = BusInterface("faulty_slave", (), (), clock="aclk", reset="aresetn", streams=True)
    try:
        return BusModel(Path(__file__).with_name("faulty_slave.v"), interface, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("fault", RULES)
def test_broken_rules_are_found(faulty, fault):
    with faulty.run(seed=1, stalls=50) as bus:
        assert bus.read(0) == (OKAY, 0)
        with pytest.raises(RuntimeError, match=f"the model ended: .*{RULES[fault]}"):  # noqa: PT012
            bus.write(0, fault)
            for _ in range(9):
                bus.read(0)
            bus.reset(3)
            bus._one(ord("Q"))


def test_stalls_are_fewer_than_all(faulty):
    with pytest.raises(ValueError, match="stalls must be at least 0 and less than 100 percent, not 100"):
        faulty.command(stalls=100)
