"""Sequencers of the engines: from any contents of its registers an engine is soon free, and its updates keep time.

A property speaks of two states that are one clock edge apart. The first one is arbitrary, so induction extends it to
all edges, and nothing is unrolled over a latency. A property counts the edges that remain until an event, as a function
of the registers. If this number falls at every edge, the event comes in time.
"""

from collections import Counter
from functools import reduce
from itertools import combinations
from operator import add, and_, or_

from amaranth import *
from amaranth.asserts import AnyConst, AnySeq, Initial
from amaranth.hdl import Assert, Assume, Cover
from amaranth.lib.wiring import In

__all__ = ["ChannelRecovery", "ChannelTiming", "UpdateRecovery", "UpdateTiming"]


def driven(fragment):
    """Maps the name of each signal that a circuit drives, without those of its submodules, to the Signal.

    Signals that have the same name are left out.
    """
    found = {id(signal): signal for statements in fragment.statements.values() for statement in statements
             for signal in statement._lhs_signals()}
    counts = Counter(signal.name for signal in found.values())
    return {signal.name: signal for signal in found.values() if counts[signal.name] == 1}


def before(m, value):
    """The value in the first state, to use in the second."""
    value = Value.cast(value)
    kept = Signal(value.shape(), reset_less=True)
    m.d.sync += kept.eq(value)
    return kept


def implies(condition, consequence):
    """A Value that is low only if the condition holds without the consequence."""
    return ~condition.bool() | consequence.bool()


class _Edge(Elaboratable):
    """Base: an engine with free inputs and without a reset, in two states that are one clock edge apart.

    A subclass says in ``claims`` what holds in the second state.
    """

    def __init__(self, make):
        self.engine = make()
        system = self.engine.system
        self.start, self.finish = (getattr(self.engine, name) for name in (system.start, system.finish))

    def elaborate(self, platform):
        m, engine = Module(), self.engine
        circuit = Fragment.get(engine, platform)
        inputs = [Value.cast(getattr(engine, name)) for name, member in engine.signature.members.items()
                  if member.flow is In]
        second = Signal(reset_less=True)
        m.d.comb += [Assume(~ResetSignal()), *(value.eq(AnySeq(len(value))) for value in inputs)]
        m.d.sync += second.eq(Initial())
        claims, event = self.claims(m, driven(circuit))
        with m.If(second):
            m.d.comb += [*(Assert(claim) for claim in claims), Cover(event)]
        fragment = Fragment.get(m, platform)
        fragment.add_subfragment(circuit, "engine")
        return fragment

    def claims(self, m, s):
        """What holds in the second state, and what is possible in it: a list of Value, and a Value.

        ``s`` maps the names of the engine's signals to the signals.
        """
        raise NotImplementedError


class _Update(_Edge):
    """Base: an Engine."""

    def __init__(self, make):
        super().__init__(make)
        self.length, self.end = self.engine.program.length, len(self.engine.state_names) - 1

    def running(self, s):
        """High in the cycles of an update before END."""
        return (s["state"] != 0) & (s["state"] < self.end)

    def ready(self, s):
        """High if the engine is idle, and the next start begins an update."""
        return (s["state"] == 0) & (s["cycle"] == 0) & (s["left"] == self.length - 1) & s["primed"]

    def remaining(self, s):
        """Edges until the engine is idle: 0 if it is."""
        in_update = Mux(s["left"] < 0, 2, s["left"] + 3)
        return Mux(s["state"] == 0, 0, Mux(self.running(s), in_update, 1)).as_unsigned()


class UpdateRecovery(_Update):
    """From any contents of the registers an Engine is idle within ``2 * latency`` edges, whatever starts come.

    The number of remaining edges is at most ``2 * latency``, falls at every edge, and is 0 only if the engine is idle.
    If it is idle after an edge, it is ready for a start.
    """

    def claims(self, m, s):
        remaining, idle = self.remaining(s), s["state"] == 0
        earlier = before(m, remaining)
        return [remaining <= 2 * self.engine.latency,
                (remaining == 0) == idle,
                implies(earlier != 0, remaining < earlier),
                implies(idle, self.ready(s))], idle & (earlier == 1)


