"""The words of a core for several channels, for people."""

from collections import defaultdict

from .explain import kernel_line

__all__ = ["stream_listing"]


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
