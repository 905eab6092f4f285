# amaranth: UnusedElaboratable=no
# A core tells its ports without being elaborated.
"""SINS_uart: SINS_top that sends what it found over a serial line."""

from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.link import NAVIGATION, FrameSender

from .catalogue import make_core

__all__ = ["UartCore", "sins_uart"]


class UartCore(wiring.Component):
    """A core and a FrameSender that sends a NAVIGATION frame after each update.

    Parameters
    ----------
    core : Core
        With a port ``out_NAME`` for each quantity of NAVIGATION, and a status port.
    sample_rate_hz : float
        Updates a second.
    clock_hz, baud_rate : float
        As in ``UartTransmitter``.

    Members
    -------
    clk, rst_n, and the core's
        As without the link.
    uart_tx : Out(1)
        The serial line.
    out_link_busy, out_link_overrun : Out(1)
        As ``busy`` and ``overrun`` of FrameSender.

    Latency: the core's; the first start bit begins two cycles after the finish has risen.
    Raises: ValueError if the frame takes longer than a sample period, and as ``UartTransmitter``.
    """

    def __init__(self, core, *, sample_rate_hz, clock_hz, baud_rate):
        self._core = core
        number_size = core.engine.program.format.width // 8
        payload_size = len(NAVIGATION.quantities) * number_size
        if payload_size not in NAVIGATION.payload_sizes:
            raise ValueError(f"a frame holds binary32 or binary64, not {core.engine.program.format.name}")
        self._sender = FrameSender(NAVIGATION.number, payload_size, clock_hz=clock_hz, baud_rate=baud_rate)
        if self._sender.interval > clock_hz / sample_rate_hz:
            raise ValueError(
                f"a frame of {self._sender.size} bytes takes {1000 * self._sender.interval / clock_hz:.3g} ms at "
                f"{baud_rate:g} baud, longer than the sample period of {1000 / sample_rate_hz:.3g} ms")
        super().__init__({**core.signature.members, "uart_tx": Out(1, init=1), "out_link_busy": Out(1),
                          "out_link_overrun": Out(1)})

    @property
    def core(self):
        """The core inside."""
        return self._core

    @property
    def sender(self):
        """The sender of frames inside."""
        return self._sender

    def elaborate(self, platform):
        m = Module()
        m.domains.sync = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal().eq(self.clk), ResetSignal().eq(~self.rst_n)]
        m.submodules.engine = engine = self._core.engine
        for name, member in engine.signature.members.items():
            source, sink = (self, engine) if member.flow == In else (engine, self)
            m.d.comb += getattr(sink, name).eq(getattr(source, name))

        m.submodules.sender = sender = self._sender
        finish, before = getattr(engine, engine.system.finish), Signal()
        m.d.sync += before.eq(finish)
        m.d.comb += [
            sender.send.eq(finish & ~before),
            sender.status.eq(getattr(engine, engine.system.status_port)),
            sender.payload.eq(Cat(getattr(engine, f"out_{quantity.name}") for quantity in NAVIGATION.quantities)),
            self.uart_tx.eq(sender.tx), self.out_link_busy.eq(sender.busy), self.out_link_overrun.eq(sender.overrun)]
        return m


def sins_uart(config, *, clock_hz, baud_rate):
    """SINS_uart for a SinsConfig. Raises: as UartCore."""
    return UartCore(make_core("SINS_top", config), sample_rate_hz=config.sample_rate_hz, clock_hz=clock_hz,
                    baud_rate=baud_rate)
