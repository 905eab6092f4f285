"""Buses around a core: the register table, and the blocks of AXI4-Lite and AXI4-Stream.

Of the package it imports only ``component``. The core in its bus, and the table that follows from its ports, are in
``strapdown.cores``.
"""

from .buffers import *
from .registers import *
from .slave import *
from .starts import *
from .streams import *
