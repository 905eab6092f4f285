"""The stream of pixels that capture, buffer and spot finder share."""

from typing import Any

from amaranth.lib import data, stream

__all__ = ["PIXEL_WIDTH", "PixelStream"]

PIXEL_WIDTH = 12
"""Bits of a pixel."""


def PixelStream(channels: int) -> stream.Signature:
    """The signature of a stream of pixels: the same pixel of ``channels`` line sensors, light positive.

    ``first`` and ``last`` mark the first and the last pixel of a line. A consumer takes a pixel in every cycle.
    """
    layout: Any = data.StructLayout({"first": 1, "last": 1, "pixel": data.ArrayLayout(PIXEL_WIDTH, channels)})
    return stream.Signature(layout, always_ready=True)
