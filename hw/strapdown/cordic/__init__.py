"""Iterative operators on floating-point numbers, made of shifts, additions and a small table."""

from .atan2 import *
