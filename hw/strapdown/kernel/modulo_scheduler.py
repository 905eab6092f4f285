"""A schedule in which an update begins once per interval: modulo scheduling."""

import random
from collections import Counter
from collections.abc import Hashable
from heapq import heapify, heappop, heappush

from .machine import BUSES, Machine, Problem
from .pool import Unit
from .schedule import Schedule, Step
from .trace import Graph, Node

__all__ = ["modulo_schedule"]


def modulo_schedule(graph: Graph, machine: Machine, interval: int | None = None) -> Schedule:
    """Place every node of a graph in time, so that an update can begin every ``interval`` cycles.

    Nodes are placed backwards, because next-state values are the most constrained and inputs the least. The node with
    the longest path from the start comes first. Each node takes the latest cycle that is early enough for its readers,
    and in which all its resources are free, modulo the interval. If no such cycle exists, the node takes the place of
    another node for which a new place is found; that node may in turn replace a third one. Units that are busy for
    several cycles start on a grid, for which ports and bus are reserved, so that their idle cycles are not scattered.
    In one cycle of the interval the main bus stays free: the engine writes a constant. This is repeated from priorities
    with small random changes, with other grids and other free cycles, the same in every run. The schedule with the
    fewest stages is chosen; among these, the one that keeps the least in side memories. If no attempt succeeds, all
    are repeated thoroughly: with reservations that end with the last operation on a unit, and with more searches.

    Parameters
    ----------
    graph : Graph
    machine : StreamMachine
    interval : int or None
        Not less than the cycles for which any unit, bus or read port is taken. None: the shortest for which a schedule
        is found.

    Returns
    -------
    Schedule
        Verified. Raises: ValueError if none is found.

    Notes
    -----
    Source: Rau, Iterative modulo scheduling, MICRO-27, 1994; ejection instead of his eviction.
    """
    graph = machine.prepared(graph)
    problem = Problem(graph, machine)
    resource, least = max(problem.intervals().items(), key=lambda bound: bound[1])
    if interval is None:
        return _shortest(problem, least)
    if interval < least:
        raise ValueError(f"interval must be at least {least}, which {resource} needs, not {interval!r}")
    result = _scheduled(problem, interval)
    if result is None:
        raise ValueError(f"interval must be longer than {interval!r}: no schedule was found")
    return result


def _shortest(problem, least):
    """The schedule of a short interval: a search upwards from ``least`` in growing steps, then by bisection."""
    precision = 1 + least // 128
    failed, step = least - 1, 1
    while (result := _scheduled(problem, failed + step)) is None:
        failed, step = failed + step, 2 * step if step > 1 else 1 + precision // 2
    while result.interval - failed > precision:
        middle = (failed + result.interval) // 2
        if shorter := _scheduled(problem, middle):
            result = shorter
        else:
            failed = middle
    return result


def _scheduled(problem, interval):
    """The best schedule of an interval; None if none is found."""
    found = _schedules(problem, interval, thorough=False) or _schedules(problem, interval, thorough=True)
    if not found:
        return None
    result = min(found, key=_cost)
    result.verify()
    return result


