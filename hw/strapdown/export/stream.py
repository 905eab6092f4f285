"""What header and description say of a core for several channels, in place of what they say of the others."""

from collections import defaultdict
from textwrap import dedent

from .explain import kernel_line

__all__ = ["stream_facts", "stream_listing", "stream_meanings", "stream_timing"]


def stream_meanings(system):
    """Meaning of the ports that other cores do not have, or have with another meaning."""
    return {system.start: "offers a sample", "in_ready": "high when an offered sample is taken; depends on in_channel",
            "in_channel": "whose sample it is", system.finish: "high for one cycle with new outputs",
            "out_channel": "whose outputs and status they are"}


def stream_timing(core):
    """When samples are taken and finished, in words."""
    system, engine = core.system, core.engine
    return " ".join(dedent(f"""
        A sample is taken at a rising edge of clk with {system.start} and in_ready high, with all inputs, which may
        change afterwards. in_ready is high in one cycle in {engine.interval}, and if nothing is under way then,
        until a sample comes; but never for a channel whose last sample is under way. {system.finish} rises
        {core.latency} cycles after that edge, for every sample, and is high for one cycle; samples finish in order.
        Outputs hold until the next finish. An update that is refused changes neither the outputs nor its
        channel's state.""").split())


def stream_facts(core):
    """Figures of a stream engine as JSON values."""
    program = core.engine.program
    return {"channels": program.channels, "interval_cycles": core.engine.interval,
            "updates_under_way": program.schedule.stages,
            "main_memory_words": program.depth, "side_memory_words": program.side_depth}


def stream_listing(program):
    """One line a word: what starts, and what is written, with the stage of the update and the kernel line."""
    schedule = program.schedule
    parts, origins = defaultdict(list), defaultdict(list)
    own = {node: f"{word}'" for word, node in schedule.graph.next_state.items()}

    def place(node):
        if node.operation in ("state", "constant", "input"):
            return node.label
        return own.get(node) or f"{schedule.bus[node]}[{program.addresses[node]}]"

    for step in schedule.steps:
        if step.unit != "input":
            operands = ", ".join("-" * operand.negated + place(operand.node) for operand in step.node.operands)
            stage, word = divmod(step.issue, program.length)
            parts[word].append(f"{step.unit}@{stage}: {step.node.operation} {operands}")
            origins[word].append(kernel_line(step.node))
    for step in schedule.steps:
        stage, word = divmod(step.write, program.length)
        parts[word].append(f"{place(step.node)} := {step.unit}@{stage}")
    for word in range(program.length):
        if parts[word]:
            yield f"{word:4} {' | '.join(parts[word])}" + (
                f"  -- {'; '.join(dict.fromkeys(origins[word]))}" if origins[word] else "")
