"""From an engine to a Verilog module: wrappers around it, and the top that adds clock and reset."""

from dataclasses import dataclass, replace

from amaranth import *
from amaranth.lib.wiring import In

from strapdown.component import Described
from strapdown.kernel.description import Port

__all__ = ["CLOCK", "CORE_CONTROL", "Constant", "ENABLED_CORE_CONTROL", "Control", "Port", "Top", "Wrapper", "through"]


def through(outer, inner, names):
    """Statements that connect ports of a component to the ports of a component inside it.

    Parameters
    ----------
    outer, inner : wiring.Component
        Both with members of the same flow and width.
    names : dict
        Maps each member of ``outer`` to the member of ``inner`` to connect, or to a part of it: its names and indices
        with points between them.
    """
    for outside, inside in names.items():
        there = inner
        for part in inside.split("."):
            there = there[int(part)] if part.isdigit() else getattr(there, part)
        here, there = Value.cast(getattr(outer, outside)), Value.cast(there)
        yield there.eq(here) if outer.signature.members[outside].flow == In else here.eq(there)


def distinct(ports, module):
    """The ports of a module, if no two have the same name. Raises: ValueError."""
    names = [port.name for port in ports]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{module} has two ports called {twice[0]!r}")
    return ports


class Wrapper(Described):
    """An engine inside a module, with added or hidden ports; by default with exactly the engine's ports.

    A wrapper works in the clock domain ``sync``. A subclass extends ``elaborate``, which returns the
    Module that holds the engine as ``m.submodules.engine``. It may also extend ``sections`` and ``facts``,
    which become parts of the header and of the JSON file.

    Parameters
    ----------
    engine : Engine, StreamEngine or Wrapper
        In the clock domain ``sync``.
    name, title : str or None
        Name of the Verilog module, and its function in one line; None means those of the engine.
    added : tuple of Port
        Ports that follow those of the engine.
    hidden : tuple of str
        Ports of the engine that are not ports of the wrapper. A hidden input is zero unless the subclass drives it.

    Members
    -------
    Those of the engine without ``hidden``, and ``added``.

    Latency: that of the engine.
    Raises: ValueError if ``hidden`` names a port that the engine does not have, or if two ports have the same name.
    """

    def __init__(self, engine, *, name=None, title=None, added=(), hidden=()):
        self._engine = engine
        self._name, self._title = name or engine.name, title or engine.title
        if unknown := set(hidden) - {port.name for port in engine.ports}:
            raise ValueError(f"{engine.name} has no port {', '.join(sorted(unknown))} to hide")
        self._passed = {port.name: port.name for port in engine.ports if port.name not in hidden}
        self._ports = distinct((*(port for port in engine.ports if port.name in self._passed), *added), self._name)
        super().__init__({port.name: port.member for port in self._ports})

    @property
    def engine(self):
        """The engine, or the wrapper, inside."""
        return self._engine

    @property
    def name(self):
        """Name of the Verilog module."""
        return self._name

    @property
    def title(self):
        """The function of the module in one line."""
        return self._title

    @property
    def system(self):
        """Equations and interface of the engine."""
        return self._engine.system

    @property
    def program(self):
        """Microprogram of the engine."""
        return self._engine.program

    @property
    def channels(self):
        """Number of channels of the engine."""
        return self._engine.channels

    @property
    def ports(self):
        """The ports, in the order of the module."""
        return self._ports

    @property
    def latency(self):
        """Cycles from the edge that takes the start to the edge that raises the finish."""
        return self._engine.latency

    @property
    def interval(self):
        """Cycles from one update to the next: the engine's ``interval``, or without one its latency."""
        return getattr(self._engine, "interval", self.latency)

    @property
    def equations(self):
        """The functions whose docstrings the header quotes."""
        return self._engine.equations

    @property
    def sections(self):
        """Sections of the header that follow the table of ports."""
        return self._engine.sections

    @property
    def facts(self):
        """Figures as JSON values."""
        return self._engine.facts

    def elaborate(self, platform):
        m = Module()
        m.submodules.engine = self._engine
        m.d.comb += through(self, self._engine, self._passed)
        return m


@dataclass(frozen=True)
class Control:
    """Ports of a top that belong to its clock domain, and their function.

    Attributes
    ----------
    clock, reset : Port
        The clock acts at its rising edge.
    reset_level : int
        Level of ``reset`` that resets.
    reset_stages : int
        Registers that ``reset`` passes before it acts, always at a clock edge. With none, ``reset`` must be
        synchronous to ``clock``. With two, it may change at any time. After power-up they hold the level that resets,
        so that the registers behind them leave their initial values only when all of them see the clock.
    enable : Port or None
        Clock enable: while it is low, registers hold, unless the reset acts.
    """

    clock: Port
    reset: Port
    reset_level: int
    reset_stages: int
    enable: Port | None = None

    @property
    def ports(self):
        """The ports, in the order of the module."""
        return (self.clock, self.reset, *((self.enable,) if self.enable else ()))


