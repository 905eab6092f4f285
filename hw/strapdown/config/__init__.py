"""Configurations: frozen, validated sets of parameters, the named ones among them."""

from .attitude import *
from .base import *
from .flight import *
from .quaternion import *
from .sins import *
from .stream import *

CONFIGS = {config.name: config for config in (
    THESIS, THESIS_COMPACT, THESIS_FAST, THESIS_X8, MAHONY, FLIGHT, FLIGHT_6AXIS, QUATERNION_J2, QUATERNION_J3,
    SINS, SINS_DAMPED)}
"""All named configurations, by name."""
