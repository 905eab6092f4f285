"""Numbers that are computed before generation: the coefficients of the kernels' polynomials."""

from .polynomial import arctangent_coefficients, sine_coefficients
from .quaternion import METHODS, TransitionCoefficients, least_squares, minimax, smallest_order

__all__ = ["METHODS", "TransitionCoefficients", "arctangent_coefficients", "least_squares", "minimax",
           "sine_coefficients", "smallest_order"]
