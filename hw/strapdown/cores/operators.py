# mypy: disable-error-code="attr-defined"
"""Operators with the module and port names of the vendor cores that the thesis's RTL instantiates."""

import operator
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described
from strapdown.cordic import FixedAtan2
from strapdown.fp import (
    BINARY32,
    FixedToFp,
    FpAdd,
    FpCompare,
    FpDivide,
    FpMultiply,
    FpSquareRoot,
    FpToFixed,
    Subnormals,
)
from strapdown.kernel.description import Port, Section

from .top import CLOCK, Control, Top, through

__all__ = ["RankedOperator", "VENDOR_OPERATORS", "VendorKind", "VendorOperator"]

FLUSHED32 = replace(BINARY32, subnormals=Subnormals.FLUSH, negative_nan=True)
"""The vendor's operators take subnormals as zeros and produce none; the sign bit of their NaN is set."""

MAXIMUM_LATENCY = 64
"""Greatest latency in cycles; greater than that of any vendor operator."""


VENDOR_CONTROL = Control(
    CLOCK, Port("sclr", In, 1, "synchronous clear, overrides ce"), reset_level=1, reset_stages=0,
    enable=Port("ce", In, 1, "clock enable"))
"""Clock, clear and enable of the vendor's cores. A clock domain's reset overrides the enable, so sclr overrides ce."""


@dataclass(frozen=True)
class VendorKind:
    """One of the vendor's operators.

    Attributes
    ----------
    name, title : str
        Module name, and its function.
    latency, least_latency : int
        Latency of the vendor's core, and the least latency that is possible here, cycles.
    make : callable
        Makes this project's operator, with at most as many register ranks as its argument.
    twin : callable
        Function of the operator and of arrays, in the order of ``operands``; returns the array of results.
    operands : tuple of Port
        Data inputs.
    result : Port
        Data output.
    notes : tuple of str
        Rounding and special values, one sentence each.
    new_data : str
        Name of the port that takes the operands.
    members : dict
        Maps the vendor's port to the member of the operator, where the names differ.
    constants : dict
        Members of the operator that are constant, and their values.
    """

    name: str
    title: str
    latency: int
    least_latency: int
    make: Callable[[int], Any]
    twin: Callable[..., np.ndarray]
    operands: tuple[Port, ...]
    result: Port
    notes: tuple[str, ...]
    new_data: str = "operation_nd"
    members: dict[str, str] = field(default_factory=dict)
    constants: dict[str, int] = field(default_factory=dict)

    def member(self, port):
        """The member of the operator behind a vendor's port."""
        return self.members.get(port.name, port.name)


class RankedOperator(Described):
    """An operator of this project with the vendor's data ports and latency.

    It works in the clock domain ``sync``; ``VendorOperator`` adds clock, clear and enable.

    Parameters
    ----------
    kind : VendorKind
    latency : int
        Cycles from operands to result.

    Members
    -------
    Those of ``VendorOperator`` without clk, sclr and ce.
    """

    def __init__(self, kind, latency):
        self._kind, self._latency = kind, latency
        self._operator = kind.make(latency)
        super().__init__({port.name: port.member for port in self.ports})

    @property
    def kind(self):
        """Description of the vendor core."""
        return self._kind

    @property
    def operator(self):
        """The operator inside."""
        return self._operator

    @property
    def name(self):
        """Name of the Verilog module."""
        return self._kind.name

    @property
    def title(self):
        """Its function, in words."""
        return self._kind.title

    @property
    def ports(self):
        """The ports: new data, ready, operands, result."""
        return (Port(self._kind.new_data, In, 1, "new data: takes the operands"),
                Port("rdy", Out, 1, "high while the result of an operation is valid"),
                *self._kind.operands, self._kind.result)

    @property
    def latency(self):
        """Cycles from the operands to their result."""
        return self._latency

    @property
    def extra_ranks(self):
        """Register ranks that follow the operator, up to ``latency``."""
        return self._latency - self._operator.latency

    @property
    def notes(self):
        """Rounding and special values, those of the format included, one sentence each."""
        notes = [*self._kind.notes]
        if any(port.width == 32 for port in self._kind.operands):
            notes.append("A subnormal operand counts as zero of the same sign.")
            if self._kind.result.width == 32:
                notes.append("A result below 2^-126, before rounding, becomes zero of the same sign.")
        return tuple(notes)

    @property
    def equations(self):
        """None."""
        return ()

    @property
    def sections(self):
        """Timing and numbers."""
        timing = (
            f"Operands are taken at each rising edge of clk with {self._kind.new_data} and ce high, one operation per "
            f"cycle. rdy is high with the result {self._latency} edges with ce high later, counting the first one. "
            "While ce is low, all registers hold. sclr high at a rising edge cancels all operations in flight, "
            "with ce high or low.")
        ranks = f"The operator has {self._operator.latency} register ranks" + (
            f"; {self.extra_ranks} more follow it. Synthesis may move these into it (retiming)."
            if self.extra_ranks else ".")
        return Section("TIMING", paragraphs=(timing, ranks)), Section("NUMBERS", paragraphs=self.notes)

    @property
    def facts(self):
        """Figures as JSON values."""
        return {"interval_cycles": 1, "extra_ranks": self.extra_ranks, "numbers": list(self.notes)}

    def elaborate(self, platform):
        m = Module()
        kind = self._kind
        m.submodules.operator = inner = self._operator
        m.d.comb += through(self, inner, {kind.new_data: "start"} | {port.name: kind.member(port)
                                                                     for port in kind.operands})
        m.d.comb += [getattr(inner, member).eq(value) for member, value in kind.constants.items()]

        # Ranks that the operator cannot use follow it: results have fewer bits than operands.
        valid, result = inner.done, Value.cast(getattr(inner, kind.member(kind.result)))
        for rank in range(self.extra_ranks):
            valid_q = Signal(name=f"valid_{rank}")
            result_q = Signal(kind.result.width, name=f"result_{rank}", reset_less=True)
            m.d.sync += [valid_q.eq(valid), result_q.eq(result)]
            valid, result = valid_q, result_q
        m.d.comb += [self.rdy.eq(valid), getattr(self, kind.result.name).eq(result)]
        return m


