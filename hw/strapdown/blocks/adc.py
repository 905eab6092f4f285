"""Capture: two analog-to-digital converters, one for each line sensor, and the stream of their pixels."""

import operator
from math import ceil

from amaranth import *
from amaranth.lib import data
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .pixels import PIXEL_WIDTH, PixelStream

__all__ = ["ParallelAdc", "SpiAdc"]

CONTROL = {"sample": In(1), "first": In(1), "last": In(1)}

# AD7476A: 16 clocks a conversion, at most 20 MHz and 1 MS/s; 10 ns from the fall of CS to that of SCLK; 50 ns quiet.
SPI_CLOCKS, SCLK_HZ_MAX, SPI_RATE_MAX, CS_TO_SCLK, QUIET = 16, 20e6, 1e6, 10e-9, 50e-9

LATENCY_MAX = 16


class _Capture(Described):
    """Base: the pixel stream of two converters."""

    def __init__(self, pins, *, invert):
        self._invert = bool(invert)
        super().__init__({**CONTROL, **pins, "pixels": Out(PixelStream(2))})

    def _light(self, word):
        """The pixel of a word: light is positive."""
        return ~word if self._invert else word

    def compute(self, words):
        """Software twin: the pixels of an array of words."""
        return (1 << PIXEL_WIDTH) - 1 - words if self._invert else words


class SpiAdc(_Capture):
    """Two serial converters with common pins CS and SCLK, AD7476A or like it.

    A conversion begins when CS falls. The converter then gives four zeros and 12 bits from the top, each of them valid
    at a falling edge of SCLK.

    Parameters
    ----------
    clock_hz, sclk_hz : float
        Frequency of the clock; greatest frequency of SCLK, up to 20 MHz.
    slot_cycles : int
        Least distance of samples, cycles.
    invert : bool
        True if the video falls with light.

    Members
    -------
    sample, first, last : In(1)
        Convert; with it, the marks of the pixel.
    sdata : In(2)
        Data pins of the roll and of the pitch converter.
    cs_n, sclk : Out(1)
        Pins, registers, high at rest. CS falls one cycle after ``sample``.
    pixels : Out(PixelStream(2))
        The pixels, light positive.

    Latency: ``latency`` cycles from ``sample`` to the pixel.
    Raises: ValueError if SCLK is out of range, or a conversion is longer than ``slot_cycles``.
    Source: AD7476A data sheet, Rev. F, pages 8 and 9.
    """

    def __init__(self, *, clock_hz, slot_cycles, sclk_hz=SCLK_HZ_MAX, invert=False):
        if not 0 < sclk_hz <= SCLK_HZ_MAX:
            raise ValueError(f"SCLK of the ADC must be up to {SCLK_HZ_MAX / 1e6:g} MHz, not {sclk_hz / 1e6:g} MHz")
        self._period = max(ceil(round(clock_hz / sclk_hz, 6)), 2)
        # SCLK is low for at least 0.4 of the least period in any case.
        self._low = self._period // 2
        self._lead = max(self._period - self._low, ceil(round(CS_TO_SCLK * clock_hz, 6)))
        conversion = self._lead + SPI_CLOCKS * self._period + ceil(round(QUIET * clock_hz, 6))
        needed = max(conversion, ceil(round(clock_hz / SPI_RATE_MAX, 6)))
        if operator.index(slot_cycles) < needed:
            raise ValueError(f"a conversion of the ADC takes {needed} cycles, longer than a pixel of {slot_cycles}")
        super().__init__({"sdata": In(2), "cs_n": Out(1, init=1), "sclk": Out(1, init=1)}, invert=invert)

    @property
    def latency(self):
        """Cycles from ``sample`` to the pixel."""
        return self._lead + (SPI_CLOCKS - 1) * self._period + 1

    @property
    def sclk_cycles(self):
        """Cycles of a period of SCLK."""
        return self._period

    def elaborate(self, platform):
        m = Module()
        words = [Signal(PIXEL_WIDTH, name=f"word_{ccd}", reset_less=True) for ccd in range(2)]
        first = Signal(reset_less=True)
        last = Signal(reset_less=True)
        left = Signal(range(SPI_CLOCKS + 1))
        wait = Signal(range(max(self._period, self._lead)))
        # ``wait`` counts to the next fall of SCLK; the data pins are read with it.
        falls = Signal()
        ends = Signal()
        m.d.comb += [falls.eq(~self.cs_n & (left != 0) & (wait == 0)), ends.eq(~self.cs_n & (left == 0))]
        with m.If(self.sample):
            m.d.sync += [self.cs_n.eq(0), left.eq(SPI_CLOCKS), wait.eq(self._lead - 1), first.eq(self.first),
                         last.eq(self.last)]
        with m.Else():
            m.d.sync += wait.eq(Mux(wait == 0, self._period - 1, wait - 1))
            with m.If(falls):
                m.d.sync += [self.sclk.eq(0), left.eq(left - 1)]
                m.d.sync += [word.eq(Cat(pin, word)) for word, pin in zip(words, self.sdata, strict=True)]
            with m.If(wait == self._period - self._low):
                m.d.sync += self.sclk.eq(1)
                with m.If(ends):
                    m.d.sync += self.cs_n.eq(1)
        done = Signal()
        m.d.sync += done.eq(falls & (left == 1))
        m.d.comb += [self.pixels.valid.eq(done), self.pixels.p.first.eq(first), self.pixels.p.last.eq(last)]
        m.d.comb += [self.pixels.p.pixel[ccd].eq(self._light(word)) for ccd, word in enumerate(words)]
        return m


