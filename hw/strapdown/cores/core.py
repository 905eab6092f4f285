# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""An engine under the ports that its users' RTL instantiates."""

from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In

from strapdown.kernel.engine import Engine

__all__ = ["Core"]


class Core(wiring.Component):
    """A self-contained Verilog module around an engine.

    Parameters
    ----------
    system : System
        Equations, and the names of all ports but clock and reset.
    pool : Pool
        Operators of the engine.
    engine : type
        Kind of engine.
    **parameters
        What else it takes.

    Members
    -------
    clk, rst_n : In(1)
        Clock, rising edge; reset, active low, asynchronous.
    All others are the engine's.

    Latency: ``latency`` clock cycles, the same in every update.
    """

    def __init__(self, system, pool, *, engine=Engine, **parameters):
        self._engine = engine(system, pool, **parameters)
        super().__init__({"clk": In(1), "rst_n": In(1), **self._engine.signature.members})

    @property
    def engine(self):
        """The engine inside."""
        return self._engine

    @property
    def system(self):
        """Equations and port names."""
        return self._engine.system

    @property
    def latency(self):
        """Cycles from the edge that takes the start to the one that raises finish."""
        return self._engine.latency

    def elaborate(self, platform):
        m = Module()
        m.domains.sync = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal().eq(self.clk), ResetSignal().eq(~self.rst_n)]
        m.submodules.engine = engine = self._engine
        for name, member in engine.signature.members.items():
            source, sink = (self, engine) if member.flow == In else (engine, self)
            m.d.comb += getattr(sink, name).eq(getattr(source, name))
        return m
