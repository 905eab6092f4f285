"""The handshake of a core, driven like a user's RTL."""

import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

__all__ = ["RESET_CYCLES", "CoreDriver"]

PERIOD_NS = 10

RESET_CYCLES = 3
"""Cycles that the reset is low, and that starts are ignored after it."""


class CoreDriver:
    """Drives the ports of a core; numbers are floats of its format.

    Inputs change at the falling edge of the clock and are taken at the rising one; outputs are
    sampled just before the falling edge.
    """

    def __init__(self, dut, core):
        self._dut = dut
        self._running = False
        self._format = core.engine.program.format
        self.core = core
        self.system = core.system
        self.start = getattr(dut, core.system.start)
        self.finish = getattr(dut, core.system.finish)

    async def reset(self):
        """Start the clock if necessary, reset, leave all inputs idle and the core ready for a start."""
        if not self._running:
            Clock(self._dut.clk, PERIOD_NS, unit="ns").start()
            self._running = True
        self.start.value = 0
        self.drive(dict.fromkeys(self.system.input_ports, 0.0))
        await FallingEdge(self._dut.clk)
        await self.assert_reset()
        await self.cycles(RESET_CYCLES)

    async def assert_reset(self, cycles=RESET_CYCLES):
        """Pull the reset low between two clock edges, and release it ``cycles`` cycles later."""
        await Timer(PERIOD_NS / 5, unit="ns")
        self._dut.rst_n.value = 0
        await self.cycles(cycles)
        await Timer(PERIOD_NS / 5, unit="ns")
        self._dut.rst_n.value = 1

    async def cycles(self, count):
        """Wait for ``count`` clock cycles."""
        for _ in range(count):
            await FallingEdge(self._dut.clk)

    def drive(self, inputs):
        """Put numbers on input ports."""
        for port, value in inputs.items():
            getattr(self._dut, port).value = int(self.system.input_bits(port, self._format, value))

    def bits(self):
        """Encodings at the output ports, as a dict of ints."""
        return {port: int(getattr(self._dut, port).value) for port in self.system.output_ports}

    def reset_bits(self):
        """Encodings at the output ports after a reset, as a dict of ints."""
        return {port: self._format.encode(value) for port, value in self.core.engine.reset_outputs.items()}

    def outputs(self):
        """Numbers at the output ports, as a dict of floats."""
        return {port: float(self._format.from_bits(bits)) for port, bits in self.bits().items()}

    def vectors(self):
        """Numbers at the output ports as arrays, by the kernel's names."""
        return self.system.read(self.outputs())

    def status(self):
        """Names of the status bits that are set; empty for a core without."""
        if not self.system.status_port:
            return set()
        value = int(getattr(self._dut, self.system.status_port).value)
        return {name for bit, name in enumerate(self.core.engine.status_names) if value >> bit & 1}

    async def begin(self, inputs):
        """Raise the start for one rising edge, then set all inputs to noise. Returns after that cycle."""
        self.drive(inputs)
        self.start.value = 1
        await RisingEdge(self._dut.clk)
        await FallingEdge(self._dut.clk)
        self.start.value = 0
        self.drive(dict.fromkeys(self.system.input_ports, np.nan))

    async def update(self, inputs):
        """One update; returns the number of cycles from the edge that took it to the finish."""
        await self.begin(inputs)
        for cycle in range(2 * self.core.latency):
            if self.finish.value:
                return cycle
            await FallingEdge(self._dut.clk)
        raise AssertionError(f"no {self.system.finish} within {2 * self.core.latency} cycles")
