"""Blocks of a bus: the AXI4-Lite slave, and what stands between the AXI4-Streams and the core.

A property speaks of states that are a few clock edges apart, the first one with any contents of the registers for which
its invariants hold. It proves these again in the last state, so induction extends it to all edges. What the registers
hold of an access is compared with what the ports showed when it was taken.
"""

from functools import reduce
from operator import or_
from typing import ClassVar

from amaranth import *
from amaranth.asserts import AnySeq, Initial
from amaranth.hdl import Assert, Assume, Cover
from amaranth.lib.wiring import In

from strapdown.bus import (
    OKAY,
    PLACE,
    REGISTER_BITS,
    SLVERR,
    Access,
    AnswerSender,
    AxiLiteSlave,
    Field,
    RecordQueue,
    Register,
    SampleFramer,
    StartControl,
    StreamMaster,
)

from .sequencer import before, driven, implies

__all__ = ["Answers", "Framing", "InTime", "Master", "Queue", "Reads", "Sending", "Starting", "Writes"]

TABLE = (
    Register("IDENTITY", 0x000, (Field("value", 0, 32, Access.CONSTANT, "", 0x1234_5678),), ""),
    Register("SCRATCH", 0x00C, (Field("value", 0, 32, Access.WRITE, "", 0xABCD),), ""),
    Register("CONTROL", 0x010, (Field("start", 0, 1, Access.PULSE, ""), Field("mode", 6, 4, Access.WRITE, ""),
                                Field("stop", 31, 1, Access.PULSE, "")), ""),
    Register("FLAGS", 0x01C, (Field("bad", 3, 1, Access.CLEAR, ""), Field("done", 7, 2, Access.CLEAR, "")), ""),
    Register("TIME", 0x028, (Field("value", 0, 32, Access.READ, ""),), ""),
    Register("INPUT", 0x100, (Field("value", 0, 24, Access.WRITE, ""),), ""),
    Register("OUTPUT", 0x400, (Field("value", 4, 16, Access.READ, ""),), ""))
"""Registers with fields of each access, in one byte lane and across several."""

FLAG, LOADED = ("FLAGS", "bad"), ("INPUT",)
COUNT, FIRST, CHANNEL_BITS = 3, 0x40, 2
"""Words of a sample or an answer, register of the first one, and bits of a channel."""
CAPACITY = 2


class _Block(Elaboratable):
    """Base: a block in the domain ``sync`` with free inputs, and without a reset."""

    edges = 1
    """Edges from the first to the last state."""
    fixed: ClassVar[dict[str, int]] = {}
    """Inputs that are not free, and their values."""

    def __init__(self, make=None):
        self.block = (make or self.make)()

    def make(self):
        """The block."""
        raise NotImplementedError

    def elaborate(self, platform):
        m, block = Module(), self.block
        circuit = Fragment.get(block, platform)
        for path, member, port in block.signature.flatten(block):
            value = Value.cast(port)
            if member.flow is In and len(value):
                m.d.comb += value.eq(self.fixed.get("__".join(map(str, path)), AnySeq(len(value))))
        m.d.comb += Assume(~ResetSignal())
        s = driven(circuit)
        now = Cat(Initial(), age := Signal(self.edges, reset_less=True))
        m.d.sync += age.eq(now)
        invariants = self.invariants(s)
        claims, event = self.claims(m, s)
        with m.If(now[0]):
            m.d.comb += [Assume(claim) for claim in invariants]
        with m.If(now[self.edges]):
            m.d.comb += [*(Assert(claim) for claim in (*invariants, *claims)), Cover(event)]
        fragment = Fragment.get(m, platform)
        fragment.add_subfragment(circuit, "block")
        return fragment

    def invariants(self, s):
        """What holds in every state; ``s`` maps the names of the block's signals to the signals."""
        return []

    def claims(self, m, s):
        """What holds in the last state, and what is possible in it: a list of Value, and a Value."""
        raise NotImplementedError


class _Slave(_Block):
    """Base: a slave with a few registers, one of which can be loaded."""

    def make(self):
        return AxiLiteSlave(TABLE, FLAG, loaded=LOADED)

    def oldest(self, s):
        """The address and the data of the write, and the address of the read, that come next: from the buffers, or else
        from the bus. And whether they are there."""
        slave = self.block
        data = Cat(slave.wdata, slave.wstrb)
        return {name: (Mux(s[f"{name}_full"], Value.cast(s[f"{name}_kept"]), offered), s[f"{name}_full"] | valid)
                for name, offered, valid in (("aw", slave.awaddr[PLACE:], slave.awvalid), ("w", data, slave.wvalid),
                                             ("ar", slave.araddr[PLACE:], slave.arvalid))}

    def buffered(self, m, s, name):
        """What a buffer holds is what came and was not taken."""
        oldest, there = self.oldest(s)[name]
        waits = before(m, there & ~s[f"{name}_taken"])
        return [s[f"{name}_full"] == waits,
                implies(waits, Value.cast(s[f"{name}_kept"]) == before(m, oldest))]


