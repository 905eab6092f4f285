"""The spot finder: its twin against the plain reference, its circuit against its twin, and directed cases."""

import re

import numpy as np
import pytest

from strapdown.blocks import SENSORS, SpotFinder, Thresholds
from strapdown_sim.reference.optical import spot, thresholds

from .support import run_blocks, stream_of

PIXELS = 256
RESULTS = ("found", "position", "peak", "width", "sum", "saturated", "several", "edge", "black_next", "line_peak",
           "line_saturated")
FINDERS = {"preset": SpotFinder(PIXELS), "short": SpotFinder(70, gap=1, width_max=9)}


def random_lines(rng, count, pixels):
    """Lines of all kinds: noise, single pixels, constant, one to three spots of many widths.

    Every eighth one is noise near full scale; the next one has two equal spots.
    """
    x, lines = np.arange(pixels), np.empty((count, pixels))
    for line in lines:
        kind = rng.integers(6)
        if kind == 0:
            line[:] = rng.integers(0, 4096, pixels)
        elif kind == 1:
            line[:] = rng.integers(90, 110, pixels) + (rng.random(pixels) < 0.02) * rng.integers(0, 4000, pixels)
        elif kind == 2:
            line[:] = rng.integers(0, 4096)
        else:
            line[:] = rng.normal(100, 4, pixels)
            for _ in range(rng.integers(1, 4)):
                middle, sigma = rng.uniform(-5, pixels + 5), rng.choice([1, 3, 8, 20])
                line += rng.uniform(50, 6000) * np.exp(-((x - middle) / sigma)**2 / 2)
    lines[::8] = rng.integers(3960, 4096, lines[::8].shape)
    lines[1::8] = 100
    for begin in 20, 40:
        lines[1::8, begin:begin + 3] = 900, 2000, 700
    return np.clip(lines, 0, 4095).astype(int)


def levels(rng, count):
    """Black level and thresholds of lines; those of every eighth line are near full scale."""
    black, lo = rng.integers(0, 200, count), rng.integers(0, 500, count)
    hi = lo + rng.integers(0, 600, count)
    lo[::8], hi[::8] = 500, 510
    black[::8] += 3400
    return black, lo, hi


@pytest.mark.parametrize("name", FINDERS)
def test_twin_is_the_reference(name):
    finder, rng = FINDERS[name], np.random.default_rng(3)
    lines, (black, lo, hi) = random_lines(rng, 300, finder.line), levels(rng, 300)
    twin = finder.compute(lines, black, lo, hi)
    options = {"gap": 1, "width_max": 9} if name == "short" else {}
    for number, line in enumerate(lines):
        wanted = spot(line, black[number], lo[number], hi[number], **options)
        assert [int(twin[result][number]) for result in RESULTS] == list(map(int, wanted)), number
    assert 0.5 < twin["found"].mean() < 1
    assert twin["several"].mean() > 0.1


@pytest.fixture(scope="module")
def finders(models, tmp_path_factory):
    return run_blocks(models, tmp_path_factory.mktemp("finders"), "finders", **FINDERS)


def circuit(finders, name, lines, black, lo, hi, *, distances, rng, pause=None):
    """Results of the circuit, one row a line, and its answer in every cycle with the cycles of the last pixels."""
    finder = FINDERS[name]
    pause = finder.latency + 1 if pause is None else pause
    valid, packed, ends = stream_of(lines[:, None, :], distances, rng, pause)
    rows = np.searchsorted(ends + pause, np.arange(len(valid)))
    answer = finders(name, pixels_valid=valid, pixels_payload=packed,
                     **{port: np.asarray(values)[rows] for port, values in
                        (("black", black), ("lo", lo), ("hi", hi))})
    return answer, ends


