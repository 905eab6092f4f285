"""Base of all pipelined operators: their ports, and register ranks placed at named cuts."""

import operator
from types import SimpleNamespace
from typing import NamedTuple

from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from .rounding import Rounded, Rounding, flags_member

__all__ = ["Pipeline", "PipelinedOperator", "Ranks", "RoundedOperator", "pick"]


class Pipeline(NamedTuple):
    """Possible places of the register ranks of a pipelined operator.

    Attributes
    ----------
    cuts : tuple of str
        The places, in the order of the data flow. Their number is the greatest latency.
    default_latency : int
        The latency if none is given.
    priority : tuple of str
        The cuts in the order in which deeper pipelines use them.
    """

    cuts: tuple[str, ...]
    default_latency: int
    priority: tuple[str, ...] = ()


class PipelinedOperator(Described):
    """Base of the fully pipelined operators: one operation per cycle, no back-pressure.

    Parameters
    ----------
    operands, result : dict
        Map each data member to its shape.
    latency : int or None
        Number of register ranks, 1 to the number of cuts; None means the pipeline's default.
    pipeline : Pipeline or None
        Possible places of the ranks; None means the class's ``PIPELINE``.
    quiet : bool
        True for results that are zero while ``done`` is low: results of several operators may meet in an OR.

    Members
    -------
    start, done : In(1), Out(1)
        ``done`` is ``start``, ``latency`` cycles later; results are valid while it is high.

    Raises: ValueError if ``latency`` is out of range.
    """

    PIPELINE: Pipeline

    def __init__(self, operands, results, *, latency=None, pipeline=None, quiet=False):
        self._pipeline = self.PIPELINE if pipeline is None else pipeline
        self._latency = self._pipeline.default_latency if latency is None else operator.index(latency)
        if not 1 <= self._latency <= len(self._pipeline.cuts):
            raise ValueError(f"latency must be from 1 to {len(self._pipeline.cuts)}, not {latency!r}")
        self._quiet = bool(quiet)
        super().__init__({
            **{name: In(shape) for name, shape in operands.items()}, "start": In(1),
            **{name: Out(shape) for name, shape in results.items()}, "done": Out(1)})

    @property
    def pipeline(self):
        """Possible places of the ranks, a Pipeline."""
        return self._pipeline

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: the registers crossed."""
        return self._latency

    @property
    def interval(self):
        """Cycles between two operations: 1."""
        return 1

    @property
    def quiet(self):
        """True for results that are zero while ``done`` is low."""
        return self._quiet

    def ranks(self, m):
        """The register ranks of this operator's pipeline, for use in ``elaborate``."""
        return Ranks(m, self._pipeline.cuts, self._pipeline.priority[:self._latency], self.start,
                     quiet=self._quiet)


class RoundedOperator(Rounded, PipelinedOperator):
    """Base of the pipelined operators whose result is a rounded number of the format of their operands.

    Parameters
    ----------
    format : FloatFormat
        Format of operands and result.
    operands : dict
        Maps each operand to its shape.
    latency : int or None
        As of PipelinedOperator. With gradual subnormals, the ranks are those of ``GRADUAL_PIPELINE``, if there is one.
    rounding : Rounding
        Direction of rounding, or its value.
    flags : bool
        True for an output ``flags``.
    pipeline, quiet
        As of PipelinedOperator.

    Raises: ValueError if ``latency`` or ``rounding`` is out of range.
    """

    GRADUAL_PIPELINE: Pipeline | None = None

    def __init__(self, format, operands, *, latency, rounding, flags, pipeline=None, quiet=False):
        self._format = format
        self._rounding = Rounding(rounding)
        self._flags = bool(flags)
        super().__init__(operands, {"result": format.layout, **flags_member(flags)}, latency=latency,
                         pipeline=self.GRADUAL_PIPELINE if format.gradual else pipeline, quiet=quiet)


class Ranks:
    """Register ranks at named cuts of a data flow.

    ``rank("align", sign=…, sum=…)`` returns a namespace with the same values. If the pipeline has a rank
    at that cut, the values are registered, except constants. ``valid`` is delayed in the same way.
    Only the chain of ``valid`` has a reset; data registers have none. If the ranks are ``quiet``, the values at the
    last cut are zero where they are not valid.
    """

    def __init__(self, m, cuts, placed, valid, *, quiet=False):
        self._m = m
        self._silenced = cuts[-1] if quiet else None
        self._cuts = iter(cuts)
        self._placed = frozenset(placed)
        self.valid = valid

    def __call__(self, cut, **values):
        assert next(self._cuts) == cut, "cuts must be passed in the order of the pipeline"
        if cut == self._silenced:
            values = {name: Mux(self.valid, value, 0) for name, value in values.items()}
        if cut not in self._placed:
            return SimpleNamespace(**values)
        registered = {}
        for name, value in values.items():
            if isinstance(value, Const):
                registered[name] = value
                continue
            register = Signal.like(value, name=f"{cut}_{name}", reset_less=True)
            self._m.d.sync += register.eq(value)
            registered[name] = register
        valid = Signal(name=f"{cut}_valid")
        self._m.d.sync += valid.eq(self.valid)
        self.valid = valid
        return SimpleNamespace(**registered)


def pick(values, *names):
    """The members of a namespace with the given names (any iterables of strings), as a dict."""
    return {name: getattr(values, name) for some in names for name in some}
