"""A core that sends its outputs over a serial line, like SINS_uart."""

from amaranth import *
from amaranth.lib import wiring

from strapdown.link import FRAME_TYPES, FrameSampler, FrameSender

from .catalogue import control_of, main_module, make_core, system_of
from .frames import LINK_PORTS, frame_facts, frame_sections
from .top import Top, Wrapper

__all__ = ["UartLink", "uart_core"]


class UartLink(Wrapper):
    """An engine, and a sender that sends its outputs in a frame after each update.

    The frame is the first of ``FRAME_TYPES`` for which the engine has a port ``out_NAME`` for each quantity.

    Parameters
    ----------
    engine : Engine or Wrapper
        An engine with a status port.
    sample_rate_hz : float
        Updates per second.
    clock_hz, baud_rate : float
        As in ``UartTransmitter``.

    Members
    -------
    The engine's, and:
    uart_tx : Out(1)
        The serial line.
    out_link_busy : Out(1)
        High while a frame is sent.
    out_link_overrun : Out(1)
        The last update was not sent, because a frame was being sent.

    Latency: that of the engine; the first start bit begins two cycles after the finish has risen.
    Raises: ValueError if no frame holds the engine's outputs, their format or all its status bits; if the engine has
    several channels; if the frame takes longer than a sample period; and as ``UartTransmitter``.
    """

    def __init__(self, engine, *, sample_rate_hz, clock_hz, baud_rate):
        system, format = engine.system, engine.program.format
        self._frame_type = kind = _frame_type(system, engine.channels, {port.name for port in engine.ports})
        payload_size = len(kind.quantities) * format.width // 8
        if payload_size not in kind.payload_sizes:
            raise ValueError(f"a frame holds binary32 or binary64, not {format.name}")
        sampled = self._sampler = FrameSampler(payload_size)
        bits, places = len(getattr(engine, system.status_port)), len(sampled.status)
        if bits > places:
            raise ValueError(f"a frame holds {places} status bits, and {system.name} has {bits}")
        self._sender = FrameSender(kind.number, payload_size, clock_hz=clock_hz, baud_rate=baud_rate)
        if self._sender.interval > clock_hz / sample_rate_hz:
            raise ValueError(
                f"a frame of {self._sender.size} bytes takes {1000 * self._sender.interval / clock_hz:.3g} ms at "
                f"{baud_rate:g} baud, longer than the sample period of {1000 / sample_rate_hz:.3g} ms")
        super().__init__(
            engine, name=f"{system.name.removesuffix('_top')}_uart",
            title=f"{system.name}, sending {kind.meaning} over a serial line",
            added=LINK_PORTS)

    @property
    def sender(self):
        """The sender of frames inside."""
        return self._sender

    @property
    def equations(self):
        """None: they are in the header of the core without the link."""
        return ()

    @property
    def sections(self):
        """Frame, payload and timing."""
        system = self.system
        return frame_sections(
            self._frame_type, self._sender,
            f"As in {system.name}, {system.finish} rises {self.latency} cycles after the edge that takes a start. "
            "A frame begins two cycles later.")

    @property
    def facts(self):
        """The frame, and the time that it takes, as JSON values."""
        return frame_facts(self._frame_type, self._sender)

    def elaborate(self, platform):
        m = super().elaborate(platform)
        engine, system = self.engine, self.system
        m.submodules.sampler = sampler = self._sampler
        m.submodules.sender = sender = self._sender
        finish, before = getattr(engine, system.finish), Signal()
        m.d.sync += before.eq(finish)
        m.d.comb += [
            sampler.sample.eq(finish & ~before), sampler.status.eq(getattr(engine, system.status_port)),
            sampler.payload.eq(Cat(getattr(engine, f"out_{quantity.name}")
                                   for quantity in self._frame_type.quantities)),
            self.uart_tx.eq(sender.tx), self.out_link_busy.eq(~sender.frames.ready),
            self.out_link_overrun.eq(sampler.overrun)]
        wiring.connect(m, sampler.frames, sender.frames)
        return m


def _frame_type(system, channels, ports):
    """The type of frame that holds the status and outputs of a system; ``ports`` are those that can be read."""
    if channels > 1:
        raise ValueError(f"a frame has no channel number: {system.name} with its {channels} channels cannot be linked")
    for kind in FRAME_TYPES.values():
        if {system.finish, system.status_port, *(f"out_{quantity.name}" for quantity in kind.quantities)} <= ports:
            return kind
    kinds = "; ".join(f"{kind.number} holds {', '.join(quantity.name for quantity in kind.quantities)}"
                      for kind in FRAME_TYPES.values())
    raise ValueError(f"no type of frame holds the outputs of {system.name}: {kinds}")


def uart_core(config, *, clock_hz, baud_rate):
    """The main module of a configuration with its UartLink, as a Top: SINS_uart for a SinsConfig.

    Raises: ValueError, as UartLink.
    """
    module = main_module(config)
    system = system_of(module, config)
    # Checked here too, because scheduling takes seconds.
    _frame_type(system, config.channels, {*system.output_ports, system.finish, system.status_port})
    engine = make_core(module, config).engine
    link = UartLink(engine, sample_rate_hz=config.sample_rate_hz, clock_hz=clock_hz, baud_rate=baud_rate)
    return Top(link, control=control_of(config))
