"""Parameters of a Verilog module that have one permitted value: declarations, and a check that stops every tool."""

import re

__all__ = ["with_constants"]


def with_constants(text, module, constants):
    """Verilog text whose module ``module`` has the parameters ``constants``.

    An instance that sets a parameter to another value instantiates a module that does not exist; the name of
    that module says what is wrong.

    Parameters
    ----------
    text : str
        Modules in plain Verilog; ``module`` has no parameters.
    module : str
    constants : tuple of Constant
        Empty: the text does not change.
    """
    if not constants:
        return text
    lines = ["", "  // Parameters. The microprogram contains their values, so each has one permitted value. At another",
             "  // value every tool stops, because the module named here does not exist. Then generate this one again."]
    for constant in constants:
        value = f"{constant.width}'h{constant.digits}"
        lines += [f"  parameter {constant.name} = {value};", "  generate",
                  f"    if ({constant.name} != {value}) begin : {constant.name}_differs",
                  f"      {module}_was_generated_for_{constant.name}_{constant.digits} generate_it_again ();",
                  "    end", "  endgenerate"]
    return re.sub(rf"^module {module} ?\([^;]*\);\n", lambda head: head[0] + "\n".join(lines) + "\n\n", text, count=1,
                  flags=re.MULTILINE)
