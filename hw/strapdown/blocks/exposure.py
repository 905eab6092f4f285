"""Exposure control: the exposure of the next line from the spot of this one."""

import operator

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .pixels import PIXEL_WIDTH
from .timing import EXPOSURE_WIDTH

__all__ = ["ExposureControl"]

TOO_HIGH, TOO_LOW, LOW = 3200, 650, 2000
"""Peaks, counts above the black level."""


class ExposureControl(Described):
    """The exposure after each line, within its range: halved if a pixel was saturated; else less an eighth above a peak
    of 3200 counts; else doubled below 650; else a quarter more below 2000.

    Parameters
    ----------
    least, most : int
        Range, cycles.
    start : int
        Exposure after a reset, cycles.
    fixed : bool
        True if the exposure stays so.

    Members
    -------
    update : In(1)
        High for one cycle with the results of a line.
    peak, saturated : In(12), In(1)
        Results of SpotFinder: ``line_peak`` and ``line_saturated``. In the dark the exposure grows.
    exposure : Out(24)
        Exposure, cycles; the new one two cycles after ``update``.

    Raises: ValueError if the range is empty or too large, or the start is outside.
    """

    def __init__(self, *, least, most, start, fixed=False):
        self._least, self._most, self._start = map(operator.index, (least, most, start))
        self._fixed = bool(fixed)
        if not 8 <= self._least <= self._most < 1 << EXPOSURE_WIDTH:
            raise ValueError(f"exposures must be from 8 to {(1 << EXPOSURE_WIDTH) - 1} cycles, "
                             f"not from {least} to {most}")
        if not self._least <= self._start <= self._most:
            raise ValueError(f"exposure must start within {least} and {most} cycles, not at {start}")
        super().__init__({"update": In(1), "peak": In(PIXEL_WIDTH), "saturated": In(1),
                          "exposure": Out(EXPOSURE_WIDTH, init=self._start)})

    def compute(self, exposure, peak, saturated):
        """Software twin: the exposure after a line, integers in cycles, from arrays of one shape."""
        exposure, peak, saturated = np.broadcast_arrays(exposure, peak, saturated)
        if self._fixed:
            return exposure.copy()
        change = np.select([saturated > 0, peak > TOO_HIGH, peak < TOO_LOW, peak < LOW],
                           [-(exposure >> 1), -(exposure >> 3), exposure, exposure >> 2], 0)
        return np.clip(exposure + change, self._least, self._most)

    def elaborate(self, platform):
        m = Module()
        if self._fixed:
            m.d.comb += self.exposure.eq(self._start)
            return m
        width = (2 * self._most).bit_length()
        exposure = Signal(width - 1, init=self._start)
        changed = Signal(width, reset_less=True)
        due = Signal()
        # One adder: the part of the exposure that is added, or taken away.
        part = Signal(width)
        less = Signal()
        with m.If(self.saturated):
            m.d.comb += [part.eq(exposure >> 1), less.eq(1)]
        with m.Elif(self.peak > TOO_HIGH):
            m.d.comb += [part.eq(exposure >> 3), less.eq(1)]
        with m.Elif(self.peak < TOO_LOW):
            m.d.comb += part.eq(exposure)
        with m.Elif(self.peak < LOW):
            m.d.comb += part.eq(exposure >> 2)
        m.d.sync += changed.eq(exposure + (part ^ less.replicate(width)) + less)
        m.d.sync += due.eq(self.update)
        with m.If(due):
            m.d.sync += exposure.eq(Mux(changed < self._least, self._least,
                                        Mux(changed > self._most, self._most, changed)))
        m.d.comb += self.exposure.eq(exposure)
        return m
