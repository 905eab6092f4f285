"""Modules of the optical sensor without equations: their ports, OPT_send's frames, variants of OPT_top at the pins."""

import re

import numpy as np
import pytest

from strapdown.blocks import SpotFinder
from strapdown.cores import OPTICAL_ERECTED, OPTICAL_S11639, OPTICAL_TCD1304, make_module
from strapdown.export import verilog_text, write_core
from strapdown.link import OPTICAL_ATTITUDE, FrameDecoder
from strapdown_sim.drivers.optical import Inertial, PinBench
from strapdown_sim.drivers.pins import PinDriver
from strapdown_sim.drivers.verilated import Interface
from strapdown_sim.instrument.calibration import Calibration

from ..link.support import received, verilated

PIXELS = {"out_valid": 1, "out_first": 1, "out_last": 1, "out_pixel_r": 12, "out_pixel_p": 12}
ANGLES = dict.fromkeys(("out_roll", "out_pitch", "out_roll_measured", "out_pitch_measured"), 32)
SEND = {"uart_tx": 1, "out_link_busy": 1, "out_link_overrun": 1}
SH_ICG, ST_CLK = {"ccd_sh_r": 1, "ccd_sh_p": 1, "ccd_icg": 1}, {"ccd_st_r": 1, "ccd_st_p": 1}
SPI = {"adc_sdata_r": 1, "adc_sdata_p": 1}, {"adc_cs_n": 1, "adc_sclk": 1}
PARALLEL = {"adc_data_r": 12, "adc_data_p": 12}, {"adc_clk": 1}
WORDS = dict.fromkeys(("in_accx", "in_accy", "in_accz", "in_yaw_rate", "in_n0_r", "in_n0_p", "in_scale_r", "in_scale_p",
                       "in_tilt_r", "in_tilt_p", "in_c3_r", "in_c3_p", "in_h", "in_k"), 32)
CONTROL = {"clk": 1, "rst_n": 1}


def inner(ports):
    """Input ports for a stream of pixels."""
    return {port.replace("out_", "in_"): width for port, width in ports.items()}


@pytest.mark.parametrize(("config", "module", "inputs", "outputs"), [
    (OPTICAL_TCD1304.replace(trigger="external"), "OPT_timing",
     {"in_run_en": 1, "in_trigger": 1, "in_exposure_r": 24, "in_exposure_p": 24},
     {"ccd_clk": 1, **SH_ICG, "out_sample": 1, "out_first": 1, "out_last": 1, "out_pixel_index": 12,
      "out_exposing_r": 1, "out_exposing_p": 1, "out_middle": 1, "out_exposure_r": 24, "out_exposure_p": 24}),
    (OPTICAL_S11639, "OPT_timing", {"in_run_en": 1, "in_exposure_r": 24, "in_exposure_p": 24},
     {"ccd_clk": 1, **ST_CLK, "out_sample": 1, "out_first": 1, "out_last": 1, "out_pixel_index": 12,
      "out_exposing_r": 1, "out_exposing_p": 1, "out_middle": 1, "out_exposure_r": 24, "out_exposure_p": 24}),
    (OPTICAL_TCD1304, "OPT_capture", {"in_sample": 1, "in_first": 1, "in_last": 1, **SPI[0]}, SPI[1] | PIXELS),
    (OPTICAL_S11639, "OPT_capture", {"in_sample": 1, "in_first": 1, "in_last": 1, **PARALLEL[0]}, PARALLEL[1] | PIXELS),
    (OPTICAL_TCD1304, "OPT_buffer", {**inner(PIXELS), "in_read_index": 12, "in_read_ccd": 1},
     {**PIXELS, "out_line_ready": 1, "out_bank": 1, "out_read_pixel": 12}),
    (OPTICAL_TCD1304, "OPT_spot", {"in_valid": 1, "in_first": 1, "in_last": 1, "in_pixel": 12, "in_black": 12,
                                   "in_lo": 12, "in_hi": 12},
     {"out_spot_finish": 1, "out_found": 1, "out_position": 24, "out_peak": 12, "out_width": 12, "out_sum": 22,
      "out_saturated": 12, "out_several": 1, "out_edge": 1, "out_black": 12,
      "out_line_peak": 12, "out_line_saturated": 1}),
    (OPTICAL_TCD1304, "OPT_send", {"in_send_en": 1, "in_status": 8} | {
        f"in_{quantity.name}": 32 for quantity in OPTICAL_ATTITUDE.quantities}, SEND),
    (OPTICAL_TCD1304, "OPT_top", {"in_run_en": 1, "in_acc_en": 1, **WORDS, **SPI[0]},
     {"ccd_clk": 1, **SH_ICG, **SPI[1], **SEND, **ANGLES, "out_attitude_finish": 1, "out_status": 8, "out_line": 16,
      "out_middle": 1}),
    (OPTICAL_S11639.replace(mode="buffered", compensation="none"), "OPT_top",
     {"in_run_en": 1, "in_read_index": 12, "in_read_ccd": 1, **PARALLEL[0],
      **{port: width for port, width in WORDS.items() if not port.startswith(("in_acc", "in_yaw", "in_k"))}},
     {"ccd_clk": 1, **ST_CLK, **PARALLEL[1], **SEND, **ANGLES, "out_attitude_finish": 1, "out_status": 8,
      "out_line": 16, "out_middle": 1, "out_line_ready": 1, "out_bank": 1, "out_read_pixel": 12}),
], ids=lambda value: getattr(value, "name", value if isinstance(value, str) else ""))
def test_ports(config, module, inputs, outputs):
    top = make_module(module, config)
    found = {flow: {port.name: port.width for port in top.ports if port.flow.name == flow} for flow in ("In", "Out")}
    assert found == {"In": CONTROL | inputs, "Out": outputs}
    assert all(port.meaning for port in top.ports)


