"""Timing rules and resources of the engines. Schedulers, schedules and programs use the same machine."""

from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

from .pool import MemoryStyle, Pool, Unit
from .trace import Graph, Node, Operand

__all__ = ["BUSES", "Machine", "Problem", "Read", "Resource", "StreamMachine", "UpdateMachine", "kept", "reads"]

BUSES = {"main": "result bus", "side": "side bus", "side2": "side bus 2", "side3": "side bus 3"}
"""Names of the buses in reports: the main bus, and the side buses that a machine can have."""


class Read(NamedTuple):
    """One operand of a step: the value, and a flag for the condition of a choice."""

    operand: Operand
    condition: bool = False

    @property
    def node(self):
        """The node that is read."""
        return self.operand.node


def reads(node):
    """All operands of a node in order, the condition last: tuple of Read."""
    arguments = tuple(Read(operand) for operand in node.arguments)
    return arguments if node.condition is None else (*arguments, Read(node.condition, condition=True))


def kept(graph):
    """Nodes whose values are needed after the update: outputs, next state, status."""
    return {*graph.outputs.values(), *graph.next_state.values(), *(operand.node for operand in graph.status.values())}


class Machine(ABC):
    """The timing rules of an engine on a pool. All numbers are cycles.

    The operands of an operation enter the operand registers at the end of the cycle of its issue. ``delay`` cycles
    later its result is on a result bus, and is written at the end of that cycle.

    Parameters
    ----------
    pool : Pool
        Settled for the engine by the subclass.

    Attributes
    ----------
    lead : int
        Cycles from an operand's address to its use.
    first_issue, first_input : int
        Earliest cycle of an operation and of an input.
    """

    lead: int
    first_issue: int
    first_input: int = 0

    def __init__(self, pool: Pool):
        self.pool = pool

    @property
    def side_buses(self) -> tuple[str, ...]:
        """Names of the result buses beside the main bus."""
        return tuple(BUSES)[1:1 + self.pool.side_buses] if self.pool.side_memory else ()

    def links(self, unit) -> tuple[str, ...]:
        """Buses that can take the results of a unit, the preferred one first."""
        return ("main", *self.side_buses)

    @cached_property
    def unit(self):
        """Maps each name to its Unit."""
        return {unit.name: unit for unit in self.pool.units}

    @abstractmethod
    def needs_step(self, node: Node) -> bool:
        """True if a node needs a step in the schedule."""

    def prepared(self, graph: Graph) -> Graph:
        """The graph that the engine computes, with additional copies of values that it cannot use in place."""
        return graph

    def units(self, node) -> list[Unit]:
        """Units that can compute a node; none for a node that is not computed."""
        return self.pool.operations.get(node.operation, [])

    @abstractmethod
    def delay(self, node) -> int:
        """Cycles from a node's issue to its result on the bus."""

    @abstractmethod
    def port(self, unit) -> int:
        """The pair of read ports that feeds a unit."""

    @abstractmethod
    def buses(self, graph) -> dict[Node, tuple[str, ...]]:
        """Maps each node to the buses that can take its result, the preferred one first."""

    def shares_register(self, node) -> bool:
        """True if a node's value passes the one register before the buses, in the cycle before it is on a bus."""
        return False

    @property
    def registered_aside(self) -> bool:
        """True if the side bus takes values that pass this register."""
        return False

    @abstractmethod
    def on_bus(self, graph) -> set[Node]:
        """Nodes whose results use a bus in every schedule."""

    @abstractmethod
    def least_wait(self, read) -> int:
        """Least number of cycles between a result and the issue that reads it."""

    @abstractmethod
    def may_wait(self, wait, read) -> bool:
        """True if a result can be read ``wait`` cycles after it is on the bus."""

    @abstractmethod
    def fetched(self, read) -> bool:
        """True if a value that is not taken directly from the bus is read from an operand memory."""

    def forwards(self, wait, read):
        """True if the reader takes the value in the cycle of the result, and not from memory."""
        return wait == 0 and self.least_wait(read) == 0


