"""The modules of the optical attitude sensor that have no equations of their own: OPT_timing to OPT_send."""

from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.blocks import (
    EXPOSURE_WIDTH,
    FRACTION,
    PIXEL_WIDTH,
    SENSORS,
    LineBuffer,
    ParallelAdc,
    SpiAdc,
    SpotFinder,
    Thresholds,
)
from strapdown.component import Described
from strapdown.kernel.description import Port, Section, status_port
from strapdown.link import OPTICAL_ATTITUDE, FrameSampler, HeldFrameSender

from .frames import LINK_PORTS, frame_facts, frame_sections
from .optical_update import STATUS
from .top import through

__all__ = ["CCDS", "Adapter", "Assembled", "FrameOutput", "adc_pins", "capture", "finder", "opt_buffer",
           "opt_capture", "opt_send", "opt_spot", "opt_timing", "read_ports", "sensor_pins", "thresholds"]

CCDS = {"r": "roll", "p": "pitch"}
"""Letters in the names of ports, and the CCDs that they stand for."""


class Assembled(Described):
    """Base of the components with what a ``Top`` needs: ports in their order, and texts for the header.

    Parameters
    ----------
    name, title : str
        Name of the Verilog module, and its function in one line.
    ports : iterable of Port
    latency : int or None
        Cycles; None if the module has no latency.
    sections : tuple of Section
        Sections of the header that follow the table of ports.
    facts : dict or None
        Figures as JSON values.
    """

    def __init__(self, name, title, ports, *, latency=None, sections=(), facts=None):
        self._name, self._title, self._ports, self._latency = name, title, tuple(ports), latency
        self._sections, self._facts = sections, facts or {}
        super().__init__({port.name: port.member for port in self._ports})

    @property
    def name(self):
        """Name of the Verilog module."""
        return self._name

    @property
    def title(self):
        """The function of the module in one line."""
        return self._title

    @property
    def ports(self):
        """The ports, in the order of the module."""
        return self._ports

    @property
    def latency(self):
        """Cycles; None if the module has no latency."""
        return self._latency

    @property
    def equations(self):
        """None: the module has no kernel."""
        return ()

    @property
    def sections(self):
        """Sections of the header that follow the table of ports."""
        return self._sections

    @property
    def facts(self):
        """Figures as JSON values."""
        return self._facts


class Adapter(Assembled):
    """A component inside a module with other names of its ports.

    Parameters
    ----------
    name, title : str
        Of the module.
    inner : wiring.Component
    ports : dict
        Maps each Port to a member of ``inner``, as in ``through``.
    **parameters
        As of Assembled.
    """

    def __init__(self, name, title, inner, ports, **parameters):
        self._inner, self._paths = inner, ports
        super().__init__(name, title, ports, **parameters)

    def elaborate(self, platform):
        m = Module()
        m.submodules.inner = self._inner
        m.d.comb += through(self, self._inner, {port.name: path for port, path in self._paths.items()})
        return m


def _timing(text):
    return Section("TIMING", paragraphs=(text,))


def _each(pattern, flow, width, meaning, path):
    """A port for each CCD, mapped to an element of a member."""
    return {Port(pattern.format(letter), flow, width, meaning.format(ccd)): f"{path}.{index}"
            for index, (letter, ccd) in enumerate(CCDS.items())}


def _stream_ports(prefix, flow, path, letters="rp"):
    """Ports of a stream of pixels."""
    ports = {Port(f"{prefix}_valid", flow, 1, "a pixel of the line"): f"{path}.valid",
             Port(f"{prefix}_first", flow, 1, "with it: the first pixel of the line"): f"{path}.p.first",
             Port(f"{prefix}_last", flow, 1, "with it: the last pixel of the line"): f"{path}.p.last"}
    if letters:
        return ports | _each(f"{prefix}_pixel_{{}}", flow, PIXEL_WIDTH, "pixel of the {} CCD, light positive",
                             f"{path}.p.pixel")
    return ports | {Port(f"{prefix}_pixel", flow, PIXEL_WIDTH, "pixel, light positive"): f"{path}.p.pixel.0"}


