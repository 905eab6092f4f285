"""Thresholds of a line from the line before, and the spots of consecutive lines."""

import operator

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .pixels import PIXEL_WIDTH

__all__ = ["Thresholds"]


class Thresholds(Described):
    """Black level and thresholds of a line, from the results of the line before: lo = max(lo_min, peak >> shift),
    hi = max(2 lo_min, lo + (lo >> 1)).

    Parameters
    ----------
    lo_min : int
        Least value of lo, 1 to 1023.
    shift : int
        Part of the peak, 1 to 11.

    Members
    -------
    update : In(1)
        High for one cycle with the results of a line.
    peak, black_next : In(12)
        Results of SpotFinder: ``line_peak`` and ``black_next``. The peak is that of the whole
        line: with that of a run, background light could hold the thresholds.
    black, lo, hi : Out(12)
        Inputs of SpotFinder for the next line, two cycles after ``update``. After a reset: 0 and the least values.
    known : Out(1)
        There was a line before. Without one, the black level is not known, and results of the line are void.

    Raises: ValueError if a parameter is out of range.
    """

    def __init__(self, *, lo_min=40, shift=2):
        self._lo_min, self._shift = operator.index(lo_min), operator.index(shift)
        if not 1 <= self._lo_min <= 1023:
            raise ValueError(f"lo_min must be from 1 to 1023, not {lo_min!r}")
        if not 1 <= self._shift <= PIXEL_WIDTH - 1:
            raise ValueError(f"shift must be from 1 to {PIXEL_WIDTH - 1}, not {shift!r}")
        super().__init__({"update": In(1), "peak": In(PIXEL_WIDTH), "black_next": In(PIXEL_WIDTH),
                          "black": Out(PIXEL_WIDTH), "lo": Out(PIXEL_WIDTH, init=self._lo_min),
                          "hi": Out(PIXEL_WIDTH, init=int(self._upper(self._lo_min))), "known": Out(1)})

    def _upper(self, lo):
        """hi of lo, as NumPy's integers."""
        return np.maximum(2 * self._lo_min, lo + (lo >> 1))

    def compute(self, peak):
        """Software twin: lo and hi after a line with this peak, an array of integers."""
        lo = np.maximum(self._lo_min, np.asarray(peak) >> self._shift)
        return lo, self._upper(lo)

    def track(self, finder, lines):
        """The spots of consecutive lines of one sensor, from reset on.

        Parameters
        ----------
        finder : SpotFinder
        lines : ndarray of int, shape (N, pixels)

        Returns: dict of arrays, shape (N,): the results of ``finder.compute``, and ``black``, ``lo``, ``hi`` and
        ``known`` of each line.
        """
        rows = []
        black, lo, hi = 0, self._lo_min, int(self._upper(self._lo_min))
        for number, line in enumerate(lines):
            found = finder.compute(line, black, lo, hi)
            rows.append(found | {"black": black, "lo": lo, "hi": hi, "known": int(number > 0)})
            black, (lo, hi) = int(found["black_next"]), map(int, self.compute(found["line_peak"]))
        return {name: np.array([row[name] for row in rows], dtype=np.int64) for name in rows[0]}

    def elaborate(self, platform):
        m = Module()
        part = self.peak >> self._shift
        with m.If(self.update):
            m.d.sync += [self.known.eq(1), self.black.eq(self.black_next),
                         self.lo.eq(Mux(part > self._lo_min, part, self._lo_min))]
        larger = Signal(PIXEL_WIDTH + 1)
        m.d.comb += larger.eq(self.lo + (self.lo >> 1))
        m.d.sync += self.hi.eq(Mux(larger > 2 * self._lo_min, larger, 2 * self._lo_min))
        return m
