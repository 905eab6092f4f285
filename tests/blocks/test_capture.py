"""From the ADC to stored lines, thresholds and exposure, in Verilator."""

import re

import numpy as np
import pytest

from strapdown.blocks import ExposureControl, LineBuffer, ParallelAdc, SpiAdc, Thresholds
from strapdown_sim.reference.optical import next_exposure

from .support import edges, payload, run_blocks, stream_of

CLOCK_HZ = 100e6
BLOCKS = {
    "spi": SpiAdc(clock_hz=CLOCK_HZ, slot_cycles=200, invert=True),
    "slow": SpiAdc(clock_hz=CLOCK_HZ, slot_cycles=121, sclk_hz=15e6),
    **{f"parallel{latency}": ParallelAdc(adc_latency=latency, slot_cycles=slot, invert=invert)
       for latency, slot, invert in ((1, 20, False), (7, 10, True), (16, 2, False))},
    "buffer": LineBuffer(70), "thresholds": Thresholds(), "rough": Thresholds(lo_min=25, shift=3),
    "exposure": ExposureControl(least=1000, most=700_000, start=20_000),
    "fixed": ExposureControl(least=1000, most=700_000, start=20_000, fixed=True)}


@pytest.fixture(scope="module")
def blocks(models, tmp_path_factory):
    return run_blocks(models, tmp_path_factory.mktemp("capture"), "capture", **BLOCKS)


def sample_inputs(rng, starts, length):
    """``sample`` at some cycles, with marks that are noise elsewhere."""
    inputs = {"sample": np.zeros(length, int), "first": rng.integers(0, 2, length), "last": rng.integers(0, 2, length)}
    inputs["sample"][starts] = 1
    return inputs


def check_stream(answer, times, inputs, starts, pixels):
    """The stream has exactly these pixels, at these times, with the marks of their samples."""
    np.testing.assert_array_equal(np.flatnonzero(answer["pixels_valid"]), times)
    wanted = payload(inputs["first"][starts], inputs["last"][starts], *pixels)
    np.testing.assert_array_equal(answer["pixels_payload"][times], wanted)


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["spi", "slow"])
def test_serial_converters(blocks, name):
    """Two converters that follow the edges of the pins as the AD7476A's data sheet says."""
    adc, rng, count = BLOCKS[name], np.random.default_rng(8), 30
    slot = 200 if name == "spi" else 121
    starts = 5 + np.cumsum(slot + rng.choice([0, 0, 7], count))
    length = starts[-1] + 2 * slot
    inputs = sample_inputs(rng, starts, length)
    words = rng.integers(0, 4096, (2, count))
    words[:, :2] = [[0, 4095], [4095, 0]]
    # The pins do not depend on the data. First without it, to know the falls of SCLK.
    pins = blocks(name, **inputs, sdata=np.zeros(length, int))
    cs_falls, cs_rises = edges(1 - pins["cs_n"])
    np.testing.assert_array_equal(cs_falls, starts + 1)
    sclk_rises, sclk_falls = edges(pins["sclk"])
    sclk_rises = sclk_rises[sclk_rises > 0]
    assert len(sclk_falls) == 16 * count
    falls = sclk_falls.reshape(count, 16)
    period = adc.sclk_cycles
    np.testing.assert_array_equal(np.diff(falls, axis=1), period)
    assert period * 1e9 / CLOCK_HZ >= 1e9 / 20e6
    lows = sclk_rises - sclk_falls
    assert lows.min() >= 2
    assert (period - lows.max()) >= 2
    assert (falls[:, 0] - cs_falls >= 1).all()
    assert (cs_rises >= falls[:, -1]).all()
    assert (cs_falls[1:] - np.maximum(falls[:-1, -1], cs_rises[:-1]) >= 5).all()

    # After each fall the next bit comes late, 40 ns after it; until then the pin has noise.
    sdata = rng.integers(0, 4, length)
    for conversion in range(count):
        for ccd in range(2):
            bits = [int(bit) for bit in f"{words[ccd, conversion]:016b}"]
            before = np.concatenate(([cs_falls[conversion]], falls[conversion, :-1] + 4))
            for bit, begin, end in zip(bits, before, falls[conversion], strict=True):
                sdata[begin:end] = sdata[begin:end] & ~(1 << ccd) | bit << ccd
    answer = blocks(name, **inputs, sdata=sdata)
    pixels = 4095 - words if name == "spi" else words
    check_stream(answer, starts + adc.latency, inputs, starts, pixels)
    np.testing.assert_array_equal(adc.compute(words), pixels)


