"""Sums of the samples of an inertial sensor, from line to line of an optical one."""

import numpy as np
from amaranth import *
from amaranth.lib import data
from amaranth.lib.wiring import In, Out

from strapdown.component import Described
from strapdown.fp import FpAdd

__all__ = ["COUNT_WIDTH", "InertialSums"]

COUNT_WIDTH = 24
"""Bits of the number of samples."""


class InertialSums(Described):
    """Adds up samples of several numbers, with one adder, and gives out the sums of the samples between two takes.

    The sums of a take wait until they are given out, while the next ones begin.

    Parameters
    ----------
    format : FloatFormat
        Format of the numbers.
    count : int
        Numbers of a sample.
    latency : int
        Register ranks of the adder.

    Members
    -------
    sample, values : In(1), In(array of ``count`` numbers)
        A sample is taken in a cycle in which ``sample`` is high, if the one before came ``interval`` cycles or more
        ago; else it is lost.
    take : In(1)
        Ends the sums, with the samples that came before this cycle.
    give, counts : In(1), In(1)
        Gives out the sums of the last take, ``interval`` cycles or more after it; as zero, if ``counts`` is low.
    sums, number : Out(array of ``count`` numbers), Out(24)
        Sums of the samples between two takes, and how many they are; without samples they are zero. They change in the
        cycle after ``give``, and then hold.
    missing : Out(1)
        With them: there was no sample between the takes, whether they count or not.
    """

    def __init__(self, format, count, *, latency=4):
        self._format, self._count = format, count
        self._adder = FpAdd(format, latency=latency)
        numbers = data.ArrayLayout(format.width, count)
        super().__init__({"sample": In(1), "values": In(numbers), "take": In(1), "give": In(1),
                          "counts": In(1), "sums": Out(numbers), "number": Out(COUNT_WIDTH), "missing": Out(1)})

    @property
    def interval(self):
        """Least number of cycles from sample to sample."""
        return 2 + self._count + self._adder.latency

    def compute(self, samples):
        """Software twin: the sums of samples, shape (N, count), as an array of the format's dtype, shape (count,)."""
        sums = self._format.array(np.zeros(self._count))
        for sample in samples:
            sums = self._adder.compute(sums, self._format.array(sample))
        return sums

    def elaborate(self, platform):
        m = Module()
        m.submodules.adder = adder = self._adder
        # The sums go round: each leaves the first place for the adder, and comes back to the last one.
        places = [Signal(self._format.width, name=f"sum_{index}") for index in range(self._count)]
        sample = Array(Signal(self._format.width, name=f"value_{index}", reset_less=True)
                       for index in range(self._count))
        number = Signal(COUNT_WIDTH)
        # Cycles left until the sample is in the sums; the adder takes numbers in the first of them.
        busy, index = Signal(range(self.interval)), Signal(range(self._count))
        begins, adds, idle, ends = Signal(), Signal(), Signal(), Signal()
        m.d.comb += [idle.eq(busy == 0), begins.eq(self.sample & idle), adds.eq(busy > self._adder.latency + 1)]
        # The operands have registers, because the choice of the sample takes time.
        a, b, start = (Signal.like(operand, reset_less=True) for operand in (adder.a, adder.b, adder.start))
        m.d.sync += [a.eq(places[0]), b.eq(sample[index]), start.eq(adds)]
        m.d.comb += [adder.a.eq(a), adder.b.eq(b), adder.start.eq(start)]
        with m.If(begins):
            m.d.sync += [busy.eq(self.interval - 1), number.eq(number + 1)]
            m.d.sync += [register.eq(self.values[index]) for index, register in enumerate(sample)]
        with m.Elif(~idle):
            m.d.sync += busy.eq(busy - 1)
        m.d.sync += index.eq(Mux(adds, index + 1, 0))
        with m.If(adds | adder.done):
            m.d.sync += [place.eq(following) for place, following in zip(places, [*places[1:], adder.result],
                                                                         strict=True)]
        # A take waits for a sample that is being added.
        waiting = Signal()
        m.d.comb += ends.eq((self.take | waiting) & idle)
        m.d.sync += waiting.eq((self.take | waiting) & ~idle)
        taken = [Signal.like(place, name=f"taken_{index}") for index, place in enumerate(places)]
        taken_number = Signal.like(number)
        with m.If(ends):
            m.d.sync += [*(register.eq(place) for register, place in zip(taken, places, strict=True)),
                         *(place.eq(0) for place in places), taken_number.eq(number), number.eq(begins)]
        with m.If(self.give):
            m.d.sync += self.missing.eq(taken_number == 0)
        # The zero comes first, because flip-flops have a reset before their enable.
        with m.If(self.give & ~self.counts):
            m.d.sync += [self.sums.eq(0), self.number.eq(0)]
        with m.Elif(self.give):
            m.d.sync += [self.sums[index].eq(register) for index, register in enumerate(taken)]
            m.d.sync += self.number.eq(taken_number)
        return m
