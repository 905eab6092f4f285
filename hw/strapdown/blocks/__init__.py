"""Integer streaming blocks for line sensors: timing, capture, buffer, spot finder, thresholds, exposure."""

from .adc import *
from .buffer import *
from .exposure import *
from .pixels import *
from .sensors import *
from .spot import *
from .thresholds import *
from .timing import *
