"""Buffers of streams: a skid buffer, a register, and a queue of a few records."""

from itertools import pairwise

from amaranth import *
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

__all__ = ["RecordQueue", "SkidBuffer", "StreamRegister"]


class SkidBuffer(Described):
    """Passes a stream on, so that its ``ready`` does not depend on the ``ready`` that comes back.

    Parameters
    ----------
    shape : ShapeLike
        Shape of the payload.

    Members
    -------
    input : In(stream of shape)
        ``ready`` is the inverse of a register.
    output : Out(stream of shape)
        In the same cycle, the payload of ``input``, or else the one that was not taken.

    Latency: none; one payload per cycle.
    """

    def __init__(self, shape):
        self._shape = shape
        super().__init__({"input": In(stream.Signature(shape)), "output": Out(stream.Signature(shape))})

    def elaborate(self, platform):
        m = Module()
        full, kept = Signal(), Signal(self._shape, reset_less=True)
        m.d.comb += [self.input.ready.eq(~full), self.output.valid.eq(self.input.valid | full),
                     self.output.payload.eq(Mux(full, kept, self.input.payload))]
        m.d.sync += full.eq(self.output.valid & ~self.output.ready)
        with m.If(~full):
            m.d.sync += kept.eq(self.input.payload)
        return m


class StreamRegister(Described):
    """Passes a stream on, so that ``valid`` and the payload are registers.

    Parameters
    ----------
    shape : ShapeLike
        Shape of the payload.

    Members
    -------
    input, output : In(stream of shape), Out(stream of shape)
        ``ready`` of ``input`` depends on that of ``output``.

    Latency: one cycle; one payload per cycle.
    """

    def __init__(self, shape):
        self._shape = shape
        super().__init__({"input": In(stream.Signature(shape)), "output": Out(stream.Signature(shape))})

    def elaborate(self, platform):
        m = Module()
        m.d.comb += self.input.ready.eq(~self.output.valid | self.output.ready)
        with m.If(self.input.ready):
            m.d.sync += [self.output.valid.eq(self.input.valid), self.output.payload.eq(self.input.payload)]
        return m


class RecordQueue(Described):
    """A queue of a few records, in registers.

    Parameters
    ----------
    shape : ShapeLike
        Shape of a record.
    depth : int
        Greatest number of records, at least 1.

    Members
    -------
    push, record : In(1), In(shape)
        Adds a record. Must not be high while ``depth`` records are in the queue, unless ``pop`` is.
    pop : In(1)
        Removes the oldest record. Must not be high while the queue is empty.
    oldest : Out(shape)
        The oldest record, while the queue is not empty.
    level : Out(range(depth + 1))
        Number of records.

    Latency: one cycle.
    """

    def __init__(self, shape, depth):
        self._shape, self._depth = shape, depth
        super().__init__({"push": In(1), "record": In(shape), "pop": In(1), "oldest": Out(shape),
                          "level": Out(range(depth + 1))})

    def elaborate(self, platform):
        m = Module()
        records = [Signal(self._shape, name=f"record_{index}", reset_less=True) for index in range(self._depth)]
        place = Signal(range(self._depth + 1))
        m.d.comb += [self.oldest.eq(records[0]), place.eq(self.level - self.pop)]
        m.d.sync += self.level.eq(place + self.push)
        with m.If(self.pop):
            m.d.sync += [record.eq(later) for record, later in pairwise(records)]
        for index, record in enumerate(records):
            with m.If(self.push & (place == index)):
                m.d.sync += record.eq(self.record)
        return m
