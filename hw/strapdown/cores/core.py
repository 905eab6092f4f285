"""An engine as a Verilog module with its published ports."""

from strapdown.kernel.engine import Engine

from .top import CORE_CONTROL, Top, Wrapper

__all__ = ["Core"]


class Core(Top):
    """A self-contained Verilog module with an engine, without a wrapper.

    Parameters
    ----------
    system : System
        Equations, and the names of all ports but clock and reset.
    pool : Pool
        Operators of the engine.
    engine : type
        Kind of engine.
    control : Control
        Ports of clock and reset.
    constants : tuple of Constant
        Parameters of the Verilog module.
    hidden : tuple of str
        Ports of the engine that are not ports of the core.
    **parameters
        Further parameters of the engine.

    Members
    -------
    clk, rst_n : In(1)
        Clock, rising edge; reset, active low, as in ``Top``.
    All others are the engine's, without ``hidden``.

    Latency: ``latency`` clock cycles, the same in every update.
    """

    def __init__(self, system, pool, *, engine=Engine, control=CORE_CONTROL, constants=(), hidden=(), **parameters):
        super().__init__(Wrapper(engine(system, pool, **parameters), hidden=hidden), control=control,
                         constants=constants)

    @property
    def engine(self):
        """The engine inside."""
        return self.component.engine

    @property
    def system(self):
        """Equations and port names."""
        return self.engine.system
