"""UART transmitter: 8 data bits, no parity, one stop bit."""

from amaranth import *
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

__all__ = ["BITS_PER_BYTE", "UartTransmitter"]

BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""

LEAST_DIVISOR = 4
LARGEST_ERROR = 0.02
"""A receiver samples the stop bit 9.5 bits after the edge of the start bit. There, an error of half a bit, less a
sixteenth for the receiver's sampling, is 4.6 %. The transmitter may use less than half of it."""


class UartTransmitter(Described):
    """Sends bytes over a serial line, 8N1, least significant bit first.

    Parameters
    ----------
    clock_hz, baud_rate : float
        Frequency of the clock, and bits per second on the line.

    Members
    -------
    data : In(stream of 8 bits)
        Bytes.
    tx : Out(1)
        The line, directly from a register; high while idle.

    Latency: the start bit begins in the cycle after the byte was taken. A byte takes ``10 * divisor`` cycles;
    ``data.ready`` is high in the last of them, so that bytes follow each other without a gap.
    Raises: ValueError if a bit is shorter than 4 cycles, or the rate has an error of more than 2 %.
    """

    def __init__(self, *, clock_hz, baud_rate):
        if not (clock_hz > 0 and baud_rate > 0):
            raise ValueError(f"clock and baud rate must be above zero, not {clock_hz:g} Hz and {baud_rate:g} baud")
        self._divisor = round(clock_hz / baud_rate)
        if self._divisor < LEAST_DIVISOR:
            raise ValueError(f"{baud_rate:g} baud need a clock of {LEAST_DIVISOR * baud_rate:g} Hz or more, "
                             f"not {clock_hz:g} Hz")
        actual = clock_hz / self._divisor
        if abs(actual / baud_rate - 1) > LARGEST_ERROR:
            raise ValueError(f"{clock_hz:g} Hz / {self._divisor} is {actual:g} baud, more than "
                             f"{LARGEST_ERROR:.0%} from {baud_rate:g}: choose another clock or baud rate")
        super().__init__({"data": In(stream.Signature(unsigned(8))), "tx": Out(1, init=1)})

    @property
    def divisor(self):
        """Clock cycles per bit."""
        return self._divisor

    def elaborate(self, platform):
        m = Module()
        timer = Signal(range(self._divisor))
        left = Signal(range(BITS_PER_BYTE + 1))
        shift = Signal(BITS_PER_BYTE, init=-1)
        bit_ends = timer == 0
        m.d.comb += [self.tx.eq(shift[0]), self.data.ready.eq((left == 0) | ((left == 1) & bit_ends))]

        m.d.sync += timer.eq(Mux(bit_ends, self._divisor - 1, timer - 1))
        with m.If(self.data.ready):
            m.d.sync += left.eq(0)
            with m.If(self.data.valid):
                m.d.sync += [shift.eq(Cat(C(0, 1), self.data.payload, C(1, 1))), left.eq(BITS_PER_BYTE),
                             timer.eq(self._divisor - 1)]
        with m.Elif(bit_ends):
            # Ones follow the stop bit, so the idle line is high.
            m.d.sync += [shift.eq(Cat(shift[1:], C(1, 1))), left.eq(left - 1)]
        return m
