"""Listings of a program: the operations and writes of each cycle, and the kernel lines behind them."""

from collections import defaultdict

from strapdown.kernel.machine import reads

__all__ = ["explain_cycle", "explain_line", "kernel_line", "operations_of_cycles", "program_listing"]


def program_listing(program):
    """One line for each cycle in which an operation starts or a result is written.

    If several updates are in flight, ``@s`` gives the stage of the update: the intervals since its start.
    """
    started, _ = _by_cycle(program)
    for cycle, operations in operations_of_cycles(program):
        origins = "; ".join(dict.fromkeys(kernel_line(step.node) for step in started[cycle] if step.node.origin))
        yield f"{cycle:4} {operations}" + (f"  -- {origins}" if origins else "")


def operations_of_cycles(program):
    """Each cycle in which an operation starts or a result is written, and the text of these."""
    started, written = _by_cycle(program)
    for cycle in range(program.length):
        parts = [f"{_unit(program, step, step.issue)}: {_operation(program, step)}" for step in started[cycle]]
        for step in written[cycle]:
            only = " (only after a reset)" if step.node.operation == "state" else ""
            value = f" {_operation(program, step)}" if step.unit == "constant" else ""
            parts.append(f"{program.place(step.node)} := {_unit(program, step, step.write)}{value}{only}")
        if parts:
            yield cycle, " | ".join(parts)


def explain_cycle(program, cycle):
    """Lines that describe one word: its bits, operations and writes, with the kernel lines."""
    started, written = _by_cycle(program)
    word = program.layout.const(program.words[cycle])
    yield f"cycle {cycle}: word {word.as_bits():0{-(-program.layout.size // 4)}x}"
    for verb, steps in ("starts", started[cycle]), ("writes", written[cycle]):
        for step in steps:
            if verb == "starts":
                unit, what = _unit(program, step, step.issue), _operation(program, step)
            else:
                unit, what = _unit(program, step, step.write), f"{program.place(step.node)} := {step.node}"
            yield f"  {verb} {unit}: {what}  (issued in cycle {step.issue}, there in cycle {step.write})"
            for origin in step.node.origin:
                yield f"    {origin}"


def explain_line(program, file, place):
    """Lines for every operation that comes from a part of a kernel; cycles count from the start of the update.

    Parameters
    ----------
    program : Program
    file : str
        Name of the kernel's file, without folders.
    place : int or str
        A line of the file, or the name of a function in it.
    """
    for step in program.schedule.steps:
        if step.node.computed and any(
                f"/{origin.file}".endswith(f"/{file}") and place in (origin.line, origin.function)
                for origin in step.node.origin):
            target = program.place(step.node) if step.stored else "its reader"
            yield f"cycles {step.issue:>4} to {step.write:>4}  {step.unit}: {_operation(program, step)} -> {target}"


def kernel_line(node):
    """The innermost kernel line of the operation, vector helpers excluded."""
    return str(next(origin for origin in reversed(node.origin) if origin.file == node.origin[0].file))


def _by_cycle(program):
    started, written = defaultdict(list), defaultdict(list)
    for step in program.schedule.steps:
        if step.unit in program.schedule.machine.unit:
            started[program.schedule.slot(step.issue)].append(step)
        if step.stored:
            written[program.schedule.slot(step.write)].append(step)
    return started, written


def _unit(program, step, cycle):
    stage = f"@{cycle // program.length}" if program.schedule.interval else ""
    return f"{step.unit}{stage}"


def _operation(program, step):
    if step.unit == "constant":
        return f"{program.constant(step.node):g}"
    operands = ", ".join("-" * read.operand.negated + program.operand_place(step, read) for read in reads(step.node))
    return f"{step.node.operation} {operands}"
