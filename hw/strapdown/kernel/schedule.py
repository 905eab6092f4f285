"""When each operation starts, when its result is there, and whether memory has to keep it."""

import random
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heapify, heappop, heappush

from .pool import Pool
from .trace import Graph, Node

__all__ = ["BUSES", "Step", "Schedule", "schedule"]

BUSES = {"main": "result bus", "side": "side bus"}
"""What people call the buses."""


@dataclass(frozen=True)
class Step:
    """One node in time.

    ``unit`` is the unit that computes it; "input" for an input port, put on the result bus as
    it is; for a state word, the unit that puts its reset value back (written only in the first
    update after a reset). In cycle ``issue`` its operands are fetched, from memory or straight
    from where a result comes out in that very cycle; ``write`` is the cycle in which its own result
    can be on the result bus. ``stored`` tells whether it then goes into memory. ``bus`` is "main", or "side"
    for a bus that has a small memory of its own, without which results would queue.
    """

    node: Node
    unit: str
    issue: int
    write: int
    stored: bool = True
    bus: str = "main"


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

    @cached_property
    def written(self):
        """Node to the cycle in which its result is there."""
        return {step.node: step.write for step in self.steps}

    def forwarded(self, step, operand):
        """Whether ``step`` takes an operand straight from where it comes out, and not from memory."""
        return operand.node.operation != "state" and self.written.get(operand.node) == step.issue

    @cached_property
    def direct(self):
        """Names of the units whose results can be operands without the result bus."""
        return {unit.name for unit in self.pool.units if unit.direct}

    @cached_property
    def aside(self):
        """Nodes that are kept in the side memory."""
        return {step.node for step in self.steps if step.stored and step.bus == "side"}

    def on_bus(self, step):
        """Whether a step's result goes over a result bus."""
        return step.stored or step.unit not in self.direct

    @cached_property
    def bounds(self):
        """Cycles that no schedule can do without: "dependences", and each resource that is used up to.

        The bound of a resource counts the cycles it is taken for, and the shortest way to and from it.
        """
        return _Table(self.graph, self.pool).bounds()

    @cached_property
    def critical_path(self):
        """The steps that the last result waits for, first to last, each with the cycles it waited beyond its operands.

        Such a wait is for a unit, a read port or the result bus.
        """
        steps = {step.node: step for step in self.steps}
        path = [max(self.steps, key=lambda step: step.write)]
        waited: list[int] = []
        while True:
            step, waits = path[-1], {}
            for position, operand in enumerate(step.node.operands):
                if operand.node in steps:
                    other = steps[operand.node]
                    by_hand = self.pool.forwarding and not _from_memory(position, operand)
                    waits[other] = step.issue - other.write - (0 if by_hand else self.pool.memory_delay)
            # An operand that is tied to its reader comes as late as the other one makes it.
            if not waits:
                return list(zip(path, [*waited, 0], strict=True))[::-1]
            path.append(min(waits, key=lambda other: (not other.stored, waits[other])))
            waited.append(waits[path[-1]])

    def utilisation(self):
        """Unit or bus to the share of cycles in which it is taken."""
        units = {unit.name: unit for unit in self.pool.units}
        taken: Counter[str] = Counter()
        for step in self.steps:
            if step.unit in units:
                taken[step.unit] += units[step.unit].interval
        for step in self.steps:
            if self.on_bus(step):
                taken[BUSES[step.bus]] += 1
        return {name: count / self.length for name, count in taken.items()}

    def verify(self):
        """Raise AssertionError unless the schedule is one that the engine can run."""
        units = {unit.name: unit for unit in self.pool.units}
        written = self.written
        assert len(written) == len(self.steps), "a node is scheduled twice"
        assert set(written) == {node for node in self.graph.nodes if node.operation != "constant"}, "a node is missing"
        for resource, uses in (
                ("result bus", [(step.bus, step.write) for step in self.steps if self.on_bus(step)]),
                ("read port", [(units[step.unit].read_port, step.issue) for step in self.steps if step.unit in units])):
            busiest, count = Counter(uses).most_common(1)[0]
            assert count == 1, f"{resource} {busiest} is used {count} times"
        stored = {step.node for step in self.steps if step.stored}
        assert _kept(self.graph) <= stored, "a result is not stored"
        assert self.aside <= _for_side_bus(self.graph, self.pool), "a result is in the wrong memory"
        last: dict[str, int] = {}
        for step in self.steps:
            if step.unit in units:
                assert step.write == step.issue + _delay(units[step.unit]), f"{step} is not there then"
            for position, operand in enumerate(step.node.operands):
                if operand.node.operation != "constant":
                    wait = step.issue - written[operand.node]
                    by_hand = self.pool.forwarding and wait == 0 and not _from_memory(position, operand)
                    fetched = wait >= self.pool.memory_delay and operand.node in stored
                    assert by_hand or fetched, f"{step} reads {operand.node} too early"
            if step.unit in last and step.unit in units:
                assert step.issue - last[step.unit] >= units[step.unit].interval, f"{step.unit} is still busy"
            last[step.unit] = step.issue


