"""Output of the generator: Verilog files and their descriptions."""

from .backend import *
from .verilog import *
