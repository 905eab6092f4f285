"""Control of the operators: no result is lost, extra, late, early, or that of another operation."""

from amaranth import *
from amaranth.asserts import AnySeq, Initial
from amaranth.hdl import Assert, Assume, Cover
from amaranth.lib.wiring import In

__all__ = ["PipelineAlignment", "PipelineFromReset", "PipelineSilence", "IterativeAlignment", "IterativeHandshake",
           "IterativeHold", "IterativeRecovery", "VendorAlignment", "VendorHold", "VendorOrder"]


def ports(op, flow, *, without):
    """Ports of an operator as plain Values, by name."""
    return {name: Value.cast(getattr(op, name)) for name, member in op.signature.members.items()
            if (member.flow is In) == (flow is In) and name not in without}


def anything(value):
    """An input with an arbitrary value in every cycle."""
    return AnySeq(len(value))


def _module_around(op, *, without=()):
    """A module with the operator as ``op`` and arbitrary inputs, except those ``without``."""
    m = Module()
    m.submodules.op = op
    m.d.comb += [value.eq(anything(value)) for value in ports(op, In, without=without).values()]
    return m, op


def equal_results(one, other):
    """True if all results of two copies are equal."""
    return Cat(*one.values()) == Cat(*other.values())


class _Clockwork(Elaboratable):
    """Base: ``age`` bit n is high n edges after the first state."""

    def age(self, m, edges):
        age = Signal(edges + 1, reset_less=True)
        now = Cat(Initial(), age)
        m.d.sync += age.eq(now)
        return now


class PipelineAlignment(_Clockwork):
    """Two copies in any two states get the same operation and, before and after it, different ones.

    ``latency`` edges later ``done`` of both is high if ``start`` was high and no reset came since. In
    this case their results agree. The first state is arbitrary, so this holds at every time, and
    the result depends on its own operands alone.
    """

    def __init__(self, make):
        self.one, self.other = make(), make()

    def elaborate(self, platform):
        m = Module()
        m.submodules.one, m.submodules.other = one, other = self.one, self.other
        age = self.age(m, one.latency)
        inputs = ports(one, In, without=())
        for name, value in ports(other, In, without=()).items():
            m.d.comb += [inputs[name].eq(anything(value)), value.eq(Mux(age[0], inputs[name], anything(value)))]
        started = Signal(one.latency)
        m.d.sync += started.eq(Cat(one.start, started))
        results = (ports(op, None, without=("done",)) for op in (one, other))
        with m.If(age[one.latency]):
            m.d.comb += [Assert(one.done == started[-1]), Cover(one.done)]
            # A reset of both copies ends an operation in flight.
            with m.If(started[-1]):
                m.d.comb += [Assert(other.done), Assert(equal_results(*results))]
        return m


class PipelineFromReset(Elaboratable):
    """From power-on, while the pipeline fills: ``done`` is ``start``, ``latency`` edges later."""

    def __init__(self, make):
        self.op = make()

    def elaborate(self, platform):
        m, op = _module_around(self.op)
        started = Signal(op.latency)
        m.d.sync += started.eq(Cat(op.start, started))
        m.d.comb += [Assert(op.done == started[-1]), Cover(op.done)]
        return m


class PipelineSilence(_Clockwork):
    """From any state, with any inputs: after an edge the results are zero, or ``done`` is high."""

    def __init__(self, make):
        self.op = make()

    def elaborate(self, platform):
        m, op = _module_around(self.op)
        results = Cat(*ports(op, None, without=("done",)).values())
        # A reset acts on ``done``, but not on the results.
        m.d.comb += Assume(~ResetSignal())
        with m.If(self.age(m, 1)[1]):
            m.d.comb += [Assert(op.done | ~results.any()), Cover(op.done & results.any())]
        return m


