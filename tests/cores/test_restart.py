"""A core that refuses every update of finite inputs starts again; one whose sensor fails does not."""

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import (
    CONFIGS,
    QUATERNION_J3,
    SINS,
    THESIS,
    THESIS_COMPACT,
    THESIS_X8,
    main_module,
    modules_of,
    system_of,
)
from strapdown.export import write_core
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel
from strapdown_sim.reference import quaternion as exact

LIMIT = 8
SEED = 20151


def circuit(make_core, config, models, tmp_path):
    core = make_core(main_module(config), config)
    kind = StreamModel if config.channels > 1 else CoreModel
    return kind(core, write_core(core, config, tmp_path, ""), models)


def rows_with(model, result, name):
    """Updates with a status bit."""
    status = result[model.core.system.status_port]
    return np.flatnonzero(status >> model.core.engine.status_names.index(name) & 1)


def rates(system, count):
    """Samples of QUAT_direct with random rates, without a load."""
    omega = np.random.default_rng(SEED).uniform(-20, 20, (count, 3))
    return omega, system.bind(omega=omega, load=0.0, start=np.array([1.0, 0, 0, 0]))


@pytest.mark.verilator
def test_a_state_that_overflows_starts_again(make_core, models, tmp_path):
    """The square of a loaded quaternion is infinite: every later update is refused, even another load."""
    model = circuit(make_core, QUATERNION_J3, models, tmp_path)
    system, loaded = model.core.system, 20
    first = loaded + LIMIT + 1
    omega, inputs = rates(system, 60)
    inputs["in_load_en"][[loaded, loaded + 5]] = 1
    inputs["in_e1"][loaded] = 1e30
    result = model.update(inputs)
    assert model.differing_bits(inputs, result) == 0
    assert rows_with(model, result, "refused").tolist() == list(range(loaded + 1, first))
    assert rows_with(model, result, "restarted").tolist() == [first - 1]
    # Outputs hold until the next update, which starts from the reset state.
    e = system.read(result)["e"].astype(float)
    assert (e[loaded:first, 1] == np.float32(1e30)).all()
    truth = exact.cumulative(np.array([1.0, 0, 0, 0]), exact.increment(omega[first:], QUATERNION_J3.period_s))
    assert exact.angle_between(e[first:], truth).max() < 1e-5


@pytest.mark.verilator
def test_a_sensor_that_holds_nan_never_restarts_a_core(make_core, models, tmp_path):
    model = circuit(make_core, QUATERNION_J3, models, tmp_path)
    system, fails, held = model.core.system, 100, 1000
    _, inputs = rates(system, 1300)
    inputs["in_q"][fails:fails + held] = np.nan
    result = model.update(inputs)
    assert model.differing_bits(inputs, result) == 0
    assert rows_with(model, result, "refused").tolist() == list(range(fails, fails + held))
    assert not rows_with(model, result, "restarted").size
    # Attitude is kept: the other samples give the attitudes of a run without the failure.
    valid = np.delete(np.arange(1300), np.s_[fails:fails + held])
    undisturbed, _ = system.run(QUATERNION_J3.pool, {port: values[valid] for port, values in inputs.items()})
    for port in system.output_ports:
        np.testing.assert_array_equal(result[port][valid], undisturbed[port])


@pytest.mark.verilator
@pytest.mark.parametrize(("config", "port", "other"), [(QUATERNION_J3, "in_p", "in_r"), (THESIS, "in_gyrox", "in_accz"),
                                                       (THESIS_COMPACT, "in_gyrox", "in_accz"),
                                                       (THESIS_X8, "in_gyrox", "in_accz")],
                         ids=lambda value: getattr(value, "name", ""))
def test_the_circuit_counts_like_the_twin(make_core, models, tmp_path, config, port, other):
    """Overflow and NaN in random order: a NaN does not count, and does not clear the count."""
    model = circuit(make_core, config, models, tmp_path)
    rng, count = np.random.default_rng(SEED), 3000
    inputs = {name: rng.standard_normal(count) for name in model.core.system.input_ports}
    inputs[port] = np.where(rng.random(count) < 0.85, 1e38, inputs[port])
    inputs[other] = np.where(rng.random(count) < 0.3, np.nan, inputs[other])
    if config.channels == 1:
        result, channels = model.update(inputs), 1
    else:
        # Half of the channels never overflow, so they never start again.
        number = rng.integers(config.channels, size=count)
        inputs[port][number % 2 == 0] = 1
        result, channels = model.update(number, inputs), config.channels // 2
        assert (result["out_channel"][rows_with(model, result, "restarted")] % 2).all()
    assert model.differing_bits(inputs, result) == 0
    assert rows_with(model, result, "restarted").size > 10 * channels


def test_which_cores_start_again():
    for config in CONFIGS.values():
        module = modules_of(config)[0] if config.assemblies() else main_module(config)
        system = system_of(module, config)
        assert system.restart_after == config.restart_after == (0 if isinstance(config, type(SINS)) else LIMIT)
    assert system_of("INS_acc", THESIS).restart_after == 0


def test_a_core_that_never_starts_again_has_no_bit(make_core):
    without = make_core("QUAT_direct", QUATERNION_J3.replace(restart_after="0"))
    assert without.engine.status_names == ("refused", "ignored")
    assert make_core("QUAT_direct", QUATERNION_J3).engine.status_names == ("refused", "ignored", "restarted")
    assert make_core("INS_top", THESIS.replace(restart_after="0")).engine.status_names == (
        "accelerometer_missing", "magnetometer_missing", "refused", "ignored", "tilt_reversed", "heading_reversed")


def test_a_number_of_updates_that_cannot_be():
    with pytest.raises(ConfigError, match=r"^configuration thesis: restart_after must be greater than or equal to 0, "
                                          r"not -1$"):
        THESIS.replace(restart_after=-1)
