"""The list of operators: all data that reports, pages, proofs and exhaustive runs need about each of them."""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from itertools import product
from typing import Any

from strapdown.cordic import CordicAtan2, CordicSinCos, FixedAtan2, TableAtan2
from strapdown.fp import (
    BINARY16,
    BINARY32,
    BINARY64,
    RELATIONS,
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
    FpSumOfProducts,
    FpTableReciprocal,
    FpToFixed,
    FpToFp,
    Rounding,
)

from . import special_values as special

__all__ = ["OPERATORS", "Claim", "FullRun", "Measured", "OperatorEntry", "Variants"]

FLUSH = BINARY32.with_subnormals("flush")
BOTH = (BINARY32,), (FLUSH,)
FLUSH_FIRST = (FLUSH,), (BINARY32,)
DOUBLE = [(BINARY64.with_subnormals("flush"),)]

# Small formats, for which all operands can be tried.
TINY = FloatFormat(2, 1)
SMALL = FloatFormat(3, 2)
EIGHT_BITS = FloatFormat(4, 3)

DEPTHS = "every depth"
"""In place of values for ``latency``: all latencies that the operator can have."""


def _policies(*formats):
    """The formats with either policy for subnormals, as positional parameters."""
    return [tuple(fmt.with_subnormals(policy) for fmt in formats) for policy in ("gradual", "flush")]


@dataclass(frozen=True)
class Variants:
    """An operator with several sets of parameters.

    Attributes
    ----------
    formats : sequence of tuples
        Positional parameters of the class; one empty tuple for none.
    choices : dict
        Maps each keyword parameter to its values; ``latency`` may map to ``DEPTHS``.
    """

    formats: Sequence[tuple]
    choices: Mapping[str, Iterable[Any]] = field(default_factory=dict)

    def of(self, component: Any) -> Iterator[tuple[tuple, dict[str, Any]]]:
        """Positional and keyword parameters of each variant of a class."""
        for formats in self.formats:
            choices: Mapping[str, Iterable[Any]] = self.choices
            if choices.get("latency") is DEPTHS:
                fixed = {name: next(iter(values)) for name, values in choices.items() if name != "latency"}
                cuts = component(*formats, **fixed).pipeline.cuts
                choices = {**choices, "latency": range(1, len(cuts) + 1)}
            for values in product(*choices.values()):
                yield formats, dict(zip(choices, values, strict=True))


_SPEED = {"latency", "bits_per_cycle", "iterative", "steps_per_cycle"}


def _is_default(component, formats, parameters):
    others = {name: value for name, value in parameters.items() if name not in _SPEED}
    default = component(*formats, **others)
    return all(getattr(default, name) == value for name, value in parameters.items() if name in _SPEED)


def _is_flushed(component, formats, parameters):
    return FLUSH in formats


def _is_default_or_deep(component, formats, parameters):
    default = component(*formats).latency
    return parameters["latency"] == default or (FLUSH in formats and parameters["latency"] >= default - 1)


def _never(component, formats, parameters):
    return False


def _always(component, formats, parameters):
    return True


@dataclass(frozen=True)
class Measured(Variants):
    """Variants that the report measures.

    Attributes
    ----------
    title : str
        Title of the table in the report.
    placed : callable
        Function of class and parameters; true if the variant is also placed and routed, which takes minutes.
    """

    title: str = ""
    placed: Callable[..., bool] = _is_default


class Claim(Enum):
    """The property that is proved for every result of a small variant."""

    ROUNDED = "every result is the exact one, rounded"
    RELATION = "every relation is that of the exact values"
    EXTREME = "the result is the minimum or maximum of the operands"


