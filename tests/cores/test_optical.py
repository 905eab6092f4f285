"""The optical attitude sensor: its configuration, its ports, and OPT_attitude against the twin in Verilator."""

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import OPTICAL_ERECTED, OPTICAL_S11639, OPTICAL_TCD1304, modules_of, system_of
from strapdown.export import write_core
from strapdown.kernel.pool import Pool
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.instrument.calibration import SET_B

RNG = np.random.default_rng(14)
CALIBRATION = {"in_n0_r", "in_n0_p", "in_scale_r", "in_scale_p", "in_tilt_r", "in_tilt_p", "in_c3_r", "in_c3_p", "in_h"}
COMPENSATION = {"none": set(), "patent": {"in_accx", "in_accy", "in_accz", "in_k"},
                "exact": {"in_accx", "in_accy", "in_accz", "in_k", "in_yaw_rate"}}
STATUS = ("roll_missing", "pitch_missing", "refused", "ignored", "several", "saturated", "edge", "uncompensated")


@pytest.mark.parametrize(("config", "rate", "adc"), [
    (OPTICAL_TCD1304, 135.135, "spi"), (OPTICAL_S11639, 2000, "parallel"), (OPTICAL_ERECTED, 135.135, "spi")])
def test_presets_are_those_of_the_sensor(config, rate, adc):
    assert config.sample_rate_hz == pytest.approx(rate, rel=1e-5)
    assert (config.adc, config.restart_after) == (adc, 8)
    assert modules_of(config) == ("OPT_attitude", "OPT_timing", "OPT_capture", "OPT_buffer", "OPT_spot", "OPT_send",
                                  "OPT_top")


def test_what_follows_from_other_fields_follows_a_change():
    changed = OPTICAL_TCD1304.replace(sensor="s11639")
    assert (changed.line_clocks, changed.sensor_clock_hz, changed.adc) == (2500, 5e6, "parallel")
    assert changed.replace(line_clocks="5000").sample_rate_hz == 1000
    assert changed.replace(line_clocks="5000").replace(exposure_us=100).exposure_us == 100
    assert OPTICAL_TCD1304.replace(clock_hz=200e6).sample_at == 2 * OPTICAL_TCD1304.sample_at


@pytest.mark.parametrize(("changes", "message"), [
    ({"sample_rate_hz": 100}, "sample_rate_hz must be left out: it is sensor_clock_hz/line_clocks, not 100"),
    ({"channels": 2}, "channels must be 1: a core serves one sensor, not 2"),
    ({"compensation": "patent", "erection_s": 30}, "erection_s must be 0 unless compensation is exact, not 30"),
    ({"line_clocks": 14_788}, "a line of tcd1304 takes 14792 clocks of the sensor or more, not 14788"),
    ({"line_clocks": 200_000}, "a line must take less than 8388608 cycles, not 10000000"),
    ({"clock_hz": 33e6}, "the clock must be a whole multiple of the sensor's 2 MHz, 4 times or more, not 33 MHz"),
    ({"sample_at": 200}, "sample_at must be within the pixel, after the 500 ns in which the video settles, from 50 to "
                         "199 cycles, not 200"),
    ({"sensor": "tsl1402", "clock_hz": 32e6, "sensor_clock_hz": 8e6},
     "the video of tsl1402 settles in 120 ns, and a pixel of 125 ns has no cycle of the clock after that: choose a "
     "slower clock of the sensor, or a faster clock"),
    ({"exposure_min_us": 5},
     "the exposure of tcd1304 must be from 11.2 to 7311.2 us in this line, not from 5 to 7311.2 us"),
    ({"exposure_us": 9000}, "exposure_us must be from 11.2 to 7311.2, not 9000"),
    ({"sensor": "s11639", "baud_rate": 115_200},
     "a frame of 45 bytes takes 3.91 ms at 115200 baud, longer than 0.5 ms, which is send_every=1 lines"),
    ({"sensor": "s11639", "adc": "spi"}, "a conversion of the ADC takes 100 cycles, longer than a pixel of 20"),
])
def test_configurations_that_cannot_be_are_refused_in_one_line(changes, message):
    with pytest.raises(ConfigError) as error:
        OPTICAL_TCD1304.replace(**changes)
    assert str(error.value) == f"configuration optical_tcd1304: {message}"


def test_only_binary32_has_frames():
    from strapdown.fp import BINARY64

    with pytest.raises(ConfigError, match=r"^configuration optical_tcd1304: pool must be in binary32, not binary64$"):
        OPTICAL_TCD1304.replace(pool=Pool(format=BINARY64))


@pytest.mark.parametrize("compensation", COMPENSATION)
def test_ports(make_core, compensation):
    core = make_core("OPT_attitude", OPTICAL_TCD1304.replace(compensation=compensation))
    flow = {port: member.flow.name for port, member in core.signature.members.items()}
    inputs = {"in_roll_px", "in_pitch_px", *CALIBRATION, *COMPENSATION[compensation]}
    outputs = {"out_roll", "out_pitch", "out_roll_measured", "out_pitch_measured"}
    assert flow == dict.fromkeys({"clk", "rst_n", "in_line_en", *inputs}, "In") | dict.fromkeys(
        {"out_attitude_finish", "out_status", *outputs}, "Out")
    assert {len(getattr(core, port)) for port in inputs | outputs} == {32}
    assert core.engine.status_names == STATUS


def test_other_modules_have_no_equations():
    with pytest.raises(ValueError, match=r"^OPT_top has no equations of its own: choose OPT_attitude$"):
        system_of("OPT_top", OPTICAL_TCD1304)


@pytest.mark.verilator
@pytest.mark.parametrize("config", [OPTICAL_TCD1304, OPTICAL_TCD1304.replace(compensation="patent"), OPTICAL_ERECTED],
                         ids=lambda config: f"{config.name}-{config.compensation}")
def test_circuit_is_the_twin_in_every_bit(make_core, models, tmp_path, config):
    core = make_core("OPT_attitude", config)
    model = CoreModel(core, write_core(core, config, tmp_path, ""), models)
    count = 600
    inputs = {port: np.full(count, value) for port, value in SET_B.ports().items()}
    inputs |= {"in_roll_px": RNG.uniform(0, 3648, count), "in_pitch_px": RNG.uniform(300, 3348, count),
               "in_yaw_rate": RNG.normal(0, 0.02, count)}
    inputs |= {f"in_acc{axis}": RNG.normal(-9.8 * (axis == "z"), 3, count) for axis in "xyz"}
    inputs["in_accy"][100], inputs["in_k"][200], inputs["in_roll_px"][300] = np.nan, np.inf, np.nan
    # Finite, but a product of it is not.
    inputs["in_scale_p"][400:410] = 1e38
    inputs = {port: inputs[port] for port in core.system.input_ports}
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert core.latency <= (260 if config.erection_s else 240)
    assert model.differing_bits(inputs, result) == 0
    refused = result["out_status"] >> STATUS.index("refused") & 1
    assert np.flatnonzero(refused).tolist() == [100, 200, 300, *range(400, 410)]
    assert set(result["out_status"]) == {0, 1 << STATUS.index("refused")}
    assert result["out_roll"][100] == result["out_roll"][99]
    # The eighth refusal in a row starts again: the rotor is vertical.
    if config.compensation == "exact":
        assert result["nz"][407] == 1