CLOCK = Port("clk", In, 1, "clock, rising edge")
CORE_CONTROL = Control(
    CLOCK, Port("rst_n", In, 1, "reset, active low, at any time for three clock periods; acts at clock edges"),
    reset_level=0, reset_stages=2)
"""Clock and reset of the cores."""

ENABLED_CORE_CONTROL = replace(
    CORE_CONTROL, enable=Port("ce", In, 1, "clock enable: while it is low nothing changes, but for a reset"))
"""Clock, reset and clock enable of the cores that have one."""


@dataclass(frozen=True)
class Constant:
    """A parameter of a Verilog module that has one permitted value, because the module was generated for it.

    Attributes
    ----------
    name : str
        Name in Verilog.
    value, width : int
        The permitted value, which is also the default, as an unsigned integer, and its bits.
    meaning : str
        Meaning and unit.
    """

    name: str
    value: int
    width: int
    meaning: str

    @property
    def digits(self):
        """The value in hexadecimal digits."""
        return f"{self.value:0{-(-self.width // 4)}x}"


class Top(Described):
    """A component as a top-level Verilog module: the only place that adds clock, reset and the clock domain.

    A top adds no level of hierarchy. It is the component's own module, and the component's ports are its ports.

    Parameters
    ----------
    component : wiring.Component
        A component in the clock domain ``sync``: a Wrapper, or another component with the properties ``name``,
        ``title``, ``ports``, ``latency``, ``equations``, ``sections`` and ``facts``.
    control : Control
        Ports of clock and reset.
    constants : tuple of Constant
        Parameters of the Verilog module, for RTL that sets them. A tool that reads another value stops, because the
        module then instantiates one that does not exist.

    Members
    -------
    clk, rst_n : In(1)
        Clock, rising edge; reset, active low. The reset may change at any time, and must be low for three clock
        periods. It acts at the second or third rising edge after it falls, and until the second or third one after
        it rises; without a clock it does nothing. A ``control`` may have other ports.
    All others are the component's.

    Latency: ``latency`` clock cycles, the component's.
    Raises: ValueError if a port of the component has the name of a port of ``control``.
    """

    def __init__(self, component, *, control=CORE_CONTROL, constants=()):
        self._component, self._control, self._constants = component, control, tuple(constants)
        distinct(self.ports, component.name)
        super().__init__({port.name: port.member for port in self.ports})
        # The component's signals are the ports themselves, so nothing has to be connected.
        vars(self).update({name: getattr(component, name) for name in component.signature.members})

    @property
    def component(self):
        """The component of the module."""
        return self._component

    @property
    def control(self):
        """Ports of clock and reset."""
        return self._control

    @property
    def constants(self):
        """Parameters of the Verilog module."""
        return self._constants

    @property
    def ports(self):
        """The ports, in the order of the module."""
        return (*self._control.ports, *self._component.ports)

    @property
    def latency(self):
        """Latency of the component in clock cycles."""
        return self._component.latency

    @property
    def interval(self):
        """Cycles from one update to the next: the component's ``interval``, or without one its latency."""
        return getattr(self._component, "interval", self.latency)

    def elaborate(self, platform):
        control, component = self._control, self._component
        reset = getattr(self, control.reset.name)
        if control.enable:
            component = EnableInserter(getattr(self, control.enable.name))(component)
        fragment = Fragment.get(component, platform)
        # The reset is synchronous: an asynchronous one can change the address of a block RAM just before a clock
        # edge, and thereby destroy its contents (UG473, "Block RAM Attributes"; AR 42571).
        fragment.add_domains(ClockDomain("sync"))
        # Clock and reset come first, before the statements that use them.
        own, fragment.statements = fragment.statements, {}
        fragment.add_statements("comb", ClockSignal().eq(getattr(self, control.clock.name)))
        resets = reset if control.reset_level else ~reset
        for stage in range(control.reset_stages):
            # These registers are neither reset nor enabled.
            sampled = Signal(name=f"reset_{stage}", init=1, reset_less=True, attrs={"ASYNC_REG": "TRUE"})
            fragment.add_statements("sync", sampled.eq(resets))
            resets = sampled
        fragment.add_statements("comb", ResetSignal().eq(resets))
        for domain, statements in own.items():
            fragment.add_statements(domain, statements)
        return fragment