@dataclass(frozen=True)
class FullRun:
    """A variant of one 32-bit operand, whose 2**32 operands are all tried.

    Attributes
    ----------
    name : str
        Name for ``make exhaustive ONLY=``.
    make : callable
        Makes the operator.
    expectation : str
        The function of exhaustive.cpp that computes the expected results.
    meaning : str
        Description for docs/proof.md.
    modes : dict
        Maps members of the operator to constants.
    """

    name: str
    make: Callable[[], Any]
    expectation: str
    meaning: str
    modes: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class OperatorEntry:
    """An operator, with its page, measurements, proofs and exhaustive runs.

    Attributes
    ----------
    component : type
        Its class.
    special_values : callable
        Makes the Markdown of its special values.
    parameters : dict
        Parameters of the variant that its page describes.
    choices : dict
        Parameters on which the latency depends, and their values in the table of its page.
    measured : tuple of Measured
        Variants that the report measures.
    control : tuple of Variants
        Variants whose control is proved. Control does not depend on data, so the formats are the smallest.
    claim : Claim or None
        The property that is proved for the results of ``proved``.
    proved : tuple of Variants
        Small variants. Each means all rounding directions, and flags, if the class has these.
    tried : tuple of Variants
        Variants with formats of 8 bits; the tests try all their operands on the circuit. Expanded like ``proved``.
    full_runs : tuple of FullRun
        Variants with one 32-bit operand, whose values can all be tried.
    """

    component: Any
    special_values: Callable[[], str]
    parameters: dict[str, Any] = field(default_factory=lambda: {"format": BINARY32})
    choices: Mapping[str, Iterable[Any]] = field(default_factory=dict)
    measured: tuple[Measured, ...] = ()
    control: tuple[Variants, ...] = ()
    claim: Claim | None = None
    proved: tuple[Variants, ...] = ()
    tried: tuple[Variants, ...] = ()
    full_runs: tuple[FullRun, ...] = ()

    @property
    def name(self):
        """The name of the class."""
        return self.component.__name__

    def make(self, **parameters):
        """The operator that the page describes, or the same operator with other parameters."""
        return self.component(**{**self.parameters, **parameters})

    def page_choices(self):
        """``choices`` with the depths written out."""
        if self.choices.get("latency") is DEPTHS:
            return {**self.choices, "latency": range(1, len(self.make().pipeline.cuts) + 1)}
        return self.choices

    def rounded(self, variants):
        """Parameters, positional and keyword, of variants in all rounding directions and with flags."""
        accepted = inspect.signature(self.component).parameters
        flags = {"flags": True} if "flags" in accepted else {}
        roundings = [{"rounding": rounding, **flags} for rounding in Rounding] if "rounding" in accepted else [{}]
        for formats, parameters in variants.of(self.component):
            for options in roundings:
                yield formats, {**parameters, **options}


_PER_CYCLE = (1, 2, 3, 4, 6)
_BITS = {"bits_per_cycle": _PER_CYCLE}
_FORMATS = tuple(fmt for fmt, in BOTH)
_RECURRENCES = {"format": _FORMATS, "iterative": (False, True), **_BITS}


_AHEAD = {"looks_ahead": (False, True)}


def _digit_recurrence(component, title, special_values, **parts):
    """The entry of a digit recurrence that may be pipelined or iterative."""
    return OperatorEntry(
        component, special_values, choices=_RECURRENCES,
        measured=tuple(Measured(FLUSH_FIRST, {"bits_per_cycle": (1, 2, 3), "iterative": (iterative,)}, title)
                       for iterative in (False, True)),
        control=(Variants([(SMALL,)], {"bits_per_cycle": (1, 2, SMALL.precision)}),
                 Variants([(TINY,)], {"bits_per_cycle": (1, 2), "iterative": (True,), **_AHEAD})),
        claim=Claim.ROUNDED, proved=(Variants(_policies(SMALL), _AHEAD),), **parts)


def _fixed(title, width, fraction_bits):
    return Measured([(FLUSH,)], {"width": (width,), "fraction_bits": (fraction_bits,), "latency": DEPTHS},
                    f"{title}, {width} bits")


_DEEP = {"latency": DEPTHS}
_DSP = {"dsp_shifts": (True,)}
_TWO_PATHS = {"two_paths": (True,)}
_FLUSHED = [(fmt.with_subnormals("flush"),) for fmt in (SMALL, EIGHT_BITS)]
_QUIET = {"quiet": (True,), "latency": (1, 2)}
_SMALL_FIXED = Variants([(SMALL,)], {"width": (4,), "fraction_bits": (2,), "latency": DEPTHS})