class Answers(_Slave):
    """An answer is given to each access and to no other; an offer stays until it is taken.

    Accesses that were taken and not answered are those in the buffers, in the stages and in the answers: their number
    changes by one for each access and each answer.
    """

    def claims(self, m, s):
        slave = self.block
        writes = s["write_valid"] & s["answered"]
        inside = {"aw": s["aw_full"] + writes + slave.bvalid, "w": s["w_full"] + writes + slave.bvalid,
                  "ar": s["ar_full"] + s["read_valid"] + slave.rvalid}
        claims = []
        for name, number in inside.items():
            comes = getattr(slave, f"{name}valid") & getattr(slave, f"{name}ready")
            goes = slave.rvalid & slave.rready if name == "ar" else slave.bvalid & slave.bready
            claims.append(number + before(m, goes) == before(m, number) + before(m, comes))
        for valid, ready, payload in ((slave.bvalid, slave.bready, slave.bresp),
                                      (slave.rvalid, slave.rready, Cat(slave.rdata, slave.rresp))):
            claims.append(implies(before(m, valid & ~ready), valid & (payload == before(m, payload))))
        return claims, before(m, slave.bvalid & slave.bready & slave.rvalid & slave.rready)


class InTime(_Slave):
    """If answers are taken at once, an access is answered in the second cycle after it is there."""

    edges = 2
    fixed: ClassVar = {"bready": 1, "rready": 1, "pause": 0}

    def claims(self, m, s):
        slave, oldest = self.block, self.oldest(s)
        (_, address), (_, data), (_, read) = (oldest[name] for name in ("aw", "w", "ar"))
        write = address & data
        return [implies(before(m, before(m, write)), slave.bvalid), implies(before(m, before(m, read)), slave.rvalid),
                slave.awready | ~before(m, write), slave.wready | ~before(m, write), slave.arready], slave.rvalid


