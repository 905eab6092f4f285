"""Sums of inertial samples, in Verilator: which samples a take ends, and the bits of their sums."""

import numpy as np
import pytest
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.cores.inertial_sums import InertialSums
from strapdown.kernel.pool import Pool

from ..blocks.support import run_blocks

FORMAT, COUNT = Pool().format, 4
SUMS = InertialSums(FORMAT, COUNT)


class Flat(wiring.Component):
    """InertialSums with a port for each number."""

    def __init__(self):
        super().__init__({**dict.fromkeys(("sample", "take", "give", "counts"), In(1)),
                          "number": Out(24), "missing": Out(1),
                          **{f"value_{index}": In(32) for index in range(COUNT)},
                          **{f"sum_{index}": Out(32) for index in range(COUNT)}})

    def elaborate(self, platform):
        m = Module()
        m.submodules.sums = sums = InertialSums(FORMAT, COUNT)
        m.d.comb += [getattr(sums, name).eq(getattr(self, name)) for name in ("sample", "take", "give", "counts")]
        m.d.comb += [self.number.eq(sums.number), self.missing.eq(sums.missing)]
        for index in range(COUNT):
            m.d.comb += [sums.values[index].eq(getattr(self, f"value_{index}")),
                         getattr(self, f"sum_{index}").eq(sums.sums[index])]
        return m


@pytest.mark.verilator
def test_sums_of_random_samples_between_random_takes(models, tmp_path):
    rng = np.random.default_rng(3)
    cycles = 8000
    sample, take, give = (np.zeros(cycles, int) for _ in range(3))
    # Samples as close as may be, then far apart; takes anywhere, also together with a sample and without any between.
    distance = np.concatenate((np.full(200, SUMS.interval), rng.integers(SUMS.interval, 120, 100)))
    places = np.cumsum(distance)
    sample[places[places < cycles]] = 1
    takes = np.cumsum(rng.integers(SUMS.interval + 2, 140, 200))
    takes = takes[takes < cycles - 20]
    take[takes] = 1
    # The sums are given out as early as may be, with the next take, or between.
    early, late = takes[:-1] + SUMS.interval, takes[1:]
    gives = np.choose(rng.integers(3, size=len(early)), (early, late, rng.integers(early, late, endpoint=True)))
    give[gives] = 1
    counts = rng.random(cycles) < 0.8
    values = FORMAT.array(rng.normal(0, 10, (cycles, COUNT)) * 10.0 ** rng.integers(-6, 6, (cycles, COUNT)))
    values[places[40], 2] = np.nan
    run = run_blocks(models, tmp_path, "inertial_sums", flat=Flat())
    answer = run("flat", sample=sample, take=take, give=give, counts=counts.astype(int),
                 **{f"value_{index}": FORMAT.to_bits(values[:, index]) for index in range(COUNT)})
    last, nothing = 0, 0
    for place, given in zip(takes, gives, strict=False):
        own = np.flatnonzero(sample[last:place]) + last
        shown = given + 1
        expected = SUMS.compute(values[own] if counts[given] else [])
        assert [int(answer[f"sum_{index}"][shown]) for index in range(COUNT)] == FORMAT.to_bits(expected).tolist()
        assert answer["number"][shown] == (len(own) if counts[given] else 0)
        assert answer["missing"][shown] == (len(own) == 0)
        last, nothing = place, nothing + (len(own) == 0)
    assert nothing > 3
    assert (sample[takes] == 1).sum() > 3


def test_the_sums_are_those_of_numpy():
    samples = np.random.default_rng(4).normal(0, 100, (50, COUNT)).astype(np.float32)
    expected = np.zeros(COUNT, np.float32)
    for row in samples:
        expected += row
    assert SUMS.compute(samples).tobytes() == expected.tobytes()
