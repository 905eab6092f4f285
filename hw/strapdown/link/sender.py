"""Frames from payloads, onto a serial line."""

from amaranth import *
from amaranth.lib.crc.catalog import CRC16_IBM_3740
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .frame import LAYOUT, MAX_PAYLOAD, SYNC, crc, frame_size, place
from .uart import BITS_PER_BYTE, UartTransmitter

__all__ = ["FrameSender"]


class FrameSender(Described):
    """Sends its payload as one frame of ``LAYOUT`` when it is told to.

    Parameters
    ----------
    kind : int
        Type of the frames, 0 to 255.
    payload_size : int
        Bytes of the payload, 1 to 255.
    clock_hz, baud_rate : float
        As in ``UartTransmitter``.

    Members
    -------
    send : In(1)
        Takes status and payload, if ``busy`` is low; the frame then is of these, whatever they do later.
    status, payload : In(8), In(8 * payload_size)
        What is sent, least significant byte first.
    busy : Out(1)
        High from the cycle after a send that was taken until the next can be.
    overrun : Out(1)
        A send came while busy and was ignored; cleared by the next that is taken.
    tx : Out(1)
        The serial line.

    ``counter`` counts every send, the ignored ones too: the receiver sees a gap where one was.
    Latency: the first start bit begins two cycles after the send; a send is taken every ``interval`` cycles.
    Raises: ValueError for a kind or size out of range, and as ``UartTransmitter``.
    """

    def __init__(self, kind, payload_size, *, clock_hz, baud_rate):
        if not 0 <= kind <= 255:
            raise ValueError(f"type of a frame must be 0 to 255, not {kind}")
        if not 1 <= payload_size <= MAX_PAYLOAD:
            raise ValueError(f"payload must have 1 to {MAX_PAYLOAD} bytes, not {payload_size}")
        self._kind, self._payload_size = kind, payload_size
        self._uart = UartTransmitter(clock_hz=clock_hz, baud_rate=baud_rate)
        super().__init__({"send": In(1), "status": In(8), "payload": In(8 * payload_size),
                          "busy": Out(1), "overrun": Out(1), "tx": Out(1, init=1)})

    @property
    def size(self):
        """Bytes of a frame."""
        return frame_size(self._payload_size)

    @property
    def divisor(self):
        """Clock cycles a bit."""
        return self._uart.divisor

    @property
    def interval(self):
        """Cycles from one send to the first that can follow."""
        return self.size * BITS_PER_BYTE * self.divisor + 1

    def compute(self, counter, status, payload):
        """Software twin: the bytes of a frame, from the number of the send since reset, the status and the payload.

        Raises: ValueError if the payload has another size.
        """
        if len(payload) != self._payload_size:
            raise ValueError(f"payload must have {self._payload_size} bytes, not {len(payload)}")
        checked = bytes((self._payload_size, self._kind, *(counter & 0xFFFF).to_bytes(2, "little"), status)) + payload
        return SYNC + checked + crc(checked).to_bytes(2, "big")

    def elaborate(self, platform):
        m = Module()
        m.submodules.uart = uart = self._uart
        m.submodules.crc = check = CRC16_IBM_3740(data_width=8).create()

        counter = Signal(8 * _width("counter"))
        values = {"sync": C(int.from_bytes(SYNC, "little"), 8 * len(SYNC)),
                  "length": C(self._payload_size, 8), "type": C(self._kind, 8),
                  "counter": counter, "status": self.status, "payload": self.payload}
        frame = Cat(values[field.name] for field in LAYOUT if field.name != "crc")
        assert len(frame) == 8 * (self.size - _width("crc"))

        # Bytes that the line has not taken yet, the next one lowest; the CRC comes after them.
        waiting = Signal(len(frame), reset_less=True)
        left = Signal(range(self.size + 1))
        take = Signal()
        m.d.comb += [take.eq(self.send & ~self.busy), self.busy.eq((left != 0) | ~uart.ready), self.tx.eq(uart.tx),
                     uart.valid.eq(left != 0),
                     uart.data.eq(Mux(left > 2, waiting[:8], Mux(left == 2, check.crc[8:], check.crc[:8])))]
        in_crc = (left <= self.size - _width("sync")) & (left > _width("crc"))
        m.d.comb += [check.start.eq(take), check.data.eq(uart.data), check.valid.eq(uart.valid & uart.ready & in_crc)]

        with m.If(uart.valid & uart.ready):
            m.d.sync += [left.eq(left - 1), waiting.eq(waiting >> 8)]
        with m.If(take):
            m.d.sync += [waiting.eq(frame), left.eq(self.size), self.overrun.eq(0)]
        with m.Elif(self.send):
            m.d.sync += self.overrun.eq(1)
        with m.If(self.send):
            m.d.sync += counter.eq(counter + 1)
        return m


def _width(name):
    """Bytes of a field of fixed size."""
    part = place(name)
    return part.stop - part.start
