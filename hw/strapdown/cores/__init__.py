"""Filters with their configurations, and the modules with their published ports."""

from .attitude import *
from .axi import *
from .catalogue import *
from .core import *
from .flight import *
from .link import *
from .optical import *
from .optical_update import *
from .port_names import *
from .quaternion import *
from .registers import *
from .sins import *
from .top import *
