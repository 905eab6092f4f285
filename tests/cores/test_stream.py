"""INS_top_x8: eight attitudes from one core, against one software twin per channel."""

import re
from dataclasses import replace

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import (
    ATTITUDE_CORES,
    FLIGHT,
    QUATERNION_J3,
    THESIS,
    THESIS_FAST_X16,
    THESIS_X8,
    THESIS_X64,
    Core,
    main_module,
    make_core,
    modules_of,
)
from strapdown.export import description, verilog_text, write, write_core
from strapdown.kernel.pool import MemoryStyle
from strapdown.kernel.stream import StreamEngine
from strapdown_sim.drivers.stream import RESET, StreamModel

SEED = 20151
UPDATES = 20_000


@pytest.fixture(scope="module")
def core():
    return make_core("INS_top_x8", THESIS_X8)


@pytest.fixture(scope="module")
def verilog(core, tmp_path_factory):
    return write_core(core, THESIS_X8, tmp_path_factory.mktemp("verilog"), "")


@pytest.fixture(scope="module")
def model(core, verilog, models):
    return StreamModel(core, verilog, models)


def samples(core, count, seed=SEED):
    """Channels in any order, and numbers with all magnitudes of sensors; one vector in twenty is zero."""
    rng = np.random.default_rng(seed)
    ports = core.system.input_ports
    values = rng.standard_normal((count, len(ports))) * 10 ** rng.uniform(-4, 4, (count, 1))
    for first in 0, 3:
        values[rng.random(count) < 0.05, first:first + 3] = 0
    return rng.integers(THESIS_X8.channels, size=count), dict(zip(ports, values.T, strict=True)), rng


def in_order(result, channels):
    return (channels[result["row"]] == result["out_channel"]).all() and (np.diff(result["row"]) > 0).all()


def test_ports_are_those_of_ins_top_with_a_channel(core):
    flow = {name: (member.flow.name, len(getattr(core, name))) for name, member in core.signature.members.items()}
    inputs = {f"in_{sensor}{axis}" for sensor in ("acc", "mag", "gyro") for axis in "xyz"}
    outputs = {f"out_c{row}{column}" for row in "123" for column in "123"} | {"out_pitch", "out_roll", "out_yaw"}
    assert flow == (dict.fromkeys(("clk", "rst_n", "in_data_en"), ("In", 1)) | dict.fromkeys(inputs, ("In", 32))
                    | dict.fromkeys(outputs, ("Out", 32)) | dict.fromkeys(("in_ready", "out_INS_finish"), ("Out", 1))
                    | {"in_channel": ("In", 3), "out_channel": ("Out", 3), "out_status": ("Out", 6)})
    assert core.engine.status_names == ("accelerometer_missing", "magnetometer_missing", "refused", "restarted",
                                        "tilt_reversed", "heading_reversed")


def test_file_explains_itself(core, verilog):
    text = verilog.read_text(encoding="utf-8")
    header = text[:text.index("module ")]
    for port in core.signature.members:
        assert re.search(rf"^//   {port} ", header, re.MULTILINE), port
    told = description(core, THESIS_X8, "")
    assert told["latency_cycles"] == core.latency
    assert told["interval_cycles"] == core.engine.interval == THESIS_X8.interval
    assert told["channels"] == 8
    assert modules_of(THESIS_X8) == ("INS_top_x8",)
    assert modules_of(THESIS_X8.replace(channels=4)) == ("INS_top_x4",)


def test_bad_configurations_are_refused():
    with pytest.raises(ConfigError, match=r"^configuration thesis_x8: channels must be a power of two, not 6$"):
        THESIS_X8.replace(channels=6)
    with pytest.raises(ValueError, match=r"^interval must be at least 67, which adder needs, not 66$"):
        make_core("INS_top_x8", THESIS_X8.replace(interval=66))


@pytest.mark.verilator
def test_any_order_any_subset_any_gap_is_the_twin_in_every_bit(model):
    channels, inputs, rng = samples(model.core, UPDATES)
    # Phases in which only few channels send, and gaps longer and shorter than an update.
    half = UPDATES // 2
    channels[half:half + 2000] %= 2
    idle = np.where(rng.random(UPDATES) < 0.3, rng.integers(3 * model.core.engine.interval, size=UPDATES), 0)
    result = model.update(channels, inputs, idle)
    assert len(result["row"]) == UPDATES
    assert in_order(result, channels)
    assert set(result["finished"] - result["taken"]) == {model.core.latency}
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_refused_samples_leave_their_channel_alone(model):
    count = 4000
    channels, inputs, rng = samples(model.core, count, SEED + 1)
    strange = np.array([np.nan, np.inf, -np.inf, 3e38, -1e30, 1e-30, 1e-40, 0.0, -0.0])
    for values in inputs.values():
        values[:] = np.where(rng.random(count) < 0.02, rng.choice(strange, count), values)
    result = model.update(channels, inputs)
    assert model.differing_bits(inputs, result) == 0
    refused = result["out_status"] >> 2 & 1
    assert 0 < refused.sum() < count
    assert all(np.isfinite(result[name]).all() for name in (*model.core.system.output_ports, *model.core.system.reset))


@pytest.mark.verilator
def test_reset_at_any_time_starts_all_channels_anew(model):
    count = 400
    channels, inputs, rng = samples(model.core, count, SEED + 2)
    idle = np.where(rng.random(count) < 0.2, rng.integers(500, size=count), 0)
    resets = np.arange(19, count, 20)
    idle[resets] = RESET
    result = model.update(channels, inputs, idle)
    assert count // 2 < len(result["row"]) < count - len(resets)
    assert in_order(result, channels)
    assert set(result["finished"] - result["taken"]) == {model.core.latency}
    assert model.differing_bits(inputs, result, resets) == 0


