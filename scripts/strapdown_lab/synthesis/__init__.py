"""Resources of a Verilog module in several FPGA families, and its clock frequency on those with a free router."""

from .ecp5 import *
from .families import *
from .openxc7 import *
from .tools import *
from .xc7 import *
