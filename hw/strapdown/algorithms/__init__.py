"""Navigation equations, each written once as a plain function.

A kernel takes a numeric namespace ``xp`` first: ``xp.sqrt``, ``xp.atan2``, ``xp.select`` and
``xp.maximum`` beside Python's ``+ - * /``, ``<`` and unary minus. The namespace decides what
the equation means: float64 arrays (the truth), the bit-exact twin of the circuit, or a trace
from which the circuit is made. Nothing here imports anything but its own vector helpers.
"""