@pytest.mark.verilator
@pytest.mark.parametrize(("name", "latency", "slot"), [("parallel1", 1, 20), ("parallel7", 7, 10),
                                                       ("parallel16", 16, 2)])
def test_parallel_converters(blocks, name, latency, slot):
    """Two pipelines that move with the edges of the clock pin."""
    adc, rng = BLOCKS[name], np.random.default_rng(9)
    starts = 7 + slot * np.concatenate([np.arange(30), 50 + np.arange(30)])
    length = starts[-1] + (latency + 3) * slot
    inputs = sample_inputs(rng, starts, length)
    rises, falls = edges(blocks(name, **inputs)["adc_clk"])
    np.testing.assert_array_equal(rises, np.arange(starts[0] + 1, rises[-1] + 1, slot))
    np.testing.assert_array_equal(falls - rises[:len(falls)], slot // 2)
    assert np.isin(starts + 1, rises).all()

    # The word of each edge is there just before the edge ``latency`` later, and at no other time.
    words = rng.integers(0, 4096, (len(rises), 2))
    data = rng.integers(0, 1 << 24, length)
    for edge in range(latency, len(rises)):
        data[rises[edge] - 1] = words[edge - latency] @ [1, 1 << 12]
    answer = blocks(name, **inputs, data=data)
    own = words[np.searchsorted(rises, starts + 1)].T
    check_stream(answer, starts + adc.latency, inputs, starts, adc.compute(own))
    np.testing.assert_array_equal(adc.compute(own), 4095 - own if name == "parallel7" else own)


@pytest.mark.verilator
def test_line_buffer(blocks):
    buffer, rng, count, pixels = BLOCKS["buffer"], np.random.default_rng(10), 12, 70
    lines = rng.integers(0, 4096, (count, 2, pixels))
    distances = rng.integers(1, 1 + rng.choice([1, 3], (count, 1)), (count, pixels))
    distances[:, 0] = rng.integers(1, 100, count)
    valid, packed, ends = stream_of(lines, distances, rng, 0)
    # Pixels of a line that is given up, and then a whole one.
    valid, packed = (np.concatenate((values[:40], values, np.zeros(250, int))) for values in (valid, packed))
    ends = ends + 40
    index, ccd = rng.integers(0, pixels, len(valid)), rng.integers(0, 2, len(valid))
    answer = blocks("buffer", pixels_valid=valid, pixels_payload=packed, read_index=index, read_ccd=ccd)
    times = ends[:, None] + 2 + np.arange(pixels)
    assert times[0, -1] == ends[0] + buffer.latency
    np.testing.assert_array_equal(np.flatnonzero(answer["stored_valid"]), times.ravel())
    number = np.arange(pixels)
    for line, own in zip(lines, times, strict=True):
        wanted = payload((number == 0).astype(int), (number == pixels - 1).astype(int), *line)
        np.testing.assert_array_equal(answer["stored_payload"][own], wanted)
    ready = np.flatnonzero(answer["line_ready"][:-1])
    assert len(ready) > 150
    line = np.searchsorted(ends, ready) - 1
    np.testing.assert_array_equal(answer["read_pixel"][ready + 1], lines[line, ccd[ready], index[ready]])
    np.testing.assert_array_equal(answer["bank"][ready], (line + 1) % 2)
    rises, falls = edges(answer["line_ready"])
    np.testing.assert_array_equal(falls, ends[np.searchsorted(ends, falls) - 1] + 1)
    np.testing.assert_array_equal(rises, ends[np.searchsorted(ends, rises) - 1] + buffer.latency)


@pytest.mark.verilator
@pytest.mark.parametrize("name", ["thresholds", "rough"])
def test_thresholds(blocks, name):
    block, rng, count = BLOCKS[name], np.random.default_rng(11), 1000
    peak, black = rng.integers(0, 4096, count), rng.integers(0, 4096, count)
    peak[:4] = 0, 4095, 160, 163
    update = (rng.random(count) < 0.3).astype(int)
    answer = blocks(name, update=update, peak=peak, black_next=black)
    lo, hi = block.compute(peak)
    start = block.compute(0)
    rows = np.flatnonzero(update[:-3])
    last = rows[np.searchsorted(rows, np.arange(rows[0], count - 3), side="right") - 1]
    cycles = np.arange(rows[0], count - 3)
    for port, values in ("lo", lo), ("black", black):
        np.testing.assert_array_equal(answer[port][cycles + 1], values[last])
    np.testing.assert_array_equal(answer["hi"][cycles + 2], hi[last])
    np.testing.assert_array_equal(answer["known"], (np.arange(count) > rows[0]).astype(int))
    before = slice(0, rows[0] + 1)
    for port, value in ("lo", start[0]), ("hi", start[1]), ("black", 0):
        assert (answer[port][before] == value).all()


def test_exposure_law_is_the_reference():
    control, rng = BLOCKS["exposure"], np.random.default_rng(12)
    exposure, peak = rng.integers(1000, 700_001, 5000), rng.integers(0, 4096, 5000)
    saturated = rng.integers(0, 3, 5000) // 2
    wanted = [next_exposure(*row, 1000, 700_000) for row in zip(*(values.tolist() for values in (
        exposure, peak, saturated)), strict=True)]
    np.testing.assert_array_equal(control.compute(exposure, peak, saturated), wanted)
    np.testing.assert_array_equal(BLOCKS["fixed"].compute(exposure, peak, saturated), exposure)


@pytest.mark.verilator
def test_exposure_control(blocks):
    control, rng, count = BLOCKS["exposure"], np.random.default_rng(13), 4000
    peak = rng.choice([0, 649, 650, 1999, 2000, 3200, 3201, 4095], count)
    saturated = rng.choice([0, 0, 0, 1], count)
    # Runs of the same peak reach both ends of the range.
    peak[1000:1200], saturated[1000:1400], peak[1200:1400] = 0, 0, 4095
    update = np.zeros(count, int)
    update[::4] = 1
    answer = blocks("exposure", update=update, peak=np.repeat(peak[::4], 4), saturated=np.repeat(saturated[::4], 4))
    exposure, seen = 20_000, set()
    for begin in range(0, count, 4):
        assert answer["exposure"][begin] == answer["exposure"][begin + 1] == exposure
        exposure = int(control.compute(exposure, peak[begin], saturated[begin]))
        assert answer["exposure"][begin + 2] == answer["exposure"][begin + 3] == exposure
        seen.add(exposure)
    assert {1000, 700_000} <= seen
    assert (blocks("fixed", update=update, peak=peak)["exposure"] == 20_000).all()


@pytest.mark.parametrize("factor", [1 / 40, 1 / 7, 1, 7, 40])
def test_exposure_settles(factor):
    """From 1/40 to 40 times the right exposure, the line's peak is in range after 8 lines and stays there.

    A line shows the exposure that was set before the line before it: the exposure of a line begins while the one before
    is read.
    """
    control = ExposureControl(least=100, most=700_000, start=int(17_000 * factor))
    exposures = [int(17_000 * factor)] * 2
    for _ in range(40):
        light = 2600 * exposures[-2] / 17_000
        exposures.append(int(control.compute(exposures[-1], min(light, 4095), light > 4000)))
    peaks = 2600 * np.array(exposures) / 17_000
    assert ((peaks[8:] > 650) & (peaks[8:] < 4000)).all()
    assert ((peaks[16:] >= 2000) & (peaks[16:] <= 3200)).all()


@pytest.mark.parametrize(("make", "options", "message"), [
    (SpiAdc, {"clock_hz": 1e8, "slot_cycles": 200, "sclk_hz": 25e6},
     "SCLK of the ADC must be up to 20 MHz, not 25 MHz"),
    (SpiAdc, {"clock_hz": 1e8, "slot_cycles": 20},
     "a conversion of the ADC takes 100 cycles, longer than a pixel of 20"),
    (SpiAdc, {"clock_hz": 1e8, "slot_cycles": 200, "sclk_hz": 5e6},
     "a conversion of the ADC takes 335 cycles, longer than a pixel of 200"),
    (ParallelAdc, {"adc_latency": 0, "slot_cycles": 20}, "latency of the ADC must be from 1 to 16 clocks, not 0"),
    (ParallelAdc, {"adc_latency": 1, "slot_cycles": 1}, "a clock of the ADC takes 2 cycles or more, not 1"),
    (LineBuffer, {"pixels": 1}, "pixels must be from 2 to 4096, not 1"),
    (Thresholds, {"lo_min": 0}, "lo_min must be from 1 to 1023, not 0"),
    (Thresholds, {"shift": 12}, "shift must be from 1 to 11, not 12"),
    (ExposureControl, {"least": 7, "most": 100, "start": 50}, "exposures must be from 8 to 16777215 cycles, "
                                                              "not from 7 to 100"),
    (ExposureControl, {"least": 10, "most": 100, "start": 101}, "exposure must start within 10 and 100 cycles, "
                                                                "not at 101"),
])
def test_refuses_parameters(make, options, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        make(**options)
