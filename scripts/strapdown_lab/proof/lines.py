"""Blocks for line sensors: pins and samples keep their distance, no pixel is lost or doubled, gaps change no result."""

from functools import reduce
from operator import and_

from amaranth import *
from amaranth.asserts import AnyConst, AnySeq, Initial
from amaranth.hdl import Assert, Assume, Cover
from amaranth.lib.wiring import In

from .sequencer import before, driven, implies

__all__ = ["BufferedLine", "Finish", "Gaps", "LineEdges", "ParallelCapture", "SerialCapture",
           "distance"]


def _anything(value):
    return AnySeq(len(Value.cast(value)))


def distance(timing):
    """Least number of cycles from an edge of SH or ST to a sample, by the places that ``LineEdges`` proves.

    ``timing`` is a LineTiming. The sample is the edge of the ADC's pin.
    """
    events, slot = timing.events, timing.slot_cycles
    first, last = events["first sample"], events["last sample"]
    own = [events[name] for name in ("SH rises", "SH falls", "ST falls") if name in events]
    # The place of exposures, in any slot; the cycles of the transfer in their line.
    return min((first - timing.exposure_place) % slot or slot,
               *(first + -(-max(edge - first, 0) // slot) * slot - edge for edge in own if edge <= last))


class LineEdges(Elaboratable):
    """A LineTiming in two states that are one clock edge apart, the first of which obeys an invariant.

    The invariant holds in the second state too. In it the place in the line is the number of a cycle, which tells when
    pins change and samples are taken:

    - ``sample`` comes at the place of the samples in a slot, from the first to the last one of a line that is read,
      numbered from 0, with ``first`` at number 0 and ``last`` at the last number;
    - SH and ST change at the cycles of the transfer, or at the place of exposures in a slot while ICG is high;
    - ICG changes at its two cycles, and rises while the clock of the sensor is high.
    """

    def __init__(self, make):
        self.timing = make()

    def elaborate(self, platform):
        m, timing = Module(), self.timing
        circuit = Fragment.get(timing, platform)
        s, second = driven(circuit), Signal(reset_less=True)
        inputs = [Value.cast(getattr(timing, name)) for name, member in timing.signature.members.items()
                  if member.flow is In]
        m.d.comb += [Assume(~ResetSignal()), *(value.eq(_anything(value)) for value in inputs)]
        m.d.sync += second.eq(Initial())
        holds = reduce(and_, self.invariant(s))
        with m.If(Initial()):
            m.d.comb += Assume(holds)
        claims, event = self.claims(m, s)
        with m.If(second):
            m.d.comb += [Assert(holds), *(Assert(claim) for claim in claims), Cover(event)]
        fragment = Fragment.get(m, platform)
        fragment.add_subfragment(circuit, "timing")
        return fragment

    def place(self, s):
        """Cycle of the slot, and cycle of the line."""
        clock, slot = self.timing.clock_cycles, self.timing.slot_cycles
        # A slot of one clock has no counter of clocks.
        phase = s["beat"] + (s["clock"] * clock if slot > clock else 0)
        return phase, s["slot"] * slot + phase

    def since(self, phase, place):
        """Cycles since the last one at a place of the slot, from 1 to the cycles of a slot."""
        slot = self.timing.slot_cycles
        return Mux(phase > place, phase - place, phase + slot - place)[:slot.bit_length()]

    def invariant(self, s):
        """What holds in every state: a list of Values."""
        timing, (phase, cycle) = self.timing, self.place(s)
        events, slot, line = timing.events, timing.slot_cycles, timing.line_cycles
        end, flush = events["exposure ends"], timing.flush_cycles
        least, most = timing.exposure_range
        first, last = events["first sample"] - 1, events["last sample"] - 1
        opens, latest = (end - most - flush - 1) % line, (end - least - flush) % line
        # The exposure of a sensor without a shutter ends late in the line, after the last decision on the next one.
        late = end > latest
        counts_on, counts = (C(1), s["exposes"]) if late else (s["exposes"], s["reads"])
        holds = [
            s["beat"] < timing.clock_cycles, phase < slot, cycle < line,
            implies(counts_on & (cycle > end), s["remaining"] + cycle == line + end),
            implies(counts & (cycle <= end), s["remaining"] + cycle == end),
            implies(s["sampling"], s["reads"] & (cycle > first) & (cycle <= last)
                    & (cycle == first + timing.pixel_index * slot + self.since(phase, first % slot)))]
        for ccd in range(2):
            holds += [implies(s[f"armed_{ccd}"], s["exposes"] & (cycle > opens) & (cycle <= latest))]
            if "ccd_sh" in timing.signature.members:
                high, pitch = timing.flush_slots
                step, left, taken = (s[f"{name}_{ccd}"] for name in ("step", "left", "taken"))
                flushes = (flush // slot - high) // pitch
                number = (flushes - left)[:4] * pitch + step - 1
                holds += [implies(s[f"flushing_{ccd}"], s["exposes"] & (cycle > opens) & (step != 0) & (step <= pitch)
                                  & (left <= flushes) & implies(left == 0, step <= high)
                                  & (taken >= least) & (taken <= most) & ~s[f"armed_{ccd}"]
                                  & (s["remaining"] + number[:8] * slot
                                     + self.since(phase, timing.exposure_place) == taken + flush))]
        if "ccd_icg" in timing.signature.members:
            holds.append(implies(~timing.ccd_icg, s["reads"] & (cycle != 0) & (cycle <= events["ICG rises"])))
        return holds

    def claims(self, m, s):
        """What holds in the second state, and what is possible in it: a list of Values, and a Value."""
        timing = self.timing
        events, slot, sensor = timing.events, timing.slot_cycles, timing.sensor
        phase, cycle = (before(m, value) for value in self.place(s))
        reads, index = before(m, s["reads"]), before(m, timing.pixel_index)
        first, last = events["first sample"] - 1, events["last sample"] - 1
        sample = timing.sample
        claims = [
            implies(sample, reads & (phase == first % slot) & (cycle >= first) & (cycle <= last)),
            implies(sample, (timing.first & (timing.pixel_index == 0)) | (timing.pixel_index == index + 1)),
            implies(sample, timing.first == (cycle == first)),
            implies(sample, timing.last == (timing.pixel_index == sensor.pixels - 1)),
            # All samples of a line come.
            implies(reads & (cycle == first), sample),
            implies(before(m, s["sampling"]) & (phase == first % slot), sample),
            implies(~sample, ~timing.first & ~timing.last)]
        at_place, event = phase == timing.exposure_place, sample
        if "ccd_sh" in timing.signature.members:
            transfer = reads & ((cycle == events["SH rises"]) | (cycle == events["SH falls"]))
            icg_before = before(m, timing.ccd_icg)
            for pin in timing.ccd_sh:
                changes = pin ^ before(m, pin)
                claims.append(implies(changes, transfer | (at_place & icg_before & timing.ccd_icg)))
            claims += [implies(icg_before & ~timing.ccd_icg, cycle == events["ICG falls"]),
                       implies(~icg_before & timing.ccd_icg, (cycle == events["ICG rises"]) & timing.ccd_clk)]
        else:
            for pin in timing.ccd_st:
                claims.append(implies(pin ^ before(m, pin), phase == events["ST falls"]))
                claims.append(implies(before(m, pin) & ~pin, cycle == events["ST falls"]))
        return claims, event


class SerialCapture(Elaboratable):
    """From any state at rest: a sample gives one pixel, with the word of its conversion, and then the pins rest again.

    Without a sample nothing happens. Beside the SpiAdc are two converters that follow its pins.
    """

    def __init__(self, make, *, slot_cycles):
        self.adc, self.slot_cycles = make(), slot_cycles

    def elaborate(self, platform):
        m, adc = Module(), self.adc
        circuit = Fragment.get(adc, platform)
        now = Cat(Initial(), age := Signal(self.slot_cycles, reset_less=True))
        begins, rests = AnyConst(1), adc.cs_n & adc.sclk & ~adc.pixels.valid
        first, last, words = AnyConst(1), AnyConst(1), [AnyConst(12) for _ in range(2)]
        m.d.sync += age.eq(now)
        m.d.comb += [Assume(~ResetSignal()), adc.sample.eq(now[0] & begins),
                     adc.first.eq(Mux(now[0], first, AnySeq(1))), adc.last.eq(Mux(now[0], last, AnySeq(1)))]
        with m.If(Initial()):
            m.d.comb += Assume(rests)

        cs_before, sclk_before = before(m, adc.cs_n), before(m, adc.sclk)
        for pin, word in zip(adc.sdata, words, strict=True):
            # The first zero comes with CS, the other bits after the falls of SCLK.
            shift = Signal(16, reset_less=True)
            m.d.comb += pin.eq(Mux(adc.cs_n | cs_before, AnySeq(1), shift[15]))
            with m.If(~adc.cs_n & cs_before):
                m.d.sync += shift.eq(word)
            with m.Elif(sclk_before & ~adc.sclk):
                m.d.sync += shift.eq(shift << 1)
        out = adc.pixels
        m.d.comb += Cover(out.valid)
        with m.If(begins):
            m.d.comb += Assert(out.valid == now[adc.latency])
            with m.If(now[self.slot_cycles]):
                m.d.comb += Assert(rests)
            with m.If(out.valid):
                m.d.comb += [Assert(out.p.first == first), Assert(out.p.last == last),
                             *(Assert(pixel == adc.compute(word))
                               for pixel, word in zip(out.p.pixel, words, strict=True))]
        with m.Else():
            m.d.comb += Assert(rests)
        fragment = Fragment.get(m, platform)
        fragment.add_subfragment(circuit, "adc")
        return fragment


class ParallelCapture(Elaboratable):
    """From reset: each sample gives one pixel, with the word that its own edge of the clock took in.

    Beside it are two pipelines that move with the clock pin. Samples come at any multiple of the slots from the first.
    """

    def __init__(self, make, *, adc_latency, slot_cycles):
        self.adc, self.adc_latency, self.slot_cycles = make(), adc_latency, slot_cycles

    def elaborate(self, platform):
        m, adc = Module(), self.adc
        m.submodules.adc = adc
        m.d.comb += Assume(~ResetSignal())
        begun, place = Signal(), Signal(range(self.slot_cycles))
        m.d.comb += [adc.sample.eq(AnySeq(1) & (~begun | (place == 0))), adc.first.eq(AnySeq(1)),
                     adc.last.eq(AnySeq(1))]
        m.d.sync += [begun.eq(begun | adc.sample),
                     place.eq(Mux((begun | adc.sample) & (place != self.slot_cycles - 1), place + 1, 0))]

        rises = adc.adc_clk & ~before(m, adc.adc_clk)
        delayed = []
        for port in adc.data:
            word, stages = AnySeq(12), Signal(12 * self.adc_latency)
            with m.If(rises):
                m.d.sync += stages.eq(Cat(word, stages))
            # The word is there until the edge after the one that it must be there for.
            m.d.comb += port.eq(stages[-12:])
            delays = Signal(12 * adc.latency)
            m.d.sync += delays.eq(Cat(word, delays))
            # The edge of the pin follows ``sample`` by a cycle.
            delayed.append(delays[-24:-12] if adc.latency > 1 else word)
        marks = Signal(3 * adc.latency)
        m.d.sync += marks.eq(Cat(adc.sample, adc.first, adc.last, marks))
        valid, first, last = marks[-3:]
        out = adc.pixels
        m.d.comb += [Assert(out.valid == valid), Cover(out.valid & begun)]
        with m.If(valid):
            m.d.comb += [Assert(out.p.first == first), Assert(out.p.last == last),
                         *(Assert(pixel == adc.compute(own)) for pixel, own in zip(out.p.pixel, delayed, strict=True))]
        return m


class BufferedLine(Elaboratable):
    """From reset: a complete line comes out of a LineBuffer once, in order, as it was, with its marks.

    Pixels come at any distance, and after lines that are given up.
    """

    def __init__(self, make, *, pixels):
        self.buffer, self.pixels = make(), pixels

    def elaborate(self, platform):
        m, buffer, pixels = Module(), self.buffer, self.pixels
        m.submodules.buffer = buffer
        m.d.comb += Assume(~ResetSignal())
        given, out = buffer.pixels, buffer.stored
        number, begun = Signal(range(pixels)), Signal()
        m.d.comb += [given.valid.eq(AnySeq(1)), given.p.first.eq(AnySeq(1)), given.p.last.eq(AnySeq(1)),
                     buffer.read_index.eq(AnySeq(12)), buffer.read_ccd.eq(AnySeq(1))]
        present = Mux(given.p.first, 0, number)
        m.d.comb += [pixel.eq(AnySeq(12)) for pixel in given.p.pixel]
        # The last pixel has the last number, and a line begins with its first pixel.
        with m.If(given.valid):
            m.d.comb += [Assume(given.p.first | begun), Assume(given.p.last == (present == pixels - 1))]
            m.d.sync += [number.eq(present + 1), begun.eq(~given.p.last)]

        # What any one pixel of the line was, and of the line before.
        watched, present_line, line = AnyConst(len(number)), Signal(24), Signal(24)
        left = Signal(range(pixels + 2))
        m.d.comb += Assume((left <= 1) | ~(given.valid & given.p.last))
        m.d.sync += left.eq(Mux(left == 0, 0, left - 1))
        value = Mux(present == watched, given.p.pixel.as_value(), present_line)
        with m.If(given.valid):
            m.d.sync += present_line.eq(value)
            with m.If(given.p.last):
                m.d.sync += [line.eq(value), left.eq(pixels + 1)]
        m.d.comb += [Assert(out.valid == ((left != 0) & (left != pixels + 1))), Cover(out.valid & out.p.last & begun)]
        with m.If(out.valid):
            m.d.comb += [Assert(out.p.first == (left == pixels)), Assert(out.p.last == (left == 1)),
                         Assert((pixels - left != watched) | (out.p.pixel.as_value() == line))]
        # Any pixel can be read then.
        ready = before(m, buffer.line_ready) & (before(m, buffer.read_index) == watched) & (watched < pixels)
        ccd = before(m, buffer.read_ccd)
        with m.If(ready & buffer.line_ready):
            m.d.comb += Assert(buffer.read_pixel == line.word_select(ccd, 12))
        return m


class Gaps(Elaboratable):
    """Two copies of a SpotFinder in the same state, any one in which no division runs, take the same pixel.

    One takes it at once, the other after as many cycles without a pixel as there are stages. When a copy has done its
    work on the pixel, all registers that a result depends on are those of the other copy then: those of the run, those
    of the best run, the results, and the begin of the division. And a further cycle without a pixel changes none of
    them, unless a division runs. So, by induction over the pixels of a line, the results do not depend on the gaps.
    """

    STAGES = 3
    REGISTERS = ("index", "opened", "below", "length", "run_sum", "run_peak", "run_width", "run_saturated",
                 "starts_line", "ends_line", "moment", "end", "dividend", "left", "done", "block", "finish", "found",
                 "several", "edge", "position", "peak", "width", "sum", "saturated", "black_next", "line_peak",
                 "line_saturated")

    def __init__(self, make):
        self.one, self.other = make(), make()

    def elaborate(self, platform):
        m, stages = Module(), self.STAGES
        now = Cat(Initial(), age := Signal(2 * stages, reset_less=True))
        m.d.sync += age.eq(now)
        levels, payload = [AnyConst(12) for _ in range(3)], AnyConst(14)
        circuits, states = {}, []
        for name, finder, at in ("one", self.one, 0), ("other", self.other, stages):
            circuits[name] = Fragment.get(finder, platform)
            states.append(driven(circuits[name]))
            m.d.comb += [finder.pixels.valid.eq(now[at]), finder.pixels.payload.as_value().eq(payload)]
            m.d.comb += [getattr(finder, port).eq(level)
                         for port, level in zip(("black", "lo", "hi"), levels, strict=True)]
        one, other = states
        with m.If(Initial()):
            # The pixel belongs to the line whose pixels are in the stages, so none of these is the last one.
            m.d.comb += [Assume(one["left"] == 0), Assume(~one["done"]), Assume(~one["last"]), Assume(~one["last_q"]),
                         *(Assume(one[name] == other[name]) for name in one)]
        m.d.comb += Assume(~ResetSignal())
        results = Cat(one[name] for name in self.REGISTERS)
        earlier = results
        for _ in range(stages):
            earlier, kept = Signal.like(results), earlier
            m.d.sync += earlier.eq(kept)
        with m.If(now[2 * stages]):
            m.d.comb += [Assert(earlier == Cat(other[name] for name in self.REGISTERS)), Cover(self.other.found)]
        previous = before(m, results)
        with m.If(now[stages + 1] & (before(m, one["left"]) == 0) & ~before(m, one["done"])):
            m.d.comb += Assert(previous == results)
        fragment = Fragment.get(m, platform)
        for name, circuit in circuits.items():
            fragment.add_subfragment(circuit, name)
        return fragment


class Finish(Elaboratable):
    """From any state inside a line: ``finish`` comes the latency after the last pixel, and not before."""

    def __init__(self, make):
        self.finder = make()

    def elaborate(self, platform):
        m, finder = Module(), self.finder
        circuit = Fragment.get(finder, platform)
        s, pixels = driven(circuit), finder.pixels
        now = Cat(Initial(), age := Signal(finder.latency, reset_less=True))
        m.d.sync += age.eq(now)
        m.d.comb += [value.eq(_anything(value)) for value in (finder.black, finder.lo, finder.hi,
                                                              pixels.payload.as_value())]
        m.d.comb += [pixels.valid.eq(AnySeq(1)), Assume(~ResetSignal()),
                     Assume(~(pixels.valid & (pixels.p.first | (pixels.p.last != now[0])))),
                     Assume(pixels.valid | ~now[0])]
        with m.If(Initial()):
            m.d.comb += [Assume(~s[name]) for name in ("finish", "done", "last", "last_q", "first", "first_q")]
            m.d.comb += Assume(s["left"] == 0)
        m.d.comb += [Assert(finder.finish == now[finder.latency]), Cover(finder.finish)]
        fragment = Fragment.get(m, platform)
        fragment.add_subfragment(circuit, "finder")
        return fragment
