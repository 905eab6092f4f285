"""Descriptions of a component: ports with their meaning, and the sections of a file's header."""

from dataclasses import dataclass
from typing import Any

from amaranth.lib.wiring import Flow, In, Out

from strapdown.component import Described

__all__ = ["Port", "Section", "program_facts", "program_sections", "SystemComponent", "status_port",
           "status_ports"]


@dataclass(frozen=True)
class Port:
    """A port of a component.

    Attributes
    ----------
    name : str
        Name of the member, and of the port in Verilog.
    flow : In or Out
        Direction.
    width : int
        Bits.
    meaning : str
        Meaning, unit and frame, for headers and documents.
    init : int
        Value of an output after a reset.
    vector : bool
        Whether Verilog declares a port of one bit as a vector, ``[0:0]``.
    """

    name: str
    flow: Flow
    width: int
    meaning: str
    init: int = 0
    vector: bool = False

    @property
    def member(self):
        """The port as a member of a signature."""
        return self.flow(self.width, init=self.init)

    @property
    def direction(self):
        """Direction as Verilog calls it: input or output."""
        return "input" if self.flow is In else "output"


@dataclass(frozen=True)
class Section:
    """A section of the header of a Verilog file.

    Attributes
    ----------
    title : str
    paragraphs : tuple of str
        Text; the header breaks its lines.
    rows : tuple of tuple
        Cells of a table.
    program : object or None
        A microprogram to list.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    rows: tuple[tuple[Any, ...], ...] = ()
    program: Any = None


class SystemComponent(Described):
    """Base of the engines: a component whose equations and interface are those of a System."""

    _system: Any

    @property
    def system(self):
        """Equations and interface."""
        return self._system

    @property
    def name(self):
        """Name of the Verilog module."""
        return self._system.name

    @property
    def title(self):
        """The function of the module in one line."""
        return self._system.title

    @property
    def equations(self):
        """The functions whose docstrings, or else whose source, explain the equations; never empty."""
        return self._system.kernels or (self._system.equations,)


def status_ports(system, names):
    """The status port of a system with the bits ``names``, lowest first, as a tuple of Port; empty without one."""
    return (status_port(system.status_port, names),) if system.status_port else ()


def status_port(name, names, flow=Out):
    """A port of the status bits ``names``, lowest first."""
    bits = ", ".join(f"{bit} {name.replace('_', ' ')}" for bit, name in enumerate(names))
    return Port(name, flow, len(names), f"status bits: {bits}")


def program_sections(program):
    """Sections on the operators and the words of a microprogram."""
    return (Section("OPERATORS", rows=tuple(
                (unit.name, f"latency {unit.latency}, interval {unit.interval}", ", ".join(unit.operations))
                for unit in program.units)),
            Section("MICROPROGRAM", program=program))


def program_facts(program, status_names):
    """Figures of a microprogram, and the names of the status bits, as JSON values."""
    return {"status_bits": list(status_names), "operations": program.schedule.graph.count(),
            "microprogram": {"words": program.length, "width": program.layout.size}}