@pytest.mark.verilator
@pytest.mark.parametrize("name", FINDERS)
def test_circuit_is_the_twin_whatever_the_gaps(finders, name):
    finder, rng, count = FINDERS[name], np.random.default_rng(4), 240
    lines, (black, lo, hi) = random_lines(rng, count, finder.line), levels(rng, count)
    distances = rng.integers(1, 1 + rng.choice([1, 2, 6], (count, 1)), (count, finder.line))
    answer, ends = circuit(finders, name, lines, black, lo, hi, distances=distances, rng=rng)
    # The results come after the latency, not earlier, and hold until a line begins.
    assert not answer["finish"][ends + finder.latency - 1].any()
    assert answer["finish"][ends + finder.latency].all()
    twin = finder.compute(lines, black, lo, hi)
    for result in RESULTS:
        np.testing.assert_array_equal(answer[result][ends + finder.latency], twin[result], err_msg=result)
        np.testing.assert_array_equal(answer[result][ends + finder.latency + 1], twin[result], err_msg=result)
    assert finder.latency <= 48


@pytest.mark.verilator
def test_lines_that_are_cut_short(finders):
    """A line that begins too early takes away the one before; one without its last pixel gives no result."""
    finder, rng = FINDERS["preset"], np.random.default_rng(5)
    lines = random_lines(rng, 40, PIXELS)
    level = [np.full(40, value) for value in (100, 40, 80)]
    twin = finder.compute(lines, *level)
    for pause in range(0, finder.latency + 1, 2):
        answer, ends = circuit(finders, "preset", lines, *level, distances=np.ones((40, PIXELS), int), rng=rng,
                               pause=pause)
        seen = np.flatnonzero(np.diff(answer["finish"]) == 1) + 1
        # The next line begins pause + 2 cycles after the last pixel.
        due = ends + finder.latency if pause + 2 >= finder.latency else ends[:0]
        np.testing.assert_array_equal(seen, due[due < len(answer["finish"])])
        for result in RESULTS:
            np.testing.assert_array_equal(answer[result][seen], twin[result][:len(seen)])
    # The first half of a line, then a whole one.
    half, packed, _ = stream_of(lines[:1, None, :PIXELS], np.ones((1, PIXELS), int), rng, 0)
    whole, second, ends = stream_of(lines[1:2, None], np.ones((1, PIXELS), int), rng, finder.latency + 1)
    answer = finders("preset", pixels_valid=np.concatenate((half[:100], whole)),
                     pixels_payload=np.concatenate((packed[:100], second)), black=np.full(100 + len(whole), 100),
                     lo=np.full(100 + len(whole), 40), hi=np.full(100 + len(whole), 80))
    assert np.flatnonzero(answer["finish"])[0] == 100 + ends[0] + finder.latency
    for result in RESULTS:
        assert answer[result][100 + ends[0] + finder.latency] == twin[result][1]


def line_with(*parts, base=100, pixels=2048):
    """A line of a constant, with values from given pixels on."""
    line = np.full(pixels, base)
    for begin, values in parts:
        line[begin:begin + np.size(values)] = values
    return line


