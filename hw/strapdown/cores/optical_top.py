"""OPT_top: the optical attitude sensor from the pins of its CCDs to roll and pitch."""

from amaranth import *
from amaranth.lib.wiring import In, Out, connect

from strapdown.algorithms.optical import Calibration, Inertial
from strapdown.blocks import SENSORS, ExposureControl, LineBuffer
from strapdown.config import Assembly
from strapdown.kernel.description import Port, Section, status_port
from strapdown.kernel.engine import Engine
from strapdown.kernel.system import leaves
from strapdown.link import OPTICAL_ATTITUDE

from .frames import LINK_PORTS
from .inertial_sums import InertialSums
from .optical_modules import (
    CCDS,
    MIDDLE,
    TITLES,
    Assembled,
    adc_pins,
    capture,
    finder,
    opt_buffer,
    opt_capture,
    opt_send,
    opt_spot,
    opt_timing,
    read_ports,
    run_ports,
    sensor_pins,
    thresholds,
)
from .optical_update import FRACTION, STATUS, opt_update
from .top import through

__all__ = ["OPTICAL_ASSEMBLIES", "OpticalTop"]

COUNTED, PLACED = 127 + 23, 127 + 11
"""Exponent fields of the numbers 2²³ and 2¹¹, whose fractions take an integer and a position."""

LINE_BITS = 16
"""Bits of the number of a line, as in a frame."""


def _counted(integer):
    """An integer of up to 23 bits as a number, as by ``counted``."""
    return Cat(integer[:FRACTION], C(0, FRACTION - len(integer[:FRACTION])), C(COUNTED, 9))