class UpdateMachine(Machine):
    """The rules of Engine: one update at a time.

    Results of units that are not direct, and inputs, are registered on the way to the bus; with horizontal microcode,
    inputs and constants twice. There is one register for them. It and the ROM of the constants have a field in common.
    Constants have steps like inputs, so that no update depends on what the memory contained before. Each state word has
    such a step, too, which restores its reset value in the first update after a reset. A result may be forwarded to its
    readers in the cycle in which it comes out. Conditions and the state always come from memory.
    """

    def __init__(self, pool):
        super().__init__(pool.settled(channels=1))
        for name in "side_buses", "read_ranks":
            if (value := getattr(self.pool, name)) > 1:
                raise ValueError(f"{name} must be 1 for one channel, not {value}")
        if self.pool.side_memory and MemoryStyle.BLOCK in (self.pool.operand_memory, self.pool.side_memory):
            raise ValueError("operand_memory and side_memory must be auto or distributed for one channel with a side "
                             "memory")
        if self.pool.horizontal and (self.pool.forwarding or self.pool.side_memory):
            raise ValueError("forwarding and side_memory must be False with horizontal microcode")
        self.lead = self.first_issue = self.pool.memory_delay - 1

    def needs_step(self, node):
        return True

    def delay(self, node):
        units = self.units(node)
        return 1 + units[0].latency + (not units[0].direct) if units else 1 + self.pool.horizontal

    def port(self, unit):
        return unit.read_port

    def buses(self, graph):
        conditions = {node.condition.node for node in graph.nodes if node.condition is not None}
        barred = kept(graph) | conditions
        return {node: ("side", "main") if self.pool.side_memory and node not in barred and self._goes_aside(node)
                else ("main",) for node in graph.nodes}

    def _goes_aside(self, node):
        if self.shares_register(node):
            return self.registered_aside and (node.computed or node.operation == "constant")
        return True

    @property
    def registered_aside(self):
        return bool(self.pool.side_memory) and self.pool.side_registered

    def shares_register(self, node):
        return not (node.computed and all(unit.direct for unit in self.units(node)))

    def on_bus(self, graph):
        result = kept(graph)
        ports: dict[Node, Counter] = {}
        for node in graph.nodes:
            for read in reads(node):
                if self.least_wait(read) or not node.spreads:
                    result.add(read.node)
            taken = {self.port(unit) for unit in self.units(node)}
            for operand in dict.fromkeys(read.node for read in reads(node)):
                ports.setdefault(operand, Counter()).update(taken if len(taken) == 1 else ())
        result |= {node for node in graph.nodes if self.shares_register(node)}
        # Readers that share a port cannot all be issued in the cycle in which the result comes out.
        result |= {node for node, counts in ports.items() if max(counts.values(), default=0) > 1}
        return result

    def least_wait(self, read):
        from_memory = read.condition or read.node.operation == "state"
        return 0 if self.pool.forwarding and not from_memory else self.pool.memory_delay

    def may_wait(self, wait, read):
        return wait >= self.pool.memory_delay or self.forwards(wait, read)

    def fetched(self, read):
        return True