class Writes(_Slave):
    """A write changes the bytes that it selects, of the fields at its address that can be written, and nothing else.

    Its answer tells whether it was permitted. A flag is set even if it is cleared at the same time.
    """

    def claims(self, m, s):
        slave, oldest = self.block, self.oldest(s)
        (address, has_address), (data, has_data) = oldest["aw"], oldest["w"]
        stage = Cat(s["write_address"], Value.cast(s["write"]))
        goes, pairs = s["goes"], has_address & has_data
        loads = slave.load.valid & slave.load.ready
        word = Cat(slave.load.p.address, slave.load.p.data, C(0b1111, 4))
        claims = [
            *self.buffered(m, s, "aw"), *self.buffered(m, s, "w"),
            ~(loads & pairs), implies(loads, goes),
            s["write_valid"] == before(m, Mux(goes, pairs | loads, s["write_valid"])),
            s["answered"] == before(m, Mux(goes, pairs, s["answered"])),
            implies(before(m, goes & pairs), stage == before(m, Cat(address, data))),
            implies(before(m, loads), stage == before(m, word)),
            implies(before(m, ~goes), stage == before(m, stage))]

        acts, answered = s["write_valid"] & goes, s["answered"]
        number, value, strobes = s["write_address"], s["write"][:REGISTER_BITS], s["write"][REGISTER_BITS:]
        lanes = Cat(strobe.replicate(REGISTER_BITS // len(strobes)) for strobe in strobes)
        permitted = Const(0)
        for register in TABLE:
            hit = number == register.address >> PLACE
            if register.name in LOADED:
                hit = hit & ~(slave.locked & answered)
            permitted = permitted | (hit & Const(register.writable))
            for field in register.fields:
                chosen, bits = (part[field.low:field.high + 1] for part in (lanes, value))
                written = Mux(acts & hit, chosen, 0)
                if field.access in (Access.WRITE, Access.CLEAR):
                    member = slave.field(register.name, field.name)
                    after = (member & ~written) | (bits & written)
                    if field.access is Access.CLEAR:
                        sets = s["bad"] if (register.name, field.name) == FLAG else getattr(
                            slave, f"{register.name}_{field.name}_set".lower())
                        after = (member & ~(written & bits)) | sets
                    claims.append(member == before(m, after))
                elif field.access is Access.PULSE:
                    claims.append(slave.field(register.name, field.name) == written & bits)
        claims += [
            s["bad"] == (acts & ~permitted) | s["bad_read"],
            implies(before(m, acts & answered),
                    slave.bvalid & (slave.bresp == before(m, Mux(permitted, Const(OKAY, 2), SLVERR)))),
            implies(slave.pause, ~(acts & answered))]
        return claims, before(m, acts & permitted & answered)


class Reads(_Slave):
    """A read returns the fields at its address, in the cycle in which it was taken, and 0 in all other bits.

    Its answer, and the flag, tell whether there is a register.
    """

    def claims(self, m, s):
        slave = self.block
        address, there = self.oldest(s)["ar"]
        word, known = Const(0, REGISTER_BITS), Const(0)
        for register in TABLE:
            hit = address == register.address >> PLACE
            known = known | hit
            for field in register.fields:
                if field.access is not Access.PULSE:
                    value = Const(field.reset, field.width) if field.access is Access.CONSTANT else \
                        slave.field(register.name, field.name)
                    word = word | (Mux(hit, value, 0) << field.low)
        stage = Cat(reduce(or_, (s[name] for name in s if name.startswith("group_"))), s["found"])
        answer = Cat(slave.rdata, slave.rresp == OKAY)
        taken, moves = s["ar_taken"], ~slave.rvalid | slave.rready
        claims = [
            *self.buffered(m, s, "ar"),
            s["read_valid"] == before(m, Mux(taken, there, s["read_valid"])),
            implies(before(m, taken & there), stage == before(m, Cat(word[:REGISTER_BITS], known))),
            implies(before(m, ~taken), stage == before(m, stage)),
            taken == ~s["read_valid"] | moves,
            slave.rvalid == before(m, Mux(moves, s["read_valid"], slave.rvalid)),
            implies(before(m, moves & s["read_valid"]), answer == before(m, stage)),
            (slave.rresp == OKAY) | (slave.rresp == SLVERR) | ~before(m, moves),
            s["bad_read"] == s["read_valid"] & moves & ~s["found"]]
        return claims, before(m, taken & there & known)


class Master(_Block):
    """A word that comes is offered from the next cycle until it is taken, once, unless it is dropped."""

    def make(self):
        return StreamMaster(CHANNEL_BITS)

    def claims(self, m, s):
        master, words = self.block, self.block.words
        offered, waits = Cat(master.tdata, master.tlast, master.tid), master.tvalid & ~master.tready
        comes = words.valid & words.ready & ~master.drop
        return [words.ready == ~waits, master.tvalid == before(m, comes | waits),
                implies(before(m, waits), offered == before(m, offered)),
                implies(before(m, comes), offered == before(m, words.payload.as_value()))], before(m, comes)


class Framing(_Block):
    """Each word is loaded once, in order, to the register of its place; the last one of a sample completes it.

    Unless ``bad`` is high, no loaded word is lost. Until a sample is taken, no word is loaded.
    """

    def make(self):
        return SampleFramer(COUNT, FIRST, CHANNEL_BITS)

    def invariants(self, s):
        return [s["index"] < COUNT, implies(self.block.sample.valid, s["index"] == 0)]

    def claims(self, m, s):
        framer, words, load, sample = (self.block, self.block.words, self.block.load, self.block.sample)
        comes, loads = words.valid & words.ready, load.valid & load.ready
        oldest = Mux(s["word_full"], Value.cast(s["word_kept"]), words.payload.as_value())
        data, last, channel = oldest[:REGISTER_BITS], oldest[REGISTER_BITS], oldest[REGISTER_BITS + 1:]
        waits = before(m, (s["word_full"] | words.valid) & ~loads)
        index = s["index"]
        other = (index != 0) & (channel != sample.p.channel)
        place = Mux(other, 0, index)
        ends = loads & (place == COUNT - 1)
        end = Cat(last, channel)
        kept = before(m, index + loads)
        return [
            s["word_full"] == waits, implies(waits, Value.cast(s["word_kept"]) == before(m, oldest)),
            s["word_full"] + before(m, loads) == before(m, s["word_full"]) + before(m, comes),
            implies(load.valid, framer.enable & ~sample.valid & (load.p.data == data)
                    & (load.p.address == FIRST + place)),
            implies(before(m, loads & ~ends & ~last), index == before(m, place) + 1),
            sample.valid == before(m, ends | (sample.valid & ~sample.ready)),
            implies(before(m, ends), sample.payload.as_value() == before(m, end)),
            implies(before(m, sample.valid & ~sample.ready),
                    sample.payload.as_value() == before(m, sample.payload.as_value())),
            implies(~before(m, framer.bad), Mux(before(m, ends), kept == COUNT, index == kept)),
            implies(before(m, framer.bad & ~ends), index <= before(m, loads)),
            framer.partial == (index != 0)], before(m, ends)


class Sending(_Block):
    """An answer is sent once, word by word, each one until it is taken, and the last one is final."""

    def make(self):
        return AnswerSender(COUNT, CHANNEL_BITS)

    def invariants(self, s):
        return [s["index"] < COUNT, implies(~self.block.busy, s["index"] == 0)]

    def claims(self, m, s):
        sender, answer, index = self.block, self.block.answer, s["index"]
        goes = answer.valid & answer.ready
        m.d.comb += Assume(~(sender.send & sender.busy) | (goes & sender.final))
        kept = Cat(s["last"], answer.p.channel)
        word = Array(sender.words[place] for place in range(COUNT))[index]
        continues = before(m, sender.busy & ~(goes & sender.final))
        return [
            answer.valid == sender.busy, answer.p.data == word, sender.final == (index == COUNT - 1),
            answer.p.last == (sender.final & s["last"]),
            sender.busy == before(m, sender.send) | continues,
            implies(continues, (index == before(m, index + goes)) & (kept == before(m, kept))),
            implies(before(m, sender.send), (index == 0) & (kept == before(m, Cat(sender.last, sender.channel)))),
        ], before(m, goes & sender.final & sender.send)


class Starting(_Block):
    """A command, and each sample of the stream, start one update, and no start is withdrawn.

    A sample is taken with its start, and only if its answer has room.
    """

    def make(self):
        return StartControl(CAPACITY, CHANNEL_BITS)

    def invariants(self, s):
        starts = self.block
        from_stream = s["pending"] & s["streamed"]
        return [s["unanswered"] <= CAPACITY,
                implies(from_stream, starts.sample.valid & (s["ends"] == starts.sample.p.last)
                        & (starts.start_channel == starts.sample.p.channel))]

    def claims(self, m, s):
        starts, sample, pending, streamed = self.block, self.block.sample, s["pending"], s["streamed"]
        end = sample.payload.as_value()
        stays = before(m, sample.valid & ~sample.ready)
        # A stream keeps its offers, a command keeps to its rule, and an answer has had its sample.
        m.d.comb += [Assume(Initial() | implies(stays, sample.valid & (end == before(m, end)))),
                     Assume(~(starts.command & starts.busy)), Assume(implies(starts.answered, s["unanswered"] != 0))]
        taken, unanswered = starts.start & starts.ready, s["unanswered"]
        by_stream = taken & streamed
        waits = before(m, starts.start & ~starts.ready)
        return [
            (sample.valid & sample.ready) == by_stream,
            implies(by_stream, unanswered < CAPACITY),
            implies(waits, starts.start & (starts.start_channel == before(m, starts.start_channel))
                    & (streamed == before(m, streamed))),
            pending == before(m, pending & ~taken | starts.command | (sample.valid & ~pending)),
            implies(before(m, starts.command), starts.start & starts.waiting
                    & (starts.start_channel == before(m, starts.channel))),
            implies(pending & ~starts.start, streamed & (unanswered == CAPACITY)),
            implies(starts.start, pending), starts.waiting == (pending & ~streamed),
            unanswered + before(m, starts.answered) == before(m, unanswered) + before(m, by_stream),
            starts.answering == (unanswered != 0)], before(m, by_stream & starts.answered)


class Queue(_Block):
    """Records leave a queue in the order in which they came, each one once."""

    DEPTH = 3

    def make(self):
        return RecordQueue(2, self.DEPTH)

    def invariants(self, s):
        return [self.block.level <= self.DEPTH]

    def claims(self, m, s):
        queue, records = self.block, [s[f"record_{place}"] for place in range(self.DEPTH)]
        m.d.comb += [Assume(implies(queue.pop, queue.level != 0)),
                     Assume(implies(queue.push, (queue.level != self.DEPTH) | queue.pop))]
        rest = queue.level - queue.pop
        later = [Mux(queue.pop, after, record) for record, after in zip(records, [*records[1:], 0], strict=True)]
        return [
            queue.level == before(m, rest + queue.push), implies(queue.level != 0, queue.oldest == records[0]),
            *(implies(before(m, place < rest), record == before(m, kept))
              for place, (record, kept) in enumerate(zip(records, later, strict=True))),
            *(implies(before(m, queue.push & (rest == place)), record == before(m, queue.record))
              for place, record in enumerate(records))], before(m, queue.push & queue.pop)
