# amaranth: UnusedElaboratable=no
"""All properties that are proved, of every operator."""

import inspect
from collections.abc import Iterator
from typing import Any

from strapdown.cordic import CordicAtan2, CordicSinCos, FixedAtan2
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.fp import (
    FixedToFp,
    FloatFormat,
    FpAdd,
    FpCompare,
    FpDivide,
    FpDivideSquareRoot,
    FpMinMax,
    FpMultiply,
    FpReciprocalSquareRoot,
    FpRelation,
    FpSelect,
    FpSquareRoot,
    FpToFixed,
    FpToFp,
    Rounding,
)
from strapdown.fp.compare import RELATIONS

from .arithmetic import Extreme, FixedResult, FloatResult, Relation
from .handshake import (
    IterativeAlignment,
    IterativeHandshake,
    IterativeHold,
    PipelineAlignment,
    PipelineFromReset,
    VendorAlignment,
    VendorHold,
    VendorOrder,
)
from .solver import Property

__all__ = ["properties"]

# Control does not look at the data: the least formats of each operator do.
SMALL = FloatFormat(3, 2)
TINY = FloatFormat(2, 1)
EIGHT_BITS = FloatFormat(4, 3)

# z3 does not find that two dividers are equal.
SOLVERS = {"div": "boolector"}

CLAIMS = {
    FloatResult: "every result is the exact one, rounded",
    FixedResult: "every result is the exact one, rounded",
    Relation: "every relation is that of the exact values",
    Extreme: "the result is the operand that it should be",
}


def both(fmt):
    """A format under either policy for subnormals."""
    return fmt, fmt.with_subnormals("flush")


def describe(make, *parameters, **options):
    """An operator as a caller would write it, short."""
    def word(value):
        if isinstance(value, FloatFormat):
            return f"({value.exponent_width}, {value.fraction_width}) {value.subnormals.value}"
        return value.value if isinstance(value, Rounding) else str(value)
    return ", ".join([make.__name__, *map(word, parameters),
                      *(word(value) if name == "rounding" else name if value is True else f"{name} {word(value)}"
                        for name, value in options.items())])


def pipelines():
    """Pipelined operators: class, positional and named parameters, for every depth of pipeline."""
    of_cuts: list[tuple[Any, tuple[Any, ...], dict[str, Any]]] = [
        (FpAdd, (SMALL,), {}), (FpMultiply, (SMALL,), {}), (FpCompare, (SMALL,), {}), (FpMinMax, (SMALL,), {}),
        (FpRelation, (SMALL, "<"), {}), (FpToFp, (EIGHT_BITS, SMALL), {}),
        (FpToFixed, (SMALL,), {"width": 4, "fraction_bits": 2}),
        (FixedToFp, (SMALL,), {"width": 4, "fraction_bits": 2})]
    for make, parameters, options in of_cuts:
        for latency in range(1, len(make.CUTS) + 1):
            yield make, parameters, {**options, "latency": latency}
    for latency in 1, 2, 7, len(FixedAtan2.CUTS):
        yield FixedAtan2, (), {"latency": latency}
    yield FpSelect, (SMALL,), {}
    for make in FpDivide, FpSquareRoot:
        for bits in 1, 2, SMALL.precision:
            yield make, (SMALL,), {"bits_per_cycle": bits}
    for fmt in both(FloatFormat(3, 1)):
        yield CordicAtan2, (fmt,), {"steps_per_cycle": 3, "iterative": False}
    for fmt in both(FloatFormat(5, 1)):
        yield CordicSinCos, (fmt,), {"steps_per_cycle": 4, "iterative": False}


