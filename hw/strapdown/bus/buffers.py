"""Buffers: a skid buffer of a stream, and a queue of a few records."""

from itertools import pairwise

from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

__all__ = ["RecordQueue", "skid_buffer"]


def skid_buffer(m, name, shape, valid, payload, ready):
    """A skid buffer: passes a stream on, so that its ``ready`` does not depend on the one that comes back.

    Parameters
    ----------
    m : Module
        Gets the statements, in the domain ``sync``.
    name : str
        Of the buffer, for its signals.
    shape : ShapeLike
        Shape of the payload.
    valid, payload, ready : Value
        The stream that comes in; ``ready`` is driven, by the inverse of a register.

    Returns
    -------
    valid, payload, taken : Signal
        The stream that goes out, in the same cycle; ``taken`` is to be driven, and means nothing while ``valid`` is
        low.
    """
    full, kept = Signal(name=f"{name}_full"), Signal(shape, name=f"{name}_kept", reset_less=True)
    out_valid = Signal(name=f"{name}_valid")
    out = Signal(shape, name=name)
    taken = Signal(name=f"{name}_taken")
    m.d.comb += [ready.eq(~full), out_valid.eq(valid | full), out.eq(Mux(full, kept, payload))]
    m.d.sync += full.eq(out_valid & ~taken)
    with m.If(~full):
        m.d.sync += kept.eq(payload)
    return out_valid, out, taken


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
