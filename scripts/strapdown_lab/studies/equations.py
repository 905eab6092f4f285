"""A digest of the equations of a system, which tells whether the figures of a study are those of this commit."""

from strapdown_sim.cache import digest

__all__ = ["equations_digest"]


def equations_digest(system, pool):
    """SHA-256 of the operations of a system in a pool, which do not depend on the schedule or the text of a circuit."""
    graph = system.trace(pool)
    number = {node: index for index, node in enumerate(graph.nodes)}
    lines = [" ".join((node.operation, node.label, float(node.value).hex(),
                       *(f"{'-' * operand.negated}{number[operand.node]}" for operand in node.operands)))
             for node in graph.nodes]
    ends = [f"{name} {number[node]}" for name, node in (graph.outputs | graph.next_state).items()]
    return digest("\n".join(lines + ends))
