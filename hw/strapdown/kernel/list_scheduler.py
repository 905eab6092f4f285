"""The shortest schedule of one update: list scheduling."""

import random
from collections.abc import Hashable
from dataclasses import replace
from heapq import heapify, heappop, heappush
from itertools import accumulate

from .machine import Machine, Problem, kept, reads
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
        places = table.pack({chain: -table.to_go[chain[0]] * (1 + rng.uniform(-spread, spread))
                             for chain in table.chains})
        for _ in range(ROUNDS):
            late = table.pack({chain: -places[chain[-1]].write for chain in table.chains}, late=True)
            shorter = table.pack({chain: late[chain[0]].issue for chain in table.chains})
            if _length(shorter) >= _length(places):
                break
            places = shorter
        if best is None or _length(places) < _length(best):
            best = places
        if _length(best) <= bound:
            break
    assert best is not None
    result = Schedule(graph, machine, tuple(sorted(_stored(graph, machine, best), key=lambda step: step.issue)))
    result.verify()
    return result


ATTEMPTS = 48
"""Number of starts of the scheduler; it stops earlier if a schedule meets the bound."""

SEED = 3
"""Seed of the random changes: one with short schedules of the named configurations."""

ROUNDS = 20
"""Greatest number of justifications in an attempt; about five are usual."""


def _length(places):
    return 1 + max(step.write for step in places.values()) - min(step.issue for step in places.values())


def _stored(graph, machine, places):
    """The steps. A result is stored only if a reader takes it from memory, or if the readers could hide that it is
    not finite; constants are finite."""
    stored = kept(graph)
    for step in places.values():
        for read in reads(step.node):
            hides = not step.node.spreads and read.node.operation != "constant"
            if read.node in places and (hides or not machine.forwards(step.issue - places[read.node].write, read)):
                stored.add(read.node)
    return [replace(step, stored=step.node in stored) for step in places.values()]


Chain = tuple[Node, ...]


class _Table(Problem):
    """A graph whose nodes are joined into chains, and the reservation tables in which they are placed."""

    def __init__(self, graph, machine):
        super().__init__(graph, machine)
        self.chains = self._chains()
        self.chain_of = {node: chain for chain in self.chains for node in chain}
        self.number = {chain: index for index, chain in enumerate(self.chains)}
        self.ahead, self.behind = (
            {chain: {self.chain_of[other] for node in chain for other, _ in edges[node]} - {chain}
             for chain in self.chains} for edges in (self.operands, self.readers))
        # Each node with its issue relative to that of the first node; cycles to the last result.
        self.offsets: dict[Chain, list[tuple[Node, int]]] = {}
        self.span: dict[Chain, int] = {}
        for chain in self.chains:
            ends = [0, *accumulate(self.delay[node] for node in chain)]
            self.offsets[chain], self.span[chain] = list(zip(chain, ends, strict=False)), ends[-1]

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
        """Steps by node. The chains are placed in the earliest, or latest, free cycle, the lowest priority first.

        The first cycle may have any number.
        """
        ahead, behind = (self.ahead, self.behind)[::-1] if late else (self.ahead, self.behind)
        waiting = {chain: len(ahead[chain]) for chain in self.chains}
        queue = [(priority[chain], self.number[chain]) for chain in self.chains if not waiting[chain]]
        heapify(queue)
        places: dict[Node, Step] = {}
        full: dict[Hashable, int] = {}
        while queue:
            chain = self.chains[heappop(queue)[1]]
            self._place(chain, places, full, late)
            for other in behind[chain]:
                waiting[other] -= 1
                if not waiting[other]:
                    heappush(queue, (priority[other], self.number[other]))
        assert len(places) == len(self.nodes)
        # The address of the first operand is needed before the cycle in which the operand is fetched.
        first = min(step.issue for step in places.values()) - self.machine.lead
        return {node: Step(node, step.unit, step.issue - first, step.write - first, bus=step.bus)
                for node, step in places.items()}

    def _place(self, chain, places, full, late):
        """Add the steps of a chain to ``places``, and their resources to ``full``.

        Cycles of ``full`` count backwards if the chain goes to the latest cycle. So they are never negative, and the
        search for a place goes upwards in both directions.
        """
        limits = []  # (offset of an issue or a result, cycle of the other end, kind of read)
        for node, offset in self.offsets[chain]:
            if late:
                limits += [(offset + self.delay[node], places[reader].issue, read)
                           for reader, read in self.readers[node] if self.chain_of[reader] is not chain]
            else:
                limits += [(offset, places[operand].write, read)
                           for operand, read in self.operands[node] if self.chain_of[operand] is not chain]
        sign = -1 if late else 1
        least = max((sign * (other - offset) + self.machine.least_wait(read) for offset, other, read in limits),
                    default=self.span[chain] if late else 0)
        taken = self._taken(chain, full, sign) >> least
        while True:
            # The lowest clear bit is the next cycle that may be free.
            step = (~taken & taken + 1).bit_length() - 1
            taken >>= step
            least += step
            if all(self.machine.may_wait(least - sign * (other - offset), read) for offset, other, read in limits) \
                    and (found := self._ways(chain, full, sign, least)):
                break
            taken |= 1
        for node, unit, bus, issue in found:
            name = unit.name if unit else "input" if node.operation == "input" else "constant"
            places[node] = Step(node, name, issue, issue + self.delay[node], bus=bus)

    def _taken(self, chain, full, sign):
        """Cycles in which the chain cannot start because one of its resources is taken, one bit per cycle."""
        def moved(mask, by):
            return mask >> by if by > 0 else mask << -by

        taken = 0
        for node, offset in self.offsets[chain]:
            if self.units[node]:
                busy = -1
                for unit in self.units[node]:
                    busy &= full.get(self.machine.port(unit), 0) | full.get(unit.name, 0)
                taken |= moved(busy, sign * offset)
        busy = -1
        for bus in self.buses[chain[-1]]:
            busy &= full.get(bus, 0)
        return taken | moved(busy, sign * self.span[chain])

    def _ways(self, chain, full, sign, start):
        """Node, unit, bus and issue of each node of a chain that starts in a cycle; their resources enter ``full``.

        None if a resource is not free; then ``full`` does not change.
        """
        before, found = dict(full), []
        for node, offset in self.offsets[chain]:
            issue = start + sign * offset
            for unit in self.units[node]:
                port = self.machine.port(unit)
                if not (full.get(port, 0) | full.get(unit.name, 0)) >> issue & 1:
                    full[port] = full.get(port, 0) | 1 << issue
                    # No other start may be so near that the unit is still busy.
                    near, first = (1 << 2 * unit.interval - 1) - 1, issue - unit.interval + 1
                    full[unit.name] = full.get(unit.name, 0) | (near << first if first >= 0 else near >> -first)
                    break
            else:
                if self.units[node]:
                    full.clear()
                    full.update(before)
                    return None
                unit = None
            found.append((node, unit, "main", sign * issue))
        write = start + sign * self.span[chain]
        bus = next(bus for bus in self.buses[chain[-1]] if not full.get(bus, 0) >> write & 1)
        full[bus] = full.get(bus, 0) | 1 << write
        node, unit, _, issue = found[-1]
        return [*found[:-1], (node, unit, bus, issue)]
