"""Time stamps: faults that are mended, and gaps between samples."""

import numpy as np
import pytest

from strapdown_sim.recordings.clock import gaps, mended

STEADY = np.arange(40) / 100


def changed(**rows):
    """STEADY with other stamps in some rows, such as row_3=0.5."""
    time_s = STEADY.copy()
    for row, stamp in rows.items():
        time_s[int(row.removeprefix("row_"))] = stamp
    return time_s


def test_a_steady_clock_is_not_touched():
    clock = mended(STEADY)
    assert clock.rows.tolist() == list(range(40))
    assert (clock.time_s == STEADY).all()
    assert clock.faults == {}
    assert gaps(STEADY) == ([], 0)


def test_rows_without_a_stamp_are_dropped():
    clock = mended(changed(row_3=np.nan, row_5=np.inf))
    assert clock.faults == {"samples without a time stamp, dropped": 2}
    assert {3, 5}.isdisjoint(clock.rows)
    assert [gap.lost for gap in gaps(clock.time_s).lost] == [1, 1]


def test_swapped_samples_are_sorted():
    clock = mended(changed(row_10=STEADY[11], row_11=STEADY[10]))
    assert clock.faults == {"samples out of order, sorted": 1}
    assert clock.rows[9:13].tolist() == [9, 11, 10, 12]
    assert (clock.time_s == STEADY).all()


def test_a_sample_that_comes_later_in_the_file_is_sorted():
    order = [*range(5), *range(6, 20), 5, *range(20, 40)]
    clock = mended(STEADY[order])
    assert (clock.time_s == STEADY).all()
    assert [order[row] for row in clock.rows] == list(range(40))


def test_a_stamp_that_repeats_takes_its_share_of_the_time_to_the_next():
    clock = mended(np.array([0, 0.0025, 0.0025, 0.0075, 0.01]))
    assert clock.time_s == pytest.approx([0, 0.0025, 0.005, 0.0075, 0.01])
    assert clock.faults == {"samples with the stamp of the one before, spread": 1}


def test_stamps_of_packets_are_spread():
    packets = np.repeat(np.arange(10) / 10, 5)
    clock = mended(packets)
    assert clock.time_s == pytest.approx(np.arange(50) / 50)


def test_a_doubled_sample_is_dropped():
    clock = mended(np.insert(STEADY, 7, STEADY[7]))
    assert clock.faults == {"doubled samples, dropped": 1}
    assert (clock.time_s == STEADY).all()


@pytest.mark.parametrize(("unit", "bits"), [(1e-6, 32), (1e-3, 16), (1e-4, 32)])
def test_a_counter_that_wraps_is_continued(unit, bits):
    modulus = 2**bits
    ticks = (modulus - 20 * round(0.01 / unit) + np.arange(40) * round(0.01 / unit)) % modulus
    clock = mended(ticks * unit)
    assert clock.faults == {"wraps of the clock, continued": 1}
    assert np.diff(clock.time_s) == pytest.approx(0.01, abs=1e-6)


@pytest.mark.parametrize("step_s", [-0.7, 1.7e9])
def test_a_clock_that_is_set_goes_on(step_s):
    time_s = np.arange(400) / 100
    time_s[200:] += step_s
    clock = mended(time_s)
    assert clock.faults == {"steps of the clock, replaced by one usual step": 1}
    assert np.diff(clock.time_s) == pytest.approx(0.01, abs=1e-6)


def test_a_clock_that_starts_again_is_told():
    clock = mended(np.concatenate([np.arange(400), np.arange(300)]) / 100)
    assert clock.restart == 400
    assert len(clock.rows) == 400


def test_lost_samples_are_gaps():
    time_s = np.delete(STEADY, [5, 20, 21])
    found = gaps(time_s)
    assert [(gap.sample, gap.lost) for gap in found.lost] == [(5, 1), (19, 2)]
    assert found.lost[0].start_s == pytest.approx(0.04)
    assert found.lost[0].end_s == pytest.approx(0.06)


def test_a_late_stamp_is_no_gap():
    assert gaps(changed(row_7=0.0751)) == ([], 1)


@pytest.mark.parametrize("steps", [[0.01] * 5 + [0.005] * 4, [0.005] * 30 + [0.01] * 30, [0.01], [0.01, 0.01]])
def test_another_rate_is_no_gap(steps):
    assert gaps(np.cumsum([0, *steps])).lost == []


def test_jitter_loses_nothing():
    stamps = np.arange(2000) / 200 + np.random.default_rng(0).uniform(-0.0012, 0.0012, 2000)
    assert gaps(stamps).lost == []
