"""What all pipelined operators share: their ports, and register ranks placed at named cuts."""

import operator
from types import SimpleNamespace

from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

__all__ = ["PipelinedOperator", "Ranks", "pick"]


class PipelinedOperator(wiring.Component):
    """Base of the fully pipelined operators: one operation a cycle, no back-pressure.

    Parameters
    ----------
    operands, result : dict
        Member name to shape of the data ports.
    latency : int or None
        Number of register ranks, 1 to ``len(CUTS)``; None means ``DEFAULT_LATENCY``.

    Members
    -------
    start, done : In(1), Out(1)
        ``done`` is ``start``, ``latency`` cycles later; results are valid while it is high.

    A subclass lists in ``CUTS`` the places of its data flow where a rank may stand, in the
    order of the flow, and in ``CUT_PRIORITY`` the order in which a deeper pipeline takes them.

    Raises: ValueError if ``latency`` is out of range.
    """

    CUTS: tuple[str, ...] = ()
    CUT_PRIORITY: tuple[str, ...] = ()
    DEFAULT_LATENCY: int = 1

    def __init__(self, operands, results, *, latency=None):
        self._latency = self.DEFAULT_LATENCY if latency is None else operator.index(latency)
        if not 1 <= self._latency <= len(self.CUTS):
            raise ValueError(f"latency must be from 1 to {len(self.CUTS)}, not {latency!r}")
        super().__init__({
            **{name: In(shape) for name, shape in operands.items()}, "start": In(1),
            **{name: Out(shape) for name, shape in results.items()}, "done": Out(1)})

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
        return Ranks(m, self.CUTS, self.CUT_PRIORITY[:self._latency], self.start)


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
        assert next(self._cuts) == cut, "cuts must be passed in the order of CUTS"
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
