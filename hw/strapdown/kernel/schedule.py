"""Schedules: the cycles of each operation and of its result, and the results that memory has to keep."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

from .machine import BUSES, Machine, Problem, kept, reads
from .trace import Graph, Node

__all__ = ["Schedule", "Step"]


@dataclass(frozen=True)
class Step:
    """One node in time.

    ``unit`` is the unit that computes the node; "input" for an input port; "constant" for a constant, and for a state
    word, which is restored to its reset value. In cycle ``issue`` the operands are fetched, from memory or directly
    from a unit whose result comes out in the same cycle. ``write`` is the cycle in which the result can be on the bus
    named ``bus``, "main" or a side bus. ``stored`` is true if the memory of that bus stores the result.
    """

    node: Node
    unit: str
    issue: int
    write: int
    stored: bool = True
    bus: str = "main"


@dataclass(frozen=True)
class Schedule:
    """All steps of a graph on a machine: static, free of conflicts, the same in every update.

    Attributes
    ----------
    graph, machine : Graph, Machine
        The graph, and the timing rules that the schedule obeys.
    steps : tuple of Step
        In order of issue; cycles count from the start of the update.
    interval : int or None
        Cycles from the start of one update to the start of the next. A resource that is taken in a cycle is taken in
        all cycles a multiple of the interval away. None: an update starts after the previous one has ended.
    """

    graph: Graph
    machine: Machine
    steps: tuple[Step, ...]
    interval: int | None = None

    @property
    def pool(self):
        """The operators."""
        return self.machine.pool

    @cached_property
    def length(self):
        """Cycles from the first issue to the last write."""
        return 1 + max(step.write for step in self.steps)

    @property
    def period(self):
        """Cycles after which the program repeats: the interval, or the whole length."""
        return self.interval or self.length

    def slot(self, cycle):
        """The cycle of the program for a cycle of an update."""
        return cycle % self.interval if self.interval else cycle

    @property
    def commit(self):
        """The cycle in which outputs and state change. All results have been checked for NaN and infinity by then."""
        return self.length + 1

    @property
    def stages(self):
        """Greatest number of updates in flight."""
        return self.commit // self.interval + 1 if self.interval else 1

    @property
    def section_ends(self):
        """Last cycle of each section: that of its last operation, or earlier if later sections would have no cycle of
        their own; for the last section, the end of the schedule.

        Operations of a section may be issued earlier, together with those of the previous section.
        """
        sections, ends, end = self.graph.sections, [], -1
        for later, section in zip(reversed(range(len(sections))), sections, strict=True):
            issues = (step.issue for step in self.steps if step.node.computed and step.node.section == section)
            end = min(max([end + 1, *issues]), self.length - 1 - later)
            ends.append(end)
        return (*ends[:-1], self.length - 1)

    @property
    def free(self):
        """First cycle of the interval in which the main bus is free."""
        taken = {self.slot(step.write) for step in self.steps if step.bus == "main"}
        return next(cycle for cycle in range(self.period) if cycle not in taken)

    @cached_property
    def written(self):
        """Maps each node to the cycle in which its result is ready."""
        return {step.node: step.write for step in self.steps}

    @cached_property
    def bus(self):
        """Maps each node to the bus of its result."""
        return {step.node: step.bus for step in self.steps}

    @cached_property
    def last_read(self):
        """Maps each node that is fetched from an operand memory to the last cycle in which it is."""
        last: dict[Node, int] = {}
        for step in self.steps:
            for read in reads(step.node):
                if self.machine.fetched(read) and not self.forwarded(step, read):
                    last[read.node] = max(last.get(read.node, 0), step.issue)
        return last

    def forwarded(self, step, read):
        """True if ``step`` takes an operand in the cycle in which it comes out, and not from memory."""
        return read.node in self.written and self.machine.forwards(step.issue - self.written[read.node], read)

    @cached_property
    def direct(self):
        """Names of the units whose results can be operands without the result bus."""
        return {unit.name for unit in self.pool.units if unit.direct}

    @cached_property
    def aside(self):
        """Nodes that are kept in the memories of side buses."""
        return {step.node for step in self.steps if step.stored and step.bus != "main"}

    def on_bus(self, step):
        """True if a step's result goes over a result bus."""
        return step.stored or step.unit not in self.direct

    @cached_property
    def bounds(self):
        """Lower bounds of the interval, or of the length, in cycles, by their cause."""
        problem = Problem(self.graph, self.machine)
        return problem.intervals() if self.interval else problem.lengths()

    @cached_property
    def critical_path(self):
        """The steps that determine the last result, first to last, each with the cycles it waited after its operands.

        It waits for a unit, a read port or a result bus.
        """
        steps = {step.node: step for step in self.steps}
        path = [max(self.steps, key=lambda step: step.write)]
        waited: list[int] = []
        while True:
            step = path[-1]
            waits = {steps[read.node]: step.issue - self.written[read.node] - self.machine.least_wait(read)
                     for read in reads(step.node) if read.node in steps}
            # An operand that is joined to its reader is delayed until the other operand is ready.
            if not waits:
                return list(zip(path, [*waited, 0], strict=True))[::-1]
            path.append(min(waits, key=lambda other: (not other.stored, waits[other])))
            waited.append(waits[path[-1]])

    def utilisation(self):
        """Maps each unit and bus to the share of cycles in which it is taken."""
        taken: Counter[str] = Counter()
        for step in self.steps:
            if step.unit in self.machine.unit:
                taken[step.unit] += self.machine.unit[step.unit].interval
        for step in self.steps:
            if self.on_bus(step):
                taken[BUSES[step.bus]] += 1
        return {name: count / self.period for name, count in taken.items()}

    def verify(self):
        """Raise AssertionError if the engine cannot run the schedule."""
        machine, written = self.machine, self.written
        assert len(written) == len(self.steps), "a node is scheduled twice"
        assert sorted({*self.section_ends}) == [*self.section_ends], "a section ends before it begins"
        assert set(written) == {node for node in self.graph.nodes if machine.needs_step(node)}, "a node is missing"
        self._verify_resources()
        self._verify_operands()

    def _verify_resources(self):
        machine, buses = self.machine, self.machine.buses(self.graph)
        uses: Counter[tuple[str, int]] = Counter()
        for step in self.steps:
            node = step.node
            assert step.bus in buses[node], f"{node} cannot go over the {step.bus} bus"
            assert step.write == step.issue + machine.delay(node), f"{node} is not ready when it is written"
            if self.on_bus(step):
                uses[BUSES[step.bus], self.slot(step.write)] += 1
            if machine.shares_register(node):
                uses["register before the buses", self.slot(step.write)] += 1
            if not machine.units(node):
                assert machine.first_input <= step.issue, f"{node} is too early"
                assert not self.interval or step.issue < self.interval, f"{node} is no longer valid"
                continue
            assert step.issue >= machine.first_issue, f"{node} is too early"
            assert step.unit in {unit.name for unit in machine.units(node)}, f"{step.unit} cannot compute {node}"
            unit = machine.unit[step.unit]
            assert step.bus in machine.links(unit), f"the {step.bus} bus does not take {node} from {step.unit}"
            uses[f"read port {machine.port(unit)}", self.slot(step.issue)] += 1
            for busy in range(unit.interval):
                uses[step.unit, self.slot(step.issue + busy)] += 1
        for (resource, cycle), count in uses.items():
            assert count == 1, f"{resource} is used {count} times in cycle {cycle}"

    def _verify_operands(self):
        machine, written = self.machine, self.written
        stored = {step.node for step in self.steps if step.stored}
        assert kept(self.graph) & set(written) <= stored, "a result is not stored"
        for step in self.steps:
            for read in reads(step.node):
                if read.node not in written:
                    assert not read.condition or machine.fetched(read), f"the condition of {step.node} is not computed"
                    continue
                wait = step.issue - written[read.node]
                assert machine.may_wait(wait, read), \
                    f"{step.node} cannot read {read.node} after {wait} cycles"
                assert read.node in stored or self.forwarded(step, read), f"{read.node} is not stored for {step.node}"
