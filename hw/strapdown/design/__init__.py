"""Coefficients of the kernels' polynomials, computed before generation."""

from .polynomial import arctangent_coefficients, sine_coefficients
from .quaternion import METHODS, TransitionCoefficients, least_squares, minimax, smallest_order

__all__ = ["METHODS", "TransitionCoefficients", "arctangent_coefficients", "least_squares", "minimax",
           "sine_coefficients", "smallest_order"]