class UpdateTiming(_Update):
    """A ready Engine takes a start and finishes ``latency`` edges later; an END in another cycle is not complete.

    The edge that takes a start leads to an update with ``latency`` remaining edges. From there each edge leads to one
    less, whatever the words from the ROM, and the finish rises when none remains. An update is in step if its state,
    its counters and its words are those of one cycle of the schedule. The first state of an update is in step, and all
    that follow, and its END is complete.
    """

    def in_step(self, s):
        """High in an update in step, END included."""
        next_word, word = (self.engine.program.layout(s[name]) for name in ("next_word", "word"))
        ends = [cycle for cycle, fields in enumerate(self.engine.program.words) if fields.get("advance")]
        cycle = self.length - 1 - s["left"]

        def advances(value):
            return reduce(or_, [value == end for end in ends])

        section = 1 + reduce(add, [cycle > end + 1 for end in ends])
        running = (self.running(s) & (cycle >= 0) & (cycle <= self.length) & (s["state"] == section)
                   & (s["cycle"] == (cycle + 1)[:len(s["cycle"])])
                   & (word.advance == advances(cycle - 1))
                   & ((cycle == self.length) | (next_word.advance == advances(cycle))))
        return Mux(s["state"] == self.end, s["complete"], running) & ~self.finish

    def claims(self, m, s):
        remaining, in_step, word = self.remaining(s), self.in_step(s), self.engine.program.layout(s["word"])
        in_update = (s["state"] != 0) & (s["state"] <= self.end) & ~self.finish
        earlier, was_in_update, was_in_step = before(m, remaining), before(m, in_update), before(m, in_step)
        last = (s["state"] == self.end - 1) & word.advance & (s["left"] < 0)
        return [implies(before(m, self.ready(s) & self.start), in_step & (remaining == self.engine.latency)),
                implies(in_step, in_update),
                implies(was_in_update, (remaining == earlier - 1) & Mux(remaining == 0, self.finish, in_update)),
                implies(was_in_step & (remaining != 0), in_step),
                implies(s["complete"], before(m, last))], was_in_step & self.finish


class _Channels(_Edge):
    """Base: a StreamEngine, and any one of its channels."""

    def __init__(self, make):
        super().__init__(make)
        self.interval, self.stages = self.engine.interval, self.engine.program.schedule.stages
        self.channel = Signal.like(self.engine.in_channel)

    def claims(self, m, s):
        m.d.comb += self.channel.eq(AnyConst(len(self.channel)))
        updates = [s[f"stage{stage}_valid"] for stage in range(self.stages)]
        own = [valid & (s[f"stage{stage}_channel"] == self.channel) for stage, valid in enumerate(updates)]
        offered = self.start & (self.engine.in_channel == self.channel)
        return self.channel_claims(m, s, updates, own, offered, before(m, offered & self.engine.in_ready))

    def channel_claims(self, m, s, updates, own, offered, taken):
        """As ``claims``; ``updates`` and ``own`` say by stage whether an update is in it, and one of the channel;
        ``offered`` says whether a sample of the channel is offered, and ``taken`` whether the edge took one."""
        raise NotImplementedError

    def at_beginning(self, s):
        """High in the cycle before an interval, or while the engine waits for a sample."""
        return s["beginning"] & (s["cycle"] == 0)

    def after(self, s):
        """The counter of the next edge at which the engine does not wait."""
        counter = s["cycle"]
        following = Mux(counter == self.interval - 1, 0, counter + 1)[:len(counter)]
        return s.get("ahead", following), following


