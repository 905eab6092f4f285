"""Timing of the line sensors: the cycles of the data sheets' tables, and what the pins do, in Verilator."""

import re
from dataclasses import replace

import numpy as np
import pytest

from strapdown.blocks import SENSORS, LineTiming

from .support import edges, run_blocks

CLOCK_HZ = 100e6
# The sensors with few pixels, so that a line is short.
SMALL = {"tcd1304": replace(SENSORS["tcd1304"], pixels=64, slots=110, line_clocks=480, line_clocks_min=456),
         "s11639": replace(SENSORS["s11639"], pixels=64, slots=154, line_clocks=300, line_clocks_min=160),
         "tsl1402": replace(SENSORS["tsl1402"], pixels=64, slots=65, line_clocks=200, line_clocks_min=65)}
TIMINGS = {name: LineTiming(sensor, clock_hz=CLOCK_HZ) for name, sensor in SMALL.items()} | {
    "external": LineTiming(SMALL["s11639"], clock_hz=CLOCK_HZ, trigger="external"),
    # 12.5 cycles a half of the clock.
    "fast": LineTiming(SMALL["tcd1304"], clock_hz=CLOCK_HZ, sensor_clock_hz=4e6, line_clocks=516)}


@pytest.mark.parametrize(("name", "events"), [
    ("tcd1304", {"ICG falls": 0, "SH rises": 50, "SH falls": 250, "ICG rises": 755, "first pixel": 755 + 32 * 200,
                 "first sample": 755 + 32 * 200 + 170, "last sample": 755 + (32 + 3647) * 200 + 170,
                 "read out ends": 755 + 3694 * 200, "next line": 740_000}),
    ("s11639", {"ST falls": 10, "exposure ends": 10 + 48 * 20, "first pixel": 88 * 20, "next line": 50_000}),
    ("tsl1402", {"ST falls": 10, "first pixel": 0, "read out ends": 257 * 20, "next line": 20_000}),
])
def test_presets_have_the_cycles_of_the_data_sheets(name, events):
    timing = LineTiming(SENSORS[name], clock_hz=CLOCK_HZ)
    assert {event: timing.events[event] for event in events} == events


def test_presets():
    timing = {name: LineTiming(sensor, clock_hz=CLOCK_HZ) for name, sensor in SENSORS.items()}
    assert {name: one.sample_at for name, one in timing.items()} == {"tcd1304": 170, "s11639": 18, "tsl1402": 18}
    assert {name: one.slot_cycles for name, one in timing.items()} == {"tcd1304": 200, "s11639": 20, "tsl1402": 20}
    # 10 us; 6 clocks of ST and 48 more; the line without 18 clocks.
    assert timing["tcd1304"].exposure_range[0] == 1120
    assert timing["s11639"].exposure_range == (54 * 20, (2500 - 100 + 48) * 20)
    assert timing["tsl1402"].exposure_range == ((1000 - 18) * 20,) * 2


@pytest.fixture(scope="module")
def timings(models, tmp_path_factory):
    return run_blocks(models, tmp_path_factory.mktemp("timings"), "timings", **TIMINGS)