class IterativeHandshake(Elaboratable):
    """An operator and a counter of the cycles since the last operation; any starts, resets and operands.

    ``done`` rises ``latency`` edges after each start that the count accepts, for one cycle, and at no
    other time.
    """

    def __init__(self, make):
        self.op = make()

    def elaborate(self, platform):
        m, op = _module_around(self.op)
        left, accept = Signal(range(op.interval)), Signal()
        m.d.comb += accept.eq(op.start & (left == 0))
        m.d.sync += left.eq(Mux(accept, op.interval - 1, Mux(left == 0, 0, left - 1)))
        due, finished = Signal(op.latency), Signal(range(3))
        m.d.sync += [due.eq(Cat(accept, due)), finished.eq(finished + (op.done & (finished != 2)))]
        m.d.comb += [Assert(op.done == due[-1]), Cover(op.done & (finished == 2))]
        return m


class IterativeHold(_Clockwork):
    """From any state, and with any inputs but reset, an edge after which ``done`` is low changes no result."""

    def __init__(self, make):
        self.op = make()

    def elaborate(self, platform):
        m, op = _module_around(self.op)
        m.d.comb += Assume(~ResetSignal())
        results = Cat(*ports(op, None, without=("done",)).values())
        before = Signal.like(results)
        m.d.sync += before.eq(results)
        with m.If(self.age(m, 1)[1]):
            m.d.comb += Cover(~op.done)
            with m.If(~op.done):
                m.d.comb += Assert(results == before)
        return m


class IterativeRecovery(_Clockwork):
    """From any state, reachable or not: ``edges`` without a start or a reset later, a start is taken as at rest."""

    def __init__(self, make, *, edges):
        self.op, self.edges = make(), edges

    def elaborate(self, platform):
        m, op = _module_around(self.op, without=("start",))
        now = self.age(m, self.edges + op.latency)
        m.d.comb += [Assume(~ResetSignal()), op.start.eq(now[self.edges])]
        finish = self.edges + op.latency
        with m.If(now[self.edges:finish + 1].any()):
            m.d.comb += [Assert(op.done == now[finish]), Cover(op.done)]
        return m


class IterativeAlignment(Elaboratable):
    """Two copies with different first operations, and then the same operation, ``gap`` cycles after the earliest time.

    One copy also gets starts while it is busy, with any operands. The second results agree. With gaps of 0, 1
    and 2 the second operation starts during the rounding of the first, together with its ``done``, and when idle.
    """

    def __init__(self, make, *, gap):
        self.one, self.other, self.gap = make(), make(), gap

    def elaborate(self, platform):
        m = Module()
        m.d.comb += Assume(~ResetSignal())
        m.submodules.one, m.submodules.other = one, other = self.one, self.other
        second = one.interval + self.gap
        age = Signal(second + one.latency)
        now = Cat(Initial(), age)
        m.d.sync += age.eq(now)
        start, idle = now[0] | now[second], now[one.interval:second].any() if self.gap else C(0)
        m.d.comb += [other.start.eq(start), one.start.eq(start | (AnySeq(1) & ~idle))]
        inputs = ports(one, In, without=("start",))
        for name, value in ports(other, In, without=("start",)).items():
            m.d.comb += [inputs[name].eq(anything(value)),
                         value.eq(Mux(now[second], inputs[name], anything(value)))]
        results = (ports(op, None, without=("done",)) for op in (one, other))
        with m.If(now[second + one.latency]):
            m.d.comb += [Assert(one.done & other.done), Assert(equal_results(*results)), Cover(one.done)]
        return m


class _Vendor(_Clockwork):
    """Base: a vendor operator on the proof's clock, with free inputs."""

    CONTROL = ("clk", "ce", "sclr")

    def attach(self, m, name, vendor):
        # The operator makes a separate clock domain from its ports; the counter beside it has no reset.
        m.d.comb += Assume(~ResetSignal())
        m.submodules[name] = DomainRenamer(f"{name}_sync")(vendor)
        m.d.comb += vendor.clk.eq(ClockSignal())
        return ports(vendor, In, without=self.CONTROL)

    def free_control(self, m, *vendors):
        ce, sclr = Signal(), Signal()
        m.d.comb += [ce.eq(AnySeq(1)), sclr.eq(AnySeq(1))]
        for vendor in vendors:
            m.d.comb += [vendor.ce.eq(ce), vendor.sclr.eq(sclr)]
        return ce, sclr