def _schedules(problem, interval, *, thorough):
    """The schedules that all attempts find."""
    rng = random.Random(0)
    found = []
    attempts = max(2, min(ATTEMPTS[thorough], WORK // len(problem.nodes)))
    for attempt in range(attempts):
        spread = 0.4 * attempt / attempts
        priority = {node: -(problem.to_come[node] + problem.delay[node]) * (1 + rng.uniform(-spread, spread))
                    for node in problem.nodes}
        if steps := _Attempt(problem, interval, thorough=thorough).place(priority, rng, 3 * attempt % interval):
            found.append(Schedule(problem.graph, problem.machine, steps, interval))
    return found


def _cost(schedule):
    """Stages, and cycles for which values are kept in the side memories and in the main memory."""
    kept = {aside: sum(schedule.last_read[node] - write for node, write in schedule.written.items()
                       if node in schedule.last_read and (node in schedule.aside) == aside) for aside in (True, False)}
    return schedule.stages, kept[True], kept[False]


ATTEMPTS, WORK = (16, 4), 10_000
"""Number of starts, and of thorough starts; and the total number of nodes that are placed, so that large graphs get
fewer attempts."""

PATIENCE = 3000, 6000
"""Greatest number of searches for a new place of a placed node, in an attempt and in a thorough attempt."""

ROUNDS = 3
"""Number of passes that move steps to cycles in which fewer values have to be kept."""

COST = {bus: 1 if bus == "main" else 3 for bus in BUSES}
"""Cost of a value per cycle that the memory of a bus keeps it: side memories are small."""

DEPTH = 2
"""Greatest number of nodes that may have to move for one node."""

Place = tuple[int, str, Unit | None]
"""Cycle of issue, bus of the result, and unit; None for an input."""

Slot = tuple[Hashable, int]
"""A bus or a read port, and a cycle of the interval."""


class _Attempt:
    """A modulo reservation table: ``taken`` has the owners of slots, ``full`` one bit per cycle."""

    def __init__(self, problem, interval, *, thorough):
        self.problem, self.interval = problem, interval
        least = problem.machine.least_wait
        self.operands = {node: [(other, least(read)) for other, read in edges]
                         for node, edges in problem.operands.items()}
        self.readers = {node: [(other, least(read)) for other, read in edges]
                        for node, edges in problem.readers.items()}
        self.places: dict[Node, Place] = {}
        self.taken: dict[Slot, Node | None] = {}
        self.full: dict[Hashable, int] = {}
        self.patience = PATIENCE[thorough]
        self.thorough = thorough

    def place(self, priority, rng, free):
        """Steps of all nodes, or None. Of the nodes whose readers are placed, the lowest priority is next.

        In the cycle ``free`` of the interval the main bus stays free, for a constant.
        """
        problem = self.problem
        self._occupy([("main", free)], None)
        grids = self._grids(rng)
        if grids is None:
            return None
        to_place = Counter(tuple(unit.name for unit in problem.units[node]) for node in problem.nodes)
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
                to_place[tuple(units)] -= 1
                if self.thorough and not to_place[tuple(units)]:
                    self._release(grids, units.values())
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
        """Move steps, one after another, to the cycles in which their operands and results need the least memory.

        Steps that were placed late without need, and so kept their operands for long, move to earlier cycles.
        """
        movable = [node for node in self.problem.nodes if (unit := self.places[node][2]) and unit.interval == 1]
        for node in sorted(movable, key=self._issue, reverse=reverse):
            old = self.places[node]
            self._take(node)
            # The cycle until which each operand is kept in any case, and the cost of one more cycle.
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

            ways = [(bus, unit, self._free(node, bus, unit)) for bus, unit in self._ways(node)]
            _, cycle, _, way = min(
                (cost(cycle, bus), cycle, bus, way) for cycle in range(earliest, latest + 1)
                for way, (bus, _, free) in enumerate(ways) if free >> cycle % self.interval & 1)
            self._put(node, (cycle, *ways[way][:2]))

    def _grids(self, rng):
        """Maps each slow unit to the cycles in which it may start, reserved on port and bus; None if they are full."""
        grids: dict[str, set[int]] = {}
        slow = {unit.name: unit for units in self.problem.units.values() for unit in units if unit.interval > 1}
        for unit in slow.values():
            choices = []
            for phase in range(self.interval):
                starts = {(phase + cell * unit.interval) % self.interval
                          for cell in range(self.interval // unit.interval)}
                slots = self._reserved(unit, starts)
                if self.taken.keys().isdisjoint(slots):
                    choices.append((starts, slots))
            if not choices:
                return None
            grids[unit.name], slots = rng.choice(choices)
            self._occupy(slots, None)
        return grids

    def _reserved(self, unit, starts):
        """Slots of port and bus that a unit takes if it starts in all these cycles."""
        slots: set[Slot] = {(self.problem.machine.port(unit), start) for start in starts}
        return slots | {("main", (start + unit.latency + 1) % self.interval) for start in starts}

    def _release(self, grids, units):
        """Release the reservations of units that have no further operations."""
        for unit in units:
            self._vacate(self._reserved(unit, grids[unit.name]))

    def _steps(self):
        """The steps, with cycles counted from the start of the update."""
        machine = self.problem.machine
        begin = min(cycle - (machine.first_issue if unit else machine.first_input)
                    for cycle, _, unit in self.places.values())
        inputs = {cycle % self.interval for cycle, _, unit in self.places.values() if not unit}
        while (begin % self.interval) in inputs:
            begin -= 1
        steps = []
        for node, (cycle, bus, unit) in self.places.items():
            issue = cycle - begin
            if not unit:
                # Inputs are valid for one interval only.
                issue %= self.interval
            steps.append(Step(node, unit.name if unit else "input", issue, issue + self.problem.delay[node], bus=bus))
        return tuple(sorted(steps, key=lambda step: step.issue))

    def _latest(self, node):
        return min((self._issue(reader) - wait for reader, wait in self.readers[node] if reader in self.places),
                   default=0) - self.problem.delay[node]

    def _earliest(self, node):
        """First cycle to try: an interval before the latest one, because slots repeat, but not before the operands."""
        before = max((self._issue(operand) + self.problem.delay[operand] + wait
                      for operand, wait in self.operands[node] if operand in self.places), default=None)
        least = self._latest(node) - self.interval + 1
        return least if before is None else max(before, least)

    def _ways(self, node):
        """Buses and units that a node can take, in order of preference."""
        machine = self.problem.machine
        return [(bus, unit) for bus in self.problem.buses[node] for unit in self.problem.units[node] or [None]
                if unit is None or bus in machine.links(unit)]

    def _free(self, node, bus, unit):
        """Cycles of the interval in which port and bus are free for a node, one bit per cycle."""
        shift, everything = self.problem.delay[node] % self.interval, (1 << self.interval) - 1
        full = self.full.get(bus, 0)
        full = full >> shift | full << (self.interval - shift)
        if unit:
            full |= self.full.get(self.problem.machine.port(unit), 0)
        return ~full & everything

    def _slots(self, node, place):
        """Slots of the table that a node takes."""
        cycle, bus, unit = place
        slots: list[Slot] = [(bus, (cycle + self.problem.delay[node]) % self.interval)]
        if unit:
            slots.append((self.problem.machine.port(unit), cycle % self.interval))
        return slots

    def _occupy(self, slots, node):
        for resource, cycle in slots:
            self.taken[resource, cycle] = node
            self.full[resource] = self.full.get(resource, 0) | 1 << cycle

    def _vacate(self, slots):
        for resource, cycle in slots:
            del self.taken[resource, cycle]
            self.full[resource] &= ~(1 << cycle)

    def _put(self, node, place):
        self.places[node] = place
        self._occupy(self._slots(node, place), node)

    def _take(self, node):
        self._vacate(self._slots(node, self.places.pop(node)))

    def _latest_free(self, node, earliest, latest):
        """The place with the latest free cycle, among less than an interval of cycles; None if none is free."""
        best = None
        for bus, unit in self._ways(node):
            free = self._free(node, bus, unit)
            # The latest cycle becomes the highest bit.
            turn = self.interval - 1 - latest % self.interval
            free = (free << turn | free >> (self.interval - turn)) & ((1 << self.interval) - 1)
            cycle = latest - (self.interval - free.bit_length())
            if free and cycle >= earliest and (best is None or cycle > best[0]):
                best = cycle, bus, unit
        return best

    def _find(self, node, depth):
        """Place a node, and move up to ``depth`` other nodes for it; True if a place was found."""
        earliest, latest = self._earliest(node), self._latest(node)
        if place := self._latest_free(node, earliest, latest):
            self._put(node, place)
            return True
        if not depth:
            return False
        ways = self._ways(node)
        for place in ((cycle, *way) for cycle in range(latest, earliest - 1, -1) for way in ways):
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
