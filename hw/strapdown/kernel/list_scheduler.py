"""The shortest schedule of one update: list scheduling."""

import random
from dataclasses import replace
from heapq import heapify, heappop, heappush

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
        ahead, behind = (self.readers, self.operands) if late else (self.operands, self.readers)
        waiting = {chain: len({self.chain_of[other] for node in chain for other, _ in ahead[node]} - {chain})
                   for chain in self.chains}
        number = {chain: index for index, chain in enumerate(self.chains)}
        queue = [(priority[chain], number[chain]) for chain in self.chains if not waiting[chain]]
        heapify(queue)
        places: dict[Node, Step] = {}
        taken: set[tuple] = set()
        while queue:
            chain = self.chains[heappop(queue)[1]]
            self._place(chain, places, taken, late)
            for other in {self.chain_of[other] for node in chain for other, _ in behind[node]} - {chain}:
                waiting[other] -= 1
                if not waiting[other]:
                    heappush(queue, (priority[other], number[other]))
        assert len(places) == len(self.nodes)
        # The address of the first operand goes out before the cycle in which it comes.
        first = min(step.issue for step in places.values()) - self.machine.lead
        return {node: replace(step, issue=step.issue - first, write=step.write - first)
                for node, step in places.items()}

    def _place(self, chain, places, taken, late):
        """Add the steps of a chain to ``places``, and what they take up to ``taken``."""
        offsets = [0]
        for node in chain[:-1]:
            offsets.append(offsets[-1] + self.delay[node])
        inside = set(chain)
        limits = []  # (offset of an issue or a result, cycle of the other end, how it is read)
        for node, offset in zip(chain, offsets, strict=True):
            if late:
                limits += [(offset + self.delay[node], places[reader].issue, read)
                           for reader, read in self.readers[node] if reader not in inside]
            else:
                limits += [(offset, places[operand].write, read)
                           for operand, read in self.operands[node] if operand not in inside]
        if late:
            cycle = min((other - offset - self.machine.least_wait(read) for offset, other, read in limits),
                        default=-offsets[-1] - self.delay[chain[-1]])
        else:
            cycle = max((other - offset + self.machine.least_wait(read) for offset, other, read in limits),
                        default=0)
        sign = -1 if late else 1
        while True:
            if all(self.machine.may_wait(sign * (cycle + offset - other), read)
                   for offset, other, read in limits):
                needs = self._needs(chain, offsets, cycle, taken)
                if needs is not None:
                    break
            cycle += sign
        units, bus, slots = needs
        taken |= slots
        for node, offset, unit in zip(chain, offsets, units, strict=True):
            places[node] = Step(node, unit.name if unit else "input", cycle + offset, cycle + offset + self.delay[node],
                                bus=bus if node is chain[-1] else "main")

    def _needs(self, chain, offsets, cycle, taken):
        """For a chain that starts in ``cycle``: units of its nodes, bus of its last result, slots they take up.

        None if they are not free.
        """
        write = cycle + offsets[-1] + self.delay[chain[-1]]
        bus = next((bus for bus in self.buses[chain[-1]] if (bus, write) not in taken), None)
        if bus is None:
            return None
        slots: set[tuple] = {(bus, write)}
        chosen = []
        for node, offset in zip(chain, offsets, strict=True):
            issue = cycle + offset
            for unit in self.units[node]:
                wanted: set[tuple] = {("port", self.machine.port(unit), issue),
                                      *((unit.name, issue + busy) for busy in range(unit.interval))}
                if taken.isdisjoint(wanted) and slots.isdisjoint(wanted):
                    break
            else:
                if self.units[node]:
                    return None
                unit, wanted = None, set()
            slots |= wanted
            chosen.append(unit)
        return chosen, bus, slots
