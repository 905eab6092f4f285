"""The register table of a core, from its own ports."""

import json
import zlib
from itertools import count

import numpy as np
from amaranth.lib.wiring import In
from amaranth.utils import exact_log2

from strapdown.bus import CYCLES_BITS, MAP_VERSION, REGISTER_BITS, Access, Field, Register, RegisterTable, Word
from strapdown.config import Config
from strapdown.kernel.system import System, leaves

from .core import Core

__all__ = ["IDENTITY", "constant_ports", "register_table"]

IDENTITY = b"STRP"
"""First bytes of each table, in ASCII, in the order of their addresses."""

CONTROL, INTERRUPT_FLAGS, INPUTS, OUTPUTS = 0x010, 0x01C, 0x100, 0x400
"""Addresses of CONTROL, of INTERRUPT_FLAGS, of the first input and of the first output."""

INTERRUPTS = {
    "finish": "an update has finished",
    "refused": "an update was refused; outputs and state did not change",
    "overrun": "a start was ignored, because the core was busy, or the streams, if any, were on",
    "bad_access": "an access to an address without a register, or a write to a register that cannot be written",
    "bad_frame": "a piece of a sample was dropped: TLAST was not at the end of a sample, or TID changed inside it",
}
"""Fields of the interrupt registers, lowest bit first, and their meanings."""

STATUS = {
    "accelerometer_missing": "the accelerometer sample had no length, and was not used",
    "magnetometer_missing": "the magnetometer sample had no length, or was not valid, and was not used",
    "tilt_reversed": "the specific force was more than 90 degrees from the attitude's vertical before the update",
    "heading_reversed": "the horizontal field was more than 90 degrees from the attitude's north before the update",
    "starting": "heading and vertical are found; the bias is not learnt in motion",
    "at_rest": "the body was at rest: the bias was learnt from the average of the gyro",
    "magnetometer_rejected": "there was a field, but its weight was zero",
    "range_exceeded": "an axis of gyro or accelerometer at the end of its range, or the tilt recovers from it, or a "
                      "period outside 0 to 0.1 s",
    "bias_clipped": "the gyro's bias was limited to its largest magnitude",
    "magnetometer_stuck": "the field does not turn in the body while the gyro does, and was not used",
    "external_used": "the external acceleration was not zero, and was used",
    "aligning": "the coarse alignment runs",
    "navigating": "position, velocity and attitude are those of the navigator",
    "out_of_range": "an input or a state was outside the range of the equations",
    "refused": "a number was NaN or infinite: outputs and state did not change",
    "ignored": "a start came while an update ran, and was ignored",
    "restarted": "the update began from the reset state, after updates that were refused in a row",
}
"""Meanings of the status bits of the cores; a core of a user's own may have others."""

STREAM_FIELDS = ("stream", "streaming", "bad_frame")
"""Fields that only a table of a core with streams has."""

CYCLES = "cycles of aclk that the last update took"


