"""A core behind its bus: updates by register, in Amaranth's simulator; parameters, ports and errors."""

from dataclasses import replace

import numpy as np
import pytest
from amaranth.sim import Simulator

from strapdown.bus import Access, Field, Register, Word
from strapdown.config import ConfigError
from strapdown.cores import (
    FLIGHT,
    QUATERNION_J2,
    QUATERNION_J3,
    THESIS,
    AxiCore,
    QuaternionConfig,
    axi_core,
    main_module,
    make_core,
    register_table,
)

SAMPLES = 3


async def write(ctx, bus, address, value):
    """A write of a whole word; returns its answer."""
    ctx.set(bus.s_axi_awaddr, address)
    ctx.set(bus.s_axi_wdata, value)
    ctx.set(bus.s_axi_wstrb, 0b1111)
    for signal in bus.s_axi_awvalid, bus.s_axi_wvalid, bus.s_axi_bready:
        ctx.set(signal, 1)
    await ctx.tick()
    for signal in bus.s_axi_awvalid, bus.s_axi_wvalid:
        ctx.set(signal, 0)
    (answer,) = await ctx.tick().sample(bus.s_axi_bresp).until(bus.s_axi_bvalid)
    return answer


async def read(ctx, bus, address):
    """A read; returns its data and its answer."""
    ctx.set(bus.s_axi_araddr, address)
    for signal in bus.s_axi_arvalid, bus.s_axi_rready:
        ctx.set(signal, 1)
    await ctx.tick()
    ctx.set(bus.s_axi_arvalid, 0)
    return await ctx.tick().sample(bus.s_axi_rdata, bus.s_axi_rresp).until(bus.s_axi_rvalid)


@pytest.mark.parametrize("parameters", [{}, {"in_kp": 3.5, "in_ki": 0.25}])
def test_updates_by_register(parameters):
    """The parameters have the values of the configuration until they are written."""
    config = THESIS.replace(inputs=[name.removeprefix("in_") for name in parameters])
    core = axi_core(config).component
    table, system, number = core.table, core.system, core.program.format
    rng = np.random.default_rng(15)
    inputs = {word.port: rng.normal(size=SAMPLES).astype(np.float32) for word in table.samples}
    before = {word.port: config.gains[word.port.removeprefix("in_")] for word in table.parameters}
    values = {port: np.array([before[port], *[value] * (SAMPLES - 1)]) for port, value in parameters.items()}
    twin, _ = system.run(config.engine_pool, inputs | values)

    async def bench(ctx):
        async def value(name):
            data, answer = await read(ctx, core, table[name].address)
            assert answer == 0
            return data

        async def put(name, data):
            assert await write(ctx, core, table[name].address, data) == 0

        for index in range(SAMPLES):
            for word in table.samples:
                await put(word.registers[0].name, int(number.to_bits(inputs[word.port][index])))
            await put("CONTROL", table["CONTROL"]["start"].mask)
            while await value("STATUS") & table["STATUS"]["busy"].mask:
                pass
            await put("CONTROL", table["CONTROL"]["snapshot"].mask)
            for word in table.outputs:
                assert await value(word.registers[0].name) == number.to_bits(twin[word.port][index])
            assert await value("SNAPSHOT_UPDATE") == index + 1
            assert await value("CYCLES") == core.latency
            for port, new in parameters.items():
                await put(port.upper(), int(number.encode(new)))

    simulator = Simulator(core)
    simulator.add_clock(1e-8)
    simulator.add_testbench(bench)
    simulator.run()


def test_inputs_with_a_value_in_the_configuration_have_it_after_a_reset():
    config = FLIGHT.replace(inputs="magnetometer_gain", period_input=True, sample_rate_hz=250)
    table = register_table(make_core(main_module(config), config), config)
    assert table["IN_MAGNETOMETER_GAIN"].reset == int(np.float32(config.magnetometer_gain).view(np.uint32))
    assert table["IN_PERIOD"].reset == int(np.float32(1 / 250).view(np.uint32))
    assert table["IN_GYROX"].reset == 0
    assert [word.port for word in table.parameters] == ["in_magnetometer_gain"]


@pytest.mark.parametrize(("changes", "options", "message"), [
    ({"clock_enable": True}, {}, "configuration thesis: clock_enable must be false: a bus has no clock enable"),
    ({}, {"error_response": "decerr"}, "error_response must be slverr or okay, not 'decerr'"),
])
def test_errors(changes, options, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        axi_core(THESIS.replace(**changes), **options)


def test_answers_must_fit_between_the_updates_of_several_channels():
    config = QUATERNION_J2.replace(channels=2)
    core = make_core(main_module(config), config)
    table = register_table(core, config)
    registers = tuple(Register(f"MORE_{place}", 0x800 + 4 * place, (Field("value", 0, 32, Access.READ, ""),), "")
                      for place in range(core.interval))
    long = replace(table, outputs=(Word("out_e0", 32 * core.interval, registers, "", "bits"),))
    with pytest.raises(ValueError, match=f"^an answer of {core.interval + 1} words takes longer than the interval of "
                                         f"{core.interval} cycles$"):
        AxiCore(core.engine, long)
    assert AxiCore(core.engine, table).stream_interval == core.interval


def test_a_parameter_that_is_named_twice():
    with pytest.raises(ConfigError, match=r"inputs must name each parameter once \(gyro_range stands twice\)"):
        FLIGHT.replace(inputs="gyro_range,gyro_range")


class Fixed(QuaternionConfig):
    """A configuration that gives a vector to its inputs."""

    def constant_inputs(self):
        return {"start": (1.0, 0.0, 0.5, 0.0), "load": 0.25}


def test_a_vector_of_the_configuration_goes_to_its_ports():
    config = Fixed(**{name: getattr(QUATERNION_J3, name) for name in QUATERNION_J3.model_fields_set})
    table = register_table(make_core(main_module(config), config), config)
    values = {"IN_E0": 1.0, "IN_E1": 0.0, "IN_E2": 0.5, "IN_E3": 0.0, "IN_LOAD_EN": 0.25, "IN_P": 0.0}
    assert {name: table[name].reset for name in values} == {
        name: int(np.float32(value).view(np.uint32)) for name, value in values.items()}
