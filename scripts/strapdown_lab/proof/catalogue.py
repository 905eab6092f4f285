"""All properties of all operators, blocks and engines that are proved."""

from collections.abc import Iterator
from functools import partial

from strapdown.blocks import SENSORS, LineBuffer, LineTiming, ParallelAdc, SpiAdc, SpotFinder
from strapdown.cores.catalogue import CONFIGS, main_module, make_core, modules_of
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.fp import FloatFormat, FpToFixed, Rounding
from strapdown_lab.operators import OPERATORS, Claim

from . import bus as blocks
from .arithmetic import Extreme, FixedResult, FloatResult, Relation
from .handshake import (
    IterativeAlignment,
    IterativeHandshake,
    IterativeHold,
    IterativeRecovery,
    PipelineAlignment,
    PipelineFromReset,
    PipelineSilence,
    VendorAlignment,
    VendorHold,
    VendorOrder,
)
from .lines import BufferedLine, Finish, Gaps, LineEdges, ParallelCapture, SerialCapture
from .sequencer import ChannelRecovery, ChannelTiming, UpdateRecovery, UpdateTiming
from .solver import Property

__all__ = ["bus", "properties"]

# z3 does not find that two dividers are equal.
SOLVERS = {"div": "boolector"}

CIRCUITS = {Claim.ROUNDED: FloatResult, Claim.RELATION: Relation, Claim.EXTREME: Extreme}


SEQUENCERS: dict[str, dict[str, type]] = {
    "Engine": {"whatever its registers held, it is idle within twice the latency": UpdateRecovery,
               "an update takes the latency, and an END in another cycle is refused": UpdateTiming},
    "StreamEngine": {"whatever its registers held, a channel is free within latency and interval": ChannelRecovery,
                     "a sample finishes with its channel after the latency, and no other does": ChannelTiming}}


def describe(make, *parameters, **options):
    """An operator in the short form of a constructor call."""
    def word(value):
        if isinstance(value, FloatFormat):
            return f"({value.exponent_width}, {value.fraction_width}) {value.subnormals.value}"
        return value.value if isinstance(value, Rounding) else str(value)
    return ", ".join([make.__name__, *map(word, parameters),
                      *(word(value) if name == "rounding" else name if value is True else f"{name} {word(value)}"
                        for name, value in options.items())])


def control(make, parameters, options):
    """Properties of the control of an operator."""
    op = partial(make, *parameters, **options)
    subject, one = describe(make, *parameters, **options), op()
    if one.interval == 1:
        yield Property(subject, "result and done belong to one start, latency edges ago",
                       partial(PipelineAlignment, op), one.latency, ("one", "other"))
        yield Property(subject, "no done before the first result", partial(PipelineFromReset, op), one.latency)
        if getattr(one, "quiet", False):
            yield Property(subject, "results are zero while done is low", partial(PipelineSilence, op), 1, ("op",))
        return
    yield Property(subject, "one done for each accepted start, and no other", partial(IterativeHandshake, op),
                   2 * one.interval + one.latency + 2)
    yield Property(subject, "results hold from one done to the next", partial(IterativeHold, op), 1, ("op",))
    # A counter may begin at a code that no operation reaches, and then counts through all of those codes first.
    edges = 2 * one.interval
    yield Property(subject, "whatever its registers held, it is free in time",
                   partial(IterativeRecovery, op, edges=edges), edges + one.latency, ("op",))
    for gap in range(3):
        yield Property(subject, f"nothing before an operation, {gap} idle cycles between, changes its result",
                       partial(IterativeAlignment, op, gap=gap), one.interval + gap + one.latency)


def vendor_control(name):
    """Properties of the control of a vendor operator."""
    vendor = partial(VendorOperator, name)
    latency, subject = vendor().latency, f"vendor {name}"
    yield Property(subject, "ce low holds every register", partial(VendorHold, vendor), 1, ("vendor",),
                   VendorHold.UNCHANGED)
    yield Property(subject, "rdy follows new data by latency enabled edges, unless cleared",
                   partial(VendorOrder, vendor, settled=True), latency, ("vendor",))
    yield Property(subject, "no rdy before the first result", partial(VendorOrder, vendor, settled=False), latency)
    yield Property(subject, "a result is that of its own operands", partial(VendorAlignment, vendor), latency,
                   ("one", "other"), solver=SOLVERS.get(name, "z3"))


