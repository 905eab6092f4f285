"""The Verilog tops with their published ports."""

from .attitude import *
from .core import *
