"""The self-checking bench of a package, and its vectors."""

from amaranth.utils import exact_log2

from .scripts import filled
from .vectors import UPDATES, Op, steps

__all__ = ["bench"]


def bench(top, config, places) -> dict[str, str]:
    """Maps the files of the bench to their texts: plain Verilog, and the steps that it carries out.

    Parameters
    ----------
    top : Top
        With an AxiCore.
    config : Config
        Its configuration.
    places : Places
        Of the package.
    """
    core = top.component
    listed = steps(top, config)
    ports = [{"name": port.name, "direction": port.direction,
              "range": f"[{port.width - 1}:0] " if port.width > 1 or port.vector else ""} for port in top.ports]
    verilog = filled(
        "bench.v", name=places.name, configuration=config.name, places=places, count=len(listed),
        limit=4 * core.latency + 1000, ports=ports, updates=UPDATES, op=Op, streams=core.streams,
        inputs=[port for port in ports if port["direction"] == "input" and port["name"] not in ("aclk", "aresetn")],
        outputs=[port for port in ports if port["direction"] == "output"],
        channel_bits=exact_log2(core.channels), registers=core.table.registers,
        longest=max(len(register.name) for register in core.table))
    return {places.bench: verilog, places.vectors: "".join(f"{step.digits}\n" for step in listed)}
