"""Angles from shifts, additions and a small table: iterative on floating-point numbers, unrolled on fixed point."""

from .atan2 import *
from .fixed_atan2 import *
from .sincos import *
