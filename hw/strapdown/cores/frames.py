"""The ports of a module that sends frames, and what its header and its JSON file tell about them."""

from amaranth.lib.wiring import Out

from strapdown.kernel.description import Port, Section
from strapdown.link import LAYOUT

__all__ = ["LINK_PORTS", "frame_facts", "frame_sections"]

LINK_PORTS = (Port("uart_tx", Out, 1, "serial line, 8N1, high while idle", init=1),
              Port("out_link_busy", Out, 1, "high while a frame is sent"),
              Port("out_link_overrun", Out, 1, "the last update was not sent, because a frame was being sent"))
"""Ports of the serial line and of its state."""


def frame_sections(kind, sender, begin):
    """Sections on layout, payload and timing of frames.

    Parameters
    ----------
    kind : FrameType
    sender : FrameSender
    begin : str
        Sentences on the instant at which a frame begins.
    """
    timing = f"{begin} It has {sender.size} bytes and takes {sender.interval} cycles, {sender.divisor} per bit."
    return (Section("FRAME", rows=tuple((field.name, field.size or "length", field.meaning) for field in LAYOUT)),
            Section("PAYLOAD", rows=tuple((quantity.name, quantity.unit, quantity.meaning)
                                          for quantity in kind.quantities)),
            Section("TIMING", paragraphs=(timing,)))


def frame_facts(kind, sender):
    """The frame, and the time that it takes, as JSON values."""
    return {"frame": [{"name": field.name, "bytes": field.size, "meaning": field.meaning} for field in LAYOUT],
            "payload": [vars(quantity) for quantity in kind.quantities],
            "frame_bytes": sender.size, "frame_cycles": sender.interval, "bit_cycles": sender.divisor}