class ChannelRecovery(_Channels):
    """From any contents of the registers a channel is soon free, and then ready, whatever the other channels do.

    Three numbers of edges are bounded, and each falls at every edge until it is 0:

    - to the beginning of an interval: at most ``interval``;
    - to the time at which the channel is free, an interval for each stage that its update still passes: at most
      ``latency + interval``;
    - to the time at which the engine is primed. Until then it takes no sample, ends the updates in flight, and then
      writes its constants to the memory, one per cycle, and marks the channels as fresh: at most
      ``latency + 2 * interval``, and the constants or channels.

    At the beginning of an interval an engine that is primed is ready for a channel that is free.
    """

    def channel_claims(self, m, s, updates, own, offered, taken):
        engine, interval, counter, turn = self.engine, self.interval, s["cycle"], s["turn"]
        # A counter beyond the interval continues to its greatest code. One that waits elsewhere goes on an edge later.
        after, _ = self.after(s)
        onward = Mux(after == 0, 0, Mux(after < interval, interval, 1 << len(counter)) - after)
        beginning = Mux(self.at_beginning(s), 0, 1 + onward + s["beginning"]).as_unsigned()

        def free(stages):
            passes = reduce(lambda rest, stage: Mux(stages[stage], self.stages - 1 - stage, rest),
                            reversed(range(self.stages)), Const(0))
            return Mux(Cat(stages).any(), 1 + beginning + passes * interval, 0)

        last = max(len(engine.program.constants), engine.channels) - 1
        turns, constants = 1 << len(turn), (last - turn)[:len(turn)]
        writing = Mux(Cat(updates).any(), free(updates) + interval + turns, beginning + 1 + constants)
        claims = [s["beginning"] == (counter == 0), implies(before(m, free(own) == 0) & ~taken, free(own) == 0),
                  implies(before(m, s["primed"]), s["primed"]),
                  implies(offered, engine.in_ready == (self.at_beginning(s) & (free(own) == 0) & s["primed"]))]
        for number, bound in ((beginning, interval), (free(own), engine.latency + interval),
                              (Mux(s["primed"], 0, writing), engine.latency + 2 * interval + turns)):
            earlier = before(m, number)
            claims += [number <= bound, implies(earlier != 0, number < earlier)]
        return claims, before(m, free(own) == 1) & offered


class ChannelTiming(_Channels):
    """A sample of a channel that is free finishes ``latency`` edges after it was taken, and no other finish has its
    channel.

    The counters are in step if they are those of one cycle of the interval. The beginning of an interval brings them
    in step, if that of the ROM's address is, and they remain so. With them in step, the edge that takes a sample leads
    to an update with ``latency`` remaining edges. Each edge leads to one less, and the finish is high with the channel
    when none remains. Without a sample, an engine in which no update is in flight remains ready.
    """

    def in_step(self, s, in_flight):
        """High if the counters are in step."""
        counter, slot = s["cycle"], s["slot"]
        follows = counter == Mux(slot == self.interval - 1, 0, slot + 1)
        waits = (counter == 0) & (slot == 0) & ~in_flight
        after, following = self.after(s)
        return ((slot < self.interval) & (s["check"] == slot) & (s["beginning"] == (counter == 0))
                & (follows | waits) & (after == following))

    def channel_claims(self, m, s, updates, own, offered, taken):
        latency, free, in_flight = self.engine.latency, ~Cat(own).any(), Cat(updates).any()
        cycle = reduce(or_, [Mux(each, stage * self.interval + s["slot"], 0) for stage, each in enumerate(own)])
        remaining = Mux(free, 0, latency - cycle)
        in_step = self.in_step(s, in_flight)
        single = reduce(and_, [~(one & other) for one, other in combinations(own, 2)], Const(1))
        timely = in_step & single & (cycle < latency)
        earlier, was_timely = before(m, remaining), before(m, timely)
        finishes = self.finish & (self.engine.out_channel == self.channel)
        after, following = self.after(s)
        begins = self.at_beginning(s) & (after == following)
        rests = begins & ~in_flight
        return [implies(before(m, in_step | begins), in_step),
                implies(in_step & free, timely),
                implies(was_timely, timely & (finishes == (earlier == 1))),
                implies(was_timely, remaining == Mux(taken, latency, Mux(earlier == 0, 0, earlier - 1))),
                implies(before(m, rests & ~self.start), rests)], finishes & was_timely