CASES = {
    # 100 above the black level of 100, with lo 40 and hi 80. A weight of 60 each.
    "one pixel": (line_with((500, 200)), {"found": 1, "position": 500 << 12, "peak": 100, "width": 1, "sum": 60}),
    "lo does not count": (line_with((500, [140, 200, 140])), {"position": 501 << 12, "width": 1, "sum": 60}),
    "hi is not enough": (line_with((500, 180)), {"found": 0, "position": 0, "peak": 0, "width": 0, "sum": 0}),
    "just above hi": (line_with((500, 181)), {"found": 1, "sum": 41}),
    "half a pixel": (line_with((500, [200, 200])), {"position": (500 << 12) + 2048, "width": 2}),
    "a third, rounded down": (line_with((500, [220, 180])), {"position": (500 << 12) + 4096 // 3, "sum": 120}),
    "four pixels below": (line_with((500, 200), (505, 200)), {"several": 0, "width": 6, "position": 1005 * 2048}),
    "five pixels below": (line_with((500, 200), (506, 200)), {"several": 1, "width": 1, "position": 500 << 12}),
    "two equal ones": (line_with((500, 200), (600, 200)), {"several": 1, "position": 500 << 12}),
    "the second is larger": (line_with((500, 200), (600, 201)), {"several": 1, "position": 600 << 12, "peak": 101}),
    "one that is not valid": (line_with((500, [180] * 50), (600, 200)), {"several": 0, "position": 600 << 12}),
    "first pixel": (line_with((0, 200)), {"edge": 1, "position": 0}),
    "second pixel": (line_with((1, 200)), {"edge": 0, "position": 1 << 12}),
    "last pixel": (line_with((2047, 200)), {"edge": 1, "position": 2047 << 12}),
    "last but one": (line_with((2046, 200)), {"edge": 0, "position": 2046 << 12}),
    "saturated": (line_with((500, [3999, 4000, 4095])), {"saturated": 2, "peak": 3995, "width": 3}),
    "1,023 pixels": (line_with((500, [200] * 1023)), {"width": 1023, "several": 0, "sum": 1023 * 60}),
    "cut at 1,024": (line_with((500, [200] * 1024)), {"found": 0, "width": 0, "sum": 0, "line_peak": 100}),
    "cut, and again": (line_with((500, [200] * 1030)), {"width": 6, "several": 0, "position": 3053 * 2048}),
    "full scale": (line_with((0, [4095] * 2048), base=0), {"found": 0, "line_peak": 3995, "line_saturated": 1}),
    "dark": (line_with(base=90), {"found": 0, "line_peak": 0, "line_saturated": 0}),
    "peak outside of runs": (line_with((9, 130)), {"found": 0, "peak": 0, "line_peak": 30}),
    "darkest block": (line_with((64, [37] * 63 + [101])), {"black_next": (37 * 63 + 101) // 64, "found": 0}),
}


@pytest.mark.parametrize("name", CASES)
def test_directed_cases(name):
    line, wanted = CASES[name]
    found = SpotFinder(2048).compute(line, 100, 40, 80)
    assert {result: int(found[result]) for result in wanted} == wanted


def test_thresholds_are_the_reference():
    peaks = np.arange(4096)
    for lo_min, shift in (40, 2), (25, 3):
        lo, hi = Thresholds(lo_min=lo_min, shift=shift).compute(peaks)
        wanted = [thresholds(peak, lo_min=lo_min, shift=shift) for peak in peaks.tolist()]
        np.testing.assert_array_equal(np.stack((lo, hi), axis=1), wanted)


def test_consecutive_lines():
    """Black level and peak of a line are those of the next one's thresholds."""
    rng = np.random.default_rng(6)
    lines = random_lines(rng, 30, PIXELS)
    tracked = Thresholds().track(FINDERS["preset"], lines)
    black, peak = 0, 0
    for number, line in enumerate(lines):
        lo, hi = thresholds(peak)
        wanted = spot(line, black, lo, hi)
        assert [int(tracked[result][number]) for result in RESULTS] == list(map(int, wanted))
        assert [int(tracked[name][number]) for name in ("black", "lo", "hi", "known")] == [black, lo, hi, number > 0]
        black, peak = wanted.black, wanted.line_peak


@pytest.mark.parametrize(("options", "message"), [
    ({"pixels": 63}, "pixels must be from 64 to 4095, not 63"),
    ({"pixels": 4096}, "pixels must be from 64 to 4095, not 4096"),
    ({"pixels": 256, "gap": 0}, "gap must be from 1 to 63, not 0"),
    ({"pixels": 256, "width_max": 1025}, "width_max must be from 2 to 1024, not 1025"),
])
def test_refuses_parameters(options, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        SpotFinder(**options)


def test_refuses_lines_of_another_length():
    with pytest.raises(ValueError, match=r"^a line must have 256 pixels, not 255$"):
        FINDERS["preset"].compute(np.zeros((2, 255)), 0, 0, 0)


def test_fits_all_sensors():
    for sensor in SENSORS.values():
        assert SpotFinder(sensor.pixels).line == sensor.pixels