def schedule(graph, pool):
    """Place every node of a graph in time: list scheduling with justification, many times over.

    A result with a single reader need not touch memory if the reader is issued when it comes
    out, so such nodes are tied into chains that are placed as one. Chain after chain, the one
    with the longest way to go takes the earliest cycle that is free. Then, as long as the
    schedule gets shorter, all are moved as late as they can go, the last first, and back to as
    early as they can, the first first: what nobody waits for yet leaves the crowded first cycles
    to the critical path (Valls, Ballestín and Quintanilla, "Justification and RCPSP", 2005). This
    is repeated from priorities that are a little off, at random but the same in every run; the
    shortest schedule wins.

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
    bound = max(table.bounds().values())
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
    result = Schedule(graph, pool, tuple(sorted(_stored(graph, best), key=lambda step: step.issue)))
    result.verify()
    return result


ATTEMPTS = 24
"""How often the scheduler starts anew, if it does not meet the bound before."""

ROUNDS = 20
"""At most so many justifications; a handful is usual."""


def _length(places):
    return 1 + max(step.write for step in places.values()) - min(step.issue for step in places.values())


def _stored(graph, places):
    """The steps, each stored only if somebody finds it in memory, or would hide it if it were not finite."""
    fetched = _kept(graph)
    for step in places.values():
        for position, operand in enumerate(step.node.operands):
            if operand.node in places and (_from_memory(position, operand) or places[operand.node].write != step.issue
                                           or not step.node.spreads):
                fetched.add(operand.node)
    return [replace(step, stored=step.node in fetched) for step in places.values()]


def _delay(unit):
    """Cycles from the issue of an operation to its result on the bus."""
    return 1 + unit.latency + (not unit.direct)


def _kept(graph):
    """Nodes that somebody looks for in memory when the update is over."""
    return {*graph.outputs.values(), *graph.next_state.values(), *(operand.node for operand in graph.status.values())}


def _for_side_bus(graph, pool):
    """Nodes whose results may go over the side bus: of direct units, not kept, and not wanted as conditions."""
    if not pool.side_memory:
        return frozenset()
    conditions = {operand.node for node in graph.nodes for operand in node.operands[2:]}
    return frozenset(node for node in graph.nodes if node.computed
                     and all(unit.direct for unit in pool.operations[node.operation])) - _kept(graph) - conditions


def _from_memory(position, operand):
    """Whether an operand cannot be taken as it comes out: a condition; the state, put back only at times."""
    return position == 2 or operand.node.operation == "state"


Chain = tuple[Node, ...]


class _Table:
    """What scheduling asks of a graph on a pool."""

    def __init__(self, graph, pool):
        self.pool = pool
        self.nodes = [node for node in graph.nodes if node.operation != "constant"]
        # A state word is put back by the unit that copies; an input needs none.
        self.units = {node: pool.operations.get("copy" if node.operation == "state" else node.operation, [])
                      for node in self.nodes}
        # Cycles from a node's issue to its result.
        self.delay = {node: _delay(units[0]) if units else 1 for node, units in self.units.items()}
        self.operands = {
            node: [(operand.node, _from_memory(position, operand)) for position, operand in enumerate(node.operands)
                   if operand.node.operation != "constant"] for node in self.nodes}
        self.readers: dict[Node, list[tuple[Node, bool]]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            for operand, from_memory in self.operands[node]:
                self.readers[operand].append((node, from_memory))
        self.to_go: dict[Node, int] = {}
        for node in reversed(self.nodes):
            rest = max((self.to_go[reader] + self._least_wait(from_memory)
                        for reader, from_memory in self.readers[node]), default=1)
            self.to_go[node] = self.delay[node] + rest
        self.to_come: dict[Node, int] = {}
        for node in self.nodes:
            self.to_come[node] = max((self.to_come[operand] + self.delay[operand] + self._least_wait(from_memory)
                                      for operand, from_memory in self.operands[node]), default=0)
        self.for_side_bus = _for_side_bus(graph, pool)
        self.chains = self._chains(graph)
        self.chain_of = {node: chain for chain in self.chains for node in chain}

    def _least_wait(self, from_memory):
        """Least number of cycles between a result and the issue that reads it."""
        return 0 if self.pool.forwarding and not from_memory else self.pool.memory_delay

    def _may_wait(self, wait, from_memory):
        return (wait == 0 and self._least_wait(from_memory) == 0) or wait >= self.pool.memory_delay

    def bounds(self):
        """Cycles that no schedule can do without, by what demands them."""
        bounds = {"dependences": max(self.to_go.values())}
        groups: dict[str, list[Node]] = {}
        for node in self.nodes:
            if node.computed:
                groups.setdefault("/".join(unit.name for unit in self.units[node]), []).append(node)
        for name, nodes in groups.items():
            units = self.units[nodes[0]]
            taken = -(-(len(nodes) - 1) * units[0].interval // len(units))
            bounds[name] = min(self.to_come[node] for node in nodes) + taken + min(self.to_go[node] for node in nodes)
        return bounds

    def _chains(self, graph) -> list[Chain]:
        """All nodes, tied where a result's only reader spreads what is not finite, which is seen on the bus."""
        kept = _kept(graph)
        before: dict[Node, Node] = {}
        for node in self.nodes:
            if not self.pool.forwarding or not node.spreads:
                continue
            free = [operand for operand, _ in self.operands[node]
                    if operand.spreads and operand not in kept
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
        first = min(step.issue for step in places.values()) - (self.pool.memory_delay - 1)
        return {node: replace(step, issue=step.issue - first, write=step.write - first)
                for node, step in places.items()}

    def _place(self, chain, places, taken, late):
        """Add the steps of a chain to ``places``, and what they take up to ``taken``."""
        offsets = [0]
        for node in chain[:-1]:
            offsets.append(offsets[-1] + self.delay[node])
        inside = set(chain)
        limits = []  # (offset of an issue or a result, cycle of the other end, whether read from memory)
        for node, offset in zip(chain, offsets, strict=True):
            if late:
                limits += [(offset + self.delay[node], places[reader].issue, from_memory)
                           for reader, from_memory in self.readers[node] if reader not in inside]
            else:
                limits += [(offset, places[operand].write, from_memory)
                           for operand, from_memory in self.operands[node] if operand not in inside]
        if late:
            cycle = min((other - offset - self._least_wait(from_memory) for offset, other, from_memory in limits),
                        default=-offsets[-1] - self.delay[chain[-1]])
        else:
            cycle = max((other - offset + self._least_wait(from_memory) for offset, other, from_memory in limits),
                        default=0)
        sign = -1 if late else 1
        while True:
            if all(self._may_wait(sign * (cycle + offset - other), from_memory)
                   for offset, other, from_memory in limits):
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
        buses = ("side", "main") if chain[-1] in self.for_side_bus else ("main",)
        bus = next((bus for bus in buses if (bus, write) not in taken), None)
        if bus is None:
            return None
        slots, chosen = {(bus, write)}, []
        for node, offset in zip(chain, offsets, strict=True):
            issue = cycle + offset
            for unit in self.units[node]:
                wanted = {("port", unit.read_port, issue),
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
