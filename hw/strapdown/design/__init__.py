"""Numbers that are found once, before a circuit exists: coefficients of the kernels' polynomials."""

from .quaternion import METHODS, TransitionCoefficients, least_squares, minimax, smallest_order

__all__ = ["METHODS", "TransitionCoefficients", "least_squares", "minimax", "smallest_order"]
