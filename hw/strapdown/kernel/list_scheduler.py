"""The shortest schedule of one update: list scheduling."""

import random
from heapq import heapify, heappop, heappush
from itertools import accumulate
from typing import NamedTuple

from .machine import BUSES, Machine, Problem, kept, reads
from .schedule import Schedule, Step
from .trace import Graph, Node

__all__ = ["list_schedule"]


def list_schedule(graph: Graph, machine: Machine) -> Schedule:
    """Place every node of a graph in time: list scheduling with justification, many times over.

    A result with a single reader does not need the memory if the reader is issued when the result comes out. Such
    nodes are joined into chains, and each chain is placed as a whole. In the order of the longest path to the end, each
    chain takes the earliest free cycle. Then all chains are moved as late as possible, beginning with the last one, and
    back to as early as possible, beginning with the first one. This is repeated as long as the schedule becomes
    shorter. It moves operations that are not urgent out of the crowded first cycles, which the critical path can then
    use (Valls, Ballestín and Quintanilla, "Justification and RCPSP", 2005). The whole is repeated from priorities with
    small random changes, the same in every run; the shortest schedule is chosen.

    Parameters
    ----------
    graph : Graph
    machine : UpdateMachine

    Returns
    -------
    Schedule
        Verified.
    """
    table = _Table(graph, machine)
    bound = max(table.lengths().values())
    rng = random.Random(SEED)
    best = None
    for attempt in range(ATTEMPTS):
        spread = 0.3 * attempt / ATTEMPTS
        places = table.pack([-table.to_go[chain[0]] * (1 + rng.uniform(-spread, spread)) for chain in table.chains])
        for _ in range(ROUNDS):
            late = table.pack([-places[chain[-1]].write for chain in table.chains], late=True)
            shorter = table.pack([late[chain[0]].issue for chain in table.chains])
            if _length(shorter) >= _length(places):
                break
            places = shorter
        if best is None or _length(places) < _length(best):
            best = places
        if _length(best) <= bound:
            break
    assert best is not None
    result = Schedule(graph, machine, tuple(sorted(_steps(graph, machine, best), key=lambda step: step.issue)))
    result.verify()
    return result


ATTEMPTS = 48
"""Number of starts of the scheduler; it stops earlier if a schedule meets the bound."""

SEED = 3
"""Seed of the random changes: one with short schedules of the named configurations."""

ROUNDS = 20
"""Greatest number of justifications in an attempt; about five are usual."""


REGISTER = "register"
"""The register before the buses among the resources in a reservation table."""


class _Place(NamedTuple):
    """A node in time: the fields of its Step. The first cycle may have any number."""

    unit: str
    issue: int
    write: int
    bus: str


def _length(places):
    return 1 + max(place.write for place in places.values()) - min(place.issue for place in places.values())


def _steps(graph, machine, places):
    """The steps. A result is stored only if a reader takes it from memory, or if the readers could hide that it is
    not finite; constants are finite."""
    stored = kept(graph)
    for node, place in places.items():
        for read in reads(node):
            hides = not node.spreads and read.node.operation != "constant"
            if read.node in places and (hides or not machine.forwards(place.issue - places[read.node].write, read)):
                stored.add(read.node)
    # The address of the first operand is needed before the cycle in which the operand is fetched.
    first = min(place.issue for place in places.values()) - machine.lead
    return [Step(node, place.unit, place.issue - first, place.write - first, node in stored, place.bus)
            for node, place in places.items()]


Chain = tuple[Node, ...]
_Link = tuple[int, Node, int, int]


