"""The cores' interfaces, and their circuits against twin and reference in Verilator."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import (
    ATTITUDE_CORES,
    CONFIGS,
    THESIS,
    THESIS_COMPACT,
    THESIS_FAST,
    AttitudeConfig,
    main_module,
    system_of,
)
from strapdown.export import write_core
from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.stimuli.pole import angle_error, inputs_through, pole_grid
from strapdown_sim.stimuli.thesis import TABLE_5_7, TABLE_5_7_INPUT, TABLES
from strapdown_sim.truth import complementary_filter, module_outputs

SEED = 20151
UPDATES = 20_000

ITERATIVE_COMPACT = THESIS_COMPACT.replace(name="iterative_compact", pool=replace(
    THESIS_COMPACT.pool, operators=(Adder(), Multiplier(), Divider(), Arctangent(), Selector())))
"""Horizontal microcode with operators whose results stay."""


def names(pattern, parts):
    return {pattern.format(part) for part in parts.split()}


MATRIX = "11 12 13 21 22 23 31 32 33"
PORTS = {
    "INS_acc": ("in_acc_en", names("in_{}", "accx accy accz c13 c23 c33"), names("out_{}", "exa eya eza"),
                "out_acc_finish"),
    "INS_mag": ("in_mag_en", names("in_mag{}", "x y z") | names("in_c{}", MATRIX), names("out_{}", "exm eym ezm"),
                "out_mag_finish"),
    "INS_gyro": ("in_gyro_en", names("in_{}", "gyrox gyroy gyroz exa eya eza exm eym ezm exi eyi ezi"),
                 names("out_{}", "exi eyi ezi wx wy wz"), "out_gyro_finish"),
    "INS_quat": ("in_quat_en", names("in_{}", "q0 q1 q2 q3 wx wy wz"), names("out_q{}", "0 1 2 3"), "out_quat_finish"),
    "INS_matx": ("in_matx_en", names("in_q{}", "0 1 2 3"), names("out_c{}", MATRIX), "out_matx_finish"),
    "INS_euler": ("in_euler_en", names("in_c{}", "11 12 13 23 33"), names("out_{}", "pitch roll yaw"),
                  "out_euler_finish"),
    "INS_atan": ("in_atan_en", {"in_a", "in_b"}, {"out_result"}, "out_atan_finish"),
    "INS_top": ("in_data_en", names("in_{}", "accx accy accz magx magy magz gyrox gyroy gyroz"),
                names("out_c{}", MATRIX) | names("out_{}", "pitch roll yaw"), "out_INS_finish"),
}


@pytest.fixture(scope="module")
def circuit(models, make_core, tmp_path_factory):
    """Function from a module's name to its CoreModel in configuration thesis."""
    made = {}

    def make(name):
        if name not in made:
            core = make_core(name, THESIS)
            made[name] = CoreModel(core, write_core(core, THESIS, tmp_path_factory.mktemp("verilog"), ""), models)
        return made[name]

    return make


def random_inputs(name, count):
    """Numbers with all magnitudes of sensors and matrices; one vector in twenty is zero."""
    rng = np.random.default_rng(SEED)
    system = ATTITUDE_CORES[name](THESIS)
    ports = system.input_ports
    values = rng.standard_normal((count, len(ports))) * 10 ** rng.uniform(-4, 4, (count, 1))
    vectors = system.read(dict(zip(ports, values.T, strict=True)), system.inputs)
    for sensor in vectors.keys() & {"a", "m"}:
        vectors[sensor][rng.random(count) < 0.05] = 0.0
    return system.bind(**vectors)


@pytest.mark.parametrize("name", PORTS)
def test_ports_are_those_of_the_thesis(make_core, name):
    start, inputs, outputs, finish = PORTS[name]
    core = make_core(name, THESIS)
    members = core.signature.members
    flow = {port: member.flow.name for port, member in members.items()}
    expected = dict.fromkeys({"clk", "rst_n", start} | inputs, "In") | dict.fromkeys(outputs | {finish}, "Out")
    if name == "INS_top":
        expected["out_status"] = "Out"
    assert flow == expected
    assert {len(getattr(core, port)) for port in inputs | outputs} == {32}
    assert {len(getattr(core, port)) for port in ("clk", "rst_n", start, finish)} == {1}


