"""The microprogram in words for people: what starts, what is written, which kernel line asked for it."""

from collections import defaultdict

__all__ = ["explain_cycle", "explain_line", "kernel_line", "microprogram_listing"]


def microprogram_listing(program):
    """One line a cycle in which something starts or is written."""
    started, written = _by_cycle(program)
    for cycle in range(program.length):
        parts = []
        for step in started[cycle]:
            parts.append(f"{step.unit}: {_operation(program, step)}")
        for step in written[cycle]:
            only = " (only after a reset)" if step.node.operation == "state" else ""
            parts.append(f"{_place(program, step.node)} := {step.unit}{only}")
        if parts:
            origins = "; ".join(dict.fromkeys(kernel_line(step.node) for step in started[cycle] if step.node.origin))
            yield f"{cycle:4} {' | '.join(parts)}" + (f"  -- {origins}" if origins else "")


def explain_cycle(program, cycle):
    """Lines that tell all about one word: its bits, what starts and what is written, with the kernel lines."""
    started, written = _by_cycle(program)
    word = program.layout.const(program.words[cycle])
    yield f"cycle {cycle}: word {word.as_bits():0{-(-program.layout.size // 4)}x}"
    for verb, steps in ("starts", started[cycle]), ("writes", written[cycle]):
        for step in steps:
            what = _operation(program, step) if verb == "starts" else f"{_place(program, step.node)} := {step.node}"
            yield f"  {verb} {step.unit}: {what}  (issued in cycle {step.issue}, there in cycle {step.write})"
            for origin in step.node.origin:
                yield f"    {origin}"


def explain_line(program, file, line):
    """Lines for every operation that comes from a line of a kernel."""
    for step in program.schedule.steps:
        if any(origin.file.endswith(f"/{file}") and origin.line == line for origin in step.node.origin):
            place = _place(program, step.node) if step.stored else "its reader"
            yield f"cycles {step.issue:>4} to {step.write:>4}  {step.unit}: {_operation(program, step)} -> {place}"


def kernel_line(node):
    """The line of the kernel that stands nearest to the operation, vector helpers left out."""
    return str(next(origin for origin in reversed(node.origin) if origin.file == node.origin[0].file))


def _by_cycle(program):
    started, written = defaultdict(list), defaultdict(list)
    for step in program.schedule.steps:
        if step.unit != "input":
            started[step.issue].append(step)
        if step.stored:
            written[step.write].append(step)
    return started, written


def _operation(program, step):
    if step.node.operation == "state":
        return f"copy {program.schedule.graph.state[step.node.label]:g}"
    operands = ", ".join(("-" if operand.negated else "") + _source(program, step, operand)
                         for operand in step.node.operands)
    return f"{step.node.operation} {operands}"


def _source(program, step, operand):
    source = program.operand_source(step, operand)
    return _place(program, operand.node) if source in ("memory", "side") else f"<{source}>"


def _place(program, node):
    """Address of a node, with the name of what is known by one."""
    names = {kept: name for name, kept in program.schedule.graph.outputs.items()}
    names |= {kept: f"{name}'" for name, kept in program.schedule.graph.next_state.items()}
    name = names.get(node) or node.label
    memory = "side" if node in program.schedule.aside else ""
    return f"{memory}[{program.addresses[node]}" + (f" {name}]" if name else "]")
