"""Verilog and JSON of a core with its serial link."""

from importlib.metadata import version

from strapdown.link import LAYOUT, NAVIGATION

from .backend import to_verilog
from .verilog import comment, configuration, paragraph, ports, table, versions, write_files

__all__ = ["link_description", "link_text", "write_link"]

NAME = "SINS_uart"

MEANINGS = {"uart_tx": "serial line, 8N1, high while idle", "out_link_busy": "high while a frame is sent",
            "out_link_overrun": "an update was not sent, because a frame was; cleared by the next frame"}


def link_text(linked, config):
    """The Verilog file of a ``UartCore``: header and modules. Equal bytes on every run."""
    core, sender = linked.core, linked.sender
    lines = [f"{NAME}: {core.system.name}, sending {NAVIGATION.meaning} over a serial line", "",
             f"Made by strapdown {version('strapdown')} from configuration {config.name} ({config.description}).",
             "Change the kernel or the configuration, not this file.",
             "", "CONFIGURATION", *table(sorted(configuration(config).items())),
             "", "PORTS",
             *table((port["name"], f"{port['direction']} {port['width']}", port["meaning"]) for port in _ports(linked)),
             "", "FRAME", *table((field.name, field.size or "length", field.meaning) for field in LAYOUT),
             "", "PAYLOAD",
             *table((quantity.name, quantity.unit, quantity.meaning) for quantity in NAVIGATION.quantities),
             "", "TIMING"]
    lines += paragraph(
        f"As {core.system.name}: {core.system.finish} rises {core.latency} cycles after the edge that takes a start. "
        f"A frame begins two cycles later; it has {sender.size} bytes and takes {sender.interval} cycles, "
        f"{sender.divisor} to a bit.")
    return comment(lines) + to_verilog(linked, NAME)


def _ports(linked):
    """All ports: name, direction, width, meaning."""
    return ports(linked.core) + [{"name": name, "direction": "output", "width": 1, "meaning": meaning}
                                 for name, meaning in MEANINGS.items()]


def link_description(linked, config, command):
    """What the JSON beside the Verilog file says, as a dict; ``command`` makes the file again."""
    sender = linked.sender
    return {
        "module": NAME,
        "configuration": configuration(config),
        "latency_cycles": linked.core.latency,
        "ports": _ports(linked),
        "frame": [{"name": field.name, "bytes": field.size, "meaning": field.meaning} for field in LAYOUT],
        "payload": [vars(quantity) for quantity in NAVIGATION.quantities],
        "frame_bytes": sender.size,
        "frame_cycles": sender.interval,
        "bit_cycles": sender.divisor,
        "versions": versions(),
        "command_line": command,
    }


def write_link(linked, config, directory, command):
    """Write ``SINS_uart.v`` and ``SINS_uart.json`` into ``directory``; returns the Verilog's path."""
    return write_files(directory / f"{NAME}.v", link_text(linked, config), link_description(linked, config, command))