def sensor_pins(timing):
    """Ports of the pins of the CCDs, mapped to members of a LineTiming."""
    pins = {Port("ccd_clk", Out, 1, "clock of both CCDs"): "ccd_clk"}
    if timing.sensor.protocol == "sh_icg":
        return pins | _each("ccd_sh_{}", Out, 1, "pin SH of the {} CCD", "ccd_sh") | {
            Port("ccd_icg", Out, 1, "pin ICG of both CCDs", init=1): "ccd_icg"}
    return pins | _each("ccd_st_{}", Out, 1, "pin ST of the {} CCD", "ccd_st")


def run_ports(timing):
    """Ports that start lines, mapped to members of a LineTiming."""
    ports = {Port("in_run_en", In, 1, "high for lines; a line always ends"): "run"}
    if "trigger" in timing.signature.members:
        ports |= {Port("in_trigger", In, 1, "its rising edge exposes a line; at any time"): "trigger"}
    return ports


MIDDLE = {Port("out_middle", Out, 1, "high for a cycle in the middle of the roll CCD's exposure"): "middle"}


def opt_timing(config):
    """OPT_timing for an OpticalConfig."""
    timing = config.timing()
    exposures = _each("in_exposure_{}", In, EXPOSURE_WIDTH, "exposure of the {} CCD, cycles of clk", "exposure")
    ports = run_ports(timing) | exposures | sensor_pins(timing) | {
        Port("out_sample", Out, 1, "an effective pixel is to be converted"): "sample",
        Port("out_first", Out, 1, "with it: the first pixel of the line"): "first",
        Port("out_last", Out, 1, "with it: the last pixel of the line"): "last",
        Port("out_pixel_index", Out, PIXEL_WIDTH, "with it: number of the pixel, from 0"): "pixel_index",
        **_each("out_exposing_{}", Out, 1, "the {} CCD is exposed", "exposing"), **MIDDLE,
        **_each("out_exposure_{}", Out, EXPOSURE_WIDTH, "exposure of the line of the {} CCD that comes, cycles of clk",
                "effective")}
    least, most = timing.exposure_range
    text = (f"A line takes {timing.line_cycles} cycles, a pixel {timing.slot_cycles}. Exposures are from {least} to "
            f"{most} cycles in steps of {timing.exposure_step}; a port takes the next shorter one. An edge that "
            f"depends on an exposure is {timing.guard} cycles before a sample, or more.")
    events = Section("EVENTS OF A LINE (cycle)", rows=tuple(timing.events.items()))
    return Adapter("OPT_timing", TITLES["OPT_timing"], timing, ports, sections=(_timing(text), events),
                   facts={"line_cycles": timing.line_cycles, "pixel_cycles": timing.slot_cycles,
                          "events": timing.events})


def capture(config, timing):
    """The ADCs of an OpticalConfig: a SpiAdc or a ParallelAdc."""
    sensor = SENSORS[config.sensor]
    if config.adc == "spi":
        return SpiAdc(clock_hz=config.clock_hz, slot_cycles=timing.slot_cycles, sclk_hz=config.adc_sclk_hz,
                      invert=sensor.invert)
    return ParallelAdc(adc_latency=config.adc_latency, slot_cycles=timing.slot_cycles, invert=sensor.invert)


def adc_pins(adc):
    """Ports of the pins of the ADCs, mapped to members of a SpiAdc or a ParallelAdc."""
    if "sdata" in adc.signature.members:
        return _each("adc_sdata_{}", In, 1, "pin SDATA of the {} ADC", "sdata") | {
            Port("adc_cs_n", Out, 1, "pin CS of both ADCs", init=1): "cs_n",
            Port("adc_sclk", Out, 1, "pin SCLK of both ADCs", init=1): "sclk"}
    return _each("adc_data_{}", In, PIXEL_WIDTH, "data pins of the {} ADC", "data") | {
        Port("adc_clk", Out, 1, "clock pin of both ADCs"): "adc_clk"}