def iteratives():
    """Iterative operators, slow and fast."""
    for bits in 1, 2:
        for make in FpDivide, FpSquareRoot:
            yield make, (TINY,), {"bits_per_cycle": bits, "iterative": True}
        yield FpDivideSquareRoot, (TINY,), {"bits_per_cycle": bits}
        yield FpReciprocalSquareRoot, (FloatFormat(3, 1),), {"bits_per_cycle": bits}
    for fmt in both(FloatFormat(3, 1)):
        for steps in 1, 3:
            yield CordicAtan2, (fmt,), {"steps_per_cycle": steps, "iterative": True}
    for fmt in both(FloatFormat(5, 1)):
        for steps in 2, 8:
            yield CordicSinCos, (fmt,), {"steps_per_cycle": steps, "iterative": True}


def rounded(make):
    """The rounding directions of an operator, as options."""
    if "rounding" not in inspect.signature(make).parameters:
        return [{}]
    flags = {"flags": True} if "flags" in inspect.signature(make).parameters else {}
    return [{"rounding": rounding, **flags} for rounding in Rounding]


def results() -> Iterator[tuple[Any, Any, tuple[Any, ...], dict[str, Any]]]:
    """Small operators, all of whose operands are tried: circuit, class, parameters."""
    make: Any
    for fmt in (*both(SMALL), *both(EIGHT_BITS)):
        for make in FpAdd, FpMultiply:
            for options in rounded(make):
                yield FloatResult, make, (fmt,), options
    for fmt in both(EIGHT_BITS):
        yield Relation, FpCompare, (fmt,), {}
        yield Extreme, FpMinMax, (fmt,), {}
        for options in rounded(FpToFixed):
            yield FixedResult, FpToFixed, (fmt,), {"width": 6, "fraction_bits": 3, **options}
        for options in rounded(FixedToFp):
            yield FloatResult, FixedToFp, (fmt,), {"width": 8, "fraction_bits": 4, **options}
    for fmt in both(SMALL):
        for make in FpDivide, FpSquareRoot, FpReciprocalSquareRoot:
            for options in rounded(make):
                yield FloatResult, make, (fmt,), options
        for relation in RELATIONS:
            yield Relation, FpRelation, (fmt, relation), {}
        for options in rounded(FpToFp):
            yield FloatResult, FpToFp, (EIGHT_BITS.with_subnormals(fmt.subnormals), fmt), options


def properties():
    """Every ``Property``, in the order of the document."""
    for make, parameters, options in pipelines():
        def op(make=make, parameters=parameters, options=options):
            return make(*parameters, **options)
        subject, latency = describe(make, *parameters, **options), op().latency
        yield Property(subject, "result and done belong to one start, latency edges ago", PipelineAlignment(op),
                       latency, ("one", "other"))
        yield Property(subject, "no done before the first result", PipelineFromReset(op), latency)
    for make, parameters, options in iteratives():
        def op(make=make, parameters=parameters, options=options):
            return make(*parameters, **options)
        subject, one = describe(make, *parameters, **options), op()
        yield Property(subject, "one done for each accepted start, none else", IterativeHandshake(op),
                       2 * one.interval + one.latency + 2)
        yield Property(subject, "results hold from one done to the next", IterativeHold(op), 1, ("op",))
        for gap in range(3):
            yield Property(subject, f"nothing before an operation, {gap} idle cycles between, changes its result",
                           IterativeAlignment(op, gap=gap), one.interval + gap + one.latency)
    for name in VENDOR_OPERATORS:
        def vendor(name=name):
            return VendorOperator(name)
        latency, subject = vendor().latency, f"vendor {name}"
        yield Property(subject, "ce low holds every register", VendorHold(vendor), 1, ("vendor",), VendorHold.UNCHANGED)
        yield Property(subject, "rdy follows new data by latency enabled edges, unless cleared",
                       VendorOrder(vendor, settled=True), latency, ("vendor",))
        yield Property(subject, "no rdy before the first result", VendorOrder(vendor, settled=False), latency)
        yield Property(subject, "a result is that of its own operands", VendorAlignment(vendor), latency,
                       ("one", "other"), solver=SOLVERS.get(name, "z3"))
    for circuit, make, parameters, options in results():
        small = make(*parameters, **options)
        yield Property(describe(make, *parameters, **options), CLAIMS[circuit], circuit(small), small.latency)
