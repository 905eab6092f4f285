"""The layout of a frame on the serial line: one description for circuit, decoder and documents."""

import binascii
from dataclasses import dataclass

__all__ = ["FRAME_TYPES", "LAYOUT", "MAX_PAYLOAD", "NAVIGATION", "OPTICAL_ATTITUDE", "SYNC", "Field", "FrameType",
           "Quantity", "crc", "frame_size", "place"]


@dataclass(frozen=True)
class Field:
    """A field of a frame.

    Attributes
    ----------
    name : str
    size : int or None
        Number of bytes; None means the value of the field ``length``. All fields but ``sync`` and ``crc`` are sent
        with the least significant byte first.
    meaning : str
        Text for documents.
    """

    name: str
    size: int | None
    meaning: str


@dataclass(frozen=True)
class Quantity:
    """A number of a payload: its ``name``, as in the port ``out_name``, its ``unit`` and its ``meaning``."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class FrameType:
    """A type of frame: the ``number`` in the field ``type``, and the quantities, all in one floating-point format."""

    number: int
    meaning: str
    quantities: tuple[Quantity, ...]

    @property
    def payload_sizes(self):
        """Maps the bytes of a payload to the bytes per number, for binary32 and binary64."""
        return {len(self.quantities) * size: size for size in (4, 8)}


SYNC = bytes((0xEB, 0x90))
MAX_PAYLOAD = 255

LAYOUT = (
    Field("sync", len(SYNC), "EB 90, in this order"),
    Field("length", 1, "bytes of the payload"),
    Field("type", 1, "kind of payload"),
    Field("counter", 2, "number of the update since reset, modulo 65,536; the first is 0"),
    Field("status", 1, "status bits of the core"),
    Field("payload", None, "IEEE 754 numbers, binary64 or binary32, depending on the length"),
    Field("crc", 2, "CRC-16/CCITT-FALSE of all bytes between sync and crc, high byte first"),
)
"""The fields in the order on the line."""

NAVIGATION = FrameType(1, "position, velocity and attitude", (
    Quantity("latitude", "deg", "latitude, north positive"),
    Quantity("longitude", "deg", "longitude, east positive"),
    Quantity("height", "m", "height above the ellipsoid"),
    Quantity("veast", "m/s", "velocity east"),
    Quantity("vnorth", "m/s", "velocity north"),
    Quantity("vup", "m/s", "velocity up"),
    Quantity("pitch", "deg", "pitch, nose up"),
    Quantity("roll", "deg", "roll, right side down"),
    Quantity("heading", "deg", "true heading, clockwise from north, [0, 360)"),
))

OPTICAL_ATTITUDE = FrameType(2, "attitude and spots of the optical sensor", (
    Quantity("pitch", "deg", "pitch, nose up"),
    Quantity("roll", "deg", "roll, right side down"),
    Quantity("pitch_measured", "deg", "measured pitch, of the body against the rotor axis"),
    Quantity("roll_measured", "deg", "measured roll, of the body against the rotor axis"),
    Quantity("roll_px", "px", "spot on the roll CCD, from its first pixel"),
    Quantity("pitch_px", "px", "spot on the pitch CCD, from its first pixel"),
    Quantity("roll_peak", "counts", "peak on the roll CCD, above black"),
    Quantity("pitch_peak", "counts", "peak on the pitch CCD, above black"),
    Quantity("exposure_r", "us", "exposure of the roll CCD, of this line"),
))

FRAME_TYPES = {kind.number: kind for kind in (NAVIGATION, OPTICAL_ATTITUDE)}
"""All types of frame, by number."""


def frame_size(payload_size):
    """Bytes of a frame whose payload has ``payload_size`` bytes."""
    return sum(payload_size if field.size is None else field.size for field in LAYOUT)


def place(name, payload_size=0):
    """The bytes of a field in a frame, as a slice. The fields before the payload do not depend on its size."""
    start = 0
    for field in LAYOUT:
        stop = start + (payload_size if field.size is None else field.size)
        if field.name == name:
            return slice(start, stop)
        start = stop
    raise KeyError(name)


def crc(data):
    """CRC-16/CCITT-FALSE (polynomial 0x1021, initial value 0xFFFF, not reflected) of bytes, as an integer."""
    return binascii.crc_hqx(data, 0xFFFF)
