"""The timing of two line sensors: clock, transfer and exposure pulses, and the instants to sample."""

import operator
from math import ceil

from amaranth import *
from amaranth.lib import data
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

__all__ = ["EXPOSURE_WIDTH", "LineTiming"]

EXPOSURE_WIDTH = 24
"""Bits of an exposure in clock cycles."""

TRIGGERS = "internal", "external"

# After a sample, and around the edges of ICG, SH rests for these times, in seconds; and ST before a sample.
SH_AFTER_SAMPLE, SH_FROM_ICG, ST_BEFORE_SAMPLE = 50e-9, 500e-9, 20e-9


class LineTiming(Described):
    """Drives two line sensors of a kind: all pins, the exposure of each, and the instants at which the ADCs sample.

    Time is divided into the pixel slots of the sensor, from reset on, and lines begin with a slot. So the distance from
    a sample to any edge of a pin is the same in all lines. A line reads what was exposed during the line before it, and
    exposes for the line after it. The first line after ``run`` rises only exposes, the last one after it falls only
    reads; then the pins rest: SH and ST low, ICG high. The sensor's clock never stops.

    Parameters
    ----------
    sensor : LineSensor
    clock_hz : float
        Frequency of the clock.
    sensor_clock_hz : float or None
        Frequency of the sensor's clock, a part of ``clock_hz``; None means the preset.
    line_clocks : int or None
        Clocks of the sensor from line to line, whole pixel slots; None means the preset.
    sample_at : int or None
        Cycles from the begin of a pixel slot to the sample; None means the preset, or the next cycle in the slot in
        which the video has settled.
    exposure_s : tuple of float or None
        Least and largest exposure, seconds; None for either means the sensor's.
    trigger : str
        "internal": lines follow each other while ``run`` is high. "external": each rising edge of ``trigger`` exposes
        one line. It is taken at the next end of a line, at once if none runs; one more is remembered.

    Members
    -------
    run : In(1)
        High for lines.
    exposure : In(array of 2 x 24 bits)
        Exposure of the roll and of the pitch sensor, cycles, taken one pixel slot before a line begins. The effective
        exposure is the next shorter one that the slots allow, within ``exposure_range``.
    trigger : In(1)
        Only with an external trigger. It may change at any time.
    ccd_clk : Out(1)
        Clock of both sensors.
    ccd_sh, ccd_icg : Out(2), Out(1)
        Pins of the protocol "sh_icg", SH for each sensor.
    ccd_st : Out(2)
        Pins of the protocol "st_clk".
    sample, first, last, pixel_index : Out(1), Out(1), Out(1), Out(12)
        ``sample`` is high for one cycle for each effective pixel, one cycle before the pin of the ADC is to change.
        With it, ``first`` and ``last`` mark the ends of the line, and ``pixel_index`` counts from 0.
    exposing : Out(2)
        The sensor is exposed.
    middle : Out(1)
        High for one cycle in the middle of the roll sensor's exposure.
    effective : Out(array of 2 x 24 bits)
        Effective exposures, cycles, of the line whose pixels come.

    All pins are registers. The edges of SH and ST that depend on an exposure have one place in a pixel slot, ``guard``
    cycles before the next sample.
    Raises: ValueError if the sensor cannot work so.
    Sources: those of the sensor.
    """

    def __init__(self, sensor, *, clock_hz, sensor_clock_hz=None, line_clocks=None, sample_at=None, exposure_s=None,
                 trigger="internal"):
        if trigger not in TRIGGERS:
            raise ValueError(f"trigger must be {' or '.join(TRIGGERS)}, not {trigger!r}")
        self._sensor, self._clock_hz, self._external = sensor, clock_hz, trigger == "external"
        self._clock = self._clock_cycles(sensor_clock_hz or sensor.clock_hz)
        self._slot = self._clock * sensor.clocks_per_pixel
        self._high = self._clock // 2
        self._events = self._transfer()
        self._line_slots = self._slots_of_line(
            sensor.line_clocks if line_clocks is None else operator.index(line_clocks))
        settled = self._cycles(sensor.settle_s)
        self._sample_at = (min(max(round(sensor.sample_at * self._slot), settled), self._slot - 1)
                           if sample_at is None else operator.index(sample_at))
        self._check_sample(settled)
        self._exposure_range = self._exposures(*(exposure_s or (None, None)))
        super().__init__({
            "run": In(1), "exposure": In(data.ArrayLayout(EXPOSURE_WIDTH, 2)),
            **({"trigger": In(1)} if self._external else {}),
            "ccd_clk": Out(1), **({"ccd_sh": Out(2), "ccd_icg": Out(1, init=1)} if self._transfers else
                                  {"ccd_st": Out(2)}),
            "sample": Out(1), "first": Out(1), "last": Out(1), "pixel_index": Out(12), "exposing": Out(2),
            "middle": Out(1), "effective": Out(data.ArrayLayout(EXPOSURE_WIDTH, 2))})

    def _cycles(self, seconds):
        """The cycles that take at least some seconds."""
        return ceil(round(seconds * self._clock_hz, 6))

    def _clock_cycles(self, sensor_clock_hz):
        """Cycles of a clock of the sensor."""
        sensor, ratio = self._sensor, self._clock_hz / sensor_clock_hz
        if not sensor.clock_hz_min <= sensor_clock_hz <= sensor.clock_hz_max:
            raise ValueError(f"the clock of {sensor.name} must be from {sensor.clock_hz_min / 1e6:g} to "
                             f"{sensor.clock_hz_max / 1e6:g} MHz, not {sensor_clock_hz / 1e6:g} MHz")
        if ratio < 4 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(f"the clock must be a whole multiple of the sensor's {sensor_clock_hz / 1e6:g} MHz, "
                             f"4 times or more, not {self._clock_hz / 1e6:g} MHz")
        return round(ratio)

    @property
    def _transfers(self):
        """True for the protocol "sh_icg", whose lines begin with a transfer."""
        return self._sensor.protocol == "sh_icg"

    def _transfer(self):
        """The cycles of a line at which its pins change, and at which the exposure of the line before ends."""
        if not self._transfers:
            # The clock falls in the middle of slot 0. Without a shutter, ST rises a clock before. This ends exposures.
            fall = self._high
            ends = fall + (self._sensor.exposure_tail if self._sensor.shutter else -1) * self._clock
            return {"ST falls": fall, "exposure ends": ends, "pixel slots": 0}
        sensor = self._sensor
        rise = self._cycles(sensor.sh_after_icg_s)
        fall = rise + self._cycles(sensor.sh_high_s)
        place = self._cycles(sensor.icg_in_clock_s)
        if not 0 < place < self._high:
            raise ValueError(f"ICG of {sensor.name} must rise while the sensor's clock is high, which it is for "
                             f"{self._high} cycles, not {place} cycles after it has risen")
        back = fall + self._cycles(sensor.icg_after_sh_s)
        back += (place - back) % self._clock
        return {"ICG falls": 0, "SH rises": rise, "SH falls": fall, "exposure ends": fall, "ICG rises": back,
                "pixel slots": back}

    def _slots_of_line(self, line_clocks):
        """Pixel slots of a line."""
        sensor = self._sensor
        pause = self._cycles(sensor.line_pause_s) + self._events["pixel slots"]
        least = max(sensor.line_clocks_min + ceil(self._cycles(sensor.line_pause_s) / self._clock),
                    ceil((sensor.slots * self._slot + pause) / self._clock))
        if line_clocks < least:
            raise ValueError(f"a line of {sensor.name} takes {least} clocks of the sensor or more, not {line_clocks}")
        if line_clocks % sensor.clocks_per_pixel:
            raise ValueError(f"a line of {sensor.name} must be a multiple of {sensor.clocks_per_pixel} clocks of the "
                             f"sensor, not {line_clocks}")
        if line_clocks * self._clock >= 1 << EXPOSURE_WIDTH:
            raise ValueError(f"a line of {sensor.name} must take less than {1 << EXPOSURE_WIDTH} cycles, "
                             f"not {line_clocks * self._clock}")
        return line_clocks // sensor.clocks_per_pixel

    def _check_sample(self, settled):
        """``settled`` is the first cycle of a slot in which the video has settled."""
        name, settle_ns = self._sensor.name, 1e9 * self._sensor.settle_s
        if settled >= self._slot:
            raise ValueError(f"the video of {name} settles in {settle_ns:g} ns, and a pixel of "
                             f"{1e9 * self._slot / self._clock_hz:g} ns has no cycle of the clock after that: choose "
                             "a slower clock of the sensor, or a faster clock")
        if not settled <= self._sample_at < self._slot:
            raise ValueError(f"sample_at must be within the pixel, after the {settle_ns:g} ns in which the video "
                             f"settles, from {settled} to {self._slot - 1} cycles, not {self._sample_at}")
        if self.guard < self._cycles(ST_BEFORE_SAMPLE):
            raise ValueError(f"sample_at must not be {self._sample_at}: there may be an edge of "
                             f"ST {self.guard} cycles before the sample")

    def _exposures(self, least_s, most_s):
        """Least and largest effective exposure in cycles."""
        sensor, clock, end, line = self._sensor, self._clock, self._events["exposure ends"], self.line_cycles
        if self._transfers:
            # SH is low before ICG falls, and after ICG has risen.
            rest = self._cycles(SH_FROM_ICG)
            least = max(self._cycles(sensor.exposure_min_s), end + rest)
            most = line + end - self._events["ICG rises"] - rest - self.flush_cycles
        elif sensor.shutter:
            least = max(self._cycles(sensor.exposure_min_s), (sensor.st_high_min + sensor.exposure_tail) * clock)
            most = line + (sensor.exposure_tail - sensor.st_low_min) * clock
        else:
            least = most = line - sensor.reset_clocks * clock
        limits = self._on_grid(least, up=True), self._on_grid(most)
        chosen = [limit if seconds is None else self._on_grid(round(seconds * self._clock_hz), up=up)
                  for seconds, limit, up in zip((least_s, most_s), limits, (True, False), strict=True)]
        if not limits[0] <= chosen[0] <= chosen[1] <= limits[1]:
            asked, can = ([f"{1e6 * cycles / self._clock_hz:g}" for cycles in pair] for pair in (
                [limit if seconds is None else seconds * self._clock_hz
                 for seconds, limit in zip((least_s, most_s), limits, strict=True)], limits))
            raise ValueError(f"the exposure of {sensor.name} must be from {can[0]} to {can[1]} us in this line, "
                             f"not from {asked[0]} to {asked[1]} us")
        return tuple(chosen)

    def _on_grid(self, exposure, *, up=False):
        """The next shorter exposure that is possible, or the next longer one."""
        # Its end is at one place of a slot, and its begin at another.
        below = (exposure - (self._events["exposure ends"] - self.exposure_place)) % self._slot
        return exposure + (-below % self._slot if up else -below)

    @property
    def exposure_place(self):
        """Cycle of a slot at which an exposure begins."""
        if not self._transfers:
            return self._high
        return (self._events["pixel slots"] + self._sample_at + self._cycles(SH_AFTER_SAMPLE)) % self._slot

    @property
    def flush_slots(self):
        """Slots in which SH is high, and slots from one pulse to the next."""
        high = ceil(self._cycles(self._sensor.sh_high_s) / self._slot)
        return high, max(ceil(self._cycles(self._sensor.flush_pitch_s) / self._slot), high + 1)

    @property
    def flush_cycles(self):
        """Cycles from the first pulse of SH before an exposure to its begin."""
        if not self._transfers:
            return 0
        high, pitch = self.flush_slots
        return (self._sensor.flushes * pitch + high) * self._slot

    @property
    def sensor(self):
        """The sensor."""
        return self._sensor

    @property
    def clock_cycles(self):
        """Cycles of a clock of the sensor; it is high in the first half, rounded down."""
        return self._clock

    @property
    def slot_cycles(self):
        """Cycles of a pixel slot: the least distance of samples."""
        return self._slot

    @property
    def line_cycles(self):
        """Cycles from line to line."""
        return self._line_slots * self._slot

    @property
    def sample_at(self):
        """Cycles from the begin of a pixel slot to the sample."""
        return self._sample_at

    @property
    def exposure_range(self):
        """Least and largest effective exposure in cycles."""
        return self._exposure_range

    @property
    def exposure_step(self):
        """Cycles from one effective exposure to the next."""
        return self._slot

    @property
    def guard(self):
        """Cycles from an edge of ST, or an edge of SH that depends on an exposure, to the next sample."""
        return (self._events["pixel slots"] + self._sample_at - self.exposure_place) % self._slot

    @property
    def events(self):
        """Cycles of a line at which something happens, by name; cycle 0 is the begin of slot 0 or the fall of ICG."""
        slots, sensor = self._events["pixel slots"], self._sensor
        pixel = slots + self._slot * sensor.lead
        rise = {} if self._transfers or sensor.shutter else {
            "ST rises": self.line_cycles + self._events["ST falls"] - self._clock}
        own = {name: cycle % self.line_cycles for name, cycle in self._events.items() if name != "pixel slots"}
        return own | rise | {
            "first pixel": pixel, "first sample": pixel + self._sample_at,
            "last sample": pixel + self._sample_at + self._slot * (sensor.pixels - 1),
            "read out ends": slots + self._slot * sensor.slots, "next line": self.line_cycles}

    def elaborate(self, platform):
        m = Module()
        sensor, line = self._sensor, self.line_cycles
        # Place in the line: slot, clock of the slot, cycle of the clock. What is decided in a cycle reaches the pins
        # after the next edge; all pins and outputs are late by this one cycle.
        beat = Signal(range(self._clock))
        clock = Signal(range(sensor.clocks_per_pixel))
        slot = Signal(range(self._line_slots), init=self._line_slots - 2)

        def in_slot(cycle):
            return (beat == cycle % self._clock) & (clock == cycle // self._clock)

        def at(cycle):
            cycle %= line
            return in_slot(cycle % self._slot) & (slot == cycle // self._slot)

        clock_ends = Signal()
        ends = Signal()
        last_but_one = Signal()
        last_slot = Signal()
        m.d.comb += [clock_ends.eq(beat == self._clock - 1), ends.eq(in_slot(self._slot - 1)),
                     last_but_one.eq(slot == self._line_slots - 2), last_slot.eq(slot == self._line_slots - 1)]
        m.d.sync += [self.ccd_clk.eq(beat < self._high), beat.eq(Mux(clock_ends, 0, beat + 1))]
        with m.If(clock_ends):
            m.d.sync += clock.eq(Mux(ends, 0, clock + 1))

        # A line exposes, reads, or both. Without a next line, the slot before the last one is repeated.
        reads = Signal()
        exposes = Signal()
        follows = Signal()
        goes = Signal()
        asked = Array(Signal(EXPOSURE_WIDTH, name=f"asked_{ccd}", reset_less=True) for ccd in range(2))
        taken = Array(Signal(EXPOSURE_WIDTH, name=f"taken_{ccd}") for ccd in range(2))
        m.d.comb += goes.eq(self.run & self._pending(m, goes & ends & last_but_one))
        with m.If(ends):
            m.d.sync += slot.eq(slot + 1)
            with m.If(last_but_one):
                m.d.sync += follows.eq(goes)
                with m.If(goes):
                    m.d.sync += [asked[ccd].eq(self.exposure[ccd]) for ccd in range(2)]
                with m.If(~goes & ~exposes):
                    m.d.sync += slot.eq(slot)
            with m.If(last_slot):
                m.d.sync += [slot.eq(0), reads.eq(exposes), exposes.eq(follows)]
                m.d.sync += [self.effective[ccd].eq(taken[ccd]) for ccd in range(2)]

        # Samples.
        sampling = Signal()
        sample = Signal()
        first = Signal()
        last = Signal()
        sample_place = Signal()
        m.d.comb += [sample_place.eq(in_slot((self.events["first sample"] - 1) % self._slot)),
                     first.eq(at(self.events["first sample"] - 1) & reads),
                     last.eq(at(self.events["last sample"] - 1)), sample.eq(sample_place & (sampling | first))]
        m.d.sync += [self.sample.eq(sample), self.first.eq(first), self.last.eq(sample & last)]
        with m.If(sample):
            m.d.sync += [sampling.eq(~last), self.pixel_index.eq(Mux(first, 0, self.pixel_index + 1))]

        # Exposure. ``ahead`` is the exposure that would follow if the first edge for it came now.
        remaining = Signal(range(line))
        ahead = Signal(range(line))
        complete = Signal()
        places = Signal()
        latest = Signal()
        opens = Signal()
        least, most = self._exposure_range
        m.d.comb += [complete.eq(at(self._events["exposure ends"])), ahead.eq(remaining - self.flush_cycles),
                     places.eq(in_slot(self.exposure_place)), latest.eq(ahead == least),
                     opens.eq(at(self._events["exposure ends"] - most - self.flush_cycles - 1) & exposes)]
        m.d.sync += remaining.eq(Mux(complete, line - 1, remaining - 1))
        for ccd in range(2):
            armed = Signal(name=f"armed_{ccd}")
            begins = Signal(name=f"begins_{ccd}")
            m.d.comb += begins.eq(armed & places & ((ahead <= asked[ccd]) | latest))
            with m.If(begins):
                m.d.sync += [armed.eq(0), taken[ccd].eq(ahead)]
            with m.If(opens):
                m.d.sync += armed.eq(1)
            exposed = self._pulses(m, ccd, begins, places, at, reads)
            with m.If(exposed):
                m.d.sync += self.exposing[ccd].eq(1)
            with m.If(complete):
                m.d.sync += self.exposing[ccd].eq(0)
        m.d.sync += self.middle.eq(self.exposing[0] & (remaining == taken[0] >> 1))
        return m

    def _pending(self, m, taken):
        """High if a line may begin; ``taken`` is high if it does."""
        if not self._external:
            return C(1)
        now = Signal()
        before = Signal()
        pending = Signal()
        m.submodules.trigger = FFSynchronizer(self.trigger, now)
        m.d.sync += before.eq(now)
        with m.If(~self.run | taken):
            m.d.sync += pending.eq(0)
        with m.If(now & ~before):
            m.d.sync += pending.eq(self.run)
        return pending

    def _pulses(self, m, ccd, begins, places, at, reads):
        """The pins of one sensor. Returns a Value that is high if its exposure begins."""
        events = self.events
        if not self._transfers:
            pin = self.ccd_st[ccd]
            rises = at(events["ST rises"]) if "ST rises" in events else begins
            with m.If(rises):
                m.d.sync += pin.eq(1)
            with m.If(at(events["ST falls"])):
                m.d.sync += pin.eq(0)
            return begins
        pin = self.ccd_sh[ccd]
        high, pitch = self.flush_slots
        flushing = Signal(name=f"flushing_{ccd}")
        left = Signal(range(self._sensor.flushes + 1), name=f"left_{ccd}")
        step = Signal(range(pitch + 1), name=f"step_{ccd}")
        exposed = Signal(name=f"exposed_{ccd}")
        flush_slot = Signal(name=f"flush_slot_{ccd}")
        pulse_ends = Signal(name=f"pulse_ends_{ccd}")
        pulse_begins = Signal(name=f"pulse_begins_{ccd}")
        sh_rises = Signal(name=f"sh_rises_{ccd}")
        m.d.comb += [flush_slot.eq(flushing & places), pulse_ends.eq(step == high), pulse_begins.eq(step == pitch),
                     sh_rises.eq(at(events["SH rises"]))]
        with m.If(begins):
            m.d.sync += [flushing.eq(1), left.eq(self._sensor.flushes), step.eq(1), pin.eq(1)]
        with m.If(flush_slot):
            m.d.sync += step.eq(step + 1)
            with m.If(pulse_ends):
                m.d.sync += [pin.eq(0), flushing.eq(left != 0)]
                m.d.comb += exposed.eq(left == 0)
            with m.If(pulse_begins):
                m.d.sync += [step.eq(1), left.eq(left - 1), pin.eq(1)]
        with m.If(reads):
            if ccd == 0:
                with m.If(at(events["ICG falls"])):
                    m.d.sync += self.ccd_icg.eq(0)
                with m.If(at(events["ICG rises"])):
                    m.d.sync += self.ccd_icg.eq(1)
            with m.If(sh_rises):
                m.d.sync += pin.eq(1)
            with m.If(at(events["SH falls"])):
                m.d.sync += pin.eq(0)
        return exposed
