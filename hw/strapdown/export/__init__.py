"""What leaves the generator: Verilog files and their descriptions."""

from .verilog import *
