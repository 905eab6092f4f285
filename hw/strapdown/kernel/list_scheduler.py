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

    A result with a single reader need not touch memory if the reader is issued when it comes out, so such nodes are
    tied into chains that are placed as one. Chain after chain, the one with the longest way to go takes the earliest
    cycle that is free. Then, as long as the schedule gets shorter, all are moved as late as they can go, the last
    first, and back to as early as they can, the first first: what nobody waits for yet leaves the crowded first cycles
    to the critical path (Valls, Ballestín and Quintanilla, "Justification and RCPSP", 2005). This is repeated from
    priorities with small random changes, the same in every run; the shortest schedule wins.

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
    rng = random.Random(0)
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


ATTEMPTS = 24
"""How often the scheduler starts anew, if it does not meet the bound before."""

ROUNDS = 20
"""Most justifications in an attempt; a handful is usual."""


def _length(places):
    return 1 + max(step.write for step in places.values()) - min(step.issue for step in places.values())


def _stored(graph, machine, places):
    """The steps, each stored only if a reader finds it in memory, or would hide it if it were not finite."""
    stored = kept(graph)
    for step in places.values():
        for read in reads(step.node):
            if read.node in places and (not step.node.spreads
                                        or not machine.forwards(step.issue - places[read.node].write, read)):
                stored.add(read.node)
    return [replace(step, stored=step.node in stored) for step in places.values()]


Chain = tuple[Node, ...]


class _Table(Problem):
    """A graph whose nodes are tied into chains, and the reservation tables in which they are placed."""

    def __init__(self, graph, machine):
        super().__init__(graph, machine)
        self.chains = self._chains()
        self.chain_of = {node: chain for chain in self.chains for node in chain}
        self.number = {chain: index for index, chain in enumerate(self.chains)}
        self.ahead, self.behind = (
            {chain: {self.chain_of[other] for node in chain for other, _ in edges[node]} - {chain}
             for chain in self.chains} for edges in (self.operands, self.readers))
        # Each node with its issue after that of the first one; cycles to the last result.
        self.offsets: dict[Chain, list[tuple[Node, int]]] = {}
        self.span: dict[Chain, int] = {}
        for chain in self.chains:
            ends = [0, *accumulate(self.delay[node] for node in chain)]
            self.offsets[chain], self.span[chain] = list(zip(chain, ends, strict=False)), ends[-1]

    def _chains(self) -> list[Chain]:
        """All nodes, tied where a result's only reader spreads what is not finite, which is seen on the bus."""
        wanted = kept(self.graph)
        before: dict[Node, Node] = {}
        for node in self.nodes:
            if not node.spreads:
                continue
            free = [operand for operand, read in self.operands[node]
                    if operand.spreads and operand not in wanted and not self.machine.least_wait(read)
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
        """Steps by node, chain after chain placed in the earliest, or latest, free cycle, the lowest priority first.

        Cycles count from any number.
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
        # The address of the first operand goes out before the cycle in which it comes.
        first = min(step.issue for step in places.values()) - self.machine.lead
        return {node: Step(node, step.unit, step.issue - first, step.write - first, bus=step.bus)
                for node, step in places.items()}

    def _place(self, chain, places, full, late):
        """Add the steps of a chain to ``places``, and what they take up to ``full``.

        Cycles of ``full`` count backwards if the chain goes to the latest cycle: so they are never negative, and a
        place is sought upwards in both directions.
        """
        limits = []  # (offset of an issue or a result, cycle of the other end, how it is read)
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
            # The lowest bit that is not set is the next cycle that may be free.
            step = (~taken & taken + 1).bit_length() - 1
            taken >>= step
            least += step
            if all(self.machine.may_wait(least - sign * (other - offset), read) for offset, other, read in limits) \
                    and (found := self._ways(chain, full, sign, least)):
                break
            taken |= 1
        for node, unit, bus, issue in found:
            places[node] = Step(node, unit.name if unit else "input", issue, issue + self.delay[node], bus=bus)

    def _taken(self, chain, full, sign):
        """Cycles from which the chain cannot start because a single one of its resources is taken, a bit each."""
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
        """For a chain that starts in a cycle: node, unit, bus and issue of each of its nodes, now taken from ``full``.

        None if they are not free; then nothing is taken.
        """
        before, found = dict(full), []
        for node, offset in self.offsets[chain]:
            issue = start + sign * offset
            for unit in self.units[node]:
                port = self.machine.port(unit)
                if not (full.get(port, 0) | full.get(unit.name, 0)) >> issue & 1:
                    full[port] = full.get(port, 0) | 1 << issue
                    # No other start is so near that the unit would still be busy.
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
