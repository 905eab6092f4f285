"""When each operation starts if a new update begins every so many cycles: modulo scheduling."""

import random
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from heapq import heapify, heappop, heappush

from .pool import Pool
from .schedule import Step
from .trace import Graph, Node

__all__ = ["ModuloSchedule", "modulo_schedule"]

MEMORY_DELAY, CONDITION_DELAY = 2, 1
"""Least number of cycles between a result and its use: as an operand, whose address goes out a cycle
earlier, and as the condition of a choice, which waits in a register."""

FIRST_INPUT, FIRST_ISSUE = 1, 2
"""Cycles of the first input and the first operation: what their addresses depend on is known by then."""


@dataclass(frozen=True)
class ModuloSchedule:
    """All steps of an update, in cycles after its begin; another update begins every ``interval`` cycles.

    All updates have the same steps, so what is taken in a cycle is taken in all cycles a multiple
    of the interval away. Every result goes to memory. The state needs no steps: operands find it there.

    Attributes
    ----------
    graph, pool : Graph, Pool
        What is scheduled, and on what.
    interval : int
        Cycles between the begins of two updates.
    steps : tuple of Step
        In order of issue.
    """

    graph: Graph
    pool: Pool
    interval: int
    steps: tuple[Step, ...]

    @cached_property
    def written(self):
        """Node to the cycle in which its result is on a bus."""
        return {step.node: step.write for step in self.steps}

    @cached_property
    def bus(self):
        """Node to the bus of its result."""
        return {step.node: step.bus for step in self.steps}

    @property
    def commit(self):
        """The cycle in which outputs and state change: by then it is known whether all results are finite."""
        return max(self.written.values()) + 2

    @property
    def stages(self):
        """Most updates that are under way at a time."""
        return self.commit // self.interval + 1

    @cached_property
    def last_read(self):
        """Node to the last cycle in which it is fetched from memory, if it is."""
        reads: dict[Node, int] = {}
        for step in self.steps:
            for operand in step.node.operands[:2]:
                reads[operand.node] = max(reads.get(operand.node, 0), step.issue)
        return reads

    def read_port(self, unit):
        """The pair of read ports that feeds a unit, by its name."""
        return _read_port(self.pool, unit)

    def verify(self):
        """Raise AssertionError unless the schedule is one that the engine can run."""
        units = {unit.name: unit for unit in self.pool.units}
        needed = {node for node in self.graph.nodes if node.operation not in ("constant", "state")}
        assert len(self.written) == len(self.steps), "a node is scheduled twice"
        assert set(self.written) == needed, "a node is missing"
        uses: Counter[tuple] = Counter()
        for step in self.steps:
            assert step.bus in _buses(self.graph, step.node), f"{step.node} cannot go over the {step.bus} bus"
            uses[f"{step.bus} bus", step.write % self.interval] += 1
            if step.unit == "input":
                assert FIRST_INPUT <= step.issue == step.write < self.interval, f"{step.node} when it is gone"
                continue
            unit = units[step.unit]
            assert step.node.operation in unit.operations, f"{step.unit} cannot compute {step.node}"
            assert step.issue >= FIRST_ISSUE, f"{step.node} is too early"
            assert step.write == step.issue + unit.latency + 1, f"{step.node} is not there when it is written"
            uses[f"read port {self.read_port(unit.name)}", step.issue % self.interval] += 1
            for busy in range(unit.interval):
                uses[unit.name, (step.issue + busy) % self.interval] += 1
            for position, operand in enumerate(step.node.operands):
                if operand.node in self.written:
                    wait = step.issue - self.written[operand.node]
                    most = self.interval if position == 2 else 2 * self.interval
                    assert _wait(position) <= wait <= most, \
                        f"{step.node} cannot read {operand.node} after {wait} cycles"
                else:
                    assert position < 2, f"the condition of {step.node} is not computed"
        for resource, count in uses.items():
            assert count == 1, f"{resource} is used {count} times"


