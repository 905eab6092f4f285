"""A core behind a bus as a package for design tools: registers, descriptions, scripts, bench, driver."""

from .package import *
