"""OPT_top from the pins of sensors and ADCs to the serial line, in Verilator: good lines, and what may go wrong."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.blocks import SENSORS
from strapdown.cores import CONFIGS
from strapdown.link import frame_size
from strapdown_sim.drivers.optical import Inertial, PinBench
from strapdown_sim.instrument.calibration import Calibration
from strapdown_sim.instrument.flights import FLIGHTS
from strapdown_sim.instrument.image import LineCamera
from strapdown_sim.optical import flight_scene, judged, scene_source

pytestmark = pytest.mark.verilator


@pytest.fixture(scope="session")
def bench(models):
    """Benches, each made once."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = PinBench(CONFIGS[name], models)
        return made[name]

    return get


def inertial(bench, lines, f_b=(0.0, 0.0, -9.80665), yaw_rate=0.0, each=3):
    """Equal samples, ``each`` of them in a line period."""
    cycle = 1000 + np.arange(each * (lines + 1)) * bench.timing.line_cycles // each
    return Inertial(cycle, np.tile(np.array(f_b, float), (len(cycle), 1)), np.full(len(cycle), yaw_rate))


# Good lines.

@pytest.mark.parametrize(("name", "lines", "position_px"), [("optical_s11639", 200, 0.05), ("optical_tcd1304", 3, 0.1)])
def test_flight_from_the_pins(bench, name, lines, position_px):
    bench = bench(name)
    config, sensor = bench.config, SENSORS[bench.config.sensor]
    scene = flight_scene(FLIGHTS["f"], config, lines, seed=3)
    line = bench.timing.line_cycles
    cycle = 500 + np.arange(4 * (lines + 1)) * line // 4
    motion = scene.flight.at(cycle / config.clock_hz)
    run = bench.run(lines, scene.image, calibration=scene.calibration.ports(),
                    inertial=Inertial(cycle, motion.f_b, motion.yaw_rate))
    assert run.pins.violations == []
    assert len(run.cycle) == lines
    assert list(run.line) == list(range(lines))
    # Every sample is that of its pixel, and the words are the light.
    assert (run.pins.slots == sensor.lead + np.arange(sensor.pixels)).all()
    for ccd, light in enumerate(run.light):
        for row, pair in zip(light, run.seen, strict=True):
            assert np.array_equal(row, pair[ccd].image)
    # Angles come at equal distances, after each last sample.
    assert set(np.diff(run.cycle)) == {line}
    # All bits are those of the twin, at the ports and in the frames.
    found = judged(scene_source("", scene), bench, run)
    assert (found.differing_bits, found.frames_differing) == (0, 0)
    # The run ends within the last frame.
    assert (found.decoder.lost, found.decoder.crc_errors) == (0, 0)
    assert found.decoder.skipped_bytes < frame_size(36)
    assert lines - 1 <= len(found.frames) <= lines
    # Only the first line has no spot. Positions and angles are those of the rays.
    assert run.status.tolist() == [3] + [0] * (lines - 1)
    for error in found.position_error_px:
        assert len(error) == lines - 1
        assert np.sqrt(np.mean(error ** 2)) <= position_px
    for part, largest in (("arithmetic", 0.0005), ("equations", 0.005), ("total", 0.01)):
        assert np.abs(found.parts[part]).max() <= largest, part
    # The strobe comes in the middle of the roll sensor's exposure, within a clock of the sensor.
    middles = np.array([own.middle_s * config.clock_hz for own in run.pins.lines[0]])
    assert np.abs(run.pins.middles[:len(middles)] - middles).max() <= bench.timing.clock_cycles


# Bad input. The light of each line is chosen; between two faults there are good lines.

SENSOR = SENSORS["s11639"]
MIDDLE = (SENSOR.pixels - 1) / 2
CALIBRATION = Calibration(MIDDLE, MIDDLE, 14 / 25_000, 14 / 25_000, k=8e-4)