def test_the_sequencer_walks_the_states_of_the_thesis(make_core):
    core = make_core("INS_top", THESIS)
    assert core.engine.state_names == ("IDLE", "ACC_MAG", "GYRO", "QUAT", "MATX", "EULER", "END")
    assert core.engine.status_names == ("accelerometer_missing", "magnetometer_missing", "refused", "ignored",
                                        "restarted", "tilt_reversed", "heading_reversed")


@pytest.mark.verilator
@pytest.mark.parametrize("name", PORTS)
def test_circuit_is_the_twin_in_every_bit(circuit, name):
    model = circuit(name)
    inputs = random_inputs(name, UPDATES)
    result = model.update(inputs)
    assert set(result["cycles"]) == {model.core.latency}
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
@pytest.mark.parametrize("config", [THESIS_COMPACT, ITERATIVE_COMPACT, THESIS_FAST], ids=lambda config: config.name)
def test_other_pools_are_the_twin_in_every_bit(config, make_core, models, tmp_path):
    core = make_core("INS_top", config)
    model = CoreModel(core, write_core(core, config, tmp_path, ""), models)
    inputs = random_inputs("INS_top", UPDATES)
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_circuit_is_the_twin_when_samples_are_refused_or_strange(circuit):
    model = circuit("INS_top")
    inputs = random_inputs("INS_top", UPDATES)
    rng = np.random.default_rng(SEED + 1)
    strange = np.array([np.nan, np.inf, -np.inf, 3e38, -1e30, 1e-30, 1e-40, 0.0, -0.0])
    for values in inputs.values():
        values[:] = np.where(rng.random(UPDATES) < 0.02, rng.choice(strange, UPDATES), values)
    result = model.update(inputs)
    assert model.differing_bits(inputs, result) == 0
    refused = result["out_status"] >> 2 & 1
    assert 0 < refused.sum() < UPDATES
    assert all(np.isfinite(result[port]).all() for port in model.core.system.output_ports)
    assert all(np.isfinite(result[word]).all() for word in model.core.system.reset)


@pytest.mark.verilator
def test_angles_give_the_matrix_back_near_the_pole(circuit):
    model = circuit("INS_top")
    system = model.core.system
    _, attitudes = pole_grid(step_deg=120, distances_deg=(1, 1e-3, 1e-6, 0))
    inputs = inputs_through(attitudes, system, THESIS)
    result = model.update(inputs)
    assert model.differing_bits(inputs, result) == 0
    outputs = system.read(result)
    assert angle_error(outputs["angles"], outputs["c"]).max() < 1e-4
    assert (np.abs(outputs["angles"][:, 0]) > 90 - 2e-5).sum() >= 36


def test_differing_bits_are_counted(circuit):
    model = circuit("INS_top")
    inputs = random_inputs("INS_top", 10)
    result = model.update(inputs)
    result["out_yaw"][3] = np.nextafter(result["out_yaw"][3], np.float32(400))
    assert model.differing_bits(inputs, result) >= 1


@pytest.mark.verilator
@pytest.mark.parametrize("name", TABLES)
def test_published_values(circuit, name):
    (inputs, printed), system = TABLES[name], circuit(name).core.system
    expected = module_outputs(name, inputs, THESIS)
    once = {port: value[None] for port, value in system.bind(**inputs).items()}
    result = system.read(circuit(name).update(once))
    for output, values in printed.items():
        np.testing.assert_allclose(result[output][0], expected[output], rtol=2e-6, atol=0)
        # The table is printed with four decimals or more.
        np.testing.assert_allclose(result[output][0], values, rtol=2e-6, atol=5e-5)


@pytest.mark.verilator
def test_table_5_7(circuit):
    system = circuit("INS_top").core.system
    vectors = {name: np.tile(vector, (5, 1)) for name, vector in TABLE_5_7_INPUT.items()}
    angles = system.read(circuit("INS_top").update(system.bind(**vectors)))["angles"]
    truth = complementary_filter(THESIS).run(*vectors.values())
    np.testing.assert_allclose(angles, np.stack(truth[1:], axis=-1), rtol=0, atol=5e-5)
    np.testing.assert_allclose(angles, TABLE_5_7, rtol=0, atol=5e-5 + 5e-5)


