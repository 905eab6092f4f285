"""What the instrument refuses."""

__all__ = ["InstrumentError"]


class InstrumentError(Exception):
    """An error of the user: one line."""
