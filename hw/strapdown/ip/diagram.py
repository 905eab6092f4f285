"""The block diagram of a core behind AXI, as SVG."""

from pathlib import Path

from strapdown.cores import Top

from .drawing import arrow, box, sheet, wire, write_svg

__all__ = ["block_diagram"]

BUS, CORE, UNIT = "#dbe7f5", "#f4f4f4", "#e3f1dc"
"""Colours of blocks of the bus, of the core and of its operators."""


def block_diagram(bus: Top, path: Path) -> None:
    """Draw the blocks between the bus and the operators of a core behind AXI, with their sizes, as SVG.

    Two runs give equal bytes.
    """
    engine, table = bus.component.engine, bus.component.table
    figure, axes = sheet(97, 50, bottom=1)
    program = engine.program
    width = program.format.width

    box(axes, (36, 3), (60, 46), "", CORE)
    axes.text(66, 47, f"{engine.name}: {engine.latency} cycles", ha="center", va="center", weight="bold")
    slave = box(axes, (14, 33), (17, 13), f"AXI4-Lite slave\n{len(table.registers)} registers\nsnapshot, flags", BUS)
    inputs = box(axes, (39, 33), (15, 10), f"inputs\n{len(engine.system.input_ports)} × {width} bits", CORE)
    rom = box(axes, (39, 20), (15, 10), f"microprogram\n{program.length} × {program.layout.size} bits", CORE)
    memory = box(axes, (58, 33), (15, 10), f"operand memory\n{program.depth} × {width} bits", CORE)
    outputs = box(axes, (39, 6), (15, 10), f"outputs\n{len(engine.system.output_ports)} × {width} bits", CORE)
    units = list(program.units)
    high = 36 / len(units)
    boxes = [box(axes, (77, 43 - (place + 1) * high + 0.4), (17, high - 0.8),
                 f"{unit.name}, {unit.latency} cycles", UNIT) for place, unit in enumerate(units)]
    top, bottom = boxes[0].centre[1], boxes[-1].centre[1]

    arrow(axes, (1, slave.centre[1]), (slave.left, slave.centre[1]), "s_axi", both=True)
    arrow(axes, (slave.left, slave.centre[1] - 4), (1, slave.centre[1] - 4), "irq")
    wire(axes, (slave.right, 41), (inputs.left, 41))
    wire(axes, (outputs.left, 13), (34.5, 13), (34.5, 35), (slave.right, 35))
    if bus.component.streams:
        framer = box(axes, (14, 20), (17, 8), f"sample framer\n{table.sample_words} words", BUS)
        sender = box(axes, (14, 5), (17, 8), f"answer sender\n{table.answer_words} words", BUS)
        arrow(axes, (1, framer.centre[1]), (framer.left, framer.centre[1]), "s_axis")
        arrow(axes, (sender.left, sender.centre[1]), (1, sender.centre[1]), "m_axis")
        wire(axes, (framer.right, 25), (33, 25), (33, 38), (inputs.left, 38))
        wire(axes, (outputs.left, 10), (sender.right, 10))
    wire(axes, (inputs.right, 38), (memory.left, 38))
    wire(axes, (rom.right, 25), (63, 25))
    axes.text(63.5, 25, "control", ha="left", va="center", size=9)
    # The operand bus to the operators, and the result bus back.
    axes.plot((75, 75), (bottom, top), color="black", lw=1.2)
    wire(axes, (memory.right, 38), (75, 38))
    for unit_box in boxes:
        wire(axes, (75, unit_box.centre[1]), (unit_box.left, unit_box.centre[1]))
        axes.plot((unit_box.right, 95), (unit_box.centre[1],) * 2, color="black", lw=1.2)
    axes.plot((95, 95, 72, 72), (top, 4.5, 4.5, 11), color="black", lw=1.2)
    axes.text(81, 4.9, "result bus", ha="center", va="bottom", size=9)
    wire(axes, (72, 11), (outputs.right, 11))
    wire(axes, (72, 11), (72, memory.bottom))
    write_svg(figure, path)