class VendorHold(_Vendor):
    """With ``ce`` and ``sclr`` low, an edge changes no register, for every state and all operands.

    ``holds_without`` states this for every register. The assertions here: outputs are functions of
    registers alone, and ``result`` holds even while ``sclr`` is high.
    """

    UNCHANGED = "(and (not [-1:ce]) (not [-1:sclr]))"

    def __init__(self, make):
        self.vendor = make()

    def elaborate(self, platform):
        m = Module()
        vendor = self.vendor
        for value in self.attach(m, "vendor", vendor).values():
            m.d.comb += value.eq(anything(value))
        ce, sclr = self.free_control(m, vendor)
        age = self.age(m, 1)
        outputs = ports(vendor, None, without=())
        result, before, idle, cleared = Cat(*outputs.values()), Signal(len(Cat(*outputs.values()))), Signal(), Signal()
        m.d.sync += [before.eq(result), idle.eq(~ce), cleared.eq(sclr)]
        with m.If(age[1] & idle):
            m.d.comb += Cover(vendor.rdy)
            with m.If(cleared):
                data, data_before = (Cat(*(value for name, value in zip(outputs, values, strict=True) if name != "rdy"))
                                     for values in (outputs.values(), _split(before, outputs.values())))
                m.d.comb += [Assert(data == data_before), Assert(~vendor.rdy)]
            with m.Else():
                m.d.comb += Assert(result == before)
        return m


def _split(whole, parts):
    """Slices of a Value as wide as the given parts."""
    first = 0
    for part in parts:
        yield whole[first:first + len(part)]
        first += len(part)


class VendorOrder(_Vendor):
    """``rdy`` is ``operation_nd`` of ``latency`` edges ago, unless ``sclr`` has been high since.

    ``ce`` is low only together with ``sclr``, because cycles that hold change nothing (``VendorHold``). With
    ``settled`` the first state is arbitrary and the last state is examined; else all states from power-on.
    """

    def __init__(self, make, *, settled):
        self.vendor, self.settled = make(), settled

    def elaborate(self, platform):
        m = Module()
        vendor = self.vendor
        for value in self.attach(m, "vendor", vendor).values():
            m.d.comb += value.eq(anything(value))
        ce, sclr = self.free_control(m, vendor)
        m.d.comb += Assume(ce | sclr)
        age = self.age(m, vendor.latency)
        new_data = getattr(vendor, vendor.kind.new_data)
        taken = Signal(vendor.latency)
        m.d.sync += taken.eq(Mux(sclr, 0, Cat(new_data, taken)))
        with m.If(age[vendor.latency] if self.settled else 1):
            m.d.comb += [Assert(vendor.rdy == taken[-1]), Cover(vendor.rdy)]
        return m


class VendorAlignment(_Vendor):
    """Two copies in any two states, as in ``PipelineAlignment``; ``ce`` is high (``VendorHold``)."""

    def __init__(self, make):
        self.one, self.other = make(), make()

    def elaborate(self, platform):
        m = Module()
        inputs, others = self.attach(m, "one", self.one), self.attach(m, "other", self.other)
        age = self.age(m, self.one.latency)
        for name, value in others.items():
            m.d.comb += [inputs[name].eq(anything(value)), value.eq(Mux(age[0], inputs[name], anything(value)))]
        m.d.comb += [port.eq(1) for port in (self.one.ce, self.other.ce)]
        results = (ports(vendor, None, without=("rdy",)) for vendor in (self.one, self.other))
        with m.If(age[self.one.latency] & self.one.rdy):
            m.d.comb += [Assert(self.other.rdy), Assert(equal_results(*results)),
                         Cover(self.one.rdy)]
        return m
