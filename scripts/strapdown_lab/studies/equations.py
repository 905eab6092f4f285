"""A digest of the equations of a system, which tells whether the figures of a study are those of this commit."""

from strapdown_sim.cache import digest

__all__ = ["equations_digest"]


def equations_digest(system, pool):
    """SHA-256 of the operations of a pool that compute the next state of a system, with their constants.

    It does not change with the order of operations that do not depend on each other, nor with the outputs that are no
    state, nor with the schedule or the text of a circuit.
    """
    graph = system.trace(pool)
    texts: dict = {}
    for node in graph.nodes:
        texts[node] = digest(node.operation, node.label, float(node.value).hex(),
                             *(f"{operand.negated} {texts[operand.node]}" for operand in node.operands))
    return digest(*(f"{word} {graph.state[word]!r} {texts[node]}" for word, node in graph.next_state.items()))