def test_an_update_that_takes_longer_than_a_line_is_refused(monkeypatch):
    # No line of the sensors that there are is so short.
    monkeypatch.setattr(SpotFinder, "latency", 50_000)
    wanted = r"^the angles of a line take \d+ cycles, and a line of s11639 only 50000: choose a longer line or "
    with pytest.raises(ValueError, match=wanted):
        make_module("OPT_top", OPTICAL_S11639)


@pytest.mark.parametrize("config", [OPTICAL_TCD1304, OPTICAL_S11639, OPTICAL_ERECTED], ids=lambda config: config.name)
def test_angles_come_within_300_cycles_of_the_last_pixel(make_module, config):
    assert make_module("OPT_top", config).latency <= 300


def test_updates_come_once_a_line(make_module):
    """The interval is the line period; and the inputs are samples, of which the core takes the mean."""
    top = make_module("OPT_top", OPTICAL_S11639)
    assert (top.latency, top.interval) == (279, 50_000)
    for module, meaning in (("OPT_top", "m/s^2, a sample"), ("OPT_attitude", "m/s^2, mean over the line period")):
        ports = {port.name: port.meaning for port in make_module(module, OPTICAL_S11639).ports}
        assert ports["in_accx"].endswith(meaning)
    assert make_module("OPT_attitude", OPTICAL_S11639).interval == make_module("OPT_attitude", OPTICAL_S11639).latency


@pytest.mark.parametrize("changes", [{}, {"sensor": "tsl1402", "trigger": "external", "send_every": 3}],
                         ids=["preset", "others"])
@pytest.mark.parametrize("config", [OPTICAL_TCD1304, OPTICAL_S11639], ids=lambda config: config.name)
@pytest.mark.parametrize("module", ["OPT_timing", "OPT_capture", "OPT_buffer", "OPT_spot", "OPT_send"])
def test_signals_have_names(module, config, changes):
    """At most a fifth of the signals in the Verilog have only a number."""
    config = config.replace(**changes)
    text = re.sub(r"//.*", "", verilog_text(make_module(module, config), config))
    names = re.findall(r"^ *(?:wire|reg) *(?:\[[^\]]*\] *)?(\w+)", text, re.MULTILINE)
    assert len(names) >= 10
    assert len([name for name in names if re.fullmatch(r"n\d+", name)]) <= 0.2 * len(names)


