"""Frames: sampled from the outputs of a core, and sent over a serial line."""

from amaranth import *
from amaranth.lib import data, stream
from amaranth.lib.crc.catalog import CRC16_IBM_3740
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .frame import LAYOUT, MAX_PAYLOAD, SYNC, crc, frame_size, place
from .uart import BITS_PER_BYTE, UartTransmitter

__all__ = ["FrameSampler", "FrameSender", "HeldFrameSender", "frame_layout"]

WORD = 4
"""Bytes of a word of the payload that is loaded at once."""


def frame_layout(payload_size):
    """The fields that differ from frame to frame, as a StructLayout: counter, status, and payload.

    ``payload_size`` is in bytes. Raises: ValueError for a size that a frame cannot have.
    """
    if not 1 <= payload_size <= MAX_PAYLOAD:
        raise ValueError(f"payload must have 1 to {MAX_PAYLOAD} bytes, not {payload_size}")
    return data.StructLayout({"counter": 8 * _width("counter"), "status": 8 * _width("status"),
                              "payload": 8 * payload_size})


def _width(name):
    """Bytes of a field of fixed size."""
    part = place(name)
    return part.stop - part.start


class FrameSampler(Described):
    """Samples and numbers the updates, and offers each sample to a stream in the same cycle.

    Parameters
    ----------
    payload_size : int
        Bytes of the payload, 1 to 255.

    Members
    -------
    sample : In(1)
        Status and payload are sampled in every cycle in which this is high.
    status, payload : In(8), In(8 * payload_size)
        The values to sample, least significant byte first.
    frames : Out(stream of frame_layout(payload_size))
        The samples, in the cycle in which they come. A sample that comes while the stream is not ready is lost:
        ``valid`` is high only together with ``ready``, so ``ready`` must not wait for it.
    overrun : Out(1)
        The last sample was lost.

    ``counter`` counts all samples since reset, lost samples included, so the receiver sees a gap for each loss.
    Latency: none; one cycle for ``overrun``.
    Raises: ValueError for a size out of range.
    """

    def __init__(self, payload_size):
        super().__init__({"sample": In(1), "status": In(8), "payload": In(8 * payload_size),
                          "frames": Out(stream.Signature(frame_layout(payload_size))), "overrun": Out(1)})

    def elaborate(self, platform):
        m = Module()
        frames = self.frames
        counter = Signal(8 * _width("counter"))
        m.d.comb += [frames.p.counter.eq(counter), frames.p.status.eq(self.status), frames.p.payload.eq(self.payload),
                     frames.valid.eq(self.sample & frames.ready)]
        with m.If(self.sample):
            m.d.sync += [counter.eq(counter + 1), self.overrun.eq(~frames.ready)]
        return m


