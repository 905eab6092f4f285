"""Floating-point operators: unpack, compute, round, pack. Imports nothing from other packages of the generator."""

from .add import *
from .compare import *
from .convert import *
from .divide_square_root import *
from .format import *
from .min_max import *
from .multiply import *
from .reciprocal_square_root import *
from .resize import *
from .rounding import *
from .select import *
from .sum_of_products import *
from .table_reciprocal import *