class Studio:
    """Light at fixed positions; ``faults`` maps ranges of lines to changes of the roll sensor's camera.

    ``position`` is the position on the roll sensor; a change ``light`` multiplies the light of both sensors.
    """

    def __init__(self, faults, *, exposure_s=50e-6):
        self.camera = LineCamera(SENSOR.pixels, sigma_px=4.6, exposure_s=exposure_s, seed=5)
        self.faults = faults

    def __call__(self, line):
        changes = next((dict(changes) for lines, changes in self.faults.items() if line.number in lines), {})
        light, position = changes.pop("light", 1.0), changes.pop("position", 900.25)
        if line.ccd == 1:
            changes, position = {}, 1200.5
        camera = replace(self.camera, peak=self.camera.peak * light, seed=5 + 2 * line.number + line.ccd, **changes)
        return camera.charge(position, line.exposure_s)


def flags(run, name, rows):
    """A status bit in some updates: the set of its values."""
    return set(run.flag(name)[list(rows)].tolist())


def run_of(bench, lines, light, actions=(), samples=None):
    """A run of OPT_top with the S11639. Without faults between the pins, its bits must be those of the twin."""
    run = bench.run(lines, light, calibration=CALIBRATION.ports(), actions=actions,
                    inertial=inertial(bench, lines) if samples is None else samples)
    assert run.pins.violations == []
    return run


def test_light_that_is_not_good(bench):
    """Each fault has its status bit; in good lines all bits are low, after the exposure has settled again."""
    bench = bench("optical_s11639")
    lost, ghost_near, ghost_far, two = range(10, 110), range(120, 124), range(128, 132), range(136, 140)
    edge, ambient, gradient, bright = range(144, 148), range(152, 166), range(176, 182), range(186, 198)
    dark = range(210, 214)
    faults = {lost: {"laser": False}, ghost_near: {"ghost": 0.2, "ghost_px": 40.0},
              ghost_far: {"ghost": 0.2, "ghost_px": 150.0}, two: {"ghost": 0.9, "ghost_px": -300.0},
              edge: {"position": 1.5}, ambient: {"ambient": 0.3}, gradient: {"gradient": 0.1}, bright: {"light": 8.0},
              dark: {"light": 0.0}}
    run = run_of(bench, 226, Studio(faults, exposure_s=100e-6))
    twin, (roll, _) = bench.twin(run)
    assert bench.differing_bits(run, twin) == 0
    # No spot: its bit, the last good position, and the other sensor goes on.
    assert flags(run, "roll_missing", lost) == {True}
    assert set(roll.position[list(lost)]) == {roll.position[9]}
    assert flags(run, "pitch_missing", range(1, bright[0])) == {False}
    assert abs(roll.position[118] / 4096 - 900.25) < 0.1
    # The rotor still follows the accelerometer: its axis turns about f by k·g.
    tilt = run.angles["out_pitch"].astype(float) - run.angles["out_pitch_measured"]
    across = 9.80665 * np.sin(np.radians(run.angles["out_roll"][lost[0]].astype(float)))
    drift = np.degrees(CALIBRATION.k * across * bench.config.period_s)
    # Angles of 6 degrees have steps of 5e-7.
    assert np.diff(tilt[list(lost)]) == pytest.approx(drift, abs=2e-6)
    # A ghost of 20 % is below the threshold of a spot; a second spot of 90 % is not, and the larger one is used.
    for rows in ghost_near, ghost_far:
        assert flags(run, "several", rows) == {False}
    assert flags(run, "several", two) == {True}
    assert np.abs(roll.position[list(two)] / 4096 - 900.25).max() < 0.2
    assert flags(run, "edge", edge) == {True}
    # Ambient light is in the black level after a line. Where it saturates the sensor, the exposure settles first: the
    # black level of a line is that of the exposure before.
    for rows in ambient[8:], gradient[1:]:
        assert flags(run, "roll_missing", rows) == {False}
        assert np.abs(roll.position[list(rows)] / 4096 - 900.25).max() < 1.5
    # Saturated: the exposure is halved until it is right.
    assert flags(run, "saturated", bright[:2]) == {True}
    assert flags(run, "saturated", bright[8:]) == {False}
    # The lasers are off.
    assert set(run.status[list(dark)]) == {3}
    good = sorted(set(range(1, 226)) - {row for rows in faults for row in rows} - set(range(110, 119))
                  - set(range(166, 175)) - set(range(198, 207)) - set(range(214, 223)) - {182})
    assert set(run.status[good]) == {0}


