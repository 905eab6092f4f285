"""The product guide of a core: a page in Markdown, from the core itself, its register table and measured figures."""

import inspect
import json
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import version
from itertools import groupby
from typing import Any

from strapdown.config import Config
from strapdown.cores import Top, Wrapper, control_of
from strapdown.kernel.program import UpdateProgram
from strapdown.kernel.system import leaves
from strapdown.markdown import markdown_table

from .page import register_tables

__all__ = ["guide_text", "handshake_wave"]

LIMITS = {
    "INS_top": (
        "The accelerometer stands for the vertical: a long acceleration tilts the estimate towards the specific force.",
        "The magnetometer corrects all three axes: a disturbed field also disturbs pitch and roll.",
        "The error vector vanishes not only at the true attitude: the filter can stay upside down, or at a wrong pitch "
        "with the heading reversed. The bits `tilt_reversed` and `heading_reversed` of the status show it.",
        "The gains hold for the sample rate of the configuration."),
    "INS_flight": (
        "The true heading needs an undisturbed field at some time; without a magnetometer the heading is relative.",
        "A rate beyond the range of the gyro is lost; the status says so."),
    "QUAT_direct": (
        "There is no correction by other sensors: the error of the gyro is integrated.",
        "The polynomials are designed for rates up to rate_max_deg_s; above, their error grows quickly."),
    "SINS_top": (
        "The free vertical channel is unstable: use a configuration with damping for flights of more than minutes.",
        "The coarse alignment needs a vehicle at rest."),
}
"""What a user of a module must know."""

COMMON_LIMITS = ("NaN and infinity at an input refuse the update; the status says so.",)


def handshake_wave(bus: Top) -> str:
    """The start, the inputs, the finish and the outputs of an update of the core as WaveJSON, for WaveDrom."""
    engine = bus.component.engine
    system, several = engine.system, engine.channels > 1
    lanes: list[dict[str, Any]] = [
        {"name": "clk", "wave": "p....|...."}, {"name": system.start, "wave": "010..|...."},
        {"name": "inputs", "wave": "x=x..|....", "data": ["sample"]},
        {"name": system.finish, "wave": "0....|10.." if several else "1.0..|1..."},
        {"name": "outputs", "wave": "=....|=...", "data": ["previous update", "this update"]},
        {"name": system.status_port, "wave": "=....|=...", "data": ["previous update", "this update"]},
        {"node": "..a...b"}]
    rows = ",\n  ".join(map(json.dumps, lanes))
    return (f'{{"signal": [\n  {rows}],\n "config": {{"hscale": 2}}, "edge": ["a<->b {engine.latency} cycles"]}}')


def guide_text(config: Config, bus: Top, *, picture: str, wave: str | None = None,
               figures: Mapping[str, Any] | None = None, accuracy: Sequence[Sequence[Any]] = ()) -> str:
    """The product guide of the main module of a configuration.

    Parameters
    ----------
    config : Config
    bus : Top
        Its main module behind AXI, from ``axi_core``.
    picture : str
        Path of the block diagram, as seen from the page.
    wave : str or None
        Path of the timing diagram; None: the page has the text for WaveDrom.
    figures : dict or None
        Measured resources: the row of the configuration in docs/report/cores.json. None: not measured.
    accuracy : sequence of rows
        Quantity, largest and RMS difference from float64, as text. Empty: not measured.
    """
    engine, table = bus.component.engine, bus.component.table
    core = Top(Wrapper(engine), control=control_of(config))
    name, system = engine.name, engine.system
    drawn = f"![One update]({wave})" if wave else f"```wavedrom\n{handshake_wave(bus)}\n```"
    parts = [
        f"# `{name}` in the configuration `{config.name}`",
        f"{_sentence(system.title)} {_sentence(config.description)}",
        f"This page is generated. It describes the core itself and `{table.name}`, the core behind AXI4-Lite"
        f"{' and AXI4-Stream' * bus.component.streams}.",
        "## What it computes", "\n".join(_equations(engine)),
        "## Configuration", _configuration(config),
        "## Block diagram", f"![Blocks of {table.name}]({picture})",
        "## Ports of the core", _ports(core),
        "## Ports of the core behind AXI", _ports(bus),
        "## Registers", register_tables(table, 3).strip(),
        *(("## Streams", _streams(table)) if bus.component.streams else ()),
        "## Timing", f"{_timing(engine)}\n\n{drawn}",
        "## Latency and rate", _rate(config, bus.component),
        "## Number format and accuracy", _accuracy(engine.program.format, accuracy),
        "## Resources and clock frequency", _resources(figures),
        "## Errors", _errors(engine, table),
        "## Limits", "\n".join(f"- {limit}" for limit in (*LIMITS.get(name.partition("_x")[0], ()), *COMMON_LIMITS)),
        "## Changes", f"Version {version('strapdown')}. CHANGELOG.md of the project lists the changes.",
    ]
    return "\n\n".join(parts) + "\n"


