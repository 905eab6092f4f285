"""From a kernel to a circuit: trace, schedule, microprogram, engine; and the software twin.

This module exports the names that the author of a kernel needs: ``System`` and ``Update``, ``vector`` and
``matrix`` for names of ports, and ``Pool`` with its operators.
"""

from strapdown.algorithms import Update

from .operators import *
from .pool import *
from .system import *

__all__ = [
    "Adder", "Arctangent", "Comparator", "Converter", "Divider", "Extremes", "MemoryStyle", "Multiplier", "Operation",
    "Operator", "Pool", "ReciprocalRoot", "Selector", "SineCosine", "System", "TableArctangent", "TableReciprocal",
    "Update", "matrix", "vector",
]
