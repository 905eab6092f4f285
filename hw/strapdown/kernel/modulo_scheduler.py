"""A schedule in which an update begins every so many cycles: modulo scheduling."""

import random
from heapq import heapify, heappop, heappush

from .machine import Machine, Problem
from .pool import Unit
from .schedule import Schedule, Step
from .trace import Graph, Node

__all__ = ["modulo_schedule"]


def modulo_schedule(graph: Graph, machine: Machine, interval: int) -> Schedule:
    """Place every node of a graph in time, so that an update can begin every ``interval`` cycles.

    Nodes are placed backwards, because next-state values are the most constrained and inputs the least. Node after
    node, the one with the longest way to come first, takes the latest cycle from which its readers are in time and in
    which all it needs is free, in this cycle and in all a multiple of the interval away. If there is none it takes the
    place of another node that finds a new one, which may in turn do so. Units that are busy for several cycles start on
    a grid, for which ports and bus are reserved, so that their idle cycles are not scattered. This is repeated from
    priorities with small random changes and other grids, the same in every run; the schedule with the fewest stages
    wins, and of these the one that keeps least in the side memory.

    Parameters
    ----------
    graph : Graph
    machine : StreamMachine
    interval : int
        At least as long as every unit, bus and read port is taken.

    Returns
    -------
    Schedule
        Verified. Raises: ValueError if none is found.

    Notes
    -----
    Source: Rau, Iterative modulo scheduling, MICRO-27, 1994; ejection instead of his eviction.
    """
    problem = Problem(graph, machine)
    resource, least = max(problem.intervals().items(), key=lambda bound: bound[1])
    if interval < least:
        raise ValueError(f"interval must be at least {least}, as long as the {resource} is taken, not {interval!r}")
    rng = random.Random(0)
    best = None
    for attempt in range(ATTEMPTS):
        spread = 0.4 * attempt / ATTEMPTS
        priority = {node: -(problem.to_come[node] + problem.delay[node]) * (1 + rng.uniform(-spread, spread))
                    for node in problem.nodes}
        steps = _Attempt(problem, interval).place(priority, rng)
        if steps is None:
            continue
        found = Schedule(graph, machine, steps, interval)
        lifetimes = {bus: sum(found.last_read[node] - write for node, write in found.written.items()
                              if node in found.last_read and found.bus[node] == bus) for bus in ("side", "main")}
        cost = found.stages, lifetimes["side"], lifetimes["main"]
        if best is None or cost < best[0]:
            best = cost, found
    if best is None:
        raise ValueError(f"interval must be longer than {interval!r}: no schedule was found")
    best[1].verify()
    return best[1]


ATTEMPTS = 16
"""How often the scheduler starts anew."""

PATIENCE = 3000
"""Most searches in an attempt for another place of a node that is placed already."""

ROUNDS = 3
"""How often steps are moved to where they keep the fewest values."""

COST = {"main": 1, "side": 3}
"""What a value costs for each cycle that it is kept in the memory of a bus: the side memory is small."""

DEPTH = 2
"""Most nodes that may have to move for one."""

Place = tuple[int, str, Unit | None]
"""Cycle of issue, bus of the result, and unit; None for an input."""