def _configuration(config):
    """A table of all fields, with their meanings where they have one."""
    fields = type(config).model_fields
    return markdown_table(["field", "value", "meaning"], [
        [f"`{name}`", ", ".join(map(str, leaves(value))) if isinstance(value, tuple) else value,
         (fields[name].description if name in fields else None) or "–"]
        for name, value in config.values.items() if name not in ("name", "description")])


def _sentence(text):
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _equations(engine):
    """A line for each kernel: its name and the first sentence of its docstring."""
    for kernel in engine.equations:
        while isinstance(kernel, partial):
            kernel = kernel.func
        text = (inspect.getdoc(kernel) or "").partition("\n\n")[0]
        yield f"- `{kernel.__name__}`: {' '.join(text.split()).replace('``', '`')}"


def _ports(top):
    """A table of ports; neighbours of one kind and meaning share a row."""
    same = groupby(top.ports, lambda port: (port.direction, port.width, port.meaning))
    return markdown_table(["port", "direction", "bits:", "meaning"], [
        [", ".join(f"`{port.name}`" for port in group), direction, width, meaning]
        for (direction, width, meaning), group in same])


def _streams(table):
    samples = ", ".join(f"`{register.name}`" for word in table.samples for register in word.registers)
    answers = ", ".join(f"`{register.name}`" for word in table.outputs for register in word.registers)
    return (f"A sample is {table.sample_words} words of 32 bits: {samples}.\n\n"
            f"An answer is {table.answer_words} words of 32 bits: {answers}, and the status.")


def _timing(engine):
    system = engine.system
    ready = "ready" if engine.channels > 1 else "idle"
    return (f"`{system.start}` is sampled at the rising edge of the clock while the core is {ready}, together with all "
            f"inputs. `{system.finish}` rises {engine.latency} cycles later, in every update, with the outputs.")


def _rate(config, core):
    program = core.program
    rows = [["cycles from start to finish", core.latency],
            ["cycles from one start to the next", core.interval],
            ["words of the microprogram", program.length],
            ["operations of an update", sum(program.schedule.graph.count().values())],
            ["updates per second that the configuration is made for", f"{config.sample_rate_hz:g}"]]
    if isinstance(program, UpdateProgram):
        rows.insert(2, ["words of the operand memory", program.used])
    return markdown_table(["figure", "value:"], rows)


def _accuracy(fmt, accuracy):
    text = (f"All data ports have the format {fmt.name}. Every operation rounds to nearest even; subnormal numbers are "
            f"{'kept' if fmt.gradual else 'flushed to zero'}. The circuit equals its software twin in every bit.")
    if not accuracy:
        return f"{text} The guides in the documents of the project have measured differences from float64."
    return f"{text} The twin against the same equations in float64:\n\n" + markdown_table(
        ["quantity", "largest difference:", "RMS:"], accuracy)


def _resources(figures):
    if figures is None:
        return "The guides in the documents of the project have measured figures."
    xc7, ecp5 = figures["xc7"], figures.get("ecp5")
    rows = [["LUT, 7 series, Yosys", f"{xc7['lut']:,}"], ["flip-flops, 7 series", f"{xc7['ff']:,}"],
            ["DSP48E1", xc7["dsp"]], ["block RAM of 36 kbit", f"{xc7['bram']:g}"]]
    if ecp5:
        rows.append(["clock frequency on an ECP5 of the slowest grade, routed", f"{ecp5['fmax_mhz']:.1f} MHz"])
    return markdown_table(["figure of the core without AXI", "value:"], rows)


def _errors(engine, table):
    bits = [[field.low, f"`{field.name}`", field.meaning] for field in table["SNAPSHOT_STATUS"].fields]
    return f"Bits of `{engine.system.status_port}`:\n\n" + markdown_table(["bit:", "name", "meaning"], bits)