@pytest.mark.verilator
@pytest.mark.parametrize("name", [name for name in PORTS if name != "INS_top"])
def test_circuit_is_near_the_reference(circuit, name):
    count, system = 2000, circuit(name).core.system
    inputs = random_inputs(name, count)
    if name == "INS_euler":
        # Angles need a rotation: use the matrices that INS_matx computes from unit quaternions.
        q = np.random.default_rng(SEED).standard_normal((count, 4))
        matx = circuit("INS_matx").core.system
        made = circuit("INS_matx").update(matx.bind(q=q / np.linalg.norm(q, axis=1, keepdims=True)))
        inputs = {port: made[port.replace("in", "out")].astype(float) for port in inputs}
    # The reference gets the same rounded numbers as the circuit.
    inputs = {port: np.asarray(values, np.float32).astype(float) for port, values in inputs.items()}
    expected = module_outputs(name, system.read(inputs, system.inputs), THESIS)
    result = system.read(circuit(name).update(inputs))
    largest = np.max([np.abs(values).reshape(count, -1).max(axis=1) for values in expected.values()], axis=0)
    for output, values in expected.items():
        # No output is a sum of more than 32 terms. No term is larger than about four times the largest
        # output, and each is rounded a few times: the error is always below 64 * 2**-24 of that output.
        error = np.abs(result[output] - values).reshape(count, -1)
        if output == "angles":
            # An arctangent of rounded elements of C: 2**-24 radians over the length of their vector.
            c11, c12, c13, c23, c33 = inputs.values()
            seen = np.stack([np.sqrt(np.maximum(1 - c13**2, 0)), np.hypot(c23, c33), np.hypot(c11, c12)], axis=-1)
            error = np.minimum(error, 360 - error)
            assert (error * np.maximum(seen, 2.0**-12) <= 64 * 2.0**-24 * 360).all()
        else:
            assert (error <= 64 * 2.0**-24 * np.maximum(largest, 1e-3)[:, None]).all(), output


@pytest.mark.parametrize("config", [config for config in CONFIGS.values() if isinstance(config, AttitudeConfig)],
                         ids=lambda config: config.name)
def test_gains_can_be_inputs(config):
    """With the values of the configuration the results are those of constant gains; without any gain nothing fails."""
    module = main_module(config)
    tuned = config.replace(inputs="kp,ki")
    constant, system, pool = system_of(module, config), system_of(module, tuned), config.engine_pool
    assert tuned.constant_inputs() == {"kp": config.kp, "ki": config.ki}
    assert system.input_ports == (*constant.input_ports, "in_kp", "in_ki")
    inputs = dict(zip(constant.input_ports, np.random.default_rng(SEED).standard_normal((9, 50)), strict=True))
    gains = {"in_kp": np.full(50, config.kp), "in_ki": np.full(50, config.ki)}
    (expected, _), (found, _) = constant.run_float64(inputs), system.run_float64(inputs | gains)
    (rounded, _), (twin, _) = constant.run(pool, inputs), system.run(pool, inputs | gains)
    for port in system.output_ports:
        assert np.array_equal(found[port], expected[port])
        # A few more roundings, of angles up to 360 degrees.
        np.testing.assert_allclose(twin[port], rounded[port], rtol=0, atol=1e-4)
    off, _ = system.run(pool, inputs | dict.fromkeys(gains, np.zeros(50)))
    assert not off["refused"].any()
    assert not any(off[f"i{axis}"].any() for axis in "xyz")


def test_gains_of_the_gyro_module_can_be_inputs():
    system = ATTITUDE_CORES["INS_gyro"](THESIS.replace(inputs="ki"))
    assert system.input_ports[-1] == "in_ki"
    assert system.port_meanings["in_ki"] == "integral gain Ki, rad/s² per unit error"


def test_other_inputs_are_an_error():
    with pytest.raises(ConfigError) as error:
        THESIS.replace(inputs="kp,period")
    assert str(error.value) == "configuration thesis: inputs must name parameters of the filter (period is unknown), " \
                               "not 'kp,period'"