class StreamMachine(Machine):
    """The rules of StreamEngine: an update begins every ``interval`` cycles, and several are in flight.

    Every result goes over a bus to the memory of that bus. State words go over the main bus. They need no steps to be
    read, because they are in its memory. Inputs are registered for one interval. An operand's address is needed
    ``read_ranks`` cycles before the operand. Conditions are kept in separate registers. If the pool has private ports,
    each adder and each multiplier has its own pair of read ports, and all other units share the first pair of the kind
    that has more units. With side memories, the units of each pair but the first have a side bus, in turn, for results
    that are not state words. The adder or multiplier of the first pair prefers the main bus to that of the second pair.
    The results of all other units go over the main bus, and inputs over the last side bus.

    Raises: ValueError for a pool that forwards results.
    """

    CONDITION_DELAY = 1

    # Before this cycle, values that the addresses depend on are not known.
    first_input = 1

    def __init__(self, pool):
        super().__init__(pool.settled(channels=2))
        if self.pool.forwarding:
            raise ValueError("forwarding must be False for several channels: all operands come from memory")
        if self.pool.horizontal:
            raise ValueError("horizontal must be False for several channels")
        self.lead = self.pool.read_ranks
        self.first_issue = self.first_input + self.lead

    def prepared(self, graph):
        """The graph with a copy of each state word and constant whose sign is a condition or a status bit."""
        readers = {node.condition.node: node for node in graph.nodes if node.condition is not None}
        signs = {**readers, **{operand.node: operand.node for operand in graph.status.values()}}
        copies = {node: Node("copy", (Operand(node),), section=reader.section, origin=reader.origin)
                  for node, reader in signs.items() if not self.needs_step(node)}
        return _with_signs(graph, copies) if copies else graph

    def needs_step(self, node):
        return node.operation not in ("constant", "state")

    def delay(self, node):
        units = self.units(node)
        return 1 + units[0].latency if units else 0

    def port(self, unit):
        return unit.read_port if unit.direct else self._shared_port

    @cached_property
    def _shared_port(self):
        """The pair of read ports of all units that have none of their own."""
        pairs: dict[str, list[int]] = {}
        for unit in self.pool.units:
            if unit.direct:
                pairs.setdefault(unit.kind, []).append(unit.read_port)
        return max(pairs.values(), key=len, default=[0])[0]

    def links(self, unit):
        if not unit.direct or not self.side_buses:
            return ("main",)
        port = self.port(unit)
        own = self.side_buses[(max(port, 1) - 1) % len(self.side_buses)]
        return (own, "main") if port else ("main", own)

    def buses(self, graph):
        own = set(graph.next_state.values())
        return {node: ("main",) if node in own else self._preferred(node) for node in graph.nodes}

    def _preferred(self, node):
        """Buses of a value that is not a state word."""
        if not node.computed:
            return self.side_buses[-1:] or ("main",)
        return tuple(dict.fromkeys(bus for unit in self.units(node) for bus in self.links(unit)))

    def on_bus(self, graph):
        return {node for node in graph.nodes if self.needs_step(node)}

    def least_wait(self, read):
        return self.CONDITION_DELAY if read.condition else 1 + self.lead

    def may_wait(self, wait, read):
        return self.least_wait(read) <= wait

    def fetched(self, read):
        return not read.condition


def _with_signs(graph, copies):
    """The graph, with conditions and status bits taken from ``copies`` of nodes."""
    new: dict[Node, Node] = {}

    def renewed(operand):
        return Operand(new[operand.node], operand.negated)

    def sign(operand):
        return Operand(copies.get(operand.node) or new[operand.node], operand.negated)

    nodes = []
    for node in graph.nodes:
        operands = tuple(renewed(operand) for operand in node.arguments)
        if node.condition is not None:
            operands += (sign(node.condition),)
        new[node] = replace(node, operands=operands) if node.operands else node
        nodes += [new[node], copies[node]] if node in copies else [new[node]]
    return replace(
        graph, nodes=tuple(nodes), outputs={name: new[node] for name, node in graph.outputs.items()},
        next_state={word: new[node] for word, node in graph.next_state.items()},
        status={name: sign(operand) for name, operand in graph.status.items()})


class Resource(NamedTuple):
    """A resource of a schedule: each of ``nodes`` takes one of its ``instances`` for ``cycles`` cycles."""

    nodes: list[Node]
    cycles: int = 1
    instances: int = 1