class _Attempt:
    """A modulo reservation table that fills."""

    def __init__(self, problem, interval):
        self.problem, self.interval = problem, interval
        least = problem.machine.least_wait
        self.operands = {node: [(other, least(read)) for other, read in edges]
                         for node, edges in problem.operands.items()}
        self.readers = {node: [(other, least(read)) for other, read in edges]
                        for node, edges in problem.readers.items()}
        self.places: dict[Node, Place] = {}
        self.taken: dict[tuple, Node | None] = {}
        self.patience = PATIENCE

    def place(self, priority, rng):
        """Steps of all nodes, or None; the node of the lowest priority among those whose readers are placed first."""
        problem = self.problem
        grids = self._grids(rng)
        if grids is None:
            return None
        number = {node: index for index, node in enumerate(problem.nodes)}
        waiting = {node: len(self.readers[node]) for node in problem.nodes}
        queue = [(priority[node], number[node]) for node in problem.nodes if not waiting[node]]
        heapify(queue)
        while queue:
            node = problem.nodes[heappop(queue)[1]]
            units = {unit.name: unit for unit in problem.units[node]}
            if grids.keys() & units:
                latest = self._latest(node)
                cycle, name = max((latest - (latest - start) % self.interval, name)
                                  for name in units for start in grids[name])
                grids[name].remove(cycle % self.interval)
                self.places[node] = cycle, "main", units[name]
            elif not self._find(node, DEPTH):
                return None
            for operand, _ in self.operands[node]:
                waiting[operand] -= 1
                if not waiting[operand]:
                    heappush(queue, (priority[operand], number[operand]))
        for settled in range(ROUNDS):
            self._settle(reverse=settled % 2 == 1)
        return self._steps()

    def _issue(self, node):
        return self.places[node][0]

    def _settle(self, *, reverse):
        """Move steps, one after another, to where their operands and results fill the memories least.

        What waits for the end without need, and keeps its operands for it, does not any more.
        """
        movable = [node for node in self.problem.nodes if (unit := self.places[node][2]) and unit.interval == 1]
        for node in sorted(movable, key=self._issue, reverse=reverse):
            old = self.places[node]
            self._take(node)
            # Until when each operand is kept in any case, and what a cycle more of it costs.
            kept = [(max((self._issue(reader) for reader, _ in self.readers[operand] if reader is not node),
                         default=self._issue(operand)), COST[self.places[operand][1]])
                    for operand, _ in self.operands[node]]
            wanted = max((self._issue(reader) for reader, _ in self.readers[node]), default=None)
            earliest = max((self._issue(operand) + self.problem.delay[operand] + wait
                            for operand, wait in self.operands[node]), default=old[0])
            latest = old[0] if wanted is None else self._latest(node)

            def cost(cycle, bus, kept=kept, wanted=wanted):
                own = 0 if wanted is None else COST[bus] * (wanted - cycle)
                return own + sum(each * max(cycle - other, 0) for other, each in kept)

            _, cycle, bus, index = min(
                (cost(cycle, bus), cycle, bus, index) for cycle in range(earliest, latest + 1)
                for bus in self.problem.buses[node] for index, unit in enumerate(self.problem.units[node])
                if self.taken.keys().isdisjoint(self._slots(node, (cycle, bus, unit))))
            self._put(node, (cycle, bus, self.problem.units[node][index]))

    def _grids(self, rng):
        """Slow unit to the cycles in which it may start, reserved on port and bus; None if there is no room."""
        grids: dict[str, set[int]] = {}
        slow = {unit.name: unit for units in self.problem.units.values() for unit in units if unit.interval > 1}
        for unit in slow.values():
            choices = []
            for phase in range(self.interval):
                starts = {(phase + cell * unit.interval) % self.interval
                          for cell in range(self.interval // unit.interval)}
                slots: set[tuple] = {("port", self.problem.machine.port(unit), start) for start in starts}
                slots |= {("main", (start + unit.latency + 1) % self.interval) for start in starts}
                if self.taken.keys().isdisjoint(slots):
                    choices.append((starts, slots))
            if not choices:
                return None
            grids[unit.name], slots = rng.choice(choices)
            self.taken |= dict.fromkeys(slots)
        return grids

    def _steps(self):
        """The steps, with cycles counted from the beginning of the update; None if a value waits for too long."""
        problem, machine = self.problem, self.problem.machine
        begin = min(cycle - (machine.first_issue if unit else machine.first_input)
                    for cycle, _, unit in self.places.values())
        inputs = {cycle % self.interval for cycle, _, unit in self.places.values() if not unit}
        while (begin % self.interval) in inputs:
            begin -= 1
        steps = []
        for node, (cycle, bus, unit) in self.places.items():
            issue = cycle - begin
            if not unit:
                # Inputs are there for one interval only.
                issue %= self.interval
            write = issue + problem.delay[node]
            if not all(machine.may_wait(self._issue(reader) - begin - write, read, self.interval)
                       for reader, read in problem.readers[node]):
                return None
            steps.append(Step(node, unit.name if unit else "input", issue, write, bus=bus))
        return tuple(sorted(steps, key=lambda step: step.issue))

    def _latest(self, node):
        return min((self._issue(reader) - wait for reader, wait in self.readers[node] if reader in self.places),
                   default=0) - self.problem.delay[node]

    def _cycles(self, node):
        """Cycles to try, the best first: one interval of them, for then they repeat."""
        latest = self._latest(node)
        earliest = max((self._issue(operand) + self.problem.delay[operand] + wait
                        for operand, wait in self.operands[node] if operand in self.places),
                       default=latest - self.interval + 1)
        return range(latest, max(earliest, latest - self.interval + 1) - 1, -1)

    def _slots(self, node, place):
        """What a node takes of the table."""
        cycle, bus, unit = place
        slots: list[tuple] = [(bus, (cycle + self.problem.delay[node]) % self.interval)]
        if unit:
            slots.append(("port", self.problem.machine.port(unit), cycle % self.interval))
        return slots

    def _put(self, node, place):
        self.places[node] = place
        self.taken |= dict.fromkeys(self._slots(node, place), node)

    def _take(self, node):
        for slot in self._slots(node, self.places.pop(node)):
            del self.taken[slot]

    def _find(self, node, depth):
        """Place a node, and for its sake up to ``depth`` others anew; whether there is a place."""
        choices: list[Place] = [(cycle, bus, unit) for cycle in self._cycles(node) for bus in self.problem.buses[node]
                                for unit in self.problem.units[node] or [None]]
        for place in choices:
            if self.taken.keys().isdisjoint(self._slots(node, place)):
                self._put(node, place)
                return True
        if not depth:
            return False
        for place in choices:
            if not self.patience:
                return False
            self.patience -= 1
            owners = {self.taken[slot] for slot in self._slots(node, place) if slot in self.taken}
            (owner, *others) = owners
            if others or owner is None:
                continue
            old = self.places[owner]
            self._take(owner)
            self._put(node, place)
            if self._find(owner, depth - 1):
                return True
            self._take(node)
            self._put(owner, old)
        return False