def answer_of(timings, name, lines, exposure, *, stop=None, **inputs):
    """Outputs of a timing, over some lines; exposures of both sensors, one row a line."""
    timing = TIMINGS[name]
    count = int((lines + 1) * timing.line_cycles)
    row = np.minimum(np.arange(count) // timing.line_cycles, len(exposure) - 1)
    run = np.ones(count, dtype=int)
    run[stop:] = 0 if stop else 1
    return timings(name, run=run, exposure=np.asarray(exposure)[row] @ [1, 1 << 24], **inputs)


def exposures_of(name, answer):
    """Begin and end of each exposure of each sensor, from the pins, as the data sheets define them."""
    timing = TIMINGS[name]
    for ccd in range(2):
        if "ccd_sh" in answer:
            _, falls = edges(answer["ccd_sh"] >> ccd & 1)
            icg_falls, icg_rises = edges(1 - answer["ccd_icg"])
            # The fall while ICG is low, and the one before it.
            low = list(zip(icg_falls, icg_rises, strict=False))
            ends = [fall for fall in falls if any(begin < fall < end for begin, end in low)]
            yield [falls[falls < end][-1] for end in ends], ends
        else:
            rises, falls = edges(answer["ccd_st"] >> ccd & 1)
            if timing.sensor.shutter:
                yield rises[:len(falls)], falls + 48 * timing.clock_cycles
            else:
                # The rise of SI ends an exposure, and the next one begins 18 clocks later.
                yield rises[:-1] + 18 * timing.clock_cycles, rises[1:]


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["tcd1304", "fast", "s11639", "tsl1402"])
def test_exposures_and_samples(timings, name):
    timing, rng, lines = TIMINGS[name], np.random.default_rng(7), 24
    least, most = timing.exposure_range
    asked = rng.integers(0, most + most // 4 + 1000, (lines + 2, 2))
    asked[:4] = [(0, 1 << 23), (least, most), (least - 1, most + 1), (least + timing.exposure_step - 1, most - 1)]
    answer = answer_of(timings, name, lines, asked)
    first, _ = edges(answer["first"])
    assert len(first) >= lines - 1
    # The same distance from line to line, and from pixel to pixel.
    samples = np.flatnonzero(answer["sample"])[:len(first) * timing.sensor.pixels]
    wanted = first[:, None] + timing.slot_cycles * np.arange(timing.sensor.pixels)
    np.testing.assert_array_equal(np.diff(first), timing.line_cycles)
    np.testing.assert_array_equal(samples[:wanted[:-1].size], wanted[:-1].ravel())
    assert (answer["pixel_index"][wanted[:-1]] == np.arange(timing.sensor.pixels)).all()
    np.testing.assert_array_equal(np.flatnonzero(answer["last"])[:len(first) - 1], wanted[:-1, -1])

    guard_edges = np.concatenate([np.concatenate(edges(answer[pin] >> ccd & 1)) for ccd in range(2)
                                  for pin in ("ccd_sh", "ccd_st") if pin in answer])
    # The pin of the ADC moves one cycle after ``sample``.
    following = np.searchsorted(samples + 1, guard_edges)
    near = following < len(samples)
    assert (samples[following[near]] + 1 - guard_edges[near]).min() >= timing.guard
    assert not np.isin(guard_edges, samples + 1).any()

    effective = np.stack([answer["effective"] & 0xFFFFFF, answer["effective"] >> 24], axis=1)[first]
    for ccd, (begins, ends) in enumerate(exposures_of(name, answer)):
        lengths = np.subtract(ends, begins[:len(ends)])
        np.testing.assert_array_equal(lengths[:len(first)], effective[:len(lengths), ccd])
        rises, falls = edges(answer["exposing"] >> ccd & 1)
        np.testing.assert_array_equal(rises[:len(ends)], begins[:len(ends)])
        np.testing.assert_array_equal(falls[:len(ends)], ends[:len(falls)])
        if ccd == 0:
            middle = np.flatnonzero(answer["middle"])[:len(ends)]
            assert (np.abs(2 * middle - begins[:len(middle)] - ends[:len(middle)]) <= 1).all()
    # The next shorter exposure of the grid, within the range.
    taken = asked[:len(effective)]
    if timing.sensor.shutter:
        exact = np.clip(taken, least, most)
        assert (exact - effective >= 0).all()
        assert (exact - effective < timing.exposure_step).all()
        assert ((effective - least) % timing.exposure_step == 0).all()
    else:
        assert (effective == least).all()


@pytest.mark.verilator
def test_pins_of_a_ccd(timings):
    """The rules of the TCD1304's data sheet, from the edges of the pins."""
    timing = TIMINGS["tcd1304"]
    answer = answer_of(timings, "tcd1304", 6, [(30_000, 5_000)] * 8)
    down, up = edges(1 - answer["ccd_icg"])
    rises, falls = edges(answer["ccd_clk"])
    # The first rise was before the first cycle.
    np.testing.assert_array_equal(np.diff(rises[1:]), 50)
    np.testing.assert_array_equal(falls[1:] - rises[1:len(falls)], 25)
    np.testing.assert_array_equal(up - down[:len(up)], 755)
    np.testing.assert_array_equal(answer["ccd_clk"][up], 1)
    assert np.isin(down, rises).all()
    for ccd in range(2):
        rise, fall = edges(answer["ccd_sh"] >> ccd & 1)
        np.testing.assert_array_equal(fall - rise[:len(fall)], 200)
        while_low = [(begin - low, end - low) for begin, end in zip(rise, fall, strict=False) for low in down
                     if low <= begin < low + 755]
        assert while_low == [(50, 250)] * len(up)
        # Nine pulses a line, 10 us apart, before each transfer.
        before = rise[rise < down[0]]
        np.testing.assert_array_equal(np.diff(before), [1000] * 8)
    first, _ = edges(answer["first"])
    np.testing.assert_array_equal(first + 1 - down[:len(first)], timing.events["first sample"])


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["tcd1304", "s11639", "tsl1402"])
def test_a_line_ends_before_it_stops(timings, name):
    timing = TIMINGS[name]
    stop = int(2.4 * timing.line_cycles)
    answer = answer_of(timings, name, 6, [timing.exposure_range] * 8, stop=stop)
    assert answer["first"].sum() == answer["last"].sum() == answer["middle"].sum() == 3
    assert answer["sample"].sum() == 3 * timing.sensor.pixels
    rest = slice(int(4.3 * timing.line_cycles), None)
    for pin, level in (("ccd_sh", 0), ("ccd_icg", 1), ("ccd_st", 0), ("exposing", 0)):
        if pin in answer:
            assert (answer[pin][rest] == level).all()
    # The sensor's clock goes on.
    np.testing.assert_array_equal(np.diff(edges(answer["ccd_clk"])[0][1:]), timing.clock_cycles)


