"""Samples from an AXI4-Stream, and answers to an AXI4-Stream."""

from amaranth import *
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .buffers import skid_buffer
from .registers import REGISTER_BITS
from .slave import LOAD

__all__ = ["AnswerSender", "SampleFramer", "StreamMaster", "sample_end", "stream_words"]


def stream_words(channel_bits):
    """The payload of a stream: a word, whether it is the last of a packet, and a channel, if there are several."""
    return data.StructLayout({"data": REGISTER_BITS, "last": 1, "channel": channel_bits})


def sample_end(channel_bits):
    """What is known of a sample: whether its last word was the last of a packet, and its channel."""
    return data.StructLayout({"last": 1, "channel": channel_bits})


class SampleFramer(Described):
    """Divides a stream into samples of a number of words, and loads these into registers.

    A TLAST inside a sample, and a change of the channel inside a sample, drop the words of it that have come. In the
    second case the word with the other channel begins a sample.

    Parameters
    ----------
    count : int
        Words of a sample.
    first : int
        Address of the register of the first word, in registers; the others follow.
    channel_bits : int
        Bits of a channel; 0 for one channel.

    Members
    -------
    words : In(stream of stream_words(channel_bits))
        The stream; ``ready`` is the inverse of a register. A word may be taken, and wait, at any time.
    enable : In(1)
        While it is low, no word is loaded, and words of an incomplete sample are dropped.
    load : Out(stream of LOAD)
        The words, with the addresses of their registers.
    sample : Out(stream of sample_end(channel_bits))
        A complete sample, from the cycle after its last word. No word is loaded until this is taken.
    bad : Out(1)
        High for one cycle if words are dropped.
    partial : Out(1)
        A sample has begun to come in.

    Latency: none from ``words`` to ``load``; one word per cycle.
    """

    def __init__(self, count, first, channel_bits=0):
        self._count, self._first = count, first
        self._words = stream_words(channel_bits)
        super().__init__({
            "words": In(stream.Signature(self._words)), "enable": In(1), "load": Out(stream.Signature(LOAD)),
            "sample": Out(stream.Signature(sample_end(channel_bits))), "bad": Out(1),
            "partial": Out(1)})

    def elaborate(self, platform):
        m = Module()
        words, load, sample = self.words, self.load, self.sample
        valid, word, taken = skid_buffer(m, "word", self._words, words.valid, words.payload, words.ready)
        index = Signal(range(self._count))
        place = Signal(range(self._count))
        open = Signal()
        loads = Signal()
        changed = Signal()
        ends = Signal()
        begun = Signal()
        m.d.comb += [
            open.eq(self.enable & ~sample.valid), load.valid.eq(valid & open), taken.eq(load.ready & open),
            loads.eq(valid & taken), begun.eq(index != 0), self.partial.eq(begun),
            changed.eq(begun & (word.channel != sample.p.channel)), place.eq(Mux(changed, 0, index)),
            ends.eq(place == self._count - 1),
            load.p.address.eq(self._first + place), load.p.data.eq(word.data),
            self.bad.eq(loads & (changed | word.last & ~ends) | begun & ~self.enable)]
        with m.If(sample.ready):
            m.d.sync += sample.valid.eq(0)
        with m.If(loads):
            m.d.sync += [sample.valid.eq(ends), sample.p.last.eq(word.last), sample.p.channel.eq(word.channel),
                         index.eq(Mux(ends | word.last, 0, place + 1))]
        with m.If(~self.enable):
            m.d.sync += index.eq(0)
        return m


class AnswerSender(Described):
    """Sends the words of an answer, one after the other.

    Parameters
    ----------
    count : int
        Words of an answer.
    channel_bits : int
        Bits of a channel; 0 for one channel.

    Members
    -------
    send : In(1)
        Begins an answer; must be low while ``busy`` is high, but for its last cycle.
    last, channel : In(1), In(channel_bits)
        Whether the last word of the answer ends a packet, and its channel; sampled with ``send``.
    words : In(ArrayLayout(unsigned(32), count))
        The words; must hold from the cycle after ``send`` until ``busy`` falls.
    answer : Out(stream of stream_words(channel_bits))
    final : Out(1)
        The word of ``answer`` is the last one of its answer.
    busy : Out(1)
        An answer is being sent.

    Latency: one cycle from ``send`` to the first word.
    """

    def __init__(self, count, channel_bits=0):
        self._count, self._channel_bits = count, channel_bits
        super().__init__({
            "send": In(1), "last": In(1), "channel": In(channel_bits),
            "words": In(data.ArrayLayout(REGISTER_BITS, count)),
            "answer": Out(stream.Signature(stream_words(channel_bits))), "final": Out(1), "busy": Out(1)})

    def elaborate(self, platform):
        m = Module()
        answer = self.answer
        index = Signal(range(self._count))
        last = Signal()
        m.d.comb += [self.final.eq(index == self._count - 1), answer.valid.eq(self.busy),
                     answer.p.last.eq(last & self.final)]
        with m.Switch(index):
            for number in range(self._count):
                with m.Case(number):
                    m.d.comb += answer.p.data.eq(self.words[number])
        with m.If(self.busy & answer.ready):
            m.d.sync += [index.eq(Mux(self.final, 0, index + 1)), self.busy.eq(~self.final)]
        with m.If(self.send):
            m.d.sync += [self.busy.eq(1), last.eq(self.last), answer.p.channel.eq(self.channel)]
        return m


class StreamMaster(Described):
    """The master of an AXI4-Stream; its outputs are registers.

    Parameters
    ----------
    channel_bits : int
        Bits of a channel; 0 for one channel.

    Members
    -------
    words : In(stream of stream_words(channel_bits))
        ``ready`` depends on ``tready``.
    drop : In(1)
        A word that comes while this is high is lost. One that has been offered is not taken back.
    tdata, tlast, tid, tvalid, tready : Out(32), Out(1), Out(channel_bits), Out(1), In(1)
        The AXI4-Stream; there is a tid only if there are several channels.

    Latency: one cycle; one word per cycle.
    """

    def __init__(self, channel_bits=0):
        super().__init__({
            "words": In(stream.Signature(stream_words(channel_bits))), "drop": In(1),
            "tdata": Out(REGISTER_BITS), "tlast": Out(1), **({"tid": Out(channel_bits)} if channel_bits else {}),
            "tvalid": Out(1), "tready": In(1)})

    def elaborate(self, platform):
        m = Module()
        words = self.words
        m.d.comb += words.ready.eq(~self.tvalid | self.tready)
        with m.If(words.ready):
            m.d.sync += [self.tvalid.eq(words.valid & ~self.drop), self.tdata.eq(words.p.data),
                         self.tlast.eq(words.p.last)]
            if len(words.p.channel):
                m.d.sync += self.tid.eq(words.p.channel)
        return m
