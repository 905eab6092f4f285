"""The kinds of operators that a pool may have. Each kind has a file, and a line here."""

from .adder import *
from .arctangent import *
from .base import *
from .comparator import *
from .converter import *
from .divider import *
from .extremes import *
from .multiplier import *
from .reciprocal_root import *
from .selector import *
from .sine_cosine import *
from .table_arctangent import *
from .table_reciprocal import *
