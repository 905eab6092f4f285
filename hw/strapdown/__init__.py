"""Navigation cores for FPGAs, written once in Python."""

from importlib.metadata import version

__all__ = ["__version__"]

__version__ = version("strapdown")
