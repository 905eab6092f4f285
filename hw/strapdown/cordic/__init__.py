"""CORDIC operators: angles from shifts, additions and a small table, iterative or pipelined."""

from .atan2 import *
from .fixed_atan2 import *
from .sincos import *