class FrameSender(Described):
    """Sends frames of ``LAYOUT`` over a serial line.

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
    frames : In(stream of frame_layout(payload_size))
        The frames to send, least significant byte first. ``ready`` depends on registers only.
    tx : Out(1)
        The serial line.

    Latency: the first start bit begins two cycles after the frame was taken. A frame can be taken every ``interval``
    cycles.
    Raises: ValueError for a kind or size out of range, and as ``UartTransmitter``.
    """

    def __init__(self, kind, payload_size, *, clock_hz, baud_rate):
        if not 0 <= kind <= 255:
            raise ValueError(f"type of a frame must be 0 to 255, not {kind}")
        layout = frame_layout(payload_size)
        self._kind, self._payload_size = kind, payload_size
        self._uart = UartTransmitter(clock_hz=clock_hz, baud_rate=baud_rate)
        super().__init__({"frames": In(stream.Signature(layout)), "tx": Out(1, init=1)})

    @property
    def size(self):
        """Bytes of a frame."""
        return frame_size(self._payload_size)

    @property
    def divisor(self):
        """Clock cycles per bit."""
        return self._uart.divisor

    @property
    def interval(self):
        """Least number of cycles from one frame to the next."""
        return self.size * BITS_PER_BYTE * self.divisor + 1

    def compute(self, counter, status, payload):
        """Software twin: the bytes of a frame, from counter, status and payload.

        Raises: ValueError if the payload has another size.
        """
        if len(payload) != self._payload_size:
            raise ValueError(f"payload must have {self._payload_size} bytes, not {len(payload)}")
        checked = bytes((self._payload_size, self._kind, *(counter & 0xFFFF).to_bytes(2, "little"), status)) + payload
        return SYNC + checked + crc(checked).to_bytes(2, "big")

    def elaborate(self, platform):
        m = Module()
        m.submodules.uart = uart = self._uart
        m.submodules.check = check = CRC16_IBM_3740(data_width=8).create()

        frames = self.frames
        # Bytes that the line has not taken yet. The CRC comes after the others.
        left = Signal(range(self.size + 1))
        taken, sent = Signal(), Signal()
        byte, load, advance = self._bytes(m, left)
        m.d.comb += [frames.ready.eq((left == 0) & uart.data.ready), taken.eq(frames.valid & frames.ready),
                     uart.data.valid.eq(left != 0), sent.eq(uart.data.valid & uart.data.ready), self.tx.eq(uart.tx),
                     uart.data.payload.eq(Mux(left > 2, byte, Mux(left == 2, check.crc[8:], check.crc[:8])))]
        in_crc = (left <= self.size - _width("sync")) & (left > _width("crc"))
        m.d.comb += [check.start.eq(taken), check.data.eq(uart.data.payload), check.valid.eq(sent & in_crc)]

        with m.If(sent):
            m.d.sync += [left.eq(left - 1), *advance]
        with m.If(taken):
            m.d.sync += [*load, left.eq(self.size)]
        return m

    def _frame(self, counter, status, payload):
        """All fields but the CRC as one Value, the first byte lowest."""
        values = {"sync": C(int.from_bytes(SYNC, "little"), 8 * len(SYNC)), "length": C(self._payload_size, 8),
                  "type": C(self._kind, 8), "counter": counter, "status": status, "payload": payload}
        return Cat(values[field.name] for field in LAYOUT if field.name != "crc")

    def _bytes(self, m, left):
        """The next byte of the frame, without the CRC, and the statements when a frame is taken and a byte was sent.

        ``left`` bytes are to come, those of the CRC included.
        """
        frame = self._frame(self.frames.p.counter, self.frames.p.status, self.frames.p.payload)
        assert len(frame) == 8 * (self.size - _width("crc"))
        # The next byte is the lowest.
        waiting = Signal(len(frame), reset_less=True)
        return waiting[:8], [waiting.eq(frame)], [waiting.eq(waiting >> 8)]


class HeldFrameSender(FrameSender):
    """A FrameSender that keeps the payload in a small memory, word by word, and with LUT RAM takes half of the LUTs.

    The payload of a frame must hold for ``loading`` cycles after the frame was taken. Its size is a multiple of 4.
    All else is as in FrameSender.
    """

    def __init__(self, kind, payload_size, *, clock_hz, baud_rate):
        super().__init__(kind, payload_size, clock_hz=clock_hz, baud_rate=baud_rate)
        if payload_size % WORD:
            raise ValueError(f"payload must have a multiple of {WORD} bytes, not {payload_size}")

    @property
    def loading(self):
        """Cycles, after a frame was taken, in which its payload must hold."""
        return self._payload_size // WORD

    def _bytes(self, m, left):
        m.submodules.payload = payload = Memory(shape=8 * WORD, depth=1 << (self.loading - 1).bit_length(), init=[])
        write, read = payload.write_port(), payload.read_port(domain="comb")
        index = Signal(range(self.loading))
        loads = Signal()
        # What is left of the payload; its lowest word is the next.
        rest = Signal.like(self.frames.p.payload, name="rest")
        m.d.comb += [rest.eq(self.frames.p.payload >> index * (8 * WORD)), write.addr.eq(index), write.en.eq(loads),
                     write.data.eq(rest)]
        m.d.sync += index.eq(Mux(loads, index + 1, 0))
        with m.If(index == self.loading - 1):
            m.d.sync += loads.eq(0)
        counter = Signal(8 * _width("counter"), reset_less=True)
        status = Signal(8 * _width("status"), reset_less=True)
        head = self._frame(counter, status, C(0, 0))
        begin = place("payload").start
        number = Signal(len(left))
        byte = Signal(8)
        rest_of_word = Signal(8 * WORD)
        m.d.comb += [number.eq(self.size - begin - left), read.addr.eq(number >> 2),
                     rest_of_word.eq(read.data >> number[:2] * 8), byte.eq(rest_of_word)]
        with m.Switch(left):
            for offset in range(begin):
                with m.Case(self.size - offset):
                    m.d.comb += byte.eq(head.word_select(offset, 8))
        return byte, [loads.eq(1), counter.eq(self.frames.p.counter), status.eq(self.frames.p.status)], []