class Problem:
    """A graph on a machine, in the form that schedulers use.

    Attributes
    ----------
    nodes : list of Node
        The nodes that need a step, operands before results.
    units, delay, buses : dict
        Map a node to its units, to the cycles from issue to result, and to the buses that can take its result.
    operands, readers : dict
        Map a node to pairs (other node, Read) for its operands, and for the nodes that read it.
    to_go, to_come : dict
        Map a node to the least number of cycles from its issue to the end of the update, and from the start of the
        update to its issue.
    """

    def __init__(self, graph: Graph, machine: Machine):
        self.graph, self.machine = graph, machine
        self.nodes = [node for node in graph.nodes if machine.needs_step(node)]
        self.units = {node: machine.units(node) for node in self.nodes}
        self.delay = {node: machine.delay(node) for node in self.nodes}
        self.buses = machine.buses(graph)
        known = set(self.nodes)
        self.operands = {node: [(read.node, read) for read in reads(node) if read.node in known] for node in self.nodes}
        self.readers: dict[Node, list[tuple[Node, Read]]] = {node: [] for node in self.nodes}
        for node in self.nodes:
            for operand, read in self.operands[node]:
                self.readers[operand].append((node, read))
        self.to_go: dict[Node, int] = {}
        for node in reversed(self.nodes):
            rest = max((self.to_go[reader] + machine.least_wait(read) for reader, read in self.readers[node]),
                       default=1)
            self.to_go[node] = self.delay[node] + rest
        self.to_come: dict[Node, int] = {}
        for node in self.nodes:
            self.to_come[node] = max((self.to_come[operand] + self.delay[operand] + machine.least_wait(read)
                                      for operand, read in self.operands[node]), default=0)

    @cached_property
    def resources(self) -> tuple[dict[str, Resource], dict[str, Resource]]:
        """Units and read ports by name, and buses by name."""
        groups: dict[tuple[str, ...], list[Node]] = {}
        ports: dict[str, list[Node]] = {}
        for node in self.nodes:
            if node.computed:
                groups.setdefault(tuple(unit.name for unit in self.units[node]), []).append(node)
                taken = {self.machine.port(unit) for unit in self.units[node]}
                if len(taken) == 1:
                    ports.setdefault(f"read port {taken.pop()}", []).append(node)
        issues = {"/".join(names): Resource(nodes, self.units[nodes[0]][0].interval, len(names))
                  for names, nodes in groups.items()}
        issues |= {name: Resource(nodes) for name, nodes in ports.items()}
        on_bus = self.machine.on_bus(self.graph)
        written = [node for node in self.nodes if node in on_bus]
        names = dict.fromkeys(bus for node in self.nodes for bus in self.buses[node])
        results = {BUSES[bus]: Resource([node for node in written if self.buses[node] == (bus,)]) for bus in names}
        if len(names) > 1:
            results[f"{len(names)} buses"] = Resource(written, instances=len(names))
        shared = [node for node in written if self.machine.shares_register(node)]
        if any(len(self.buses[node]) > 1 for node in shared):
            results["register before the buses"] = Resource(shared)
        return issues, {name: resource for name, resource in results.items() if resource.nodes}

    def intervals(self):
        """Least interval between updates, by the resource that limits it.

        In one cycle the main bus takes a constant.
        """
        issues, results = self.resources
        bounds = {name: -(-len(nodes) // instances) * cycles for name, (nodes, cycles, instances) in issues.items()}
        aside = {BUSES[bus] for bus in self.machine.side_buses}
        return bounds | {name: -(-(len(nodes) + (name not in aside)) // instances)
                         for name, (nodes, _, instances) in results.items()}

    def lengths(self):
        """Least length of a whole update, by its cause: "dependences", and for each resource the time that it is
        taken plus the shortest path to and from it."""
        def taken(resource):
            return (len(resource.nodes) - 1) // resource.instances * resource.cycles

        issues, results = self.resources
        bounds = {"dependences": max(self.to_go.values())}
        for name, resource in issues.items():
            bounds[name] = (min(self.to_come[node] for node in resource.nodes) + taken(resource)
                            + min(self.to_go[node] for node in resource.nodes))
        for name, resource in results.items():
            bounds[name] = (min(self.to_come[node] + self.delay[node] for node in resource.nodes) + taken(resource)
                            + min(self.to_go[node] - self.delay[node] for node in resource.nodes))
        return bounds
