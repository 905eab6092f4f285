"""Circuits in Verilator, and a receiver for their serial line that is independent of the transmitter."""

import numpy as np
import pytest

from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import VerilatedModel


def verilated(source, interface, models):
    """A Verilog file in Verilator; skips the test if Verilator is missing."""
    try:
        return VerilatedModel(source, interface, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


def received(line, divisor):
    """Bytes on a line and the cycle of each start bit; asserts the framing and the length of every bit.

    Parameters
    ----------
    line : ndarray of int
        The line in every clock cycle, idle first.
    divisor : int
        Cycles per bit.
    """
    line = np.asarray(line)
    data, starts, cycle = bytearray(), [], 0
    while (low := np.flatnonzero(line[cycle:] == 0)).size:
        start = cycle + int(low[0])
        bits = line[start:start + 10 * divisor].reshape(10, divisor)
        assert (bits == bits[:, :1]).all(), "an edge that is not at a bit's end"
        assert bits[0, 0] == 0
        assert bits[9, 0] == 1, "no stop bit"
        data.append(sum(int(bits[1 + bit, 0]) << bit for bit in range(8)))
        starts.append(start)
        cycle = start + 10 * divisor
    return bytes(data), starts


def crc16(data):
    """CRC-16/CCITT-FALSE by long division, bit by bit: the register's polynomial is x^16 + x^12 + x^5 + 1."""
    register = 0xFFFF
    for byte in data:
        for bit in reversed(range(8)):
            carry = register >> 15 ^ byte >> bit & 1
            register = register << 1 & 0xFFFF ^ (0x1021 if carry else 0)
    return register


def frame(counter, status, numbers, dtype="<f8"):
    """A navigation frame, byte by byte, from the description in docs/link.md."""
    payload = np.asarray(numbers, dtype=dtype).tobytes()
    body = bytes((len(payload), 1, counter & 0xFF, counter >> 8, status)) + payload
    return b"\xeb\x90" + body + crc16(body).to_bytes(2, "big")