def modulo_schedule(graph, pool, interval):
    """Place every node of a graph in time, so that an update can begin every ``interval`` cycles.

    Node after node, the one with the longest way to come first, takes the latest cycle from which
    its readers are in time and in which all it needs is free, in this cycle and in all a multiple
    of the interval away. If there is none it takes the place of another node that finds a new one,
    which may in turn do so. Units that are busy for several cycles start on a grid, for which ports
    and bus are reserved: so their idle cycles are not scattered. From the end to the begin, because
    the state to be has the least choice of cycles and the inputs the most. This is
    repeated from priorities that are a little off and other grids, at random but the same in every
    run; the schedule with the fewest stages wins, and of these the one that keeps least in the side memory.

    Parameters
    ----------
    graph : Graph
    pool : Pool
        With one adder and one multiplier.
    interval : int
        No unit, bus or read port can be taken for longer.

    Returns
    -------
    ModuloSchedule
        Verified. Raises: ValueError if none is found.

    Notes
    -----
    Source: Rau, Iterative modulo scheduling, MICRO-27, 1994; ejection instead of his eviction.
    """
    problem = _Problem(graph, pool)
    resource, least = max(problem.bounds().items(), key=lambda bound: bound[1])
    if interval < least:
        raise ValueError(f"interval must be at least {least}, as long as the {resource} is taken, not {interval!r}")
    rng = random.Random(0)
    best = None
    for attempt in range(ATTEMPTS):
        spread = 0.4 * attempt / ATTEMPTS
        priority = {node: -problem.to_come[node] * (1 + rng.uniform(-spread, spread)) for node in problem.nodes}
        steps = _Attempt(problem, interval).place(priority, rng)
        if steps is None:
            continue
        found = ModuloSchedule(graph, pool, interval, steps)
        kept = {bus: sum(found.last_read[node] - write for node, write in found.written.items()
                         if node in found.last_read and found.bus[node] == bus) for bus in ("side", "main")}
        cost = found.stages, kept["side"], kept["main"]
        if best is None or cost < best[0]:
            best = cost, found
    if best is None:
        raise ValueError(f"interval must be longer than {interval!r}: no schedule was found")
    best[1].verify()
    return best[1]


ATTEMPTS = 16
"""How often the scheduler starts anew."""

PATIENCE = 3000
"""So often an attempt looks for another place for a node that is placed already."""

ROUNDS = 3
"""How often steps are moved to where they keep the fewest values."""

COST = {"main": 1, "side": 3}
"""What a value costs for each cycle that it is kept in a memory: there is less room in one."""

DEPTH = 2
"""So many nodes may have to move for one."""


def _buses(graph, node):
    """Buses that can take a node's result to memory, the better one first."""
    if node in graph.next_state.values():
        return ("main",)
    return {"input": ("side",), "multiply": ("side", "main"), "add": ("main", "side")}.get(node.operation, ("main",))


def _read_port(pool, name):
    """Products are the most numerous: the multiplier has a pair to itself, the others share one."""
    return int(name in {unit.name for unit in pool.operations["multiply"]})


def _wait(position):
    return CONDITION_DELAY if position == 2 else MEMORY_DELAY