@pytest.mark.verilator
def test_all_channels_in_turn_are_taken_without_a_pause(model):
    count = 800
    _, inputs, _ = samples(model.core, count, SEED + 3)
    channels = np.arange(count) % 8
    result = model.update(channels, inputs)
    assert set(np.diff(result["taken"])) == set(np.diff(result["finished"])) == {model.core.engine.interval}
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_one_channel_waits_for_itself(model):
    count = 50
    _, inputs, _ = samples(model.core, count, SEED + 4)
    result = model.update(np.full(count, 5), inputs)
    # Ready again at the first start of an interval after the end of the update.
    waits = np.diff(result["taken"]) - model.core.latency
    assert ((waits >= 0) & (waits < model.core.engine.interval)).all()
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_a_sample_is_taken_at_once_after_a_pause(model):
    # From the first start without an update in flight.
    begin = -(-model.core.latency // model.core.engine.interval) * model.core.engine.interval
    idle = np.arange(begin, begin + 250)
    channels, inputs, _ = samples(model.core, len(idle), SEED + 6)
    result = model.update(channels, inputs, idle)
    assert (np.diff(result["taken"]) == idle[1:] + 1).all()
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_differing_bits_are_counted(model):
    channels, inputs, _ = samples(model.core, 40, SEED + 5)
    result = model.update(channels, inputs)
    assert model.differing_bits(inputs, result) == 0
    result["sa"][20] = np.nextafter(result["sa"][20], np.float32(2))
    assert model.differing_bits(inputs, result) >= 1


# With next-state values that are read again, and results that are kept for several intervals; with four buses.
STREAMED = {"flight": (FLIGHT.replace(channels=8), 298), "quaternion_j3": (QUATERNION_J3.replace(channels=8), 38),
            "thesis_x64": (THESIS_X64, 67), "thesis_fast_x16": (THESIS_FAST_X16, 43)}


@pytest.fixture(scope="module", params=STREAMED)
def streamed(request, tmp_path_factory, models):
    """A configuration for several channels, its model, and the bound of its interval."""
    config, bound = STREAMED[request.param]
    core = make_core(main_module(config), config)
    verilog = write_core(core, config, tmp_path_factory.mktemp(request.param), "")
    return config, StreamModel(core, verilog, models), bound


@pytest.mark.verilator
def test_every_configuration_can_have_channels(streamed):
    config, model, bound = streamed
    core, count = model.core, 3000
    assert bound <= core.engine.interval <= 1.1 * bound
    assert max(core.engine.program.schedule.bounds.values()) == bound
    rng = np.random.default_rng(SEED)
    ports = core.system.input_ports
    values = rng.standard_normal((count, len(ports))) * 10 ** rng.uniform(-2, 2, (count, 1))
    values[rng.random(count) < 0.02, 0] = np.nan
    inputs = dict(zip(ports, values.T, strict=True))
    channels = rng.integers(config.channels, size=count)
    idle = np.where(rng.random(count) < 0.2, rng.integers(3 * core.engine.interval, size=count), 0)
    resets = np.arange(149, count, 150)
    idle[resets] = RESET
    result = model.update(channels, inputs, idle)
    assert in_order(result, channels)
    assert set(result["finished"] - result["taken"]) == {core.latency}
    assert model.differing_bits(inputs, result, resets) == 0
    refused = result["out_status"] >> core.engine.status_names.index("refused") & 1
    assert 0 < refused.sum() < len(refused) / 2


@pytest.mark.verilator
def test_without_a_status_port_nothing_is_refused(tmp_path, models):
    system = ATTITUDE_CORES["INS_quat"](THESIS)
    core = Core(system, THESIS.pool, engine=StreamEngine, channels=2)
    assert core.engine.status_names == ()
    model = StreamModel(core, write(core, tmp_path, command=""), models)
    rng = np.random.default_rng(SEED)
    inputs = {port: rng.standard_normal(500) for port in system.input_ports}
    inputs[system.input_ports[0]][100] = np.nan
    result = model.update(rng.integers(2, size=500), inputs)
    assert model.differing_bits(inputs, result) == 0
    assert np.isnan(result[system.output_ports[0]]).any()


def test_what_header_and_json_say_of_the_pool_is_in_the_circuit(tmp_path):
    config = QUATERNION_J3.replace(channels=2)
    core = make_core(main_module(config), config)
    told = description(core, config, "")["configuration"]
    pool = core.engine.program.schedule.pool
    assert (told["forwarding"], told["side_memory"], told["private_ports"]) == (False, "auto", True)
    assert (told["operand_memory"], told["microcode"]) == ("block", "block")
    assert pool.forwarding is False
    for changes, memories in (
            ({}, {"main_memory": "block", "fetch_data": "block"}),
            ({"side_memory": MemoryStyle.DISTRIBUTED, "operand_memory": MemoryStyle.AUTO},
             {"side_memory": "distributed", "fetch_data": "block"}),
            ({"operand_memory": MemoryStyle.DISTRIBUTED, "side_memory": False, "microcode": MemoryStyle.DISTRIBUTED},
             {"main_memory": "distributed"})):
        changed = Core(core.system, replace(pool, **changes), engine=StreamEngine, channels=2)
        # The microcode is a table; its style is that of its output register.
        found = re.findall(r'\(\* r[ao]m_style = "(\w+)" \*\)\s+reg \[[^]]*\] (\w+)', verilog_text(changed))
        assert {name: style for style, name in found} == memories
