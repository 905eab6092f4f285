"""Packages that extras of the project install."""

__all__ = ["MissingExtraError"]


class MissingExtraError(ImportError):
    """A package of an extra is not installed. The message is one line with the command that installs it."""
