"""Schedules that are found once in a run of the tests: a search takes seconds, and many tests make the same cores."""

import json
from functools import wraps

from strapdown.kernel.schedule import Schedule, Step

__all__ = ["searched_once"]


def searched_once(search, cache):
    """A ``search``, from a graph and a machine to a Schedule, whose results are kept in a Cache.

    A result is found by all that a search reads: the operations of the graph, and the pool and its units. Each result
    that is taken is verified, as a search verifies its own.
    """
    @wraps(search)
    def schedule(graph, machine, *options):
        def make(path):
            found = search(graph, machine, *options)
            index = {node: number for number, node in enumerate(found.graph.nodes)}
            steps = [(index[step.node], step.unit, step.issue, step.write, step.stored, step.bus)
                     for step in found.steps]
            path.write_text(json.dumps({"steps": steps, "interval": found.interval}), encoding="utf-8")

        identity = {"search": search.__name__, "options": options, "graph": _graph(graph), "machine": _machine(machine)}
        kept = json.loads(cache.file(identity, ".json", make).read_text(encoding="utf-8"))
        prepared = machine.prepared(graph)
        result = Schedule(prepared, machine, tuple(Step(prepared.nodes[number], *rest)
                                                   for number, *rest in kept["steps"]), kept["interval"])
        result.verify()
        return result

    return schedule


def _graph(graph):
    """The operations of a graph as JSON values; nodes are their numbers."""
    number = {node: index for index, node in enumerate(graph.nodes)}
    return {
        "nodes": [(node.operation, node.label, node.value, node.section, node.spreads, node.condition is not None,
                   [(number[operand.node], operand.negated) for operand in node.operands]) for node in graph.nodes],
        "inputs": graph.inputs, "state": graph.state, "sections": graph.sections,
        "outputs": {port: number[node] for port, node in graph.outputs.items()},
        "next_state": {word: number[node] for word, node in graph.next_state.items()},
        "status": {name: (number[operand.node], operand.negated) for name, operand in graph.status.items()}}


def _machine(machine):
    """The timing rules of a machine as JSON values."""
    return [type(machine).__name__, repr(machine.pool), [
        (unit.name, unit.kind, unit.read_port, unit.direct, unit.latency, unit.interval, sorted(unit.operations))
        for unit in machine.pool.units]]
