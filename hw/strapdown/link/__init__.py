"""The serial link: UART transmitter, the frames that it sends, and their decoder."""

from .decoder import *
from .frame import *
from .sender import *
from .uart import *