def result(claim, make, parameters, options):
    """The property that all results of a small operator are correct."""
    small = make(*parameters, **options)
    circuit = FixedResult if make is FpToFixed else CIRCUITS[claim]
    return Property(describe(make, *parameters, **options), claim.value, partial(circuit, small), small.latency)


def sequencer(module, config):
    """Properties of the sequencer of a core."""
    kind = "Engine" if config.channels == 1 else "StreamEngine"
    for claim, circuit in SEQUENCERS[kind].items():
        yield Property(f"{kind}, {config.name} {module}", claim,
                       partial(circuit, lambda: make_core(module, config).engine), 1, ("engine",))


def lines():
    """Properties of the blocks for line sensors, from timing to spot finder."""
    # The solver is quick where a slot has a power of two cycles; the others have few registers.
    clocks = {"tcd1304": {"clock_hz": 16e6, "sensor_clock_hz": 4e6, "line_clocks": 14_812}}
    for name, sensor in SENSORS.items():
        timing = partial(LineTiming, sensor, **clocks.get(name, {"clock_hz": 100e6}))
        yield Property(f"LineTiming, {name}", "samples and edges of pins keep their places in the line",
                       partial(LineEdges, timing), 1, ("timing",))
    # The least periods of SCLK and of the clock pin.
    serial = partial(SpiAdc, clock_hz=20e6, slot_cycles=34)
    yield Property("SpiAdc", "one pixel for each sample, with its word and marks",
                   partial(SerialCapture, serial, slot_cycles=34), 34, ("adc",))
    for latency in 1, 3:
        parallel = partial(ParallelAdc, adc_latency=latency, slot_cycles=3, invert=True)
        yield Property(f"ParallelAdc, latency {latency}", "one pixel for each sample, with its word and marks",
                       partial(ParallelCapture, parallel, adc_latency=latency, slot_cycles=3),
                       2 * parallel().latency + 6)
    yield Property("LineBuffer, 3 pixels", "a complete line comes out once, in order, whatever comes between",
                   partial(BufferedLine, partial(LineBuffer, 3), pixels=3), 12, solver="boolector")
    yield Property("SpotFinder", "gaps between pixels change no result",
                   partial(Gaps, partial(SpotFinder, 3648)), 2 * Gaps.STAGES, ("one", "other"))
    yield Property("SpotFinder", "finish follows the last pixel by the latency",
                   partial(Finish, partial(SpotFinder, 3648)), SpotFinder(3648).latency, ("finder",))


def bus():
    """Properties of the blocks of a bus."""
    for subject, claim, circuit in (
            ("AxiLiteSlave", "one answer for each access, and no other; an offer stays as it is", blocks.Answers),
            ("AxiLiteSlave", "an answer comes within two cycles, if answers are taken", blocks.InTime),
            ("AxiLiteSlave", "a write changes what it selects and may change, and nothing else", blocks.Writes),
            ("AxiLiteSlave", "a read returns the fields at its address", blocks.Reads),
            ("SampleFramer", "each word is loaded once, in its place; what is dropped is flagged", blocks.Framing),
            ("StartControl", "each sample and each command starts one update", blocks.Starting),
            ("RecordQueue", "records leave in their order, each one once", blocks.Queue),
            ("AnswerSender", "each word of an answer is sent once, in its order", blocks.Sending),
            ("StreamMaster", "each word is offered until it is taken, once", blocks.Master)):
        yield Property(subject, claim, circuit, circuit.edges, ("block",))


def properties() -> Iterator[Property]:
    """Every ``Property``, in the order of the document."""
    for entry in OPERATORS:
        for variants in entry.control:
            for parameters, options in variants.of(entry.component):
                yield from control(entry.component, parameters, options)
    for name in VENDOR_OPERATORS:
        yield from vendor_control(name)
    for entry in OPERATORS:
        for variants in entry.proved:
            for parameters, options in entry.rounded(variants):
                yield result(entry.claim, entry.component, parameters, options)
    yield from lines()
    yield from bus()
    for config in CONFIGS.values():
        for module in modules_of(config):
            if module not in config.assemblies():
                yield from sequencer(module, config)
    for config in CONFIGS.values():
        if config.channels == 1 and not config.assemblies():
            several = config.replace(channels=8, horizontal=False)
            yield from sequencer(main_module(several), several)