class _Table(Problem):
    """A graph whose nodes are joined into chains, and the reservation tables in which they are placed.

    Chains have numbers, and what ``pack`` asks of a chain is in lists: it places all chains hundreds of times.
    """

    def __init__(self, graph, machine):
        super().__init__(graph, machine)
        self.chains = self._chains()
        number = {node: index for index, chain in enumerate(self.chains) for node in chain}
        self.ahead, self.behind = (
            [{number[other] for node in chain for other, _ in edges[node]} - {index}
             for index, chain in enumerate(self.chains)] for edges in (self.operands, self.readers))
        # Cycles from the issue of the first node to the last result.
        self.span: list[int] = []
        # Whether a chain's result passes the register before the buses.
        self.through = [machine.shares_register(chain[-1]) for chain in self.chains]
        # Each node with its issue relative to that of the first node, and the names of its units.
        self.stages: list[list[tuple[Node, int, list[str]]]] = []
        # (cycle relative to the first issue, node of another chain, least wait, waits that are not allowed, one bit
        # for each) of the operands, counted from the issue, and of the readers, counted from the result.
        self.sources: list[list[_Link]] = []
        self.targets: list[list[_Link]] = []
        for index, chain in enumerate(self.chains):
            ends = [0, *accumulate(self.delay[node] for node in chain)]
            self.span.append(ends[-1])
            self.stages.append([(node, offset, [unit.name for unit in self.units[node]])
                                for node, offset in zip(chain, ends, strict=False)])
            for links, edges, offsets in (self.sources, self.operands, ends), (self.targets, self.readers, ends[1:]):
                links.append([(offset, other, machine.least_wait(read), self._gaps(read))
                              for node, offset in zip(chain, offsets, strict=False) for other, read in edges[node]
                              if number[other] != index])
        units = machine.pool.units
        self.sharing = {unit.name: [other.name for other in units if machine.port(other) == machine.port(unit)]
                        for unit in units}
        # Cycles around a start in which the unit cannot start, one bit for each, and how many of them are before it.
        self.near = {unit.name: ((1 << 2 * unit.interval - 1) - 1, unit.interval - 1) for unit in units}

    def _gaps(self, read):
        """Waits from the least one on that are not allowed, one bit for each. Those of the memory's delay and more are
        allowed."""
        machine = self.machine
        return sum(1 << wait for wait in range(machine.least_wait(read), machine.pool.memory_delay)
                   if not machine.may_wait(wait, read))

    def _chains(self) -> list[Chain]:
        """Chains of all nodes. A node is joined to its only reader if the node's result need not pass the bus.

        The reader's result must not be finite if the node's is not, because only results on the bus are checked.
        """
        wanted = kept(self.graph)
        before: dict[Node, Node] = {}
        for node in self.nodes:
            if not node.spreads:
                continue
            free = [operand for operand, read in self.operands[node]
                    if operand.spreads and operand not in wanted and not self.machine.least_wait(read)
                    and all(unit.direct for unit in self.units[operand])
                    and {reader for reader, _ in self.readers[operand]} == {node}]
            if free:
                before[node] = max(free, key=lambda operand: self.to_come[operand] + self.delay[operand])
        tied = set(before.values())
        chains = []
        for node in self.nodes:
            if node not in tied:
                chain = [node]
                while chain[-1] in before:
                    chain.append(before[chain[-1]])
                chains.append(tuple(reversed(chain)))
        return chains

    def pack(self, priority, *, late=False):
        """Places by node. The chains are placed in the earliest, or latest, free cycle, the lowest priority first."""
        ahead, behind = (self.ahead, self.behind)[::-1] if late else (self.ahead, self.behind)
        waiting = [len(chains) for chains in ahead]
        queue = [(priority[chain], chain) for chain, count in enumerate(waiting) if not count]
        heapify(queue)
        places: dict[Node, _Place] = {}
        # Cycles in which a unit cannot start, or a bus or the register before them is taken, one bit for each.
        full = dict.fromkeys((*self.sharing, *BUSES, REGISTER), 0)
        while queue:
            chain = heappop(queue)[1]
            self._place(chain, places, full, late)
            for other in behind[chain]:
                waiting[other] -= 1
                if not waiting[other]:
                    heappush(queue, (priority[other], other))
        assert len(places) == len(self.nodes)
        return places

    def _place(self, chain, places, full, late):
        """Add the places of a chain's nodes to ``places``, and their resources to ``full``.

        Cycles of ``full`` count backwards if the chain goes to the latest cycle. So they are never negative, and the
        search for a place goes upwards in both directions.
        """
        if late:
            sign, least = -1, self.span[chain]
            limits = [(offset - places[other].issue, wait, gaps) for offset, other, wait, gaps in self.targets[chain]]
        else:
            sign, least = 1, 0
            limits = [(places[other].write - offset, wait, gaps) for offset, other, wait, gaps in self.sources[chain]]
        if limits:
            least = max(cycle + wait for cycle, wait, _ in limits)
        taken = self._taken(chain, full, sign) >> least
        for cycle, _, gaps in limits:
            taken |= _moved(gaps, least - cycle)
        while True:
            # The lowest clear bit is the next cycle that may be free.
            step = (~taken & taken + 1).bit_length() - 1
            taken >>= step
            least += step
            if found := self._ways(chain, full, sign, least):
                break
            taken |= 1
        places.update(found)

    def _taken(self, chain, full, sign):
        """Cycles in which the chain cannot start because one of its resources is taken, one bit per cycle."""
        taken = 0
        for _, offset, units in self.stages[chain]:
            if units:
                busy = -1
                for unit in units:
                    busy &= full[unit]
                taken |= _moved(busy, sign * offset)
        busy = -1
        for bus in self.buses[self.chains[chain][-1]]:
            busy &= full[bus]
        if self.through[chain]:
            busy |= full[REGISTER]
        return taken | _moved(busy, sign * self.span[chain])

    def _ways(self, chain, full, sign, start):
        """Place of each node of a chain that starts in a cycle; their resources enter ``full``.

        None if a resource is not free; then ``full`` does not change.
        """
        before, names = full.copy(), []
        for node, offset, units in self.stages[chain]:
            if not units:
                names.append("input" if node.operation == "input" else "constant")
                continue
            issue = start + sign * offset
            for name in units:
                if not full[name] >> issue & 1:
                    break
            else:
                full.update(before)
                return None
            names.append(name)
            for other in self.sharing[name]:
                full[other] |= 1 << issue
            near, width = self.near[name]
            full[name] |= _moved(near, width - issue)
        write = start + sign * self.span[chain]
        last = next(bus for bus in self.buses[self.chains[chain][-1]] if not full[bus] >> write & 1)
        full[last] |= 1 << write
        if self.through[chain]:
            full[REGISTER] |= 1 << write
        # Results inside a chain are forwarded.
        buses = [*["main"] * (len(names) - 1), last]
        return {node: _Place(name, sign * start + offset, sign * start + offset + self.delay[node], bus)
                for (node, offset, _), name, bus in zip(self.stages[chain], names, buses, strict=True)}


def _moved(mask, by):
    return mask >> by if by > 0 else mask << -by
