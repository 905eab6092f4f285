"""From a kernel to a circuit: trace, schedule, microprogram, engine; and the twin beside them.

What the author of a kernel needs stands here: ``System`` and ``Update``, names of ports by ``vector`` and
``matrix``, and ``Pool`` with its operators.
"""

from strapdown.algorithms import Update

from .operators import *
from .pool import *
from .system import *

__all__ = [
    "Adder", "Arctangent", "Comparator", "Divider", "Extremes", "MemoryStyle", "Multiplier", "Operation", "Operator",
    "Pool", "ReciprocalRoot", "Selector", "SineCosine", "System", "Update", "matrix", "vector",
]
