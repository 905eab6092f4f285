"""Output of the generator: Verilog files and their descriptions."""

from .verilog import *
