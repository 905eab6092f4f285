"""A schedule as words of a ROM, with an address for every value."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from amaranth import unsigned
from amaranth.lib import data
from amaranth.utils import bits_for, exact_log2

from .machine import reads
from .schedule import Schedule, Step
from .trace import Node

__all__ = ["CONSTANT", "NEXT", "PLAIN", "STATE", "TURNED", "Program", "StreamProgram", "UpdateProgram"]

PLAIN, TURNED, CONSTANT, STATE, NEXT = "plain", "turned", "constant", "state", "next"
"""Kinds of addresses in a stream program: a fixed address; an address whose low bits count the intervals; that of the
constant whose turn it is to be written; a word of the state, or of the next state, of the channel in a stage."""


@dataclass(frozen=True)
class Program(ABC):
    """The ROM of an engine, a word for each cycle of the schedule's period, and the map of its memories.

    A word controls one cycle of all updates in flight. It routes operands, starts units and selects the result for each
    bus. The address of an operand is ``machine.lead`` words earlier than the other fields of its step.

    Parameters
    ----------
    schedule : Schedule
    """

    schedule: Schedule

    @property
    def format(self):
        """Format of all numbers."""
        return self.schedule.pool.format

    @property
    def graph(self):
        """The operations."""
        return self.schedule.graph

    @property
    def length(self):
        """Number of words: the cycles of an update, or of an interval."""
        return self.schedule.period

    @cached_property
    def units(self):
        """Units that the program uses, in the pool's order."""
        used = {step.unit for step in self.schedule.steps}
        return tuple(unit for unit in self.schedule.pool.units if unit.name in used)

    @cached_property
    def read_ports(self):
        """Pairs of read ports that the program uses."""
        return tuple(sorted({self.schedule.machine.port(unit) for unit in self.units}))

    @abstractmethod
    def source(self, step: Step) -> str:
        """Name of a step's result among the sources of its bus."""

    @cached_property
    def sources(self):
        """Maps each bus to its sources: names of units, and one name for results that are registered on the way."""
        seen = {(step.bus, self.source(step)) for step in self.schedule.steps if self.schedule.on_bus(step)}
        names = dict.fromkeys([*(unit.name for unit in self.units), *sorted(name for _, name in seen)])
        return {bus: tuple(name for name in names if (bus, name) in seen)
                for bus in ("main", *self.schedule.machine.side_buses)}

    # The memories.

    @property
    @abstractmethod
    def state(self) -> dict[str, int]:
        """Maps each state word to its address in the first bank."""

    @cached_property
    def constants(self) -> tuple[float, ...]:
        """The reset values of the state, and the other constants, in the order of their numbers."""
        values = dict.fromkeys(self.graph.state.values())
        return tuple(values | dict.fromkeys(node.value for node in self.graph.nodes if node.operation == "constant"))

    @property
    def constant_words(self) -> tuple[int, ...]:
        """The constants as they are in their ROM."""
        return tuple(int(self.format.encode(value)) for value in self.constants)

    def constant(self, node):
        """The value of a constant, or the reset value of a state word."""
        return self.graph.state[node.label] if node.operation == "state" else node.value

    @property
    @abstractmethod
    def addresses(self) -> dict[Node, int]:
        """Address of every value, in the memory of its bus; the lowest of several."""

    @property
    @abstractmethod
    def depth(self) -> int:
        """Words of the main memory, a power of two."""

    @cached_property
    def side_depths(self) -> dict[str, int]:
        """Maps each side bus that is used to the words of its memory, a power of two."""
        used: dict[str, int] = {}
        for node in self.schedule.aside:
            bus = self.schedule.bus[node]
            used[bus] = max(used.get(bus, 0), self.addresses[node] + self._copies(node))
        return {bus: 1 << (used[bus] - 1).bit_length() for bus in self.schedule.machine.side_buses if bus in used}

    def _lifetime(self, node):
        """First cycle in which a value needs its address, and the number of cycles."""
        write = self.schedule.written[node]
        return write, max(self.schedule.last_read.get(node, 0) - write, 1)

    def _copies(self, node):
        """Number of addresses of a value, a power of two: the updates in flight that need it at the same time."""
        periods = -(-self._lifetime(node)[1] // self.length)
        return 1 << (periods - 1).bit_length()

    def _allocated(self, nodes, free: Sequence[int]):
        """Address of each node, in order: the first of ``free`` that no other node has in the same cycles.

        Raises: ValueError if there is none.
        """
        taken = dict.fromkeys(free, 0)
        addresses: dict[Node, int] = {}
        for node in nodes:
            begin, cycles = self._lifetime(node)
            begin %= self.length
            mask = ((1 << min(cycles, self.length)) - 1) << begin
            mask = (mask | mask >> self.length) & ((1 << self.length) - 1)
            for address in free:
                wanted = range(address, address + self._copies(node))
                if address % len(wanted) == 0 and all(not taken.get(each, -1) & mask for each in wanted):
                    break
            else:
                raise ValueError(f"the memory has no room for {node}")
            for each in wanted:
                taken[each] |= mask
            addresses[node] = address
        return addresses

    @abstractmethod
    def place(self, node: Node) -> str:
        """The place of a value, for listings."""

    def operand_place(self, step, read):
        """The source of a step's operand, for listings."""
        return self.place(read.node)

    # The words.

    @property
    @abstractmethod
    def _operand_layout(self) -> data.StructLayout:
        """Fields that route an operand."""

    @property
    @abstractmethod
    def _other_fields(self) -> dict:
        """Fields other than those of operands and units."""

    @cached_property
    def layout(self):
        """Layout of a word."""
        operand = self._operand_layout
        fields: dict = {f"port{port}": data.StructLayout({"a": operand, "b": operand}) for port in self.read_ports}
        fields["start"] = data.StructLayout({unit.name: 1 for unit in self.units})
        modes = [f"{unit.name}_{mode}" for unit in self.units for mode in unit.modes.values()]
        if modes:
            fields["mode"] = data.StructLayout(dict.fromkeys(modes, 1))
        return data.StructLayout(fields | self._other_fields)

    @cached_property
    def words(self) -> list[dict]:
        """The program: one dict per cycle, nested like ``layout``."""
        words: list[dict] = [{} for _ in range(self.length)]

        def put(cycle, *path, **fields):
            word = words[self.schedule.slot(cycle)]
            for name in path:
                word = word.setdefault(name, {})
            word |= fields

        machine = self.schedule.machine
        for step in self.schedule.steps:
            if self.schedule.on_bus(step):
                self._write(put, step)
            if step.unit not in machine.unit:
                continue
            unit = machine.unit[step.unit]
            put(step.issue, "start", **{unit.name: 1})
            if step.node.operation in unit.modes:
                put(step.issue, "mode", **{f"{unit.name}_{unit.modes[step.node.operation]}": 1})
            arguments = [read for read in reads(step.node) if not read.condition]
            # A single operand goes to both ports, which makes a copy of a choice.
            for side, read in zip("ab", (arguments[0], arguments[min(1, len(arguments) - 1)]), strict=True):
                path = f"port{machine.port(unit)}", side
                put(step.issue, *path, negate=int(read.operand.negated), **self._route(step, read))
                put(step.issue - machine.lead, *path, **self._fetch(step, read))
            if step.node.condition is not None:
                put(step.issue, "condition", negate=int(step.node.condition.negated), **self._condition(step))
        self._finish(put)
        return words

    @abstractmethod
    def _write(self, put, step):
        """Set the fields that put a step's result on a bus."""

    @abstractmethod
    def _route(self, step, read) -> dict:
        """Fields that select the source of an operand."""

    @abstractmethod
    def _fetch(self, step, read) -> dict:
        """Fields with the address of an operand."""

    @abstractmethod
    def _condition(self, step) -> dict:
        """Fields that select the condition of a step."""

    @abstractmethod
    def _finish(self, put):
        """Set the fields that do not belong to a step."""


class UpdateProgram(Program):
    """The program of Engine, one word for each cycle of an update.

    The memory begins with the state: words ``2k`` and ``2k + 1`` are the two banks of state word k. Programs use ``2k``
    for the state and ``2k + 1`` for the next state; the engine inverts the lowest bit of these addresses in every
    second update. The values of one update follow, constants included, each kept from the cycle after its write to its
    last read. The side memory uses the highest addresses of the main memory, whose lowest bit is not inverted.

    With horizontal microcode no field selects the source of the bus. ``mute`` has a bit for each input port, which is
    low where the bus takes the input, and ``arrives`` one for each output and status bit. ``constant`` is 0 where the
    bus takes none: the first constant is zero.
    """

    @property
    def horizontal(self):
        """True for horizontal microcode."""
        return self.schedule.pool.horizontal

    @cached_property
    def constants(self):
        known = super().constants
        return tuple(dict.fromkeys((0.0, *known))) if self.horizontal else known

    def source(self, step):
        return step.unit if step.unit in self.schedule.direct or step.unit == "constant" else "other"

    @cached_property
    def side_depth(self):
        """Words of the side memory: a power of two, or 0 if there is none."""
        return self.side_depths.get("side", 0)

    @cached_property
    def other_sources(self):
        """Sources that are registered on the way to the bus: names of units that are not direct, and input ports."""
        return (*(unit.name for unit in self.units if not unit.direct), *self.graph.inputs)

    @cached_property
    def operand_sources(self):
        """Sources of operands: "memory", "side" memory, the direct units whose results are forwarded, and "bus" for
        all other results; where these can be on either bus, their sources "other" and "constant"."""
        found = {self.operand_source(step, read) for step in self.schedule.steps
                 for read in reads(step.node) if not read.condition} | {"memory"}
        names = "memory", "side", *(unit.name for unit in self.units), "bus", "other", "constant"
        return tuple(name for name in names if name in found)

    def operand_source(self, step, read):
        """The source of an operand of ``step``: one of ``operand_sources``."""
        if not self.schedule.forwarded(step, read):
            return "side" if read.node in self.schedule.aside else "memory"
        producer = self._step_of[read.node]
        if producer.unit in self.schedule.direct or self.schedule.machine.registered_aside:
            return self.source(producer)
        return "bus"

    @cached_property
    def _step_of(self):
        return {step.node: step for step in self.schedule.steps}

    @property
    def state_words(self):
        """Addresses below this belong to the state."""
        return 2 * len(self.graph.state)

    @cached_property
    def state(self):
        return {word: 2 * index for index, word in enumerate(self.graph.state)}

    @cached_property
    def addresses(self):
        addresses = {node: self.state[node.label] for node in self.graph.nodes if node.operation == "state"}
        addresses |= {node: self.state[word] + 1 for word, node in self.graph.next_state.items()}
        for bus, first in ("main", self.state_words), ("side", 0):
            steps = [step for step in self.schedule.steps
                     if step.stored and step.bus == bus and step.node not in addresses]
            nodes = [step.node for step in sorted(steps, key=lambda step: step.write)]
            addresses |= self._allocated(nodes, range(first, first + len(nodes)))
        return addresses

    @cached_property
    def _lasting(self):
        """Nodes that are the last to be written to their address: outputs and status can be read later."""
        return {*self.graph.outputs.values(), *(operand.node for operand in self.graph.status.values())}

    def _lifetime(self, node):
        write, cycles = super()._lifetime(node)
        return write, self.length - write if node in self._lasting else cycles

    @cached_property
    def used(self):
        """Words of memory in use, the side memory excluded."""
        return max([*(address for node, address in self.addresses.items() if node not in self.schedule.aside),
                    self.state_words - 1]) + 1

    @cached_property
    def depth(self):
        words = max(self.used, self.state_words + self.side_depth)  # The addresses of both memories have one length.
        return 1 << (words - 1).bit_length()

    def place(self, node):
        names = {node: name for name, node in self.graph.outputs.items()}
        names |= {node: f"{word}'" for word, node in self.graph.next_state.items()}
        name = names.get(node) or node.label
        memory = "side" if node in self.schedule.aside else ""
        return f"{memory}[{self.addresses[node]}" + (f" {name}]" if name else "]")

    def operand_place(self, step, read):
        source = self.operand_source(step, read)
        if read.condition or source in ("memory", "side"):
            return self.place(read.node)
        return f"<{read.node.label}>" if read.node.operation == "constant" else f"<{source}>"

    @property
    def address_fields(self):
        """Paths of the parts of ``layout`` that have an ``address`` in the operand memory."""
        operands = [(f"port{port}", side) for port in self.read_ports for side in "ab"]
        conditions = [("condition",)] if "condition" in self.layout.members else []
        return (*operands, *conditions, ("write",))

    @property
    def _address(self):
        return unsigned((self.depth - 1).bit_length())

    @property
    def _operand_layout(self):
        return data.StructLayout({
            "address": self._address, "negate": 1, "source": unsigned((len(self.operand_sources) - 1).bit_length())})

    @property
    def _other_fields(self):
        fields = {}
        if any(unit.takes_condition for unit in self.units):
            fields["condition"] = data.StructLayout({"address": self._address, "negate": 1})
        write = {"enable": 1, "restore": 1, "address": self._address}
        if self.horizontal:
            constant = unsigned(bits_for(max(len(self.constants), 2) - 1))
            return {**fields, "write": data.StructLayout(write), "constant": constant,
                    "mute": data.StructLayout(dict.fromkeys(self.graph.inputs, 1)),
                    "arrives": data.StructLayout(dict.fromkeys(self.arrivals, 1)), "advance": 1}
        fields["write"] = data.StructLayout(write | {"source": unsigned((len(self.sources["main"]) - 1).bit_length())})
        if self.side_depth:
            fields["side"] = data.StructLayout({"enable": 1, "address": unsigned((self.side_depth - 1).bit_length()),
                                                "source": unsigned((len(self.sources["side"]) - 1).bit_length())})
        other = unsigned(bits_for(max(len(self.other_sources), len(self.constants), 2) - 1))
        return {**fields, "other": other, "advance": 1}

    @cached_property
    def arrivals(self):
        """Maps each output port and each status bit of the equations to its node."""
        return self.graph.outputs | {name: operand.node for name, operand in self.graph.status.items()}

    def _write(self, put, step):
        if self.horizontal:
            self._drive(put, step)
            return
        source, write = self.source(step), {"main": "write", "side": "side"}[step.bus]
        # Readers take registered results from the register: if none is stored aside, there is no side bus.
        if write == "write" or self.side_depth:
            put(step.write, write, source=self.sources[step.bus].index(source))
        if source == "other":
            name = step.node.label if step.unit == "input" else step.unit
            put(step.write - 1, other=self.other_sources.index(name))
        if source == "constant":
            put(step.write - 1, other=self.constants.index(self.constant(step.node)))
        if step.stored:
            put(step.write, write, enable=1, address=self.addresses[step.node])
        if step.stored and write == "write":
            put(step.write, write, restore=int(step.node.operation == "state"))

    def _drive(self, put, step):
        """Set the fields of horizontal microcode that let a step's result go over the bus."""
        if step.unit == "input":
            put(step.issue, "mute", **{step.node.label: 0})
        if step.unit == "constant":
            put(step.issue, constant=self.constants.index(self.constant(step.node)))
        put(step.write, "write", enable=1, address=self.addresses[step.node],
            restore=int(step.node.operation == "state"))
        put(step.write, "arrives", **{name: 1 for name, node in self.arrivals.items() if node is step.node})

    def _route(self, step, read):
        return {"source": self.operand_sources.index(self.operand_source(step, read))}

    def _fetch(self, step, read):
        source = self.operand_source(step, read)
        if source not in ("memory", "side"):
            return {}
        return {"address": self.addresses[read.node] + (self.depth - self.side_depth if source == "side" else 0)}

    def _condition(self, step):
        return {"address": self.addresses[step.node.condition.node]}

    @property
    def resting(self):
        """The word while no update runs: all fields are zero, but inputs are muted."""
        return {"mute": dict.fromkeys(self.graph.inputs, 1)} if self.horizontal else {}

    def _finish(self, put):
        for end in self.schedule.section_ends:
            put(end, advance=1)
        if self.horizontal:
            driving = {(step.issue, step.node.label) for step in self.schedule.steps if step.unit == "input"}
            for cycle in range(self.length):
                put(cycle, "mute", **{port: 1 for port in self.graph.inputs if (cycle, port) not in driving})


@dataclass(frozen=True)
class StreamProgram(Program):
    """The program of StreamEngine, one word for each cycle of the interval.

    For the update in stage s, word ``index`` contains cycle ``s * length + index`` of this update.

    The lower half of the main memory holds the state: word k of channel c and bank b is at
    ``k << index_bits | c << 1 | b``. The upper half holds the constants, and then the values of updates. The reset
    values of the state are the first constants. An operand that is a state word has the number of its reset value in
    the low bits of the address: the engine reads this constant if the state is fresh. In one cycle of an interval the
    engine writes a constant, in each interval the next one.
    A value that is needed for longer than an interval has two addresses, for alternate updates, or a higher power of
    two. Each side bus has a memory for values of updates only. An operand's address goes to all memories; the word of
    its step says which one it comes from, by its number in ``depths``.

    Parameters
    ----------
    schedule : Schedule
        With an interval.
    channels : int
        Number of states, a power of two from 2 to 64.

    Raises: ValueError for another number of channels.
    """

    channels: int

    def __post_init__(self):
        if not 2 <= self.channels <= 64 or self.channels & (self.channels - 1):
            raise ValueError(f"channels must be a power of two from 2 to 64, not {self.channels!r}")

    def source(self, step):
        return step.unit

    @cached_property
    def conditions(self):
        """Conditions of choices: tuples of a node, and of the number of intervals since its sign was computed."""
        found = [self._aged(step) for step in self.schedule.steps if step.node.condition is not None]
        return tuple(dict.fromkeys(found))

    def _aged(self, step):
        node = step.node.condition.node
        return node, (step.issue - self.schedule.written[node] - 1) // self.length

    @property
    def index_bits(self):
        """Low bits of the address of a state word: they hold channel and bank, or the number of the reset value."""
        resets = len({*self.graph.state.values()})
        return max(exact_log2(self.channels) + 1, bits_for(max(resets, 1) - 1))

    @property
    def constant_bits(self):
        """Bits of the number of a constant."""
        return bits_for(max(len(self.constants), 1) - 1)

    @cached_property
    def state(self):
        return {word: index << self.index_bits for index, word in enumerate(self.graph.state)}

    @cached_property
    def _main(self):
        """Bits of an address in each half; values of an update in memory, with their addresses."""
        own = set(self.graph.next_state.values())
        nodes = self._longest_first(
            node for node, bus in self.schedule.bus.items() if bus == "main" and node not in own)
        bits = max(bits_for(max(len(self.graph.state), 1) - 1) + self.index_bits, self.constant_bits)
        while True:
            try:
                return bits, self._allocated(nodes, range((1 << bits) + (1 << self.constant_bits), 2 << bits))
            except ValueError:
                bits += 1

    def _side(self, bus):
        nodes = self._longest_first(node for node, own in self.schedule.bus.items() if own == bus)
        return self._allocated(nodes, range(2 * sum(map(self._copies, nodes))))

    def _longest_first(self, nodes):
        return sorted(nodes, key=lambda node: -self._lifetime(node)[1])

    @property
    def upper(self):
        """First address of the upper half of the main memory."""
        return 1 << self._main[0]

    @property
    def depth(self):
        return 2 * self.upper

    @cached_property
    def addresses(self):
        addresses = dict(self._main[1])
        for bus in self.schedule.machine.side_buses:
            addresses |= self._side(bus)
        return addresses

    def place(self, node):
        if not node.computed:
            return node.label
        return f"{self._own[node]}'" if node in self._own else f"{self.schedule.bus[node]}[{self.addresses[node]}]"

    @cached_property
    def kinds(self):
        """Kinds of addresses, in the order of their numbers: pairs of a kind and its parameter. The parameter is the
        number of bits that count the intervals, or the stage of the update whose state is addressed."""
        turned = {(TURNED, self._copies(node).bit_length() - 1) for node in self.addresses if self._copies(node) > 2}
        read_again = {(NEXT, self._fetching(step)) for step in self.schedule.steps
                      for read in reads(step.node) if not read.condition and read.node in self._own}
        refreshed = ((CONSTANT, 0),) if self.constants else ()
        return ((PLAIN, 0), (TURNED, 1), *refreshed, *((STATE, stage) for stage in range(self.schedule.stages)),
                *sorted(turned), *sorted(read_again))

    @property
    def turning_bits(self):
        """Greatest number of bits of an address that count the intervals."""
        return max(self.constant_bits, *(parameter for kind, parameter in self.kinds if kind == TURNED))

    @cached_property
    def sources(self):
        found = super().sources
        return found | {"main": (*found["main"], "constant")} if self.constants else found

    @cached_property
    def _own(self):
        """Maps each node to the state word whose next value it is."""
        return {node: word for word, node in self.graph.next_state.items()}

    @property
    def _kind(self):
        return unsigned(bits_for(len(self.kinds) - 1))

    @property
    def _operand_layout(self):
        return data.StructLayout({"address": exact_log2(max(self.depths.values())), "kind": self._kind,
                                  **({"side": bits_for(len(self.side_depths))} if self.side_depths else {}),
                                  "negate": 1})

    @property
    def _other_fields(self):
        fields: dict = {}
        if self.conditions:
            index = unsigned(bits_for(len(self.conditions) - 1))
            fields["condition"] = data.StructLayout({"index": index, "negate": 1})
        stage = unsigned(bits_for(self.schedule.stages - 1))
        for bus, depth in self.depths.items():
            fields[bus] = data.StructLayout({
                "enable": 1, "address": exact_log2(depth), "kind": self._kind, "stage": stage,
                "source": unsigned(bits_for(len(self.sources[bus]) - 1))})
        return {**fields, "input": unsigned(bits_for(len(self.graph.inputs) - 1))}

    @property
    def depths(self):
        """Maps each bus to the number of words of its memory."""
        return {"main": self.depth, **self.side_depths}

    def _stage(self, cycle):
        return cycle // self.length

    def _fetching(self, step):
        """The stage in which the addresses of a step's operands are settled: a cycle before they go out."""
        return self._stage(step.issue - self.schedule.machine.lead - 1)

    def _place(self, node, stage, state=STATE):
        """Address and kind of a node, for a word whose addresses are settled in ``stage``."""
        if node.operation == "constant":
            address, kind = self.upper + self.constants.index(node.value), (PLAIN, 0)
        elif node.operation == "state":
            address, kind = self.state[node.label] | self.constants.index(self.constant(node)), (state, stage)
        elif node in self._own:
            address, kind = self.state[self._own[node]], (state, stage)
        elif (copies := self._copies(node)) > 1:
            # The engine adds the number of the latest update; the sum is the number of the update in the stage.
            address, kind = self.addresses[node] + -stage % copies, (TURNED, copies.bit_length() - 1)
        else:
            address, kind = self.addresses[node], (PLAIN, 0)
        return {"address": address, "kind": self.kinds.index(kind)}

    def _write(self, put, step):
        # The value on the bus is checked one cycle later.
        put(step.write, step.bus, enable=1, source=self.sources[step.bus].index(step.unit),
            stage=self._stage(step.write + 1), **self._place(step.node, self._stage(step.write - 1)))
        if step.unit == "input":
            put(step.issue, input=self.graph.inputs.index(step.node.label))

    def _route(self, step, read):
        return {"side": [*self.depths].index(self.schedule.bus.get(read.node, "main"))} if self.side_depths else {}

    def _fetch(self, step, read):
        return self._place(read.node, self._fetching(step), NEXT if read.node in self._own else STATE)

    def _condition(self, step):
        return {"index": self.conditions.index(self._aged(step))}

    def _finish(self, put):
        if self.constants:
            put(self.schedule.free, "main", enable=1, **self.refresh)

    @property
    def refresh(self):
        """Fields of the main bus that write the next constant."""
        return {"address": self.upper, "kind": self.kinds.index((CONSTANT, 0)),
                "source": self.sources["main"].index("constant")}
