"""Angles: CORDIC operators, from shifts, additions and a small table, and an arctangent from tables of parabolas."""

from .atan2 import *
from .fixed_atan2 import *
from .sincos import *
from .table_atan2 import *
