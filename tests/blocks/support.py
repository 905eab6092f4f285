"""Blocks as one Verilated module with flat ports, driven by arrays."""

import numpy as np
import pytest
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.export.backend import to_verilog
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel


class Blocks(wiring.Component):
    """Components side by side; ``NAME_member`` is a member of the component called NAME, as a plain value."""

    def __init__(self, **blocks):
        self._blocks, self._inner = blocks, {}
        for name, block in blocks.items():
            for path, member, value in block.signature.flatten(block):
                if not isinstance(value, Const):
                    self._inner["_".join((name, *path))] = member.flow, Value.cast(value)
        super().__init__({port: flow(len(value)) for port, (flow, value) in self._inner.items()})

    def names(self, flow):
        return tuple(port for port, (own, _) in self._inner.items() if own == flow)

    def elaborate(self, platform):
        m = Module()
        for name, block in self._blocks.items():
            m.submodules[name] = block
        for port, (flow, value) in self._inner.items():
            m.d.comb += value.eq(getattr(self, port)) if flow == In else getattr(self, port).eq(value)
        return m


def run_blocks(models, folder, top, **blocks):
    """A function of a block's name and its inputs, arrays with a row for each cycle; it returns the outputs."""
    bench = Blocks(**blocks)
    path = folder / f"{top}.v"
    path.write_text(to_verilog(bench, top), encoding="utf-8")
    try:
        model = VerilatedModel(path, Interface(top, bench.names(In), bench.names(Out), reset="rst", reset_active=1),
                               models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))

    def run(name, **inputs):
        answer = model.stream({f"{name}_{port}": np.asarray(values) for port, values in inputs.items()})
        return {port.removeprefix(f"{name}_"): values.astype(np.int64)
                for port, values in answer.items() if port.startswith(f"{name}_")}

    return run


def payload(first, last, *pixels):
    """The packed payload of a PixelStream."""
    return first | last << 1 | sum(pixel << 2 + 12 * ccd for ccd, pixel in enumerate(pixels))


def stream_of(lines, distances, rng, pause):
    """Inputs for lines of pixels, shape (N, channels, pixels), ``distances`` cycles apart, shape (N, pixels).

    While no pixel is valid, the payload is noise. Returns valid, payload, and the cycle of each line's last pixel.
    """
    channels, pixels = lines.shape[1:]
    valid, packed, ends, begin = [], [], [], 0
    for line, distance in zip(lines, distances, strict=True):
        places = np.cumsum(distance)
        length = places[-1] + 1 + pause
        own = np.zeros(length, dtype=np.int64)
        own[places] = 1
        noise = rng.integers(0, 1 << 2 + 12 * channels, length)
        number = np.arange(pixels)
        noise[places] = payload((number == 0).astype(int), (number == pixels - 1).astype(int), *line.astype(int))
        valid.append(own)
        packed.append(noise)
        ends.append(begin + places[-1])
        begin += length
    return np.concatenate(valid), np.concatenate(packed), np.array(ends)


def edges(values):
    """Cycles in which a signal rises and falls."""
    change = np.diff(np.concatenate(([0], values)))
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)
