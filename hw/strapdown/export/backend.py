"""From a component to Verilog text."""

from amaranth.back import rtlil

from .build import circuits
from .keywords import KEYWORDS
from .netlist import CircuitError
from .simplify import simplify
from .writer import module_text, plain, unused

__all__ = ["CircuitError", "to_verilog"]


def to_verilog(component, name, *, vectors=(), comments=None):
    """Verilog-2001 text of a component and its submodules, without a header. Equal bytes on every run.

    Parameters
    ----------
    component : amaranth.lib.wiring.Component
    name : str
        Name of the top module.
    vectors : collection of str
        Ports of one bit of the top module that are declared as vectors, ``[0:0]``.
    comments : dict
        Memory that never changes to the comments of its rows, by address.

    Raises: CircuitError if the component has a part without a counterpart in plain Verilog.
    """
    modules = circuits(rtlil.convert(component, name=name, emit_src=False))
    kinds = {module.name: (plain(module.name), _port_names(module)) for module in modules}
    texts = []
    for module in modules:
        simplify(module)
        texts.append(module_text(module, kinds, vectors=vectors if module is modules[0] else (), comments=comments))
    return "\n".join(texts)


def _port_names(module):
    """Plain names of the ports of a module."""
    names: dict[str, str] = {}
    for port in module.ports:
        names[port] = unused(plain(port), KEYWORDS | {*names.values()})
    return names
