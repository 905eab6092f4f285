"""The spot finder: from the pixels of a line to the position of the brightest spot, in integers."""

import operator

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .pixels import PIXEL_WIDTH, PixelStream

__all__ = ["BLOCK", "FRACTION", "FULL", "SpotFinder"]

FRACTION = 12
"""Fraction bits of a position."""

BLOCK = 64
"""Pixels of a block whose mean is a candidate for the black level."""

FULL = 4000
"""A pixel from here on is saturated."""


class SpotFinder(Described):
    """The position of a bright spot on a line sensor: its centre of gravity above a threshold.

    A pixel of value v counts if d = v - black > lo; its weight is w = d - lo. A run begins with a pixel that counts. It
    ends after ``gap`` pixels in a row that do not, at ``width_max`` pixels, or with the line. It is valid if its
    largest d is above hi and its width less than ``width_max``: a wider one is background light. The valid run with the
    largest sum of weights wins, the first one of equals.

    Parameters
    ----------
    pixels : int
        Pixels of a line, 64 to 4095.
    gap : int
        Pixels that end a run, 1 to 63.
    width_max : int
        Pixels at which a run is cut, 2 to 1024.

    Members
    -------
    pixels : In(PixelStream(1))
        The pixels, at any distance. Pixels without ``first`` continue the line.
    black, lo, hi : In(12)
        Black level and thresholds; constant from the first pixel of a line to its ``finish``.
    finish : Out(1)
        Falls after the first pixel of a line. Rises with the results of the line, which hold while it is high.
    found : Out(1)
        A run is valid. If not, position, peak, width, sum and saturated are zero.
    position : Out(24)
        Position of the spot in pixels, 12 bits of fraction: the mean of the pixel numbers, weighted, rounded down.
        The first pixel is 0.
    peak, width, saturated : Out(12)
        Of the winning run: largest d; pixels from its first to its last pixel that counts; pixels of at least 4000
        that count.
    sum : Out(22)
        Sum of the weights of the winning run.
    several, edge : Out(1)
        More than one run is valid; the winning run holds the first or the last pixel of the line.
    black_next : Out(12)
        Least mean of the 64-pixel blocks of the line, rounded down.
    line_peak : Out(12)
        Largest d of all pixels of the line, at least 0.
    line_saturated : Out(1)
        A pixel of the line is at least 4000.

    Latency: ``latency`` cycles from the last pixel of a line to ``finish``, whatever the line holds. A line that begins
    earlier takes away the results of the line before.
    Raises: ValueError if a parameter is out of range.
    """

    def __init__(self, pixels, *, gap=5, width_max=1024):
        self._pixels = _within("pixels", pixels, BLOCK, (1 << PIXEL_WIDTH) - 1)
        self._gap = _within("gap", gap, 1, 63)
        self._width_max = _within("width_max", width_max, 2, 1024)
        super().__init__({
            "pixels": In(PixelStream(1)), **dict.fromkeys(("black", "lo", "hi"), In(PIXEL_WIDTH)),
            "finish": Out(1), "found": Out(1), "position": Out(PIXEL_WIDTH + FRACTION), "peak": Out(PIXEL_WIDTH),
            "width": Out(12), "sum": Out(22), "saturated": Out(12), "several": Out(1), "edge": Out(1),
            "black_next": Out(PIXEL_WIDTH), "line_peak": Out(PIXEL_WIDTH), "line_saturated": Out(1)})

    @property
    def line(self):
        """Pixels of a line."""
        return self._pixels

    @property
    def gap(self):
        """Pixels that end a run."""
        return self._gap

    @property
    def width_max(self):
        """Pixels at which a run is cut."""
        return self._width_max

    @property
    def latency(self):
        """Cycles from the last pixel to ``finish``."""
        return 3 + self._quotient_width + 1

    @property
    def _quotient_width(self):
        """Bits of the distance from the centre of gravity to the end of a run."""
        return (self._width_max - 1).bit_length() + FRACTION

    def compute(self, lines, black, lo, hi):
        """Software twin, bit for bit.

        Parameters
        ----------
        lines : ndarray of int, shape (..., pixels)
            Lines, 12 bits a pixel.
        black, lo, hi : int or ndarray of int, shape (...)
            Black level and thresholds of each line.

        Returns: dict of int64 arrays, shape (...), with a key for each result: ``found`` to ``line_saturated``.
        Raises: ValueError for lines of another length.
        """
        lines = np.asarray(lines)
        if lines.shape[-1] != self._pixels:
            raise ValueError(f"a line must have {self._pixels} pixels, not {lines.shape[-1]}")
        shape = lines.shape[:-1]
        flat = lines.reshape(-1, self._pixels).astype(np.int64)
        levels = np.stack([np.broadcast_to(level, shape).ravel() for level in (black, lo, hi)], axis=-1)
        whole = self._pixels // BLOCK * BLOCK
        blocks = flat[:, :whole].reshape(len(flat), -1, BLOCK).sum(axis=-1) // BLOCK
        rows = [self._line(line, *level) for line, level in zip(flat, levels.tolist(), strict=True)]
        columns = np.array(rows, dtype=np.int64).reshape(-1, len(RESULTS)).T
        result = {name: column.reshape(shape) for name, column in zip(RESULTS, columns, strict=True)}
        highest = flat.max(axis=-1)
        whole_line = {"black_next": blocks.min(axis=-1), "line_peak": np.maximum(highest - levels[:, 0], 0),
                      "line_saturated": (highest >= FULL).astype(np.int64)}
        return result | {name: values.reshape(shape) for name, values in whole_line.items()}

    def _line(self, line, black, lo, hi):
        """The results of a line, in the order of ``RESULTS``."""
        d = line - black
        counting = np.flatnonzero(d > lo)
        begins = self._begins(counting)
        if not len(begins):
            return (0,) * len(RESULTS)
        first, last = counting[begins], counting[np.append(begins[1:], len(counting)) - 1]
        height = d[counting]
        peak, width = np.maximum.reduceat(height, begins), last - first + 1
        weight = height - lo
        total = np.add.reduceat(weight, begins)
        valid = (peak > hi) & (width < self._width_max)
        if not valid.any():
            return (0,) * len(RESULTS)
        best = int(np.argmax(np.where(valid, total, 0)))
        moment = np.add.reduceat(weight * counting, begins)[best] - int(first[best]) * int(total[best])
        position = (int(first[best]) << FRACTION) + (int(moment) << FRACTION) // int(total[best])
        saturated = np.add.reduceat(line[counting] >= FULL, begins, dtype=np.int64)[best]
        edge = first[best] == 0 or last[best] == self._pixels - 1
        return 1, position, peak[best], width[best], total[best], saturated, valid.sum() > 1, edge

    def _begins(self, counting):
        """Where runs begin, as indices into the numbers of the pixels that count."""
        begins = np.flatnonzero(np.diff(counting, prepend=-self._pixels) > self._gap)
        ends = np.append(begins[1:], len(counting))
        if len(begins) and (counting[ends - 1] - counting[begins]).max() >= self._width_max:
            # Runs that are cut begin again with the next pixel that counts.
            cut = []
            for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
                while begin < end:
                    cut.append(begin)
                    begin += int(np.searchsorted(counting[begin:end], counting[begin] + self._width_max))
            begins = np.array(cut)
        return begins

    def elaborate(self, platform):
        m = Module()
        pixels = self.pixels

        # Stage 1: height above the black level and above the threshold.
        valid, first, last, counts, full = (Signal(name=name) for name in ("valid", "first", "last", "counts", "full"))
        value, height, weight = (Signal(PIXEL_WIDTH, reset_less=True, name=name)
                                 for name in ("value", "height", "weight"))
        pixel = pixels.p.pixel[0]
        above = Signal(signed(PIXEL_WIDTH + 1))
        excess = Signal(signed(PIXEL_WIDTH + 2))
        m.d.comb += [above.eq(pixel - self.black), excess.eq(above - self.lo)]
        m.d.sync += [valid.eq(pixels.valid), first.eq(pixels.p.first), last.eq(pixels.p.last), value.eq(pixel),
                     height.eq(Mux(above < 0, 0, above)), weight.eq(excess), counts.eq(excess > 0),
                     full.eq(pixel >= FULL)]

        # Stage 2: the line, and its runs. ``inside`` is high if a run is open before this pixel.
        index = Signal(PIXEL_WIDTH)
        opened = Signal()
        inside = Signal()
        begins = Signal()
        active = Signal()
        ends = Signal()
        below = Signal(range(self._gap + 1))
        below_now = Signal.like(below)
        length = Signal(range(self._width_max + 1))
        length_now = Signal.like(length)
        m.d.comb += [
            inside.eq(opened & ~first), begins.eq(counts & ~inside), active.eq(inside | counts),
            below_now.eq(Mux(counts, 0, below + 1)), length_now.eq(Mux(inside, length, 0) + 1),
            ends.eq(active & (last | (below_now == self._gap) | (length_now == self._width_max)))]
        run_sum = Signal(22, reset_less=True)
        run_peak = Signal(PIXEL_WIDTH, reset_less=True)
        run_width = Signal.like(length, reset_less=True)
        run_saturated = Signal.like(length, reset_less=True)
        starts_line = Signal()
        ends_line = Signal()
        begins_q, active_q, ends_q, first_q, last_q = (
            Signal(name=f"{name}_q") for name in ("begins", "active", "ends", "first", "last"))
        with m.If(valid):
            m.d.sync += [index.eq(Mux(first, 0, index + 1)), opened.eq(active & ~ends), below.eq(below_now),
                         length.eq(length_now),
                         run_sum.eq(Mux(begins, 0, run_sum) + Mux(counts, weight, 0)),
                         run_saturated.eq(Mux(begins, 0, run_saturated) + (counts & full))]
            m.d.sync += self.line_saturated.eq(full | (self.line_saturated & ~first))
            with m.If(first | (height > self.line_peak)):
                m.d.sync += self.line_peak.eq(height)
            with m.If(counts & (begins | (height > run_peak))):
                m.d.sync += run_peak.eq(height)
            with m.If(counts):
                m.d.sync += [run_width.eq(length_now), ends_line.eq(last)]
            with m.If(begins):
                m.d.sync += starts_line.eq(first)
        m.d.sync += [begins_q.eq(begins), active_q.eq(valid & active), ends_q.eq(valid & ends),
                     first_q.eq(valid & first), last_q.eq(valid & last)]

        # Stage 3: the running sum of the running sum, less one, R - 1. After the run's pixel e, with S0 and S1 the sums
        # of w and of w times its distance from the begin, R = (e + 1) S0 - S1. So the position, rounded down, is
        #     e + 1 - R/S0 = e + (1 - u) - (R - u)/S0 with the last term rounded down, and u the unit of a position.
        integer, digits = self._quotient_width - FRACTION, self._quotient_width
        moment = Signal(22 + integer, reset_less=True)
        moment_now = Signal(22 + integer)
        m.d.comb += moment_now.eq((moment | begins_q.replicate(len(moment))) + run_sum)
        with m.If(active_q):
            m.d.sync += moment.eq(moment_now)
        is_valid = Signal()
        wins = Signal()
        end = Signal(PIXEL_WIDTH, reset_less=True)
        m.d.comb += [is_valid.eq(ends_q & (run_peak > self.hi) & (run_width != self._width_max)),
                     wins.eq(is_valid & (run_sum > self.sum))]

        # Division, a bit of the quotient a cycle. R - u is the moment with ones below the point. Its bits above the
        # places of the quotient's integer are less than S0, and become the first remainder.
        dividend = Signal.like(moment)
        trial = Signal(signed(24))
        left = Signal(range(digits + 1))
        done = Signal()
        fresh = Signal()
        quotient = Signal(digits, reset_less=True)
        remainder = dividend[integer - 1:]
        m.d.comb += [trial.eq(remainder - self.sum), fresh.eq((pixels.valid & pixels.p.first) | first_q)]
        with m.If(left != 0):
            m.d.sync += [left.eq(left - 1), quotient.eq(Cat(trial < 0, quotient)),
                         dividend.eq(Cat(C(1, 1), dividend[:integer - 1],
                                         Mux(trial < 0, remainder[:-1], trial[:22])))]
        with m.If(last_q):
            m.d.sync += left.eq(digits)
        with m.If(wins):
            m.d.sync += [dividend.eq(moment_now), end.eq(index), self.edge.eq(starts_line | ends_line),
                         self.sum.eq(run_sum), self.peak.eq(run_peak), self.width.eq(run_width),
                         self.saturated.eq(run_saturated)]
        with m.If(is_valid):
            m.d.sync += [self.found.eq(1), self.several.eq(self.found)]
        m.d.sync += done.eq(left == 1)
        with m.If(done):
            m.d.sync += self.finish.eq(1)
            with m.If(self.found):
                # The bits of the quotient are inverted: those below the point are already the difference.
                m.d.sync += self.position.eq(Cat(quotient[:FRACTION], end - ~quotient[FRACTION:]))
        with m.If(first_q):
            m.d.sync += [value.eq(0) for value in (self.found, self.several, self.edge, self.position, self.peak,
                                                   self.width, self.sum, self.saturated)]
        with m.If(fresh):
            # A line that begins too early ends the division of the line before.
            m.d.sync += [left.eq(0), done.eq(0), self.finish.eq(0)]

        # The least mean of a block.
        block = Signal(PIXEL_WIDTH + 6, reset_less=True)
        block_now = Signal(PIXEL_WIDTH + 6)
        place = index[:6]
        starts = Signal()
        m.d.comb += [starts.eq(first | place.all()), block_now.eq(Mux(starts, 0, block) + value)]
        complete = Signal()
        with m.If(valid):
            m.d.sync += block.eq(block_now)
        m.d.sync += complete.eq(valid & ~first & (place == BLOCK - 2))
        with m.If(complete & (block[6:] < self.black_next)):
            m.d.sync += self.black_next.eq(block[6:])
        with m.If(first_q):
            m.d.sync += self.black_next.eq((1 << PIXEL_WIDTH) - 1)
        return m


RESULTS = "found", "position", "peak", "width", "sum", "saturated", "several", "edge"
"""The results of a line that come from its runs."""


def _within(name, value, least, most):
    """An integer in a range. Raises: ValueError."""
    if not least <= operator.index(value) <= most:
        raise ValueError(f"{name} must be from {least} to {most}, not {value!r}")
    return operator.index(value)
