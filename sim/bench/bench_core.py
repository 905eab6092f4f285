"""Bench for every core: published values, bits of the twin, exact latency, handshake."""

import cocotb
import numpy as np
from strapdown_sim.bench.handshake import CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.reference.ports import reference_outputs
from strapdown_sim.stimuli.thesis import TABLES

UPDATES = 200
core, config = core_under_test()
fmt = core.engine.program.format


def samples(count):
    """Random inputs of all magnitudes that sensors and matrices have, as a list of dicts."""
    rng = np.random.default_rng(cocotb.RANDOM_SEED)
    values = rng.standard_normal((count, len(core.system.input_ports))) * 10 ** rng.uniform(-2, 2, (count, 1))
    return [dict(zip(core.system.input_ports, row, strict=True)) for row in values]


@cocotb.test(timeout_time=10, timeout_unit="ms", skip=core.system.name not in TABLES)
async def published_values(dut):
    """The thesis's table, within 2e-6 of the float64 reference, which the printed digits confirm."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    inputs, printed = TABLES[core.system.name]
    await driver.update(inputs)
    expected = reference_outputs(core.system.name, inputs, kp=config.kp, ki=config.ki,
                                 period_s=config.period_s, mag_axes=config.magnetometer_axes)
    for port, value in driver.outputs().items():
        assert abs(value - expected[port]) <= 2e-6 * abs(expected[port]), (port, value, expected[port])
        # The table is printed with four decimals or more.
        assert abs(value - printed[port]) <= 5e-5 + 2e-6 * abs(printed[port]), (port, value, printed[port])


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def every_bit_of_the_twin(dut):
    """Random updates, one after the other: outputs are the twin's, and every update takes the latency."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    system, pool = core.system, core.engine.program.schedule.pool
    state = {word: fmt.array([value]) for word, value in system.reset.items()}
    for sample in samples(UPDATES):
        assert await driver.update(sample) == core.latency
        twin = system.update_twin(pool, {port: np.array([value]) for port, value in sample.items()}, state)
        state = {word: twin[word] for word in state}
        for port, bits in driver.bits().items():
            assert bits == int(fmt.to_bits(twin[port])[0]), (port, sample)
        if system.status_port:
            assert driver.status() == set()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def finish_falls_at_once_and_outputs_hold(dut):
    """The finish is low after reset and right after a start; outputs change only when it rises."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    assert not driver.finish.value
    first, second = samples(2)
    await driver.update(first)
    before = driver.bits()
    await driver.cycles(5)
    assert driver.finish.value
    assert driver.bits() == before
    await driver.begin(second)
    for _ in range(core.latency):
        assert not driver.finish.value
        assert driver.bits() == before
        await driver.cycles(1)
    assert driver.finish.value
    assert driver.bits() != before


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def start_while_busy_is_ignored(dut):
    """A start in the middle changes neither the result nor the time; a held start begins anew after the finish."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    first, second = samples(2)
    await driver.update(first)
    expected = driver.bits()
    await driver.reset()
    await driver.begin(first)
    for cycle in range(core.latency):
        driver.drive(second)
        driver.start.value = cycle in (3, core.latency - 2)
        assert not driver.finish.value
        await driver.cycles(1)
    assert driver.bits() == expected
    driver.start.value = 1
    await driver.cycles(1)
    assert not driver.finish.value


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset_in_the_middle(dut):
    """A short reset at any time ends the update; the next one is as the first after power-up."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    first, second = samples(2)
    await driver.update(first)
    expected = driver.bits()
    for cycles in (0, 1, core.latency // 2, core.latency - 1):
        await driver.update(second)
        await driver.begin(second)
        await driver.cycles(cycles)
        await driver.assert_reset()
        assert not driver.finish.value
        await driver.cycles(2)
        assert not driver.finish.value
        assert await driver.update(first) == core.latency
        assert driver.bits() == expected