@pytest.mark.verilator
def test_external_trigger(timings):
    timing = TIMINGS["external"]
    line = timing.line_cycles
    trigger = np.zeros(12 * line, dtype=int)
    # One alone; then one during a line, taken at its end, and a second one that is remembered no more.
    for begin in (1000, 5 * line, 5 * line + 500, 5 * line + 900):
        trigger[begin:begin + 100] = 1
    trigger[9 * line:] = 1
    answer = timings("external", run=np.ones(len(trigger), dtype=int), trigger=trigger,
                     exposure=np.full(len(trigger), 3000 * (1 + (1 << 24))))
    first, _ = edges(answer["first"])
    assert len(first) == 4
    # An exposure ends one line after its trigger, late by at most three slots.
    ends = exposures_of("external", answer).__next__()[1]
    late = ends[[0, 1, 3]] - timing.events["exposure ends"] - line - np.array([1000, 5 * line, 9 * line])
    assert (late >= 0).all()
    assert (late <= 3 * timing.slot_cycles).all()
    assert ends[2] - ends[1] == line


def test_refuses_an_edge_of_icg_while_the_clock_is_low():
    late = replace(SENSORS["tcd1304"], icg_in_clock_s=250e-9)
    with pytest.raises(ValueError, match=r"^ICG of tcd1304 must rise while the sensor's clock is high, which it is for "
                                         r"25 cycles, not 25 cycles after it has risen$"):
        LineTiming(late, clock_hz=CLOCK_HZ)


@pytest.mark.parametrize("clock_hz", [5e6, 12e6, 16e6, 27e6, 50e6, 125e6])
@pytest.mark.parametrize("sensor_clock_hz", [1e6, 4e6])
def test_clocks(clock_hz, sensor_clock_hz):
    """The rules of the TCD1304 in seconds, with other clocks."""
    if clock_hz / sensor_clock_hz < 4 or clock_hz % sensor_clock_hz:
        return
    timing = LineTiming(SENSORS["tcd1304"], clock_hz=clock_hz, sensor_clock_hz=sensor_clock_hz, line_clocks=14_900)
    events = {name: cycle / clock_hz for name, cycle in timing.events.items()}
    assert 100e-9 <= events["SH rises"] <= 1000e-9
    assert events["SH falls"] - events["SH rises"] >= 1e-6
    assert events["ICG rises"] - events["SH falls"] >= 1e-6
    assert 0 < events["ICG rises"] % (1 / sensor_clock_hz) < 0.5 / sensor_clock_hz
    assert timing.exposure_range[0] / clock_hz >= 10e-6