def test_line_buffer(bench, models):
    """Equal bits with and without a line buffer, whenever samples come; and whole lines can be read."""
    plain = bench("optical_s11639")
    buffered = PinBench(plain.config.replace(mode="buffered"), models)
    index = 901
    runs = [run_of(each, 10, Studio({}), samples=inertial(plain, 10, each=24),
                   actions=[(0, "in_read_index", index)] * (each is buffered)) for each in (plain, buffered)]
    for port, values in runs[0].pins.events.items():
        if port != "cycle":
            assert np.array_equal(values, runs[1].pins.events[port]), port
    assert set(runs[1].cycle - runs[0].cycle) == {buffered.core.latency - plain.core.latency}
    assert buffered.differing_bits(runs[1]) == 0
    assert np.array_equal(runs[1].pins.events["out_read_pixel"], runs[1].light[0, :, index])
    assert set(runs[1].pins.events["out_line_ready"]) == {1}


def test_exposure_from_a_fortieth_to_forty_times(bench):
    """Light changes by a factor of 40, and back: from the 9th line on, the peak is right."""
    bench = bench("optical_s11639")
    run = run_of(bench, 48, Studio({range(12, 30): {"light": 1 / 40}}, exposure_s=11e-6))
    _, spots = bench.twin(run)
    assert bench.differing_bits(run) == 0
    for own in spots:
        peaks = own.results["peak"]
        for begin, end in (8, 12), (20, 30), (38, 48):
            assert ((peaks[begin:end] >= 2000) & (peaks[begin:end] <= 3200)).all()
    exposures = np.array([own.exposure_s for own in run.pins.lines[0]])
    assert exposures.max() / exposures.min() > 30


@pytest.mark.parametrize("word", [0, 0xFFF])
def test_adc_that_is_stuck(bench, word):
    bench = bench("optical_s11639")
    line = bench.timing.line_cycles
    # Lines 4 and 5 are read in the sixth and seventh line period.
    actions = [(5 * line, "stuck_word", word), (5 * line, "stuck", 1), (7 * line, "stuck", 0)]
    run = run_of(bench, 20, Studio({}), actions)
    assert bench.differing_bits(run) == 0
    assert [flags(run, "roll_missing", rows) for rows in (range(1, 4), range(4, 6), range(16, 20))] == [
        {False}, {True}, {False}]
    assert flags(run, "pitch_missing", range(1, 20)) == {False}
    assert set(run.angles["out_roll_measured"][4:6]) == {run.angles["out_roll_measured"][3]}
    assert np.isfinite(run.angles["out_roll"]).all()


def test_lost_pixel_clocks(bench):
    """A clock that a sensor misses shifts the rest of one line; a clock that stops takes the spots away."""
    bench = bench("optical_s11639")
    line, clock = bench.timing.line_cycles, bench.timing.clock_cycles
    first = 4 * line + 16 + 200 * clock
    actions = [(first, "lost_clock", 1), (first + clock, "lost_clock", 0),
               (8 * line, "lost_clock", 1), (10 * line, "lost_clock", 0)]
    run = bench.run(20, Studio({}), calibration=CALIBRATION.ports(), actions=actions, inertial=inertial(bench, 20))
    # The sensors notice, and nothing else does.
    assert {rule for violation in run.pins.violations for rule in violation.rules} <= {
        "period of CLK", "ST high", "ST low", "a line begins only after the read-out", "video has settled",
        "video holds"}
    assert run.pins.violations
    assert len(run.cycle) == 20
    shifted = run.angles["out_roll_measured"][3] - run.angles["out_roll_measured"][2]
    # The line comes a pixel later.
    assert shifted == pytest.approx(np.degrees(14 / 25_000), rel=0.1)
    assert run.flag("roll_missing")[7:9].any()
    assert run.flag("pitch_missing")[7:9].any()
    assert set(run.status[16:]) == {0}


