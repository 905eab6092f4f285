"""The block diagram of a core behind AXI, as SVG."""

from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from strapdown.bus import RegisterTable
from strapdown.cores import Core

__all__ = ["block_diagram"]

BUS, CORE, UNIT = "#dbe7f5", "#f4f4f4", "#e3f1dc"
"""Colours of blocks of the bus, of the core and of its operators."""


def block_diagram(core: Core, table: RegisterTable, path: Path) -> None:
    """Draw the blocks between the bus and the operators of a core, with their sizes. Two runs give equal bytes."""
    figure = Figure(figsize=(9.7, 5))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, 97)
    axes.set_ylim(1, 51)
    axes.set_axis_off()
    program = core.engine.program
    width = program.format.width

    _box(axes, (36, 3), (60, 46), "", CORE)
    axes.text(66, 47, f"{core.system.name}: {core.latency} cycles", ha="center", va="center", weight="bold")
    slave = _box(axes, (14, 33), (17, 13), f"AXI4-Lite slave\n{len(table.registers)} registers\nsnapshot, flags", BUS)
    framer = _box(axes, (14, 20), (17, 8), f"sample framer\n{table.sample_words} words", BUS)
    sender = _box(axes, (14, 5), (17, 8), f"answer sender\n{table.answer_words} words", BUS)
    inputs = _box(axes, (39, 33), (15, 10), f"inputs\n{len(core.system.input_ports)} × {width} bits", CORE)
    rom = _box(axes, (39, 20), (15, 10), f"microprogram\n{program.length} × {program.layout.size} bits", CORE)
    memory = _box(axes, (58, 33), (15, 10), f"operand memory\n{program.depth} × {width} bits", CORE)
    outputs = _box(axes, (39, 6), (15, 10), f"outputs\n{len(core.system.output_ports)} × {width} bits", CORE)
    units = list(program.units)
    high = 36 / len(units)
    boxes = [_box(axes, (77, 43 - (place + 1) * high + 0.4), (17, high - 0.8),
                  f"{unit.name}, {unit.latency} cycles", UNIT) for place, unit in enumerate(units)]
    top, bottom = boxes[0].centre[1], boxes[-1].centre[1]

    for name, block, inward in ("s_axi", slave, True), ("s_axis", framer, True), ("m_axis", sender, False):
        outside, edge = (1, block.centre[1]), (block.left, block.centre[1])
        start, end = (outside, edge) if inward else (edge, outside)
        _arrow(axes, start, end, name, both=name == "s_axi")
    _arrow(axes, (slave.left, slave.centre[1] - 4), (1, slave.centre[1] - 4), "irq")
    _wire(axes, (slave.right, 41), (inputs.left, 41))
    _wire(axes, (framer.right, 25), (33, 25), (33, 38), (inputs.left, 38))
    _wire(axes, (outputs.left, 10), (sender.right, 10))
    _wire(axes, (outputs.left, 13), (34.5, 13), (34.5, 35), (slave.right, 35))
    _wire(axes, (inputs.right, 38), (memory.left, 38))
    _wire(axes, (rom.right, 25), (63, 25))
    axes.text(63.5, 25, "control", ha="left", va="center", size=9)
    # The operand bus to the operators, and the result bus back.
    axes.plot((75, 75), (bottom, top), color="black", lw=1.2)
    _wire(axes, (memory.right, 38), (75, 38))
    for box in boxes:
        _wire(axes, (75, box.centre[1]), (box.left, box.centre[1]))
        axes.plot((box.right, 95), (box.centre[1],) * 2, color="black", lw=1.2)
    axes.plot((95, 95, 72, 72), (top, 4.5, 4.5, 11), color="black", lw=1.2)
    axes.text(81, 4.9, "result bus", ha="center", va="bottom", size=9)
    _wire(axes, (72, 11), (outputs.right, 11))
    _wire(axes, (72, 11), (72, memory.bottom))
    with rc_context({"svg.hashsalt": "strapdown", "svg.fonttype": "none"}):
        FigureCanvasSVG(figure).print_svg(path, metadata={"Date": None, "Creator": None})


class _Block:
    """A drawn box: its edges and its centre."""

    def __init__(self, corner, size):
        (self.left, self.bottom), (width, height) = corner, size
        self.right, self.top = self.left + width, self.bottom + height
        self.centre = self.left + width / 2, self.bottom + height / 2


def _box(axes, corner, size, text, colour):
    axes.add_patch(FancyBboxPatch(corner, size[0], size[1], boxstyle="round,pad=0,rounding_size=0.8", facecolor=colour,
                                  edgecolor="black", lw=1))
    block = _Block(corner, size)
    axes.text(*block.centre, text, ha="center", va="center", size=10)
    return block


def _wire(axes, *points):
    """A line with an arrow at its last point."""
    axes.plot(*zip(*points, strict=True), color="black", lw=1.2)
    _arrow(axes, points[-2], points[-1], "")


def _arrow(axes, start, end, text, *, both=False):
    axes.annotate("", xy=end, xytext=start,
                  arrowprops={"arrowstyle": "<|-|>" if both else "-|>", "color": "black", "lw": 1.2,
                              "shrinkA": 0, "shrinkB": 0})
    if text:
        axes.text((start[0] + end[0]) / 2, start[1] + 0.6, text, ha="center", va="bottom", size=9, family="monospace")
