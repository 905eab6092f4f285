"""When each operation starts and when its result is written."""

from collections import Counter
from dataclasses import dataclass

from .pool import Pool
from .trace import Graph, Node

__all__ = ["Step", "Schedule", "schedule"]


@dataclass(frozen=True)
class Step:
    """One node in time.

    ``unit`` is the unit that computes it; "input" for an input port, put on the result bus as
    it is; for a state word, the unit that puts its reset value back (written only in the first
    update after a reset). ``issue`` is the cycle in which operands are read, ``write`` the one
    in which the result is on the result bus; it can be read from the next cycle on.
    """

    node: Node
    unit: str
    issue: int
    write: int


@dataclass(frozen=True)
class Schedule:
    """All steps of a graph on a pool: static, conflict-free, the same in every update.

    Attributes
    ----------
    graph, pool : Graph, Pool
        What is scheduled, and on what.
    steps : tuple of Step
        In order of issue.
    """

    graph: Graph
    pool: Pool
    steps: tuple[Step, ...]

    @property
    def length(self):
        """Cycles from the first issue to the last write."""
        return 1 + max(step.write for step in self.steps)

    @property
    def section_ends(self):
        """Last cycle of each section: that of its last issue, and of the last one the end of the schedule.

        Steps of a section may be issued earlier, beside those of the section before.
        """
        ends, end = [], -1
        for section in self.graph.sections:
            end = max([end + 1, *(step.issue for step in self.steps if step.node.section == section)])
            ends.append(end)
        return (*ends[:-1], self.length - 1)

    def verify(self):
        """Raise AssertionError unless the schedule is one that the engine can run."""
        units = {unit.name: unit for unit in self.pool.units}
        written = {step.node: step.write for step in self.steps}
        assert len(written) == len(self.steps), "a node is scheduled twice"
        assert set(written) == {node for node in self.graph.nodes if node.operation != "constant"}, "a node is missing"
        for resource, uses in (
                ("result bus", [step.write for step in self.steps]),
                ("read port", [(units[step.unit].read_port, step.issue) for step in self.steps if step.unit in units])):
            busiest, count = Counter(uses).most_common(1)[0]
            assert count == 1, f"{resource} {busiest} is used {count} times"
        last: dict[str, int] = {}
        for step in self.steps:
            latency = units[step.unit].latency if step.unit in units else 0
            assert step.write == step.issue + latency, f"{step} is not written when its result is there"
            for operand in step.node.operands:
                if operand.node.operation != "constant":
                    assert written[operand.node] < step.issue, f"{step} reads {operand.node} too early"
            if step.unit in last and step.unit in units:
                assert step.issue - last[step.unit] >= units[step.unit].interval, f"{step.unit} is still busy"
            last[step.unit] = step.issue


def schedule(graph, pool):
    """Place every node of a graph in time: list scheduling, then justification to both sides.

    First, node after node, the one with the longest way to go takes the earliest cycle that is
    free. Then, as long as the schedule gets shorter, all nodes are moved as late as they can
    go, the last first, and back to as early as they can, the first first. What nobody waits
    for yet so leaves the crowded first cycles to the critical path (Valls, Ballestín and
    Quintanilla, "Justification and RCPSP", 2005).

    Parameters
    ----------
    graph : Graph
    pool : Pool

    Returns
    -------
    Schedule
        Verified.
    """
    table = _Table(graph, pool)
    issues = table.pack(sorted(table.nodes, key=lambda node: -table.to_go[node]))
    for _ in range(ROUNDS):
        late = table.pack(sorted(table.nodes, key=lambda node: -issues[node] - table.latency[node]), late=True)
        shorter = table.pack(sorted(table.nodes, key=lambda node: late[node]))
        if table.length(shorter) >= table.length(issues):
            break
        issues = shorter
    steps = [Step(node, unit.name if (unit := table.units[node]) else "input", issue, issue + table.latency[node])
             for node, issue in issues.items()]
    result = Schedule(graph, pool, tuple(sorted(steps, key=lambda step: step.issue)))
    result.verify()
    return result


ROUNDS = 20
"""At most so many justifications; a handful is usual."""


class _Table:
    """What scheduling asks of a graph on a pool."""

    def __init__(self, graph, pool):
        units = {operation: unit for unit in pool.units for operation in unit.operations}
        self.nodes = [node for node in graph.nodes if node.operation != "constant"]
        # A state word is put back by the unit that copies; an input needs none.
        self.units = {node: units.get("copy" if node.operation == "state" else node.operation) for node in self.nodes}
        self.latency = {node: unit.latency if unit else 0 for node, unit in self.units.items()}
        self.operands = {node: [operand.node for operand in node.operands if operand.node.operation != "constant"]
                         for node in self.nodes}
        self.readers: dict[Node, list[Node]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            for operand in self.operands[node]:
                self.readers[operand].append(node)
        self.to_go: dict[Node, int] = {}
        for node in reversed(self.nodes):
            rest = max((self.to_go[reader] for reader in self.readers[node]), default=0)
            self.to_go[node] = self.latency[node] + 1 + rest

    def length(self, issues):
        """Cycles from the first issue to the last write."""
        return 1 + max(issue + self.latency[node] for node, issue in issues.items())

    def pack(self, order, *, late=False):
        """Issue cycles of the nodes, each placed in its turn where it is free: earliest, or latest, first.

        ``order`` has operands before (or, ``late``, after) their readers. The first cycle is 0.
        """
        direction = -1 if late else 1
        issues: dict[Node, int] = {}
        taken: set[tuple] = set()
        for node in order:
            if late:
                cycle = min((issues[reader] for reader in self.readers[node]), default=0) - 1 - self.latency[node]
            else:
                cycle = max((issues[operand] + self.latency[operand] + 1 for operand in self.operands[node]), default=0)
            while not taken.isdisjoint(needs := self._needs(node, cycle)):
                cycle += direction
            issues[node] = cycle
            taken.update(needs)
        first = min(issues.values())
        return {node: issue - first for node, issue in issues.items()}

    def _needs(self, node, cycle):
        """What a node takes up if it is issued in ``cycle``: the result bus, a read port, its unit."""
        unit = self.units[node]
        needs: list[tuple] = [("bus", cycle + self.latency[node])]
        if unit:
            needs += [("port", unit.read_port, cycle), *((unit.name, cycle + busy) for busy in range(unit.interval))]
        return needs