def test_reset_in_a_line(bench):
    """Everything starts anew: number of the line, frames, rotor axis; the pins stay within their limits."""
    bench = bench("optical_s11639")
    line = bench.timing.line_cycles
    middle = 6 * line + line // 2
    run = bench.run(14, Studio({}), calibration=CALIBRATION.ports(), inertial=inertial(bench, 14),
                    actions=[(middle, "rst_n", 0), (middle + 3, "rst_n", 1)])
    before = int((run.cycle < middle).sum())
    after = len(run.cycle) - before
    assert run.line.tolist() == [*range(before), *range(after)]
    assert run.status.tolist() == [3, *[0] * (before - 1), 3, *[0] * (after - 1)]
    # The same light gives the same angles again, from a vertical rotor on.
    assert run.angles["out_roll"][before + 1] == run.angles["out_roll_measured"][before + 1]
    decoder, frames = run.frames()
    assert decoder.restarts == 1
    assert len(frames) >= before + after - 2


def test_accelerometer_that_is_not_a_number(bench):
    """The update is refused: nothing changes, and the finish is in time."""
    bench = bench("optical_s11639")
    samples = inertial(bench, 16)
    samples.f_b[15] = [np.nan, 0, 0]
    samples.yaw_rate[21] = np.inf
    run = run_of(bench, 16, Studio({range(6): {}, range(6, 16): {"position": 1000.25}}), samples=samples)
    assert bench.differing_bits(run) == 0
    refused = np.flatnonzero(run.flag("refused"))
    assert len(refused) == 2
    for row in refused:
        for values in run.angles.values():
            assert values[row] == values[row - 1]
    assert set(np.diff(run.cycle)) == {bench.timing.line_cycles}


def test_accelerometer_that_is_far_too_large(bench):
    """Finite numbers whose results are not: after eight updates that are refused, the rotor starts again."""
    bench = bench("optical_s11639")
    samples = inertial(bench, 20)
    samples.f_b[12:39] = [1e25, 1e25, 1e30]
    run = run_of(bench, 20, Studio({}), samples=samples)
    assert bench.differing_bits(run) == 0
    refused = np.flatnonzero(run.flag("refused"))
    assert list(np.diff(refused[:8])) == [1] * 7
    assert refused[7] + 1 not in refused
    tilt = run.angles["out_roll"].astype(float) - run.angles["out_roll_measured"]
    # The first update after a restart has a vertical rotor.
    assert tilt[refused[7] + 1] == 0


def test_no_samples_of_the_accelerometer(bench):
    """Without a sample since the line before, the rotor axis stays."""
    bench = bench("optical_s11639")
    samples = inertial(bench, 12)
    line = bench.timing.line_cycles
    kept = (samples.cycle < 4 * line) | (samples.cycle > 8 * line)
    run = run_of(bench, 12, Studio({}),
                 samples=Inertial(samples.cycle[kept], samples.f_b[kept], samples.yaw_rate[kept]))
    assert bench.differing_bits(run) == 0
    gap = np.flatnonzero(run.flag("uncompensated"))
    assert list(gap) == list(range(gap[0], gap[-1] + 1))
    assert len(gap) in (3, 4)
    tilt = run.angles["out_roll"].astype(float) - run.angles["out_roll_measured"]
    assert np.ptp(tilt[gap]) < 1e-5


def test_lines_stop_and_begin_again(bench):
    """A line always ends, and the pins rest."""
    bench = bench("optical_s11639")
    line = bench.timing.line_cycles
    run = run_of(bench, 14, Studio({}), [(3 * line + line // 3, "in_run_en", 0), (8 * line, "in_run_en", 1)])
    gaps = np.diff(run.cycle)
    assert (gaps >= line).all()
    assert (gaps > line).sum() == 1
    assert bench.differing_bits(run) == 0
