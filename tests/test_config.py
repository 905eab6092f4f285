import re

import pytest
from pydantic import ValidationError

from strapdown.config import Config, ConfigError
from strapdown.cores import (
    CONFIGS,
    MAHONY,
    MODULES,
    QUATERNION_J2,
    THESIS,
    THESIS_X8,
    main_module,
    make_core,
    modules_of,
    system_of,
)
from strapdown.export import description, verilog_text
from strapdown.kernel.pool import MemoryStyle


def test_thesis_has_the_constants_of_the_thesis():
    assert THESIS.period_s == 0.002
    assert THESIS.kp == 10
    assert THESIS.ki * THESIS.period_s == 0.001
    assert THESIS.magnetometer_axes == ("+y", "-x", "+z")


def test_mahony_has_identity_axes_and_no_integral():
    assert (MAHONY.kp, MAHONY.ki, MAHONY.magnetometer_axes) == (0.5, 0, ("+x", "+y", "+z"))


def test_configurations_go_by_their_names():
    assert all(config.name == name for name, config in CONFIGS.items())


def test_configurations_are_frozen():
    with pytest.raises(ValidationError, match="frozen"):
        THESIS.kp = 1


def test_replace_takes_values_and_strings():
    changed = THESIS.replace(kp="2.5", magnetometer_axes="-z,+x,-y", sample_rate_hz=256)
    assert (changed.kp, changed.magnetometer_axes, changed.sample_rate_hz) == (2.5, ("-z", "+x", "-y"), 256)
    assert THESIS.kp == 10


@pytest.mark.parametrize(("change", "message"), [
    ({"kp": -1}, "configuration thesis: kp must be greater than or equal to 0, not -1"),
    ({"kp": "fast"}, "configuration thesis: kp must be a valid number, unable to parse string as a number, not 'fast'"),
    ({"ki": float("nan")}, "configuration thesis: ki must be a finite number, not nan"),
    ({"sample_rate_hz": 0}, "configuration thesis: sample_rate_hz must be greater than 0, not 0"),
    ({"sample_rate_hz": 1e9}, "configuration thesis: sample_rate_hz must be less than or equal to 1000000, "
                              "not 1000000000.0"),
    ({"magnetometer_axes": "+x,+x,+z"}, "configuration thesis: magnetometer_axes must name each sensor axis once, "
                                        "with its sign, as in +y,-x,+z, not '+x,+x,+z'"),
    ({"magnetometer_axes": "x,y,z"}, "configuration thesis: magnetometer_axes must name each sensor axis once, "
                                     "with its sign, as in +y,-x,+z, not 'x,y,z'"),
    ({"magnetometer_axes": ("+x", "+y")}, "configuration thesis: magnetometer_axes must name each sensor axis once, "
                                          "with its sign, as in +y,-x,+z, not ('+x', '+y')"),
    ({"gain": 1}, "configuration thesis has no field 'gain': choose from name, description, sample_rate_hz, channels, "
                  "interval, operand_memory, side_memory, microcode, restart_after, clock_enable, inputs, kp, ki, "
                  "magnetometer_axes; of its pool: adder_latency, adder_dsp_shifts, adder_two_paths, adders, "
                  "multiplier_latency, multipliers, table_reciprocal_latency, table_reciprocals, "
                  "table_arctangent_latency, table_arctangents, arctangent_steps_per_cycle, arctangents, forwarding, "
                  "private_ports, horizontal, side_buses, side_registered, read_ranks"),
    ({"adders": "two"}, "configuration thesis: adders must be a valid integer, unable to parse string as an integer, "
                        "not 'two'"),
    ({"forwarding": "maybe"}, "configuration thesis: forwarding must be a valid boolean, unable to interpret input, "
                              "not 'maybe'"),
    ({"adder_latency": "99"}, "configuration thesis: latency must be from 1 to 7, not 99"),
    ({"extremes_latency": "1"}, "configuration thesis: the pool has no extremes: extremess=1 adds one"),
    ({"channels": "0"}, "configuration thesis: channels must be greater than or equal to 1, not '0'"),
    ({"channels": 6}, "configuration thesis: channels must be a power of two, not 6"),
    ({"channels": 128}, "configuration thesis: channels must be less than or equal to 64, not 128"),
    ({"interval": 100}, "configuration thesis: interval must be None (empty on a command line) where channels is 1, "
                        "not 100"),
    ({"operand_memory": "lut"}, "configuration thesis: operand_memory must be auto, distributed or block, not 'lut'"),
    ({"microcode": "none"}, "configuration thesis: microcode must be auto, distributed or block, not 'none'"),
    ({"side_memory": "yes"}, "configuration thesis: side_memory must be none, auto, distributed or block, not 'yes'"),
    ({"channels": 8, "interval": 0}, "configuration thesis: interval must be greater than or equal to 1, not 0"),
])
def test_errors_are_one_line(change, message):
    with pytest.raises(ConfigError) as error:
        THESIS.replace(**change)
    assert str(error.value) == message


