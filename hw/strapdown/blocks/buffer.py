"""The double line buffer: one bank is written while the other one is read."""

import operator

from amaranth import *
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .pixels import PIXEL_WIDTH, PixelStream

__all__ = ["LineBuffer"]


class LineBuffer(Described):
    """Stores the lines of two sensors in two banks.

    When a line is complete, the banks change places, and the line comes out as a stream, a pixel in each cycle. Then
    any pixel of it can be read.

    Parameters
    ----------
    pixels : int
        Pixels of a line, 2 to 4096.

    Members
    -------
    pixels : In(PixelStream(2))
        The pixels, at any distance. A line without its last pixel is given up by the first pixel of the next one.
    stored : Out(PixelStream(2))
        The complete line.
    read_index, read_ccd : In(12), In(1)
        Number of the pixel to read, and 0 for the roll sensor, 1 for the pitch sensor.
    read_pixel : Out(12)
        The pixel, one cycle later, while ``line_ready`` is high.
    line_ready : Out(1)
        The complete line can be read. Falls when the next one is complete.
    bank : Out(1)
        The bank that holds the complete line.

    Latency: ``latency`` cycles from the last pixel of a line to its last pixel in ``stored``. A line may be complete
    when the one before has come out, not earlier.
    Raises: ValueError if ``pixels`` is out of range.
    """

    def __init__(self, pixels):
        self._pixels = operator.index(pixels)
        if not 2 <= self._pixels <= 4096:
            raise ValueError(f"pixels must be from 2 to 4096, not {pixels!r}")
        super().__init__({"pixels": In(PixelStream(2)), "stored": Out(PixelStream(2)), "read_index": In(12),
                          "read_ccd": In(1), "read_pixel": Out(PIXEL_WIDTH), "line_ready": Out(1), "bank": Out(1)})

    @property
    def latency(self):
        """Cycles from the last pixel to the last pixel of the stored line."""
        return self._pixels + 1

    def elaborate(self, platform):
        m = Module()
        width = (self._pixels - 1).bit_length()
        m.submodules.memory = memory = Memory(shape=2 * PIXEL_WIDTH, depth=2 << width, init=[])
        write, read = memory.write_port(), memory.read_port()

        place = Signal(width)
        index = Signal(width)
        pixels, stored = self.pixels, self.stored
        m.d.comb += [index.eq(Mux(pixels.p.first, 0, place)), write.addr.eq(Cat(index, ~self.bank)),
                     write.data.eq(pixels.p.pixel.as_value()), write.en.eq(pixels.valid)]
        with m.If(pixels.valid):
            m.d.sync += place.eq(index + 1)

        scanning = Signal()
        scanned = Signal(width)
        ends = Signal()
        m.d.comb += [ends.eq(scanned == self._pixels - 1),
                     read.addr.eq(Cat(Mux(scanning, scanned, self.read_index[:width]), self.bank))]
        with m.If(scanning):
            m.d.sync += [scanned.eq(scanned + 1), scanning.eq(~ends), self.line_ready.eq(ends)]
        with m.If(pixels.valid & pixels.p.last):
            m.d.sync += [self.bank.eq(~self.bank), scanning.eq(1), scanned.eq(0), self.line_ready.eq(0)]
        ccd = Signal()
        m.d.sync += [stored.valid.eq(scanning), stored.p.first.eq(scanned == 0), stored.p.last.eq(ends),
                     ccd.eq(self.read_ccd)]
        m.d.comb += [stored.p.pixel.as_value().eq(read.data),
                     self.read_pixel.eq(read.data.word_select(ccd, PIXEL_WIDTH))]
        return m
