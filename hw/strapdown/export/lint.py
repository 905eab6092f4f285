"""Lint rules of Verilator that a generated file breaks on purpose, as a configuration file beside the Verilog."""

from textwrap import wrap

__all__ = ["WAIVED", "waivers"]

WAIVED = {
    "CASEINCOMPLETE": "Signals of a combinational block get a value before the case; a case names only the codes that "
                      "change it.",
    "DECLFILENAME": "The file holds the module and all modules below it, so that one file is enough.",
    "INITIALDLY": "In a simulation, an event in the initial time step runs the combinational blocks whose inputs never "
                  "change.",
    "PROCASSINIT": "Registers have an initial value as well as a reset, because a core also works without a reset.",
    "UNUSEDSIGNAL": "Some bits of a sum, a product or a word are dropped, and not every operator uses all of the ports "
                    "that operators have.",
}
"""Maps each rule to the reason why the generated files break it."""


def waivers(name):
    """Text of ``NAME.vlt``, for ``verilator --lint-only -Wall NAME.vlt NAME.v``."""
    # Verilator takes a comment that begins with its own name for a directive.
    lines = [f"// Lint rules that do not apply to {name}.v: verilator --lint-only -Wall {name}.vlt {name}.v",
             "`verilator_config"]
    for rule, reason in WAIVED.items():
        lines += ["", *(f"// {line}" for line in wrap(reason, 100)), f'lint_off -rule {rule} -file "*{name}.v"']
    return "\n".join(lines) + "\n"