@pytest.mark.parametrize("mode", ["streaming", "buffered"])
def test_no_memory_demands_luts(mode):
    """Families without LUT RAM have no mapping for it."""
    config = OPTICAL_TCD1304.replace(mode=mode)
    assert 'ram_style = "distributed"' not in verilog_text(make_module("OPT_top", config), config)


@pytest.mark.verilator
@pytest.mark.parametrize(("every", "distances", "sent", "overruns"), [
    # The sixth update comes while the fifth is being sent.
    (1, (2000, 2000, 2500, 3000, 500, 2000), (0, 1, 2, 3, 4, 6), {5}),
    # A frame takes longer than an update; the updates between do not count as lost.
    (3, (700,) * 9, (0, 3, 6, 9), set())])
def test_frames_hold_what_was_there_when_the_update_was_complete(models, tmp_path, every, distances, sent, overruns):
    config = OPTICAL_S11639.replace(clock_hz=20e6, sensor_clock_hz=2.5e6, baud_rate=5_000_000, send_every=every)
    top = make_module("OPT_send", config)
    path = write_core(top, config, tmp_path, "")
    sender = top.component.sender
    assert f"in the {sender.loading} cycles after it; until then all in_ numbers must hold" in " ".join(
        path.read_text(encoding="utf-8").replace("//", "").split())
    ports = {port.name: port for port in top.ports}
    numbers = [f"in_{quantity.name}" for quantity in OPTICAL_ATTITUDE.quantities]
    model = verilated(path, Interface("OPT_send", ("in_send_en", "in_status", *numbers),
                                      tuple(name for name, port in ports.items() if port.flow.name == "Out"),
                                      reset="rst_n", reset_active=0), models)
    rng = np.random.default_rng(5)
    rises = 20 + np.cumsum((0, *distances))
    cycles = rises[-1] + sender.interval + 20
    stimulus = {name: rng.integers(0, 1 << ports[name].width, cycles) for name in ("in_status", *numbers)}
    stimulus["in_send_en"] = np.zeros(cycles, int)
    for rise in rises:
        # The finish stays; the numbers hold as long as they must.
        stimulus["in_send_en"][rise:rise + 400] = 1
        for name in numbers:
            stimulus[name][rise:rise + sender.loading + 1] = stimulus[name][rise]
    answer = model.stream(stimulus)
    data, starts = received(answer["uart_tx"], sender.divisor)
    assert [int(start) for start in starts[::sender.size]] == [rises[index] + top.latency for index in sent]
    decoder = FrameDecoder(every)
    frames = [*decoder.feed(data), *decoder.finish()]
    assert [frame.number for frame in frames] == list(sent)
    assert (decoder.lost, decoder.crc_errors, decoder.skipped_bytes) == (len(overruns), 0, 0)
    for frame, index in zip(frames, sent, strict=True):
        assert (frame.type, frame.status) == (2, stimulus["in_status"][rises[index]])
        assert frame.values.view(np.uint32).tolist() == [stimulus[name][rises[index]] for name in numbers]
    assert {index for index, rise in enumerate(rises) if answer["out_link_overrun"][rise + 1]} == overruns


