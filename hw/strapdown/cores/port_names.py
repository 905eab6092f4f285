"""Names of ports: those of the text of the 2015 thesis, which the cores have, and those of its RTL, which differ."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from strapdown.config import Config, TunableConfig
from strapdown.kernel.system import System, leaves, matrix

from .attitude import ATTITUDE_CORES
from .top import Constant, Control

__all__ = ["PORT_NAMES", "PortNames", "TEXT_PORTS", "THESIS_RTL_PORTS"]


ELEMENTS = leaves(matrix("{}"))
"""Row and column of the elements of a matrix."""


@dataclass(frozen=True, eq=False)
class PortNames:
    """Names that replace those of a system and of its control, for RTL that instantiates the modules under them.

    Attributes
    ----------
    name : str
        Name on a command line.
    modules : tuple of str or None
        The modules that exist there; None: all modules keep their names.
    reset : str
        Port of the reset; empty: its own name.
    status : bool
        Whether the port of the status exists there.
    renamed : dict
        Maps each module to a dict from its ports to their new names; ports and modules that are omitted keep theirs.
    constants : dict
        Maps each module to its parameters. Each parameter has a meaning and a function from a configuration to its
        value.
    """

    name: str
    modules: tuple[str, ...] | None = None
    reset: str = ""
    status: bool = True
    renamed: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    constants: Mapping[str, Mapping[str, tuple[str, Callable]]] = field(default_factory=dict)

    def check(self, module: str, config: Config) -> None:
        """Raises: ValueError for a module that does not exist there, or with ports that do not exist there."""
        if self.modules is None:
            return
        if module not in self.modules:
            raise ValueError(f"the ports {self.name} exist for {', '.join(self.modules)}, not for {module}")
        if config.clock_enable:
            raise ValueError(f"the ports {self.name} have no clock enable: leave clock_enable at False")
        if isinstance(config, TunableConfig) and config.inputs:
            raise ValueError(f"the ports {self.name} have no parameters: leave inputs empty")

    def system(self, system: System) -> System:
        """A system with these names."""
        return system.renamed(self.renamed.get(system.name, {}))

    def control(self, control: Control) -> Control:
        """A control with these names."""
        return replace(control, reset=replace(control.reset, name=self.reset)) if self.reset else control

    def hidden(self, system: System) -> tuple[str, ...]:
        """Ports of the engine that do not exist there."""
        return (system.status_port,) if system.status_port and not self.status else ()

    def parameters(self, module: str, config: Config) -> tuple[Constant, ...]:
        """The parameters of a module, as constants in the format of the configuration."""
        return tuple(Constant(name, config.pool.format.encode(value(config)), config.pool.format.width, meaning)
                     for name, (meaning, value) in self.constants.get(module, {}).items())


TEXT_PORTS = PortNames("text")
"""The names that the cores have: those in the text of the 2015 thesis, and those of additional ports."""

THESIS_RTL_PORTS = PortNames(
    "thesis-rtl", modules=tuple(ATTITUDE_CORES), reset="rst", status=False,
    renamed={
        "INS_top": {f"out_c{element}": f"c_c{element}" for element in ELEMENTS},
        "INS_atan": {"in_atan_en": "en", "in_a": "a", "in_b": "b", "out_result": "result",
                     "out_atan_finish": "atan_finish"}},
    constants={
        "INS_gyro": {"Kp": ("proportional gain: the field kp", lambda config: config.kp),
                     "Ki": ("integral gain times sample period: the fields ki and sample_rate_hz",
                            lambda config: config.ki * config.period_s)},
        "INS_quat": {"PERIOD": ("sample period, s: the field sample_rate_hz", lambda config: config.period_s),
                     "HPERIOD": ("half the sample period, s", lambda config: config.period_s / 2)}})
"""The names in the RTL that was published with the 2015 thesis."""

PORT_NAMES = {names.name: names for names in (TEXT_PORTS, THESIS_RTL_PORTS)}
"""All port names, by name."""
