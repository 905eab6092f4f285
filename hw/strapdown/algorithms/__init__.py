"""Navigation equations, each written once as a plain function.

The first argument of a kernel is a numeric namespace ``xp``. It offers ``xp.select``, and operations such as
``xp.sqrt``, ``xp.atan2`` and ``xp.maximum``, in addition to Python's ``+ - * /``, ``<``, ``>`` and unary minus.
The namespace gives the equation its meaning: float64 arrays (the truth), the bit-exact twin of the circuit,
or a trace from which the circuit is made. Kernels import only each other and the vector helpers.
"""

from .attitude import Update

__all__ = ["Update"]