class VendorOperator(Top):
    """An operator with the module and port names, the latency and the control ports of a vendor core.

    Parameters
    ----------
    name : str
        One of ``VENDOR_OPERATORS``.
    latency : int or None
        Cycles from operands to result, ``kind.least_latency`` to 64; None means the vendor's.

    Members
    -------
    operation_nd (``atan``: nd) : In(1)
        New data: the operands are taken at a rising edge of ``clk`` with this and ``ce`` high.
    clk, sclr, ce : In(1)
        Clock; synchronous clear, which cancels all operations in flight, also while ``ce`` is low;
        clock enable, without which registers hold.
    rdy : Out(1)
        High while the result of an operation is valid.
    Operands and result have the vendor's names; see ``kind``.

    Latency: ``latency`` cycles with ``ce`` high; one operation per cycle; no back-pressure.
    Accuracy, special values: those of ``operator``. Subnormals count as zeros of the same sign.
    Raises: ValueError for an unknown name or a latency out of range.
    Source: the ports that thesis RTL connects; see docs/operators.md.
    """

    def __init__(self, name, *, latency=None):
        if name not in VENDOR_OPERATORS:
            raise ValueError(f"operator must be one of {', '.join(VENDOR_OPERATORS)}, not {name!r}")
        kind = VENDOR_OPERATORS[name]
        cycles = kind.latency if latency is None else operator.index(latency)
        if not kind.least_latency <= cycles <= MAXIMUM_LATENCY:
            raise ValueError(
                f"latency of {name} must be from {kind.least_latency} to {MAXIMUM_LATENCY}, not {latency!r}")
        super().__init__(RankedOperator(kind, cycles), control=VENDOR_CONTROL)

    @property
    def kind(self):
        """Description of the vendor core."""
        return self.component.kind

    @property
    def operator(self):
        """The operator inside."""
        return self.component.operator

    @property
    def extra_ranks(self):
        """Register ranks that follow the operator, up to ``latency``."""
        return self.component.extra_ranks

    @property
    def ports(self):
        """The ports in the vendor's order."""
        new_data, *others = self.component.ports
        return (new_data, *self.control.ports, *others)

    def compute(self, *operands):
        """Bit-exact software twin: arrays of float32, fixed point as integers, in the order of the ports."""
        return self.kind.twin(self.operator, *operands)


def _pipeline(make, **parameters):
    """A function that makes an operator with at most one register rank for each of its cuts."""
    most = len(make.PIPELINE.cuts)
    return lambda latency: make(**parameters, latency=min(latency, most))