def register_table(core: Core, config: Config, *, streams: bool = True) -> RegisterTable:
    """The register table of a core of a configuration, with or without streams.

    Inputs that the configuration's field ``inputs`` names are parameters; all others belong to each sample. After a
    reset the inputs that ``config.constant_inputs()`` names have these values. A port of more than 32 bits takes two
    registers, the low half first.

    Raises: ValueError for a core without a status port.
    """
    system = core.system
    if not system.status_port:
        raise ValueError(f"{system.name} has no status port: its refused updates would not be seen on a bus")
    parameters = {port for name in getattr(config, "inputs", ()) for port in _ports_of(system, name)}
    meanings = {port.name: port for port in core.ports}
    number = core.engine.program.format
    resets = {port: number.encode(value) for port, value in constant_ports(system, config).items()}
    addresses = {In: count(INPUTS, REGISTER_BITS // 8), None: count(OUTPUTS, REGISTER_BITS // 8)}

    def words(names, flow, access):
        return tuple(_word(meanings[name], addresses[flow], access, number, resets.get(name)) for name in names)

    samples = [name for name in system.input_ports if name not in parameters]
    return RegisterTable(
        name=f"{system.name}_axi", title=system.title, configuration=config.name,
        common=_common(core, _crc(core, config), streams),
        samples=words(samples, In, Access.WRITE),
        parameters=words([name for name in system.input_ports if name in parameters], In, Access.WRITE),
        outputs=words(system.output_ports, None, Access.READ))


def constant_ports(system: System, config: Config) -> dict[str, float]:
    """Maps each input port to its number, for the inputs that ``config.constant_inputs()`` names."""
    return {port: value for name, values in config.constant_inputs().items() if name in system.inputs
            for port, value in zip(leaves(system.inputs[name]), np.ravel(values).tolist(), strict=True)}


def _word(port, addresses, access, number, value):
    """The word of a port at the next addresses.

    ``number`` is the format of the core's numbers; ``value`` is that after a reset, None for the port's own.
    """
    value = port.init if value is None else value
    format = number.name if port.width == number.width else "bits"
    if port.width <= REGISTER_BITS:
        parts = [("", port.width, port.meaning)]
    else:
        parts = [("_LOW", REGISTER_BITS, f"low half of {port.name}: {port.meaning}"),
                 ("_HIGH", port.width - REGISTER_BITS, f"high half of {port.name}")]
    registers = []
    for index, (suffix, width, meaning) in enumerate(parts):
        reset = value >> index * REGISTER_BITS & (1 << width) - 1
        registers.append(Register(f"{port.name.upper()}{suffix}", next(addresses),
                                  (Field("value", 0, width, access, meaning, reset),), meaning))
    return Word(port.name, port.width, tuple(registers), port.meaning, format)


def _ports_of(system, name):
    """The ports of an input, by its name in the equations."""
    return leaves(system.inputs[name])


def _crc(core, config):
    """CRC-32 of what a driver must know: the configuration, and the ports of its core."""
    ports = [(port.name, port.direction, port.width) for port in core.ports]
    return zlib.crc32(json.dumps([core.system.name, config.values, ports], default=str).encode())


def _common(core, crc, streams):
    """The registers before the first input; those of ``STREAM_FIELDS`` only if there are streams."""
    def fields(*fields):
        return tuple(field for field in fields if streams or field.name not in STREAM_FIELDS)

    def flags(access):
        return fields(*(Field(name, bit, 1, access, meaning) for bit, (name, meaning) in enumerate(INTERRUPTS.items())))

    def whole(address, name, access, meaning, reset=0):
        return Register(name, address, (Field("value", 0, REGISTER_BITS, access, meaning, reset),), meaning)

    engine = core.engine
    several = engine.channels > 1
    channel = exact_log2(engine.channels)
    status = tuple(Field(name, bit, 1, Access.READ, STATUS.get(name, name.replace("_", " ")))
                   for bit, name in enumerate(engine.status_names))
    registers = [
        whole(0x000, "IDENTITY", Access.CONSTANT, f"{IDENTITY.decode()} in ASCII, the first letter in the lowest byte",
              int.from_bytes(IDENTITY, "little")),
        whole(0x004, "VERSION", Access.CONSTANT, "version of this layout, in 16.16 bits", MAP_VERSION),
        whole(0x008, "CONFIGURATION", Access.CONSTANT, "CRC-32 of the configuration and the ports", crc),
        whole(0x00C, "SCRATCH", Access.WRITE, "keeps what was written, for tests of the bus"),
        Register("CONTROL", CONTROL, fields(
            Field("start", 0, 1, Access.PULSE, "starts an update with the inputs of the registers"),
            Field("snapshot", 1, 1, Access.PULSE, "copies the outputs of the last update to the registers"),
            Field("stream", 2, 1, Access.WRITE, "samples come from the stream, and not from start"),
            Field("core_reset", 3, 1, Access.PULSE,
                  "resets the core, with its streams, but not the registers; a start in the same write is an overrun"),
        ), "commands"),
        Register("STATUS", 0x014, fields(
            Field("busy", 0, 1, Access.READ, "an update runs; a start would be ignored"),
            Field("streaming", 1, 1, Access.READ, "a sample has begun to come in, or an answer is not out yet"),
        ), "what the core does now"),
        Register("INTERRUPT_ENABLE", 0x018, flags(Access.WRITE), "which flags raise irq"),
        Register("INTERRUPT_FLAGS", INTERRUPT_FLAGS, flags(Access.CLEAR), "what has happened"),
        whole(0x020, "UPDATES", Access.READ, "updates that have finished since the reset of the core, modulo 2^32"),
        Register("CYCLES", 0x024, (Field("value", 0, CYCLES_BITS, Access.READ, CYCLES),), CYCLES),
        whole(0x028, "SAMPLE_TIME", Access.READ, "cycles of aclk since the reset, modulo 2^32"),
        *([Register("CHANNEL", 0x02C, (
            Field("value", 0, channel, Access.WRITE, "channel of the sample that start takes"),),
            "channel of the sample that start takes")] if several else []),
        whole(0x030, "SNAPSHOT_UPDATE", Access.READ, "number of the update whose outputs stand in the registers"),
        Register("SNAPSHOT_STATUS", 0x034, status, "status of this update"),
        *([Register("SNAPSHOT_CHANNEL", 0x038, (
            Field("value", 0, channel, Access.READ, "channel of this update"),), "channel of this update")]
          if several else []),
    ]
    return tuple(registers)