OPERATORS = (
    OperatorEntry(
        FpAdd, lambda: "\n\n".join([special.binary_tables(FpAdd, "a + b", subtract=False),
                                    special.binary_tables(FpAdd, "a − b", subtract=True)]),
        choices=_DEEP, measured=(Measured(FLUSH_FIRST, _DEEP, "add", _is_default_or_deep),
                                 Measured([(FLUSH,)], {**_DSP, "latency": (6,)}, "add"),
                                 Measured([(FLUSH,)], {**_TWO_PATHS, "latency": (3,)}, "add"),
                                 Measured(DOUBLE, {"latency": (6, 7, 8)}, "add in binary64", _always)),
        control=(Variants([(SMALL,)], _DEEP), Variants([(SMALL,)], _QUIET),
                 Variants([(SMALL.with_subnormals("flush"),)], {**_DSP, **_DEEP}),
                 Variants([(SMALL.with_subnormals("flush"),)], {**_TWO_PATHS, **_DEEP})),
        claim=Claim.ROUNDED, proved=(Variants([*_policies(SMALL), *_policies(EIGHT_BITS)]), Variants(_FLUSHED, _DSP),
                                     Variants(_FLUSHED, _TWO_PATHS)),
        tried=(Variants(_policies(EIGHT_BITS)), Variants(_FLUSHED[1:], _DSP), Variants(_FLUSHED[1:], _TWO_PATHS))),
    OperatorEntry(
        FpMultiply, partial(special.binary_tables, FpMultiply),
        choices=_DEEP, measured=(Measured(FLUSH_FIRST, _DEEP, "multiply", _is_default_or_deep),
                                 Measured(DOUBLE, {"latency": (2, 3, 4)}, "multiply in binary64", _always)),
        control=(Variants([(SMALL,)], _DEEP), Variants([(SMALL,)], _QUIET)),
        claim=Claim.ROUNDED, proved=(Variants([*_policies(SMALL), *_policies(EIGHT_BITS)]),),
        tried=(Variants(_policies(EIGHT_BITS)),)),
    OperatorEntry(
        FpSumOfProducts, special.sum_of_products_table,
        choices=_DEEP,
        measured=(Measured([(FLUSH,)], {"latency": (7, 8, 9)}, "sum of products"),),
        control=(Variants([(TINY,)], _DEEP),),
        claim=Claim.ROUNDED, proved=(Variants(_policies(TINY)),)),
    _digit_recurrence(
        FpDivide, "divide", partial(special.binary_tables, FpDivide),
        tried=(Variants(_policies(EIGHT_BITS), {"bits_per_cycle": (4,), **_AHEAD}),)),
    _digit_recurrence(
        FpSquareRoot, "square root", partial(special.unary_table, FpSquareRoot),
        full_runs=(FullRun("sqrt", partial(FpSquareRoot, BINARY32), "square_root", "square root, gradual"),)),
    OperatorEntry(
        FpDivideSquareRoot, lambda: "\n\n".join([
            special.binary_tables(FpDivideSquareRoot, "a / b, `square_root` = 0", square_root=False),
            "Square root of a, `square_root` = 1:",
            special.unary_table(FpDivideSquareRoot, b=1, square_root=True)]),
        choices=_BITS,
        measured=(Measured(FLUSH_FIRST, {"bits_per_cycle": (1, 2, 3)}, "divide and square root", _is_flushed),
                  Measured(DOUBLE, {"bits_per_cycle": (1, 2)}, "divide and square root in binary64", _always)),
        control=(Variants([(TINY,)], {"bits_per_cycle": (1, 2), **_AHEAD}),),
        tried=(Variants(_policies(EIGHT_BITS), {"bits_per_cycle": (3,), **_AHEAD}),)),
    OperatorEntry(
        FpReciprocalSquareRoot, partial(special.unary_table, FpReciprocalSquareRoot),
        choices=_BITS,
        measured=(Measured(FLUSH_FIRST, {"bits_per_cycle": (1, 2)}, "reciprocal square root", _is_flushed),),
        control=(Variants([(FloatFormat(3, 1),)], {"bits_per_cycle": (1, 2)}),),
        claim=Claim.ROUNDED, proved=(Variants(_policies(SMALL)),),
        tried=(Variants(_policies(EIGHT_BITS), {"bits_per_cycle": (4,)}),),
        full_runs=(FullRun("rsqrt", partial(FpReciprocalSquareRoot, BINARY32, bits_per_cycle=6),
                           "reciprocal_square_root", "reciprocal square root, gradual, 6 bits a cycle"),)),
    OperatorEntry(
        FpTableReciprocal, partial(special.table_reciprocal_table, FpTableReciprocal),
        parameters={"format": FLUSH}, choices=_DEEP,
        measured=(Measured([(FLUSH,)], _DEEP, "reciprocal and its root by table", _is_default_or_deep),),
        control=tuple(Variants([(FloatFormat(3, 9).with_subnormals("flush"),)], choices)
                      for choices in (_DEEP, _QUIET)),
        full_runs=tuple(FullRun(f"table_{name}", partial(FpTableReciprocal, FLUSH), f"table_{name}",
                                f"{name.replace('_', ' ')} by table, flushed, within 0.88 ulp", {"square_root": root})
                        for root, name in enumerate(("reciprocal", "reciprocal_square_root")))),
    OperatorEntry(
        FpCompare, partial(special.compare_tables, FpCompare),
        choices=_DEEP, measured=(Measured(FLUSH_FIRST, _DEEP, "compare"),), control=(Variants([(SMALL,)], _DEEP),),
        claim=Claim.RELATION, proved=(Variants(_policies(EIGHT_BITS)),),
        tried=(Variants(_policies(EIGHT_BITS), {"signalling": (False, True), "flags": (True,)}),)),
    OperatorEntry(
        FpRelation, partial(special.relation_table, FpRelation, RELATIONS),
        parameters={"format": BINARY32, "relation": "<"}, choices=_DEEP,
        measured=(Measured([(FLUSH, "<"), (BINARY32, "<")], _DEEP, "less"),),
        control=(Variants([(SMALL, "<")], _DEEP),),
        claim=Claim.RELATION,
        proved=(Variants([(fmt, relation) for fmt, in _policies(SMALL) for relation in RELATIONS]),),
        tried=(Variants([(fmt, relation) for fmt, in _policies(EIGHT_BITS) for relation in ("<", "!=")],
                        {"flags": (True,)}),)),
    OperatorEntry(
        FpMinMax, lambda: "\n\n".join([special.binary_tables(FpMinMax, "Minimum, `maximum` = 0", maximum=False),
                                       special.binary_tables(FpMinMax, "Maximum, `maximum` = 1", maximum=True)]),
        choices=_DEEP, measured=(Measured(FLUSH_FIRST, _DEEP, "minimum and maximum"),),
        control=(Variants([(SMALL,)], _DEEP),),
        claim=Claim.EXTREME, proved=(Variants(_policies(EIGHT_BITS)),),
        tried=(Variants(_policies(EIGHT_BITS), {"flags": (True,)}),)),
    OperatorEntry(FpSelect, partial(special.choice_table, FpSelect),
                  control=(Variants([(SMALL,)], {"quiet": (False, True)}),)),
    OperatorEntry(
        FpToFixed, partial(special.to_fixed_table, 16, 14),
        parameters={"format": BINARY32, "width": 16, "fraction_bits": 14}, choices=_DEEP,
        measured=(_fixed("to fixed", 16, 14), _fixed("to fixed", 32, 0)), control=(_SMALL_FIXED,),
        claim=Claim.ROUNDED, proved=(Variants(_policies(EIGHT_BITS), {"width": (6,), "fraction_bits": (3,)}),),
        # A small range of integers, so that operands saturate.
        tried=(Variants(_policies(EIGHT_BITS), {"width": (7,), "fraction_bits": (4,)}),
               Variants(_policies(EIGHT_BITS), {"width": (3,), "fraction_bits": (0,)})),
        full_runs=(FullRun("to_int32", partial(FpToFixed, BINARY32, width=32, fraction_bits=0), "to_int32",
                           "float to 32-bit integer"),
                   FullRun("to_fixed16", partial(FpToFixed, FLUSH, width=16, fraction_bits=14), "to_fixed16",
                           "float to 16 bits with 14 fraction bits, flushed"))),
    OperatorEntry(
        FixedToFp, partial(special.from_fixed_table, 32, 0),
        parameters={"format": BINARY32, "width": 32, "fraction_bits": 0}, choices=_DEEP,
        measured=(_fixed("from fixed", 16, 13), _fixed("from fixed", 32, 0)), control=(_SMALL_FIXED,),
        claim=Claim.ROUNDED, proved=(Variants(_policies(EIGHT_BITS), {"width": (8,), "fraction_bits": (4,)}),),
        tried=(Variants(_policies(EIGHT_BITS), {"width": (12,), "fraction_bits": (11,)}),),
        full_runs=(FullRun("from_int32", partial(FixedToFp, BINARY32, width=32, fraction_bits=0), "from_int32",
                           "32-bit integer to float"),)),
    OperatorEntry(
        FpToFp, special.resize_tables, parameters={"from_format": BINARY32, "to_format": BINARY16}, choices=_DEEP,
        measured=(Measured([(BINARY32, BINARY16), (BINARY16, BINARY32), (BINARY32, BINARY64), (BINARY64, BINARY32)],
                           _DEEP, "to another format"),),
        control=(Variants([(EIGHT_BITS, SMALL)], _DEEP),),
        claim=Claim.ROUNDED, proved=(Variants(_policies(EIGHT_BITS, SMALL)),),
        # Fewer exponents and fewer fraction bits, so that all kinds of results occur.
        tried=(Variants(_policies(EIGHT_BITS, SMALL)),)),
    OperatorEntry(
        CordicAtan2, partial(special.arctangent_tables, CordicAtan2),
        choices={"format": _FORMATS, "iterative": (True, False), "steps_per_cycle": _PER_CYCLE},
        measured=(Measured(FLUSH_FIRST, {"steps_per_cycle": (1, 2), "iterative": (True,)}, "arctangent", _is_flushed),
                  Measured([(FLUSH,)], {"steps_per_cycle": (1,), "iterative": (False,)}, "arctangent", _is_flushed),
                  Measured(DOUBLE, {"steps_per_cycle": (1,), "iterative": (True,)}, "arctangent in binary64", _always)),
        control=(Variants(_policies(FloatFormat(3, 1)), {"steps_per_cycle": (3,), "iterative": (False,)}),
                 Variants(_policies(FloatFormat(3, 1)), {"steps_per_cycle": (1, 3), "iterative": (True,)}),
                 Variants(_policies(FloatFormat(3, 1)), {"steps_per_cycle": (1,), "iterative": (True,),
                                                         "registered_addends": (True,)}))),
    OperatorEntry(
        TableAtan2, partial(special.flushed_table, TableAtan2, ("y", "x")), parameters={"format": FLUSH},
        measured=(Measured([(FLUSH,)], {"degrees": (False, True)}, "arctangent by table"),),
        control=(Variants([(FloatFormat(5, 9).with_subnormals("flush"),)], {"latency": (2, 9, 17)}),)),
    OperatorEntry(
        CordicSinCos, partial(special.sincos_table, CordicSinCos),
        choices={"iterative": (True, False), "steps_per_cycle": _PER_CYCLE},
        measured=(Measured(FLUSH_FIRST, {"steps_per_cycle": (1, 2), "iterative": (True,)}, "sine and cosine", _never),
                  Measured([(FLUSH,)], {"steps_per_cycle": (1,), "iterative": (False,)}, "sine and cosine", _never)),
        control=(Variants(_policies(FloatFormat(5, 1)), {"steps_per_cycle": (4,), "iterative": (False,)}),
                 Variants(_policies(FloatFormat(5, 1)), {"steps_per_cycle": (2, 8), "iterative": (True,)}))),
    OperatorEntry(
        FixedAtan2, partial(special.fixed_arctangent_table, FixedAtan2), parameters={},
        choices={"latency": (1, 2, 4, 5, 10, 15, 20)},
        measured=(Measured([()], {"latency": (5, 10, 15, 20)}, "arctangent, 16 bits",
                           lambda component, formats, parameters: parameters["latency"] in (10, 20)),),
        control=(Variants([()], {"latency": (1, 2, 7, 20)}),)),
)
"""All operators, in the order of their pages and tables."""