class _Problem:
    """What scheduling asks of a graph on a pool."""

    def __init__(self, graph, pool):
        self.nodes = [node for node in graph.nodes if node.operation not in ("constant", "state")]
        known = set(self.nodes)
        # Units of a kind are alike.
        self.units = {node: pool.operations.get(node.operation, []) for node in self.nodes}
        self.unit = {node: units[0] if units else None for node, units in self.units.items()}
        for units in self.units.values():
            if len(units) > 1 and units[0].interval == 1:
                raise ValueError(f"pool must have one {units[0].name.partition('_')[0]}, not {len(units)}")
        self.port = {unit.name: _read_port(pool, unit.name) for unit in pool.units}
        self.delay = {node: unit.latency + 1 if unit else 0 for node, unit in self.unit.items()}
        self.buses = {node: _buses(graph, node) for node in self.nodes}
        self.operands = {node: [(operand.node, _wait(position)) for position, operand in enumerate(node.operands)
                                if operand.node in known] for node in self.nodes}
        self.readers: dict[Node, list[tuple[Node, int]]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            for operand, wait in self.operands[node]:
                self.readers[operand].append((node, wait))
        self.to_come: dict[Node, int] = {}
        for node in self.nodes:
            self.to_come[node] = self.delay[node] + max(
                (self.to_come[operand] + wait for operand, wait in self.operands[node]), default=0)

    def bounds(self):
        """Least interval, by what demands it."""
        taken: Counter[str] = Counter({"pair of buses": -(-len(self.nodes) // 2)})
        starts: Counter[tuple[str, ...]] = Counter()
        for node, unit in self.unit.items():
            if len(self.buses[node]) == 1:
                taken[f"{self.buses[node][0]} bus"] += 1
            if unit:
                starts[tuple(each.name for each in self.units[node])] += 1
                taken[f"read port {self.port[unit.name]}"] += 1
        intervals = {unit.name: unit.interval for units in self.units.values() for unit in units}
        return {**taken, **{names[0]: -(-count // len(names)) * intervals[names[0]] for names, count in starts.items()}}


class _Attempt:
    """A modulo reservation table that fills."""

    def __init__(self, problem, interval):
        self.problem, self.interval = problem, interval
        self.issue: dict[Node, int] = {}
        self.bus: dict[Node, str] = {}
        self.taken: dict[tuple, Node | None] = {}
        self.slow: dict[Node, str] = {}
        self.patience = PATIENCE

    def place(self, priority, rng):
        """Steps of all nodes, or None; the node of the lowest priority among those whose readers are placed first."""
        problem = self.problem
        grids = self._grids(rng)
        if grids is None:
            return None
        number = {node: index for index, node in enumerate(problem.nodes)}
        waiting = {node: len(problem.readers[node]) for node in problem.nodes}
        queue = [(priority[node], number[node]) for node in problem.nodes if not waiting[node]]
        heapify(queue)
        while queue:
            node = problem.nodes[heappop(queue)[1]]
            unit = problem.unit[node]
            if unit and unit.interval > 1:
                cycle, name = max((self._latest(node) - (self._latest(node) - start) % self.interval, each.name)
                                  for each in problem.units[node] for start in grids[each.name])
                grids[name].remove(cycle % self.interval)
                self.issue[node], self.bus[node], self.slow[node] = cycle, "main", name
            elif not self._find(node, DEPTH):
                return None
            for operand, _ in problem.operands[node]:
                waiting[operand] -= 1
                if not waiting[operand]:
                    heappush(queue, (priority[operand], number[operand]))
        for settled in range(ROUNDS):
            self._settle(reverse=settled % 2 == 1)
        return self._steps()

    def _settle(self, *, reverse):
        """Move steps, one after another, to where their operands and results fill the memories least.

        What waits for the end without need, and keeps its operands for it, does not any more.
        """
        problem = self.problem
        movable = [node for node in problem.nodes if problem.unit[node] and problem.unit[node].interval == 1]
        for node in sorted(movable, key=self.issue.__getitem__, reverse=reverse):
            old = self.issue[node], self.bus[node]
            self._take(node)
            # Until when each operand is kept in any case, and what a cycle more of it costs.
            kept = [(max((self.issue[reader] for reader, _ in problem.readers[operand] if reader is not node),
                         default=self.issue[operand]), COST[self.bus[operand]])
                    for operand, _ in problem.operands[node]]
            wanted = max((self.issue[reader] for reader, _ in problem.readers[node]), default=None)
            earliest = max((self.issue[operand] + problem.delay[operand] + wait
                            for operand, wait in problem.operands[node]), default=old[0])
            latest = old[0] if wanted is None else self._latest(node)

            def cost(cycle, bus, kept=kept, wanted=wanted):
                own = 0 if wanted is None else COST[bus] * (wanted - cycle)
                return own + sum(each * max(cycle - other, 0) for other, each in kept)

            _, cycle, bus = min((cost(cycle, bus), cycle, bus)
                                for cycle in range(earliest, latest + 1) for bus in problem.buses[node]
                                if (cycle, bus) == old or self.taken.keys().isdisjoint(self._slots(node, cycle, bus)))
            self._put(node, cycle, bus)

    def _grids(self, rng):
        """Slow unit to the cycles in which it may start, reserved on port and bus; None if there is no room."""
        grids: dict[str, set[int]] = {}
        slow = {unit.name: unit for units in self.problem.units.values() for unit in units if unit.interval > 1}
        for unit in slow.values():
            choices = []
            for phase in range(self.interval):
                starts = {(phase + cell * unit.interval) % self.interval
                          for cell in range(self.interval // unit.interval)}
                slots: set[tuple] = {("port", self.problem.port[unit.name], start) for start in starts}
                slots |= {("main", (start + unit.latency + 1) % self.interval) for start in starts}
                if self.taken.keys().isdisjoint(slots):
                    choices.append((starts, slots))
            if not choices:
                return None
            grids[unit.name], slots = rng.choice(choices)
            self.taken |= dict.fromkeys(slots)
        return grids

    def _steps(self):
        """The steps, with cycles counted from the begin of the update; None if some value waits for too long."""
        problem = self.problem
        begin = min(cycle - (FIRST_ISSUE if problem.unit[node] else FIRST_INPUT) for node, cycle in self.issue.items())
        inputs = {self.issue[node] % self.interval for node in problem.nodes if not problem.unit[node]}
        while (begin % self.interval) in inputs:
            begin -= 1
        steps = []
        for node, cycle in self.issue.items():
            unit, issue = problem.unit[node], cycle - begin
            if not unit:
                # Inputs are there for one interval only.
                issue %= self.interval
            for reader, wait in problem.readers[node]:
                most = self.interval if wait == CONDITION_DELAY else 2 * self.interval
                if self.issue[reader] - begin - issue - problem.delay[node] > most:
                    return None
            name = self.slow.get(node, unit.name if unit else "input")
            steps.append(Step(node, name, issue, issue + problem.delay[node], bus=self.bus[node]))
        return tuple(sorted(steps, key=lambda step: step.issue))

    def _latest(self, node):
        return min((self.issue[reader] - wait for reader, wait in self.problem.readers[node] if reader in self.issue),
                   default=0) - self.problem.delay[node]

    def _cycles(self, node):
        """Cycles to try, the best first: one interval of them, for then they repeat."""
        latest = self._latest(node)
        earliest = max((self.issue[operand] + self.problem.delay[operand] + wait
                        for operand, wait in self.problem.operands[node] if operand in self.issue),
                       default=latest - self.interval + 1)
        return range(latest, max(earliest, latest - self.interval + 1) - 1, -1)

    def _slots(self, node, cycle, bus):
        """What a node takes of the table."""
        slots: list[tuple] = [(bus, (cycle + self.problem.delay[node]) % self.interval)]
        if self.problem.unit[node]:
            slots.append(("port", self.problem.port[self.problem.unit[node].name], cycle % self.interval))
        return slots

    def _put(self, node, cycle, bus):
        self.issue[node], self.bus[node] = cycle, bus
        self.taken |= dict.fromkeys(self._slots(node, cycle, bus), node)

    def _take(self, node):
        for slot in self._slots(node, self.issue.pop(node), self.bus.pop(node)):
            del self.taken[slot]

    def _find(self, node, depth):
        """Place a node, and for its sake up to ``depth`` others anew; whether there is a place."""
        choices = [(cycle, bus) for cycle in self._cycles(node) for bus in self.problem.buses[node]]
        for cycle, bus in choices:
            if self.taken.keys().isdisjoint(self._slots(node, cycle, bus)):
                self._put(node, cycle, bus)
                return True
        if not depth:
            return False
        for cycle, bus in choices:
            if not self.patience:
                return False
            self.patience -= 1
            owners = {self.taken[slot] for slot in self._slots(node, cycle, bus) if slot in self.taken}
            (owner, *others) = owners
            if others or owner is None:
                continue
            place = self.issue[owner], self.bus[owner]
            self._take(owner)
            self._put(node, cycle, bus)
            if self._find(owner, depth - 1):
                return True
            self._take(node)
            self._put(owner, *place)
        return False
