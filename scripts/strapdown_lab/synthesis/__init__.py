"""Resources of a Verilog module: cells of a 7-series part, and clock frequency on an ECP5."""

from .ecp5 import *
from .tools import *
from .xc7 import *