def opt_capture(config):
    """OPT_capture for an OpticalConfig."""
    adc = capture(config, config.timing())
    ports = {Port("in_sample", In, 1, "convert a pixel"): "sample",
             Port("in_first", In, 1, "with it: the first pixel of the line"): "first",
             Port("in_last", In, 1, "with it: the last pixel of the line"): "last",
             **adc_pins(adc), **_stream_ports("out", Out, "pixels")}
    text = f"out_valid is high {adc.latency} cycles after in_sample, with the pixels of that sample."
    return Adapter("OPT_capture", TITLES["OPT_capture"], adc, ports, latency=adc.latency, sections=(_timing(text),))


def read_ports():
    """Ports that read whole lines, mapped to members of a LineBuffer."""
    return {Port("in_read_index", In, PIXEL_WIDTH, "number of the pixel to read"): "read_index",
            Port("in_read_ccd", In, 1, "0: of the roll CCD, 1: of the pitch CCD"): "read_ccd",
            Port("out_line_ready", Out, 1, "the last complete line can be read"): "line_ready",
            Port("out_bank", Out, 1, "the bank that holds it"): "bank",
            Port("out_read_pixel", Out, PIXEL_WIDTH, "the pixel, one cycle after its number"): "read_pixel"}


def opt_buffer(config):
    """OPT_buffer for an OpticalConfig."""
    buffer = LineBuffer(SENSORS[config.sensor].pixels)
    ports = _stream_ports("in", In, "pixels") | _stream_ports("out", Out, "stored") | read_ports()
    text = (f"After the last pixel of a line, all its pixels come out, one in each cycle, the last one "
            f"{buffer.latency} cycles later. While out_line_ready is high, any of them can be read.")
    return Adapter("OPT_buffer", TITLES["OPT_buffer"], buffer, ports, latency=buffer.latency, sections=(_timing(text),))


def finder(config):
    """A SpotFinder of an OpticalConfig."""
    return SpotFinder(SENSORS[config.sensor].pixels, gap=config.gap, width_max=config.width_max)


def thresholds(config):
    """Thresholds of an OpticalConfig."""
    return Thresholds(lo_min=config.lo_min, shift=config.shift)


def opt_spot(config):
    """OPT_spot for an OpticalConfig."""
    spot = finder(config)
    results = {"found": "a run is valid; without one all results down to out_edge are zero",
               "position": f"position of the spot, pixels with {FRACTION} bits of fraction",
               "peak": "largest light of the spot above black, counts",
               "width": "pixels of the spot", "sum": "sum of the weights of the spot",
               "saturated": "saturated pixels of the spot", "several": "more than one run is valid",
               "edge": "the spot touches an end of the line"}
    ports = _stream_ports("in", In, "pixels", letters="") | {
        Port(f"in_{name}", In, PIXEL_WIDTH, meaning): name for name, meaning in (
            ("black", "black level, counts"), ("lo", "threshold of a pixel above black, counts"),
            ("hi", "threshold of the peak above black, counts"))} | {
        Port("out_spot_finish", Out, 1, "high when the results are valid; falls with the first pixel"): "finish"} | {
        Port(f"out_{name}", Out, len(getattr(spot, name)), meaning): name for name, meaning in results.items()} | {
        Port("out_black", Out, PIXEL_WIDTH, "black level for the next line, counts"): "black_next",
        Port("out_line_peak", Out, PIXEL_WIDTH, "largest light of the line above black, counts"): "line_peak",
        Port("out_line_saturated", Out, 1, "a pixel of the line is saturated"): "line_saturated"}
    text = (f"out_spot_finish rises {spot.latency} cycles after the last pixel, with all results, which hold until the "
            "next line. Black level and thresholds must not change from the first pixel to then.")
    return Adapter("OPT_spot", TITLES["OPT_spot"], spot, ports, latency=spot.latency, sections=(_timing(text),))


