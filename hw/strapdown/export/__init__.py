"""What leaves the generator: Verilog files and their descriptions."""

from .operators import *
from .verilog import *
