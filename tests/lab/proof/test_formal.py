"""Proofs: a sample of the properties holds, and faults in the circuits are detected."""

from functools import partial

import pytest
from amaranth import *
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Cover
from amaranth.lib import wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from strapdown.blocks import SENSORS, LineTiming, SpotFinder
from strapdown.cordic.component import CordicComponent
from strapdown.cordic.sincos import CordicSinCos
from strapdown.cores import THESIS, operators, system_of, top
from strapdown.fp import FloatFormat, FpMinMax, FpSquareRoot, FpToFp, Rounding
from strapdown.kernel.engine import Engine
from strapdown_lab.proof import formal
from strapdown_lab.proof.arithmetic import FloatResult
from strapdown_lab.proof.handshake import IterativeHandshake, IterativeRecovery, PipelineAlignment, VendorHold
from strapdown_lab.proof.lines import Gaps, LineEdges, distance
from strapdown_lab.proof.sequencer import UpdateTiming
from strapdown_lab.proof.solver import Property, prove, solver_missing

SMALL = FloatFormat(3, 2)

pytestmark = [pytest.mark.formal, pytest.mark.skipif(bool(solver_missing()), reason=solver_missing())]


@pytest.mark.parametrize("pattern", [
    r"^FpMinMax, \(4, 3\) flush: ",
    r"^FpSquareRoot, \(2, 1\) gradual, bits_per_cycle 2, iterative",
    r"^vendor less: ",
    r"^Engine, quaternion_j2 QUAT_direct: ",
    r"^StreamEngine, quaternion_j2 QUAT_direct_x8: ",
    r"^LineTiming, s11639: ",
    r"^SpotFinder: ",
])
def test_properties_hold(pattern, tmp_path):
    props = formal.chosen(pattern)
    assert props
    for prop, outcome in zip(props, formal.run(props, tmp_path), strict=True):
        assert outcome.passed, f"{prop.subject}: {prop.claim}\n{outcome.report}"
    assert (tmp_path / "outcomes.json").exists()


def assert_refuted(prop, folder):
    outcome = prove(prop, folder)
    assert not outcome.proved
    assert "Assert failed" in outcome.report
    assert (folder / "counterexample.vcd").exists()


class LateMinMax(FpMinMax):
    """An operator that reports a latency of one cycle too many."""

    @property
    def latency(self):
        return super().latency + 1


class PatientSquareRoot(FpSquareRoot):
    """An operator that reports a longer interval than it has."""

    @property
    def interval(self):
        return super().interval + 1


def test_result_of_another_operation_is_found(tmp_path):
    circuit = partial(PipelineAlignment, partial(LateMinMax, SMALL))
    assert_refuted(Property("late", "", circuit, 2, ("one", "other")), tmp_path)


def test_start_that_is_not_ignored_is_found(tmp_path):
    circuit = partial(IterativeHandshake, partial(PatientSquareRoot, FloatFormat(2, 1), iterative=True))
    assert_refuted(Property("patient", "", circuit, 12), tmp_path)


def test_state_without_a_way_back_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(CordicComponent, "_lead_back", lambda self, m, fsm: None)
    circuit = partial(IterativeRecovery, partial(CordicSinCos, FloatFormat(5, 1), steps_per_cycle=8), edges=20)
    assert_refuted(Property("dead end", "", circuit, 30, ("op",)), tmp_path)


class PatientEngine(Engine):
    """An engine that reports a latency of one cycle too many."""

    @property
    def latency(self):
        return super().latency + 1


def test_latency_that_is_not_that_of_an_update_is_found(tmp_path):
    engine = partial(PatientEngine, system_of("INS_matx", THESIS), THESIS.engine_pool)
    assert_refuted(Property("patient", "", partial(UpdateTiming, engine), 1, ("engine",)), tmp_path)