def _recurrence(make):
    """A function that makes a digit recurrence with as few bits per cycle as the latency allows."""
    def fitting(latency):
        for bits_per_cycle in range(1, FLUSHED32.precision + 2):
            recurrence = make(FLUSHED32, bits_per_cycle=bits_per_cycle)
            if recurrence.latency <= latency:
                return recurrence
        raise ValueError(f"{make.__name__} has no latency of {latency} or less")
    return fitting


_A, _B = (Port(name, In, 32, f"binary32, {name}") for name in "ab")
_FLOAT = Port("result", Out, 32, "binary32")
_ROUNDED = "Rounded to nearest, ties to even."
_NANS = "Every NaN result is ffc00000."
_KINDS = (
    VendorKind("add", "a + b", 11, 1, _pipeline(FpAdd, format=FLUSHED32),
               lambda op, a, b: op.compute(a, b), (_A, _B), _FLOAT,
               (_ROUNDED, "x - x is +0; infinity - infinity is NaN.", _NANS), constants={"subtract": 0}),
    VendorKind("sub", "a - b", 11, 1, _pipeline(FpAdd, format=FLUSHED32),
               lambda op, a, b: op.compute(a, b, True), (_A, _B), _FLOAT,
               (_ROUNDED, "x - x is +0; infinity - infinity is NaN.", _NANS), constants={"subtract": 1}),
    VendorKind("mult", "a * b", 6, 1, _pipeline(FpMultiply, format=FLUSHED32),
               lambda op, a, b: op.compute(a, b), (_A, _B), _FLOAT,
               (_ROUNDED, "0 * infinity is NaN.", _NANS)),
    VendorKind("div", "a / b", 28, 3, _recurrence(FpDivide),
               lambda op, a, b: op.compute(a, b), (_A, _B), _FLOAT,
               (_ROUNDED, "x / 0 is infinity; 0 / 0 and infinity / infinity are NaN.", _NANS)),
    VendorKind("sqrt", "square root of a", 28, 3, _recurrence(FpSquareRoot),
               lambda op, a: op.compute(a), (_A,), _FLOAT,
               (_ROUNDED, "The root of -0 is -0; the root of another negative number is NaN.", _NANS)),
    VendorKind("equl", "a = b", 2, 1, _pipeline(FpCompare, format=FLUSHED32),
               lambda op, a, b: op.compute(a, b).equal, (_A, _B),
               Port("result", Out, 1, "1 if a = b", vector=True),
               ("+0 equals -0; a NaN equals no number.",), members={"result": "equal"}),
    VendorKind("less", "a < b", 2, 1, _pipeline(FpCompare, format=FLUSHED32),
               lambda op, a, b: op.compute(a, b).less, (_A, _B),
               Port("result", Out, 1, "1 if a < b", vector=True),
               ("-0 is not less than +0; a comparison with a NaN gives 0.",), members={"result": "less"}),
    VendorKind("fl32tofi16", "fixed point with 14 fraction bits from binary32", 6, 1,
               _pipeline(FpToFixed, format=FLUSHED32, width=16, fraction_bits=14),
               lambda op, a: op.compute(a), (_A,),
               Port("result", Out, 16, "two's complement, 14 fraction bits"),
               (_ROUNDED, "A number out of range becomes the nearest end of the range, infinities included.",
                "NaN becomes the most negative number.")),
    VendorKind("fi16tofl32", "binary32 from fixed point with 13 fraction bits", 6, 1,
               _pipeline(FixedToFp, format=FLUSHED32, width=16, fraction_bits=13),
               lambda op, a: op.compute(a),
               (Port("a", In, 16, "two's complement, 13 fraction bits"),), _FLOAT,
               ("Exact.", "0 becomes +0."), members={"a": "operand"}),
    VendorKind("atan", "angle from the x axis to (x_in, y_in), rad", FixedAtan2.PIPELINE.default_latency, 1,
               _pipeline(FixedAtan2), lambda op, x_in, y_in: op.compute(y_in, x_in),
               (Port("x_in", In, 16, "two's complement, 14 fraction bits"),
                Port("y_in", In, 16, "two's complement, 14 fraction bits")),
               Port("phase_out", Out, 16, "two's complement, 13 fraction bits, rad"),
               ("Within 0.73 * 2^-13 rad, for vectors of any length.", "All four quadrants, -pi to pi.",
                "The angle of (0, 0) is 0."), new_data="nd"),
)

VENDOR_OPERATORS = {kind.name: kind for kind in _KINDS}
"""The vendor cores of the thesis, by module name."""
