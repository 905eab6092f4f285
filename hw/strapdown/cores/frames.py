"""What the header and the JSON file of a module tell about the frames that it sends."""

from strapdown.kernel.description import Section
from strapdown.link import LAYOUT

__all__ = ["frame_facts", "frame_sections"]


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