def test_sample_at_another_place_is_found(tmp_path, monkeypatch):
    timing = partial(LineTiming, SENSORS["s11639"], clock_hz=100e6)
    monkeypatch.setattr(LineEdges, "place", lambda self, s: (s["beat"], (s["slot"] + 1) * 20 + s["beat"]))
    assert_refuted(Property("late", "", partial(LineEdges, timing), 1, ("timing",)), tmp_path)


@pytest.mark.parametrize("name", SENSORS)
def test_distance_of_edges_and_samples(name):
    """The proof gives places of edges and samples; by these, an edge of SH or ST is never on a sample."""
    timing = LineTiming(SENSORS[name], clock_hz=100e6)
    assert distance(timing) == timing.guard > 0


class HastyFinder(SpotFinder):
    """A finder that looks at the mark of a pixel while none is valid."""

    def elaborate(self, platform):
        m = super().elaborate(platform)
        with m.If(~self.pixels.valid):
            m.d.sync += self.found.eq(self.found | self.pixels.p.last)
        return m


def test_result_that_depends_on_gaps_is_found(tmp_path):
    assert_refuted(Property("hasty", "", partial(Gaps, partial(HastyFinder, 256)), 2 * Gaps.STAGES, ("one", "other")),
                   tmp_path)


class Quiet(wiring.Component):
    """Outputs that are never high, as long as the registers behind them start as after a reset."""

    start: In(1)
    stays: Out(1)
    differs: Out(1)

    def elaborate(self, platform):
        m, one, other = Module(), Signal(), Signal()
        m.d.sync += [self.stays.eq(self.stays & self.start), one.eq(self.start), other.eq(self.start)]
        m.d.comb += self.differs.eq(one ^ other)
        return m


class NeverHigh(Elaboratable):
    """States that an output is never high, and that the start may be."""

    def __init__(self, output):
        self.output = output

    def elaborate(self, platform):
        m = Module()
        m.submodules.op = quiet = Quiet()
        m.d.comb += [quiet.start.eq(AnySeq(1)), Assert(~getattr(quiet, self.output)), Cover(quiet.start)]
        return m


@pytest.mark.parametrize("output", ["stays", "differs"])
def test_registers_start_with_any_contents_where_a_property_says_so(tmp_path, output):
    """No step of the translation may choose their contents."""
    circuit = partial(NeverHigh, output)
    assert prove(Property("quiet", "", circuit, 2), tmp_path).passed
    assert_refuted(Property("quiet", "", circuit, 2, ("op",)), tmp_path)


class ShortTable(Elaboratable):
    """A table of three words, read at any address: it holds nothing above 2."""

    def elaborate(self, platform):
        m = Module()
        m.submodules.table = table = Memory(shape=2, depth=3, init=range(3))
        port = table.read_port(domain="comb")
        m.d.comb += [port.addr.eq(AnySeq(2)), Assert(port.data != 3), Cover(port.data == 2)]
        return m


def test_a_read_past_the_end_of_a_table_is_anything(tmp_path):
    assert_refuted(Property("ShortTable", "holds nothing above 2", ShortTable, 1), tmp_path)


def test_wrong_rounding_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(Rounding, "increments", lambda self, sign, odd, guard, sticky: guard & sticky)
    resize = FpToFp(FloatFormat(4, 3), SMALL)
    assert_refuted(Property("truncating", "", partial(FloatResult, resize), resize.latency), tmp_path)


def test_register_that_does_not_hold_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(top, "EnableInserter", lambda enable: lambda inner: inner)
    circuit = partial(VendorHold, partial(operators.VendorOperator, "less"))
    assert_refuted(Property("free-running", "", circuit, 1, ("vendor",), VendorHold.UNCHANGED), tmp_path)


def test_idle_property_does_not_pass(tmp_path):
    """If no assertion is tested, nothing is proved."""
    # One edge too few for a result.
    prop = Property("idle", "", partial(PipelineAlignment, partial(FpMinMax, SMALL)), 0, ("one", "other"))
    outcome = prove(prop, tmp_path)
    assert outcome.proved
    assert (outcome.passed, outcome.word) == (False, "idle")