class ParallelAdc(_Capture):
    """Two pipelined converters with a common clock and parallel outputs.

    The clock runs from the first sample after reset on, with a rising edge at each sample and every ``slot_cycles``
    cycles between lines; samples keep these distances. So the words of the last pixels come out too.

    Parameters
    ----------
    latency : int
        The word of a sample is read with the rising edge of the clock that is this number after the sample's, 1 to 16.
        It must be valid just before that edge.
    slot_cycles : int
        Distance of samples, cycles; at least 2.
    invert : bool
        True if the video falls with light.

    Members
    -------
    sample, first, last : In(1)
        Convert; with it, the marks of the pixel.
    data : In(array of 2 x 12 bits)
        Data pins of the roll and of the pitch converter.
    adc_clk : Out(1)
        Clock pin, a register. It rises one cycle after ``sample``.
    pixels : Out(PixelStream(2))
        The pixels, light positive.

    Latency: ``latency`` cycles from ``sample`` to the pixel: ``adc_latency`` slots and one cycle.
    Raises: ValueError if a parameter is out of range.
    """

    def __init__(self, *, adc_latency, slot_cycles, invert=False):
        self._adc_latency, self._slot = operator.index(adc_latency), operator.index(slot_cycles)
        if not 1 <= self._adc_latency <= LATENCY_MAX:
            raise ValueError(f"latency of the ADC must be from 1 to {LATENCY_MAX} clocks, not {adc_latency!r}")
        if self._slot < 2:
            raise ValueError(f"a clock of the ADC takes 2 cycles or more, not {slot_cycles!r}")
        super().__init__({"data": In(data.ArrayLayout(PIXEL_WIDTH, 2)), "adc_clk": Out(1)}, invert=invert)

    @property
    def latency(self):
        """Cycles from ``sample`` to the pixel."""
        return self._adc_latency * self._slot + 1

    def elaborate(self, platform):
        m = Module()
        running = Signal()
        place = Signal(range(self._slot))
        rises = Signal()
        m.d.comb += rises.eq(self.sample | (running & (place == self._slot - 1)))
        m.d.sync += place.eq(Mux(rises, 0, place + 1))
        with m.If(self.sample):
            m.d.sync += running.eq(1)
        with m.If(place == self._slot // 2 - 1):
            m.d.sync += self.adc_clk.eq(0)
        with m.If(rises):
            m.d.sync += self.adc_clk.eq(1)

        # The marks of the samples in the pipeline, the last one lowest.
        marks = Signal(3 * self._adc_latency)
        valid, first, last = marks[-3:]
        payload = self.pixels.p
        m.d.sync += self.pixels.valid.eq(rises & valid)
        with m.If(rises):
            m.d.sync += [marks.eq(Cat(self.sample, self.first, self.last, marks)), payload.first.eq(first),
                         payload.last.eq(last)]
            m.d.sync += [payload.pixel[ccd].eq(self._light(self.data[ccd])) for ccd in range(2)]
        return m
