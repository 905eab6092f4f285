"""Registers of a core with random contents: it settles without a start, and its next update is right."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.cores import FLIGHT, QUATERNION_J3, SINS, THESIS, THESIS_COMPACT, THESIS_X8, main_module
from strapdown.export import write_core
from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.upsets import ALL, BIT, POWER_UP, REGISTER, UpsetModel

ITERATIVE_X8 = THESIS_X8.replace(name="iterative_x8", interval=None, pool=replace(
    THESIS_X8.pool, operators=(Adder(), Multiplier(), Divider(count=2), Arctangent(), Selector())))
"""Operators with state machines of their own."""

UPSETS = 300
SEED = 20151


@pytest.fixture(scope="module", params=[THESIS, THESIS_COMPACT, THESIS_X8], ids=lambda config: config.name)
def model(request, make_core, models, tmp_path_factory):
    config = request.param
    core = make_core(main_module(config), config)
    try:
        return UpsetModel(core, write_core(core, config, tmp_path_factory.mktemp("upsets"), ""), models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


def upset(model, kinds, register=None, **options):
    """What the model answers to upsets at random times, and the samples of the updates after them."""
    rng, core = np.random.default_rng(SEED), model.core
    samples = {port: rng.standard_normal((UPSETS, 2)) for port in core.system.input_ports}
    if core.engine.channels > 1:
        samples["in_channel"] = rng.integers(core.engine.channels, size=(UPSETS, 2))
    cycles = rng.integers(2 * core.latency, 6 * core.latency, size=UPSETS)
    result = model.next_updates(rng.integers(1 << 62, size=UPSETS), cycles, kinds, samples, register, **options)
    return result, {port: values[:, 1] for port, values in samples.items() if port != "in_channel"}


def refused(model, status):
    return status >> model.core.engine.status_names.index("refused") & 1 == 1


def assert_the_update_is_that_of_the_state_in_memory(model, result, sample, *, holds=True):
    system, program = model.core.system, model.core.engine.program
    assert set(result["cycles"]) == {model.core.latency}
    before = {word: result[word] for word in program.schedule.graph.state}
    twin = system.update_twin(program.schedule.pool, sample, before)
    after = refused(model, result[f"after.{system.status_port}"])
    np.testing.assert_array_equal(after, twin["refused"])
    assert after.sum() < UPSETS / 10
    for port in system.output_ports:
        expected = np.where(after, result[port if holds else f"after.{port}"], twin[port])
        np.testing.assert_array_equal(program.format.to_bits(result[f"after.{port}"]), program.format.to_bits(expected),
                                      err_msg=port)


@pytest.mark.verilator
def test_the_update_after_an_upset_is_that_of_the_state_in_memory(model):
    kinds = np.random.default_rng(SEED).choice([BIT, REGISTER, ALL], p=[0.7, 0.2, 0.1], size=UPSETS)
    result, sample = upset(model, kinds)
    assert not result["waited"].any()
    assert_the_update_is_that_of_the_state_in_memory(model, result, sample)


@pytest.mark.verilator
@pytest.mark.parametrize("model", [THESIS, THESIS_X8, FLIGHT, QUATERNION_J3, SINS], indirect=True,
                         ids=lambda config: config.name)
def test_a_reset_needs_no_contents_of_registers_and_memories(model):
    """Random contents, a reset, and an update: that of the reset state, and so of all constants."""
    result, sample = upset(model, np.full(UPSETS, POWER_UP))
    engine = model.core.engine
    # The microprogram is read, constants are written, and channels are marked as fresh.
    least = 2 + max(len(engine.program.constants), engine.channels) if engine.channels > 1 else 0
    assert result["waited"].max() <= least
    outputs = engine.reset_outputs if engine.channels == 1 else dict.fromkeys(model.core.system.output_ports, 0)
    for name, value in {**model.core.system.reset, **outputs}.items():
        assert set(result[name]) == {result[name].dtype.type(value)}, name
    assert_the_update_is_that_of_the_state_in_memory(model, result, sample)


@pytest.mark.verilator
def test_an_update_whose_cycles_are_not_those_of_the_schedule_is_refused(model):
    for name in ("cycle", "left") if model.core.engine.channels == 1 else ("cycle", "slot", "check"):
        result, sample = upset(model, np.full(UPSETS, BIT), f"{model.core.system.name}_engine.{name}")
        # Not in the few cycles in which nothing is in flight, or all of an update is done. With several channels, an
        # update in its last interval may also be lost: if the counter skips its last cycle, it has no finish.
        share = 0.9 if model.core.engine.channels == 1 else 0.85
        assert refused(model, result[model.core.system.status_port]).mean() > share, name
        assert_the_update_is_that_of_the_state_in_memory(model, result, sample)


@pytest.mark.verilator
@pytest.mark.parametrize("model", [ITERATIVE_X8], indirect=True, ids=lambda config: config.name)
@pytest.mark.parametrize("name", ["", ".cycle", ".beginning", "_divider_0.busy", "_divider_0.quotient",
                                  "_arctangent.fsm_state"])
def test_a_core_that_never_rests_settles_as_well(model, name):
    engine = model.core.engine
    register = f"{model.core.system.name}_engine{name}" if name else None
    result, sample = upset(model, np.full(UPSETS, BIT), register, load=True)
    assert result["waited"].max() < model.core.latency + 2 * engine.interval
    assert_the_update_is_that_of_the_state_in_memory(model, result, sample, holds=False)