def test_parameters_of_the_pool_are_fields():
    changed = THESIS.replace(adders="2", arctangents=0, forwarding="no", kp="3")
    assert changed.pool.parameters == {name: value for name, value in (
        THESIS.pool.parameters | {"adders": 2, "forwarding": False}).items() if not name.startswith("arctangent")}
    assert changed.kp == 3
    assert THESIS.replace(adders=2).replace(name="other").pool.parameters["adders"] == 2


@pytest.mark.parametrize("config", [config for config in CONFIGS.values()
                                    if config.channels == 1 and not config.assemblies()],
                         ids=lambda config: config.name)
def test_every_configuration_can_have_several_channels(config):
    several = config.replace(channels="4", interval="150")
    assert (several.channels, several.interval) == (4, 150)
    assert modules_of(several) == (f"{main_module(config)}_x4",)
    system, own = system_of(main_module(several), several), system_of(main_module(config), config)
    assert (system.name, system.title) == (f"{own.name}_x4", f"{own.title}, 4 channels")
    assert (system.inputs, system.outputs) == (own.inputs, own.outputs)
    # INS_top has another form of its update, without one column of C.
    assert set(system.reset) == set(own.reset) - ({"c12", "c22", "c32"} if own.name == "INS_top" else set())


def test_the_interval_is_the_schedulers_choice_or_given():
    assert THESIS.replace(channels=8).interval is None
    assert (THESIS_X8.interval, THESIS_X8.replace(interval="").interval) == (67, None)
    with pytest.raises(ConfigError, match=r"^configuration thesis_x8: interval must be None"):
        THESIS_X8.replace(channels=1)
    assert THESIS_X8.replace(channels=1, interval=None).interval is None


def test_a_configuration_without_a_module_is_told():
    with pytest.raises(ValueError, match=r"^configuration thesis_x8 has INS_top_x8, not INS_top$"):
        system_of("INS_top", THESIS_X8)


def test_modules_go_with_the_configurations_that_have_them():
    assert all(name in modules_of(config) for name, configs in MODULES.items() for config in configs)
    assert [config.name for config in MODULES["INS_top"]] == ["thesis", "thesis_compact", "thesis_fast", "mahony"]
    assert [config.name for config in MODULES["INS_top_x8"]] == ["thesis_x8"]


def test_a_configuration_must_say_its_modules():
    class Unfinished(Config):
        pass

    with pytest.raises(NotImplementedError):
        modules_of(Unfinished(name="unfinished", description="", sample_rate_hz=1))


@pytest.mark.parametrize(("changes", "memories", "rams", "roms"), [
    ({}, ("auto", False, "block"), {}, {"block"}),
    ({"operand_memory": "block"}, ("block", False, "block"), {"operands": "block"}, {"block"}),
    ({"side_memory": "distributed", "microcode": "distributed"}, ("auto", "distributed", "distributed"),
     {"side_memory": "distributed"}, {"distributed"}),
    ({"operand_memory": "distributed", "side_memory": "true", "microcode": "auto"}, ("distributed", "auto", "auto"),
     {"operands": "distributed"}, set()),
    ({"channels": 2, "side_memory": "none", "microcode": "auto"}, ("block", False, "auto"),
     {"main_memory": "block"}, set()),
    ({"channels": 2, "operand_memory": "auto", "side_memory": ""}, ("auto", "auto", "block"), {}, {"block"})])
def test_a_configuration_says_what_its_memories_are_made_of(changes, memories, rams, roms):
    config = QUATERNION_J2.replace(**changes)
    core = make_core(main_module(config), config)
    told = description(core, config, "")["configuration"]
    for name, wanted in zip(("operand_memory", "side_memory", "microcode"), memories, strict=True):
        assert getattr(config.engine_pool, name) == (wanted and MemoryStyle(wanted))
        assert told[name] == wanted
    text = verilog_text(core)
    assert {name: style for style, name in re.findall(
        r'\(\* ram_style = "(\w+)" \*\)\s+reg \[[^]]*\] (\w+)', text)} == rams
    # A ROM is a case, and has the attribute there and at its output.
    assert {*re.findall(r'\(\* rom_style = "(\w+)" \*\)\s+case ', text)} == roms
    # Yosys has no ROM of LUT RAM: the attribute that it reads first says LUTs.
    assert set(re.findall(r'\(\* rom_block = "(\w+)" \*\)\s+\(\* rom_style = "(\w+)" \*\)\s+(?:case|reg) ', text)) == \
        ({("logic", "distributed")} if "distributed" in roms else set())
