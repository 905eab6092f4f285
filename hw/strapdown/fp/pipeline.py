"""What all pipelined operators share: their ports, and register ranks placed at named cuts."""

import operator
from types import SimpleNamespace
from typing import NamedTuple

from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

__all__ = ["Pipeline", "PipelinedOperator", "Ranks", "pick"]


class Pipeline(NamedTuple):
    """Where the register ranks of a pipelined operator may stand.

    Attributes
    ----------
    cuts : tuple of str
        The places in the data flow, in its order. The greatest latency is their number.
    default_latency : int
        The latency if none is chosen.
    priority : tuple of str
        The cuts in the order in which deeper pipelines take them.
    """

    cuts: tuple[str, ...]
    default_latency: int
    priority: tuple[str, ...] = ()


class PipelinedOperator(Described):
    """Base of the fully pipelined operators: one operation a cycle, no back-pressure.

    Parameters
    ----------
    operands, result : dict
        Member name to shape of the data ports.
    latency : int or None
        Number of register ranks, 1 to the number of cuts; None means the pipeline's default.
    pipeline : Pipeline or None
        Where the ranks may stand; None means the class's ``PIPELINE``.

    Members
    -------
    start, done : In(1), Out(1)
        ``done`` is ``start``, ``latency`` cycles later; results are valid while it is high.

    Raises: ValueError if ``latency`` is out of range.
    """

    PIPELINE: Pipeline

    def __init__(self, operands, results, *, latency=None, pipeline=None):
        self._pipeline = self.PIPELINE if pipeline is None else pipeline
        self._latency = self._pipeline.default_latency if latency is None else operator.index(latency)
        if not 1 <= self._latency <= len(self._pipeline.cuts):
            raise ValueError(f"latency must be from 1 to {len(self._pipeline.cuts)}, not {latency!r}")
        super().__init__({
            **{name: In(shape) for name, shape in operands.items()}, "start": In(1),
            **{name: Out(shape) for name, shape in results.items()}, "done": Out(1)})

    @property
    def pipeline(self):
        """Where the ranks may stand, a Pipeline."""
        return self._pipeline

    @property
    def latency(self):
        """Cycles from ``start`` to ``done``: the registers crossed."""
        return self._latency

    @property
    def interval(self):
        """Cycles between two operations: 1."""
        return 1

    def ranks(self, m):
        """The register ranks of this operator's pipeline, for use in ``elaborate``."""
        return Ranks(m, self._pipeline.cuts, self._pipeline.priority[:self._latency], self.start)


class Ranks:
    """Register ranks at named cuts of a data flow.

    ``rank("align", sign=…, sum=…)`` gives back a namespace with the same values: registered if
    the pipeline has a rank at that cut, the values themselves if not, or if constant. ``valid`` follows.
    Data registers have no reset; only the valid chain does.
    """

    def __init__(self, m, cuts, placed, valid):
        self._m = m
        self._cuts = iter(cuts)
        self._placed = frozenset(placed)
        self.valid = valid

    def __call__(self, cut, **values):
        assert next(self._cuts) == cut, "cuts must be passed in the order of the pipeline"
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
    """The members of a namespace with these names (any iterables of strings), as a dict."""
    return {name: getattr(values, name) for some in names for name in some}
