"""Starts of updates, by a command or by a stream, and what is known of each update until it has finished."""

from amaranth import *
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .buffers import RecordQueue
from .streams import sample_end

__all__ = ["CYCLES_BITS", "StartControl"]

CYCLES_BITS = 16
"""Bits of the number of cycles that an update takes."""


class StartControl(Described):
    """Starts updates of an engine, one sample at a time, and follows them to their finish.

    Parameters
    ----------
    capacity : int
        Greatest number of updates in flight, and of samples of a stream whose answers are not out.
    channel_bits : int
        Bits of a channel; 0 for one channel.

    Members
    -------
    command, channel : In(1), In(channel_bits)
        Starts an update of a channel, and sends no answer; permitted while ``busy`` is low.
    sample : In(stream of sample_end(channel_bits))
        Starts an update, whose answer is to be sent.
    start, start_channel, ready : Out(1), Out(channel_bits), In(1)
        A start that the engine takes in a cycle with ``ready``.
    finish : In(1)
        High in the cycle in which an update finishes, oldest first; means nothing while none is in flight.
    time : In(CYCLES_BITS)
        Counts the cycles.
    waiting : Out(1)
        A command waits until the engine takes it. Its inputs must hold.
    busy, in_flight : Out(1), Out(1)
        A start waits, or an update is in flight; an update is in flight.
    finished, cycles : Out(1), Out(CYCLES_BITS)
        An update finishes, and the cycles that it took.
    answer, last : Out(1), Out(1)
        An update of the stream finishes, and whether the last word of its answer ends a packet.
    answered : In(1)
        The answer to the oldest sample is out.
    answering : Out(1)
        The answer to a sample is not out yet.

    A sample of the stream is started only if fewer than ``capacity`` answers are not out.
    Latency: one cycle from ``command`` and ``sample`` to ``start``.
    """

    def __init__(self, capacity, channel_bits=0):
        self._capacity = capacity
        super().__init__({
            "command": In(1), "channel": In(channel_bits), "sample": In(stream.Signature(sample_end(channel_bits))),
            "start": Out(1), "start_channel": Out(channel_bits), "ready": In(1), "finish": In(1),
            "time": In(CYCLES_BITS), "waiting": Out(1), "busy": Out(1), "in_flight": Out(1),
            "finished": Out(1), "cycles": Out(CYCLES_BITS),
            "answer": Out(1), "last": Out(1), "answered": In(1), "answering": Out(1)})

    def elaborate(self, platform):
        m = Module()
        record = data.StructLayout({"streamed": 1, "last": 1, "taken": CYCLES_BITS})
        m.submodules.records = in_flight = RecordQueue(record, self._capacity)
        pending = Signal()
        streamed = Signal()
        ends = Signal()
        taken = Signal()
        idle = Signal()
        unanswered = Signal(range(self._capacity + 1))
        m.d.comb += [
            idle.eq(in_flight.level == 0), self.sample.ready.eq(taken & streamed),
            self.start.eq(pending & (~streamed | (unanswered != self._capacity))), taken.eq(self.start & self.ready),
            self.waiting.eq(pending & ~streamed), self.busy.eq(pending | ~idle | self.sample.valid),
            self.in_flight.eq(~idle),
            in_flight.push.eq(taken), in_flight.record.streamed.eq(streamed), in_flight.record.last.eq(ends),
            in_flight.record.taken.eq(self.time),
            self.finished.eq(self.finish & ~idle), in_flight.pop.eq(self.finished),
            # From the edge that took the sample, one cycle after ``taken``: time - (taken + 1).
            self.cycles.eq(self.time + ~in_flight.oldest.taken),
            self.answer.eq(self.finished & in_flight.oldest.streamed), self.last.eq(in_flight.oldest.last),
            self.answering.eq(unanswered != 0)]
        with m.If(taken):
            m.d.sync += pending.eq(0)
        with m.If(self.sample.valid & ~pending):
            m.d.sync += [pending.eq(1), streamed.eq(1), ends.eq(self.sample.p.last),
                         self.start_channel.eq(self.sample.p.channel)]
        with m.If(self.command):
            m.d.sync += [pending.eq(1), streamed.eq(0), self.start_channel.eq(self.channel)]
        m.d.sync += unanswered.eq(unanswered + (taken & streamed) - self.answered)
        return m