class FrameOutput(Assembled):
    """Sends results of OPT_attitude over a serial line, in frames of the type OPTICAL_ATTITUDE.

    Parameters
    ----------
    clock_hz, baud_rate : float
        As of ``UartTransmitter``.
    every : int
        Updates from one frame to the next.
    period_s : float
        From one update to the next.

    Members
    -------
    in_send_en : In(1)
        An update is complete, at its rising edge, with the status and the numbers.
    in_status, in_NAME : In(8), In(32)
        The status bits, and a number for each quantity of the frame.
    uart_tx : Out(1)
        The serial line.
    out_link_busy, out_link_overrun : Out(1)
        As of ``UartLink``.

    Status and numbers must hold from the rising edge on, for the cycles in which the sender loads them.
    The frame's counter counts all updates.
    Latency: ``latency`` cycles from the rising edge to the first start bit.
    Raises: ValueError if a frame takes longer than ``every`` periods, and as ``UartTransmitter``.
    """

    def __init__(self, *, clock_hz, baud_rate, every, period_s):
        kind = OPTICAL_ATTITUDE
        self._every = every
        self._sampler = FrameSampler(4 * len(kind.quantities))
        self._sender = HeldFrameSender(kind.number, 4 * len(kind.quantities), clock_hz=clock_hz, baud_rate=baud_rate)
        if self._sender.interval > clock_hz * period_s * every:
            raise ValueError(
                f"a frame of {self._sender.size} bytes takes {1000 * self._sender.interval / clock_hz:.3g} ms at "
                f"{baud_rate:g} baud, longer than {1000 * period_s * every:.3g} ms, which is send_every={every} lines")
        super().__init__(
            "OPT_send", TITLES["OPT_send"], (
                Port("in_send_en", In, 1, "an update is complete, at its rising edge"),
                status_port("in_status", STATUS, In),
                *(Port(f"in_{quantity.name}", In, 32, f"{quantity.meaning}, {quantity.unit}")
                  for quantity in kind.quantities),
                *LINK_PORTS), latency=2,
            sections=frame_sections(kind, self._sender, (
                "A frame begins two cycles after in_send_en has risen"
                f"{f', every {every} times' if every > 1 else ''}. It is loaded in the cycle in which in_send_en rises "
                f"and in the {self._sender.loading} cycles after it; until then all in_ numbers must hold.")),
            facts=frame_facts(kind, self._sender))

    @property
    def sender(self):
        """The sender of frames inside."""
        return self._sender

    def elaborate(self, platform):
        m = Module()
        m.submodules.sampler = sampler = self._sampler
        m.submodules.sender = sender = self._sender
        before = Signal()
        skipped = Signal(range(self._every))
        chosen = Signal()
        m.d.sync += before.eq(self.in_send_en)
        with m.If(sampler.sample):
            m.d.sync += skipped.eq(Mux(skipped == self._every - 1, 0, skipped + 1))
        m.d.comb += [
            chosen.eq(skipped == 0), sampler.sample.eq(self.in_send_en & ~before), sampler.status.eq(self.in_status),
            sampler.payload.eq(Cat(getattr(self, f"in_{quantity.name}") for quantity in OPTICAL_ATTITUDE.quantities)),
            sampler.frames.ready.eq(sender.frames.ready | ~chosen), sender.frames.p.eq(sampler.frames.p),
            sender.frames.valid.eq(sampler.frames.valid & chosen), self.uart_tx.eq(sender.tx),
            self.out_link_busy.eq(~sender.frames.ready), self.out_link_overrun.eq(sampler.overrun)]
        return m


def opt_send(config):
    """OPT_send for an OpticalConfig."""
    return FrameOutput(clock_hz=config.clock_hz, baud_rate=config.baud_rate, every=config.send_every,
                       period_s=config.period_s)


TITLES = {
    "OPT_timing": "drives both CCDs: clock, transfer, exposure, and the instants of the samples",
    "OPT_capture": "reads both ADCs: a stream of pixels",
    "OPT_buffer": "two lines of both CCDs: one is written while the other is read",
    "OPT_spot": "finds the spot in the pixels of a CCD",
    "OPT_send": "sends the attitude over a serial line",
}
"""Functions of the modules in one line."""