@pytest.mark.verilator
def test_outputs_change_together_when_the_finish_rises(models):
    """Angles, status and number of the line; without compensation. The serial line is high but during frames."""
    config = OPTICAL_S11639.replace(sensor="tsl1402", compensation="none", baud_rate=5_000_000)
    top = make_module("OPT_top", config)
    driver = PinDriver(verilog_text(top, config), {"OPT_top": top.ports}, models, sensor="tsl1402", adc="parallel",
                       adc_latency=config.adc_latency, pixels=256, event="uart_tx", event_rises=False)
    pixels, line, lines = np.arange(256), config.timing().line_cycles, 6

    def image(own):
        # The third line has no spot on the roll CCD.
        light = 0 if own.number == 3 and own.ccd == 0 else 2600
        return np.round(150 + light * np.exp(-(pixels - 100 - 5 * own.number) ** 2 / 18)).astype(int)

    words = {"in_n0_r": 127.5, "in_n0_p": 127.5, "in_scale_r": 0.0025, "in_scale_p": 0.0025}
    actions = [(0, port, int(np.float32(value).view(np.uint32))) for port, value in words.items()]
    run = driver.run([*actions, (3, "rst_n", 1), (8, "in_run_en", 1)], image, cycles=(lines + 1) * line)
    finish = run.events["out_attitude_finish"].astype(int)
    begins = 1 + np.flatnonzero(np.diff(finish) > 0)
    assert len(begins) == lines
    for name in (*ANGLES, "out_status", "out_line"):
        assert set((1 + np.flatnonzero(np.diff(run.events[name]))).tolist()) <= set(begins.tolist())
    assert run.events["out_line"][begins].tolist() == [0, 1, 2, 3, 4, 5]
    assert run.events["out_status"][begins].tolist() == [3, 0, 1, 0, 0, 0]
    angles = run.events["out_roll"][begins].astype(np.uint32).view(np.float32)
    assert angles[2] == angles[1] != angles[3]
    # The light of a line is that of the exposure before it.
    assert np.tan(np.radians(angles[3])) == pytest.approx((100 + 5 * 4 - 127.5) * 0.0025, abs=1e-4)


@pytest.mark.verilator
def test_the_whole_with_buffer_trigger_and_the_formulas_of_the_patent(models):
    """A read-out into the line buffer, lines by an external trigger, a frame for three lines."""
    # A pixel takes four cycles, the fewest that there can be.
    config = OPTICAL_S11639.replace(mode="buffered", trigger="external", compensation="patent", send_every=3,
                                    exposure="fixed", exposure_us=120, clock_hz=20e6)
    bench = PinBench(config, models)
    line, lines = bench.timing.line_cycles, 14
    calibration = Calibration(1023.5, 1023.5, 14 / 25_000, 14 / 25_000, k=0.1)
    # Triggers are three line periods apart, then one.
    triggers = [2000 + line * number for number in (0, 3, 6, 7, 8, 9, 10)]
    actions = [action for cycle in triggers for action in ((cycle, "in_trigger", 1), (cycle + 40, "in_trigger", 0))]
    samples = 700 + np.arange(4 * lines) * line // 4
    pixels = np.arange(2048)

    def image(own):
        position = 800 + 40 * own.number + 200 * own.ccd
        return np.round(150 + 2600 * np.exp(-(pixels - position) ** 2 / 18)).astype(int)

    timing = " ".join(paragraph for section in bench.core.component.sections for paragraph in section.paragraphs)
    assert "A trigger may come later, but the equations take this period." in timing
    run = bench.run(lines, image, calibration=calibration.ports(), actions=actions, inertial=Inertial(
        samples, np.tile((0.5, 1.0, -9.8), (len(samples), 1)), np.zeros(len(samples))))
    assert run.pins.violations == []
    assert len(run.cycle) == len(triggers)
    twin, spots = bench.twin(run)
    assert bench.differing_bits(run, twin) == 0
    assert run.status[0] == 3
    assert set(run.status[1:]) == {0}
    seen = [800 + 40 * pair[0].number for pair in run.seen]
    assert np.abs(spots[0].position[1:] / 4096 - seen[1:]).max() < 0.05
    assert np.abs(run.angles["out_roll"] - run.angles["out_roll_measured"]).max() > 0.001
    decoder = FrameDecoder(config.send_every)
    frames = [*decoder.feed(run.pins.bytes), *decoder.finish()]
    assert [frame.number for frame in frames] == [0, 3, 6]
    assert bench.frames_differing(frames, twin) == 0