@pytest.mark.parametrize("name", SENSORS)
def test_preset_of_the_sample_suits_every_clock(name):
    """It follows the settling of the video, and an edge of ST by 20 ns; a clock that leaves no cycle is refused."""
    sensor, refused = SENSORS[name], set()
    for mhz in range(1, 101):
        for ratio in range(4, 101):
            if not sensor.clock_hz_min <= mhz * 1e6 / ratio <= sensor.clock_hz_max:
                continue
            try:
                timing = LineTiming(sensor, clock_hz=mhz * 1e6, sensor_clock_hz=mhz * 1e6 / ratio,
                                    line_clocks=max(sensor.line_clocks, 16_000))
            except ValueError as error:
                refused.add((mhz, ratio, str(error).split(" in ")[0]))
                continue
            assert sensor.settle_s * mhz * 1e6 - 1e-6 <= timing.sample_at < timing.slot_cycles
            assert timing.guard / mhz >= 0.02
    # The TSL1402 settles in 120 ns: the last cycle of a pixel comes earlier.
    assert refused == {(mhz, ratio, "the video of tsl1402 settles") for mhz in range(1, 101) for ratio in range(4, 101)
                       if name == "tsl1402" and mhz / ratio <= 8 and (ratio - 1) / mhz < 0.12 - 1e-9}


@pytest.mark.parametrize(("sensor", "options", "message"), [
    ("tcd1304", {"sensor_clock_hz": 5e6}, "the clock of tcd1304 must be from 0.8 to 4 MHz, not 5 MHz"),
    ("tcd1304", {"sensor_clock_hz": 3e6},
     "the clock must be a whole multiple of the sensor's 3 MHz, 4 times or more, not 100 MHz"),
    ("tcd1304", {"trigger": "none"}, "trigger must be internal or external, not 'none'"),
    ("tcd1304", {"line_clocks": 14_788}, "a line of tcd1304 takes 14792 clocks of the sensor or more, not 14788"),
    ("tcd1304", {"line_clocks": 14_802}, "a line of tcd1304 must be a multiple of 4 clocks of the sensor, not 14802"),
    ("tcd1304", {"sample_at": 200}, "sample_at must be within the pixel, after the 500 ns in which the video settles, "
                                    "from 50 to 199 cycles, not 200"),
    ("s11639", {"sample_at": 5}, "sample_at must be within the pixel, after the 60 ns in which the video settles, "
                                 "from 6 to 19 cycles, not 5"),
    ("s11639", {"sample_at": 11},
     "sample_at must not be 11: there may be an edge of ST 1 cycles before the sample"),
    ("s11639", {"line_clocks": 2_144}, "a line of s11639 takes 2145 clocks of the sensor or more, not 2144"),
    ("s11639", {"line_clocks": 838_861},
     "a line of s11639 must take less than 16777216 cycles, not 16777220"),
    ("tsl1402", {"line_clocks": 356}, "a line of tsl1402 takes 357 clocks of the sensor or more, not 356"),
    ("tcd1304", {"exposure_s": (5e-6, None)},
     "the exposure of tcd1304 must be from 11.2 to 7311.2 us in this line, not from 5 to 7311.2 us"),
    ("s11639", {"exposure_s": (None, 1e-3)},
     "the exposure of s11639 must be from 10.8 to 489.6 us in this line, not from 10.8 to 1000 us"),
])
def test_refuses_what_a_sensor_cannot(sensor, options, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        LineTiming(SENSORS[sensor], clock_hz=CLOCK_HZ, **options)