class OpticalTop(Assembled):
    """The optical attitude sensor, from the pins of its CCDs to roll and pitch, for an OpticalConfig.

    A line is read out, captured and searched for spots, in each CCD separately. Then an update of the angles begins.
    It takes the position of each spot, or the last good one if there is no good one in this line, or in_n0, which gives
    angle zero, if there never was one. Specific force and yaw rate are the means of
    the samples since the line before. A sample counts for the line whose first pixel comes after it: the angles are
    those of the exposure, which ends just before the first pixel.

    Until there was a good position of both CCDs, and in the first update after that, specific force and yaw rate are
    zero, because the angles before are not known.

    Latency: ``latency`` cycles from the last pixel in the stream of the ADCs to ``out_attitude_finish``, in every line.
    Updates come every ``interval`` cycles: the line period; with an external trigger, the shortest one.
    Raises: ValueError if an update takes longer than a line, and as the components inside.
    """

    def __init__(self, config):
        sensor, format = SENSORS[config.sensor], config.pool.format
        self._timing = timing = config.timing()
        self._adc = capture(config, timing)
        self._buffer = LineBuffer(sensor.pixels) if config.mode == "buffered" else None
        self._finders = [finder(config) for _ in CCDS]
        self._thresholds = [thresholds(config) for _ in CCDS]
        least, most = timing.exposure_range
        start = round(config.exposure_us * config.clock_hz / 1e6)
        self._exposures = [ExposureControl(least=least, most=most, start=start, fixed=config.exposure == "fixed")
                           for _ in CCDS]
        self._engine = engine = Engine(opt_update(config), config.engine_pool)
        inertial, words = (self._ports_of(fields) for fields in (Inertial, Calibration))
        self._inertial = [port.name for port in inertial]
        self._sums = InertialSums(format, len(inertial)) if inertial else None
        self._send = opt_send(config)
        latency = (self._buffer.latency if self._buffer else 0) + self._finders[0].latency + 1 + engine.latency
        if latency >= timing.line_cycles:
            raise ValueError(f"the angles of a line take {latency} cycles, and a line of {sensor.name} only "
                             f"{timing.line_cycles}: choose a longer line or a faster clock")
        shown = [port for port in engine.ports if port.name in SHOWN]
        self._paths = {self._timing: run_ports(timing) | sensor_pins(timing) | MIDDLE, self._adc: adc_pins(self._adc)}
        if self._buffer:
            self._paths[self._buffer] = read_ports()
        self._passed = {port.name: port.name for port in (*words, *shown)}
        added = (Port("in_acc_en", In, 1, "a sample of accelerometer and yaw rate, with its numbers"),)
        ports = [*(port for paths in self._paths.values() for port in paths),
                 *(added if inertial else ()), *inertial, *words, *shown, status_port("out_status", STATUS),
                 Port("out_line", Out, LINE_BITS, "number of the line since the reset, modulo 65,536; as in the frame"),
                 *LINK_PORTS]
        super().__init__("OPT_top", TITLE, sorted(ports, key=lambda port: port.flow is Out), latency=latency,
                         sections=(Section("TIMING", paragraphs=(self._text(latency),)), *engine.sections[1:],
                                   *self._send.sections[:2]),
                         facts=engine.facts | self._send.facts)

    def _ports_of(self, arguments):
        """The input ports of the engine for the fields of Inertial or Calibration."""
        inputs = self._engine.system.inputs
        names = {name for field in arguments._fields if field in inputs for name in leaves(inputs[field])}
        return [port for port in self._engine.ports if port.name in names]

    def _text(self, latency):
        samples = (" An update takes the mean of the samples of accelerometer and yaw rate that came between the first "
                   "pixel of the line before and the first pixel of its line. Samples are lost if they come less than "
                   f"{self._sums.interval} cycles after the one before.") if self._sums else ""
        late = (" A trigger may come later, but the equations take this period."
                if "trigger" in self._timing.signature.members else "")
        return (f"A line takes {self._timing.line_cycles} cycles.{late} out_attitude_finish rises {latency} cycles "
                f"after the last pixel has come from the ADCs, {self._adc.latency} cycles after its sample, in every "
                f"line; with it, all outputs and the status change.{samples}")

    @property
    def interval(self):
        """Cycles from line to line; with an external trigger, at least."""
        return self._timing.line_cycles

    @property
    def engine(self):
        """The engine inside."""
        return self._engine

    @property
    def system(self):
        """Equations of the update inside, and the names of its numbers."""
        return self._engine.system

    @property
    def equations(self):
        """The functions whose docstrings the header quotes."""
        return self._engine.equations

    def elaborate(self, platform):
        m = Module()
        m.submodules.timing, m.submodules.capture = timing, adc = self._timing, self._adc
        m.submodules.engine, m.submodules.send = engine, send = self._engine, self._send
        for inner, paths in self._paths.items():
            m.d.comb += through(self, inner, {port.name: path for port, path in paths.items()})
        m.d.comb += through(self, engine, self._passed)
        m.d.comb += [getattr(adc, name).eq(getattr(timing, name)) for name in ("sample", "first", "last")]
        pixels = adc.pixels
        if self._buffer:
            m.submodules.buffer = buffer = self._buffer
            connect(m, adc.pixels, buffer.pixels)
            pixels = buffer.stored

        # All that follows a line happens once: the finders end in the same cycle.
        line_ends, starts, before = Signal(), Signal(), Signal()
        finish = self._finders[0].finish
        m.d.comb += line_ends.eq(finish & ~before)
        m.d.sync += [before.eq(finish), starts.eq(line_ends)]
        good, seen = [], []
        for index, ccd in enumerate(CCDS.values()):
            found = self._spots(m, index, ccd, pixels, line_ends)
            good.append(found.found & self._thresholds[index].known)
            position, unseen = Signal.like(found.position, name=f"{ccd}_position"), Signal(name=f"{ccd}_unseen", init=1)
            with m.If(line_ends & good[index]):
                m.d.sync += [position.eq(found.position), unseen.eq(0)]
            seen.append(~unseen)
            m.d.comb += [
                getattr(engine, f"in_{ccd}_position").eq(Cat(position[:FRACTION], C(PLACED, 8), unseen)),
                getattr(engine, f"in_{ccd}_base").eq(Mux(position[FRACTION], 0, PLACED << FRACTION)),
                getattr(engine, f"in_{ccd}_peak").eq(_counted(found.peak))]
        exposure = Signal.like(timing.effective[0])
        with m.If(adc.pixels.valid & adc.pixels.p.last):
            m.d.sync += exposure.eq(timing.effective[0])
        m.d.comb += [engine.in_line_en.eq(starts), engine.in_exposure_r.eq(_counted(exposure))]

        missing = C(0)
        if self._sums:
            missing = self._sum(m, self._sums, adc.pixels, seen[0] & seen[1])

        def either(name):
            return Cat(each & getattr(found, name).any()
                       for each, found in zip(good, self._finders, strict=True)).any()

        flags = {"roll_missing": ~good[0], "pitch_missing": ~good[1], "uncompensated": missing,
                 **{name: either(name) for name in ("several", "saturated", "edge")}}
        self._show(m, line_ends, starts, Cat(flags.get(name, C(0)) for name in STATUS))
        m.d.comb += [send.in_send_en.eq(engine.out_attitude_finish), send.in_status.eq(self.out_status),
                     *(getattr(send, f"in_{quantity.name}").eq(getattr(engine, f"out_{quantity.name}"))
                       for quantity in OPTICAL_ATTITUDE.quantities),
                     *(getattr(self, port.name).eq(getattr(send, port.name)) for port in LINK_PORTS)]
        return m

    def _spots(self, m, index, ccd, pixels, line_ends):
        """The finder of a CCD, with its thresholds and its exposure; returns the finder."""
        found, thresholds, exposure = (parts[index] for parts in (self._finders, self._thresholds, self._exposures))
        m.submodules[f"{ccd}_spot"] = found
        m.submodules[f"{ccd}_thresholds"] = thresholds
        m.submodules[f"{ccd}_exposure"] = exposure
        m.d.comb += [
            found.pixels.valid.eq(pixels.valid), found.pixels.p.first.eq(pixels.p.first),
            found.pixels.p.last.eq(pixels.p.last), found.pixels.p.pixel[0].eq(pixels.p.pixel[index]),
            *(getattr(found, name).eq(getattr(thresholds, name)) for name in ("black", "lo", "hi")),
            thresholds.update.eq(line_ends), thresholds.peak.eq(found.line_peak),
            thresholds.black_next.eq(found.black_next), exposure.update.eq(line_ends),
            exposure.peak.eq(found.line_peak), exposure.saturated.eq(found.line_saturated),
            self._timing.exposure[index].eq(exposure.exposure)]
        return found

    def _sum(self, m, sums, pixels, counts):
        """The sums of the inertial sensors for the engine; returns a Value that is high if there was no sample."""
        m.submodules.sums = sums
        m.d.comb += [sums.sample.eq(self.in_acc_en), sums.take.eq(pixels.valid & pixels.p.first),
                     sums.give.eq(pixels.valid & pixels.p.last), sums.counts.eq(counts),
                     self._engine.in_samples.eq(_counted(sums.number))]
        for index, name in enumerate(self._inertial):
            m.d.comb += [sums.values[index].eq(getattr(self, name)), getattr(self._engine, name).eq(sums.sums[index])]
        return sums.missing

    def _show(self, m, line_ends, starts, flags):
        """Status and number of the line: they change with the outputs of the engine."""
        finish = self._engine.out_attitude_finish
        found, now = Signal(len(flags), name="flags_found"), Signal(len(flags), name="flags")
        line = Signal(LINE_BITS, name="line", init=-1)
        with m.If(line_ends):
            m.d.sync += found.eq(flags)
        # The finish falls when the engine takes the start.
        with m.If(starts):
            m.d.sync += [now.eq(found), line.eq(line + 1)]
        held = Signal(len(flags) + LINE_BITS, name="held")
        shown = Mux(finish, Cat(now, line), held)
        m.d.sync += held.eq(shown)
        m.d.comb += [self.out_status.eq(shown[:len(flags)] | self._engine.out_status),
                     self.out_line.eq(shown[len(flags):])]


SHOWN = "out_roll", "out_pitch", "out_roll_measured", "out_pitch_measured", "out_attitude_finish"
"""Ports of the engine that are ports of OPT_top."""

TITLE = "roll and pitch of the optical attitude sensor, from the pins of its CCDs"

OPTICAL_ASSEMBLIES = {name: Assembly(TITLES[name], make) for name, make in (
    ("OPT_timing", opt_timing), ("OPT_capture", opt_capture), ("OPT_buffer", opt_buffer), ("OPT_spot", opt_spot),
    ("OPT_send", opt_send))} | {"OPT_top": Assembly(TITLE, OpticalTop)}
"""The modules without equations of their own, in the order of the patent, then the whole."""
