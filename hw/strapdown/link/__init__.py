"""The serial link: UART transmitter, and the frames that it sends."""

from .frame import *
from .sender import *
from .uart import *
