"""Bench for every core: published values, all bits against the twin, exact latency, handshake, bad input."""

import math

import cocotb
import numpy as np

from strapdown_sim.bench.handshake import RESET_CYCLES, CoreDriver
from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.stimuli.thesis import TABLES
from strapdown_sim.truth import module_outputs

core, config = core_under_test()
fmt = core.engine.program.format
UPDATES = min(200, 51_200_000 // (core.latency * fmt.width**2))
"""Random updates: 200 for a thesis core, fewer for a slower one. The time of a cycle grows with the width squared."""

SWITCHES = {port: chance for port, chance in (("in_load", 0.1), ("in_load_en", 0.1), ("in_align", 0.4))
            if port in core.system.input_ports}
"""Inputs that are 1.0 or 0.0, and the probability of 1.0."""

OFF = dict.fromkeys(SWITCHES, 0.0)
NOT_FINITE = math.nan, math.inf, -math.inf
LIMITS = np.finfo(fmt.dtype)
EXTREME = LIMITS.max, -LIMITS.max, LIMITS.tiny, LIMITS.smallest_subnormal, 0.0, -0.0


def samples(count):
    """Random inputs with the magnitudes of sensors and matrices, as a list of dicts; the first one loads."""
    rng = np.random.default_rng(cocotb.RANDOM_SEED)
    values = rng.standard_normal((count, len(core.system.input_ports))) * 10 ** rng.uniform(-2, 2, (count, 1))
    inputs = dict(zip(core.system.input_ports, values.T, strict=True))
    for port, chance in SWITCHES.items():
        inputs[port] = (rng.random(count) < chance).astype(float)
        inputs[port][0] = port != "in_align"
    return [{port: column[k] for port, column in inputs.items()} for k in range(count)]


@cocotb.test(timeout_time=10, timeout_unit="ms", skip=core.system.name not in TABLES)
async def published_values(dut):
    """The thesis's table, within 2e-6 of the float64 reference, which the printed digits confirm."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    inputs, printed = TABLES[core.system.name]
    await driver.update(core.system.bind(**inputs))
    expected = module_outputs(core.system.name, inputs, config)
    for name, values in driver.vectors().items():
        np.testing.assert_allclose(values, expected[name], rtol=2e-6, atol=0)
        # The table is printed with four decimals or more.
        np.testing.assert_allclose(values, printed[name], rtol=2e-6, atol=5e-5)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def every_bit_of_the_twin(dut):
    """Random updates, one after the other: outputs and status equal the twin's, and each update takes the latency."""
    driver, inputs = CoreDriver(dut, core), samples(UPDATES)
    await driver.reset()
    rng = np.random.default_rng(cocotb.RANDOM_SEED)
    for index, sample in enumerate(inputs):
        if index % 3 == 2:
            # One input at a limit of the format; the twin decides whether that is refused.
            sample |= {rng.choice(core.system.input_ports): EXTREME[index // 3 % len(EXTREME)]}
    twin, _ = core.system.run(core.engine.program.schedule.pool,
                              {port: np.array([sample[port] for sample in inputs]) for port in core.system.input_ports})
    bits = {port: fmt.to_bits(twin[port]).tolist() for port in core.system.output_ports}
    for index, sample in enumerate(inputs):
        assert await driver.update(sample) == core.latency
        assert driver.bits() == {port: values[index] for port, values in bits.items()}, sample
        assert driver.status() == {name for name in core.engine.status_names if name in twin and twin[name][index]}


@cocotb.test(timeout_time=10, timeout_unit="ms", skip=not core.system.status_port)
async def not_a_number_is_refused(dut):
    """NaN or infinity on any input: outputs and state do not change, the finish rises in time, a status bit is set."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    first, second = samples(2)
    second |= OFF
    # The first update after a reset holds the outputs of the reset.
    await driver.update(first | dict.fromkeys(core.system.input_ports[:1], math.nan))
    assert driver.status() == {"refused"}
    assert driver.outputs() == core.engine.reset_outputs
    await driver.update(first)
    before = driver.bits()
    ports = core.system.input_ports
    for index, port in enumerate(ports[::math.ceil(len(ports) / UPDATES)]):
        await driver.begin(second | {port: NOT_FINITE[index % 3]})
        for _ in range(core.latency):
            assert not driver.finish.value
            assert driver.bits() == before
            await driver.cycles(1)
        assert driver.finish.value
        assert driver.status() == {"refused"}, port
        assert driver.bits() == before
    # The state has not changed either: the next update is the second one.
    await driver.update(second)
    after = driver.bits()
    assert driver.status() != {"refused"}
    await driver.reset()
    await driver.update(first)
    await driver.update(second)
    assert driver.bits() == after


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def finish_falls_at_once_and_outputs_hold(dut):
    """The finish is low after reset and immediately after a start; outputs change only when it rises."""
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
    """A start during an update changes neither result nor time; a start that stays high is taken after the finish."""
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


@cocotb.test(timeout_time=1, timeout_unit="ms", skip=not core.system.status_port)
async def ignored_start_sets_its_bit(dut):
    """A start while busy sets its bit at once; the next start that is taken clears it."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    sample, = samples(1)
    await driver.update(sample)
    status = driver.status()
    await driver.begin(sample)
    assert driver.status() == status
    await driver.cycles(7)
    driver.start.value = 1
    await driver.cycles(1)
    driver.start.value = 0
    assert driver.status() == status | {"ignored"}
    await driver.cycles(core.latency)
    assert driver.finish.value
    assert "ignored" in driver.status()
    await driver.update(sample)
    assert "ignored" not in driver.status()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset_in_the_middle(dut):
    """A reset at any time ends the update and resets the state; the next update equals the first one."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    assert driver.outputs() == core.engine.reset_outputs
    first, second = samples(2)
    # A load would hide an error in the reset of the state.
    await driver.update(second | OFF)
    expected = driver.bits()
    for cycles in (0, core.latency // 2, core.latency - 1):
        await driver.update(first)
        assert driver.bits() != expected
        await driver.begin(second)
        await driver.cycles(cycles)
        await driver.assert_reset()
        assert not driver.finish.value
        assert driver.outputs() == core.engine.reset_outputs
        assert driver.status() == set()
        await driver.cycles(RESET_CYCLES)
        assert not driver.finish.value
        assert await driver.update(second | OFF) == core.latency
        assert driver.bits() == expected


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset_without_a_clock_edge_does_nothing(dut):
    """A reset that comes and goes between two edges, in the middle of an update, changes nothing."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    sample, = samples(1)
    await driver.update(sample)
    expected = driver.bits()
    await driver.reset()
    await driver.begin(sample)
    await driver.assert_reset(0)
    for cycle in range(core.latency):
        assert driver.bits() == driver.reset_bits(), cycle
        await driver.cycles(1)
    assert driver.finish.value
    assert driver.bits() == expected


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def starts_right_after_a_reset_are_ignored(dut):
    """A start in the first three cycles only sets its status bit; the fourth is taken."""
    driver = CoreDriver(dut, core)
    await driver.reset()
    sample, = samples(1)
    await driver.update(sample)
    expected, status = driver.bits(), driver.status()
    for waits in range(RESET_CYCLES + 1):
        await driver.assert_reset()
        await driver.cycles(waits)
        await driver.begin(sample)
        if waits == RESET_CYCLES:
            assert driver.status() == set()
            await driver.cycles(core.latency)
            assert driver.finish.value
            assert (driver.bits(), driver.status()) == (expected, status)
            continue
        for _ in range(core.latency + RESET_CYCLES):
            await driver.cycles(1)
            assert not driver.finish.value
            assert driver.bits() == driver.reset_bits()
        assert driver.status() == ({"ignored"} if core.system.status_port else set())
