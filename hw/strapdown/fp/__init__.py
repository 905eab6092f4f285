"""Floating-point operators: unpack, compute, round, pack. Imports nothing of the package above it."""

from .add import *
from .format import *
