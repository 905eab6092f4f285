"""What leaves the generator: Verilog files and their descriptions."""

from .link import *
from .operators import *
from .verilog import *
