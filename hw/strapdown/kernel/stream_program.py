"""A modulo schedule as words of a ROM, with an address for every value in two memories."""

from dataclasses import dataclass
from functools import cached_property

from amaranth import unsigned
from amaranth.lib import data
from amaranth.utils import bits_for, exact_log2

from .modulo import ModuloSchedule
from .trace import Node

__all__ = ["StreamProgram", "PLAIN", "TURNED", "STATE"]

PLAIN, TURNED, STATE = 0, 1, 2
"""Kinds of addresses: as it is; the lowest bit turned in every other update; ``STATE + s``, a word of
the state of the channel in stage s."""


@dataclass(frozen=True)
class StreamProgram:
    """The ROM of a stream engine, one word for each cycle between two begins, and the map of its memories.

    A word tells what happens in its cycle to all updates under way: to the one in stage s what its
    cycle ``s * length + index`` demands. An operand's address stands a word before its other fields.

    The main memory has a lower half for the state, word k of channel c and bank b at
    ``(k * channels + c) * 2 + b``, and an upper half in which the same word stands as after a reset,
    where c and b are zero, with constants and values of updates around it.
    A value that is wanted for longer than a word comes round again has two addresses, for every other update.

    Parameters
    ----------
    schedule : ModuloSchedule
    channels : int
        How many states there are, a power of two.

    Raises: ValueError if ``channels`` is no power of two from 2 on, if an update reads state words
    that it has made, or if there are more values than addresses.
    """

    schedule: ModuloSchedule
    channels: int

    def __post_init__(self):
        if self.channels < 2 or self.channels & (self.channels - 1):
            raise ValueError(f"channels must be a power of two from 2 on, not {self.channels!r}")
        for word, node in self.schedule.graph.next_state.items():
            if node in self.schedule.last_read:
                raise ValueError(f"the new {word} must not be read in the update that makes it")

    @property
    def format(self):
        """Format of all numbers."""
        return self.schedule.pool.format

    @property
    def length(self):
        """Words, that is cycles between the begins of two updates."""
        return self.schedule.interval

    @cached_property
    def units(self):
        """Units that the program uses, in the pool's order."""
        used = {step.unit for step in self.schedule.steps}
        return tuple(unit for unit in self.schedule.pool.units if unit.name in used)

    @cached_property
    def sources(self):
        """Bus to what can be put on it: the units' names, and "input"."""
        seen = {(step.bus, step.unit) for step in self.schedule.steps}
        names = (*(unit.name for unit in self.units), "input")
        return {bus: tuple(name for name in names if (bus, name) in seen) for bus in ("main", "side")}

    @cached_property
    def read_ports(self):
        """Pairs of read ports that the program uses."""
        return tuple(sorted({self.schedule.read_port(unit.name) for unit in self.units}))

    @cached_property
    def conditions(self):
        """Nodes whose sign a choice depends on."""
        return tuple(dict.fromkeys(step.node.operands[2].node for step in self.schedule.steps
                                   if len(step.node.operands) == 3))

    # The memories.

    @property
    def _low_bits(self):
        return exact_log2(self.channels) + 1

    @property
    def upper(self):
        """First address of the upper half of the main memory."""
        return 1 << bits_for(max(len(self.schedule.graph.state), 1) - 1) + self._low_bits

    @property
    def depth(self):
        """Words of the main memory."""
        return 2 * self.upper

    @cached_property
    def state(self):
        """State word to the address that is its own for channel 0 and bank 0."""
        return {word: index << self._low_bits for index, word in enumerate(self.schedule.graph.state)}

    @cached_property
    def _main(self):
        """Addresses of constants, and of what the main memory keeps of an update; values with two have both."""
        free = [address for address in range(self.upper, self.depth) if address % (1 << self._low_bits)]
        values = dict.fromkeys(node.value for node in self.schedule.graph.nodes if node.operation == "constant")
        constants = dict(zip(values, reversed(free), strict=False))
        own = set(self.schedule.graph.next_state.values())
        nodes = [node for node, bus in self.schedule.bus.items() if bus == "main" and node not in own]
        return constants, self._allocated(nodes, free[:len(free) - len(constants)])

    @cached_property
    def _side(self):
        nodes = [node for node, bus in self.schedule.bus.items() if bus == "side"]
        return self._allocated(nodes, list(range(2 * len(nodes))))

    @property
    def constants(self):
        """Constants that must lie in the main memory: magnitude to address."""
        return self._main[0]

    @property
    def addresses(self) -> dict[Node, int]:
        """Address of every value of an update but the state to be; of two addresses the even one."""
        return {**self._main[1], **self._side}

    @cached_property
    def side_depth(self):
        """Words of the side memory."""
        last = max(address + (self._turned(node)) for node, address in self._side.items())
        return 1 << last.bit_length()

    def _kept(self, node):
        """From when on, and for how many cycles, an address is a value's."""
        write = self.schedule.written[node]
        return write, max(self.schedule.last_read.get(node, 0) - write, 1)

    def _turned(self, node):
        return self._kept(node)[1] > self.length

    def _allocated(self, nodes, free):
        """Address of each node: the first that is free for as long as it must be."""
        taken = dict.fromkeys(free, 0)
        addresses: dict[Node, int] = {}
        for node in sorted(nodes, key=lambda node: -self._kept(node)[1]):
            begin, cycles = self._kept(node)
            begin %= self.length
            mask = ((1 << min(cycles, self.length)) - 1) << begin
            mask = (mask | mask >> self.length) & ((1 << self.length) - 1)
            for address in free:
                wanted = [address, address + 1] if self._turned(node) else [address]
                if address % len(wanted) == 0 and all(not taken.get(each, -1) & mask for each in wanted):
                    break
            else:
                raise ValueError(f"the memory has no room for {node}: there must be more state words or channels")
            for each in wanted:
                taken[each] |= mask
            addresses[node] = address
        return addresses

    @cached_property
    def initial(self):
        """Contents of the main memory when the device is configured, as encodings."""
        words = [0] * self.depth
        for value, address in self.constants.items():
            words[address] = self.format.encode(value)
        for word, value in self.schedule.graph.state.items():
            words[self.upper + self.state[word]] = self.format.encode(value)
        return tuple(words)

    # The words.

    @property
    def kinds(self):
        """Number of kinds of addresses."""
        return STATE + self.schedule.stages

    @cached_property
    def layout(self):
        """Layout of a word."""
        address, kind = unsigned(exact_log2(self.depth)), unsigned(bits_for(self.kinds - 1))
        stage = unsigned(bits_for(self.schedule.stages - 1))
        operand = data.StructLayout({"address": address, "kind": kind, "side": 1, "negate": 1})
        fields: dict = {f"port{port}": data.StructLayout({"a": operand, "b": operand}) for port in self.read_ports}
        fields["start"] = data.StructLayout({unit.name: 1 for unit in self.units})
        modes = [f"{unit.name}_{mode}" for unit in self.units for mode in unit.modes.values()]
        if modes:
            fields["mode"] = data.StructLayout(dict.fromkeys(modes, 1))
        if self.conditions:
            index = unsigned(bits_for(len(self.conditions) - 1))
            fields["condition"] = data.StructLayout({"index": index, "negate": 1})
        for bus, width in ("main", address), ("side", unsigned(exact_log2(self.side_depth))):
            fields[bus] = data.StructLayout({
                "enable": 1, "address": width, "kind": kind, "stage": stage,
                "source": unsigned(bits_for(len(self.sources[bus]) - 1))})
        fields["input"] = unsigned(bits_for(len(self.schedule.graph.inputs) - 1))
        return data.StructLayout(fields)

    def _place(self, node, cycle):
        """Address and kind for a word that acts in ``cycle``; where it points to is settled in the cycle before."""
        stage = (cycle - 1) // self.length
        words = {new: word for word, new in self.schedule.graph.next_state.items()}
        if node.operation == "constant":
            return {"address": self.constants[node.value], "kind": PLAIN}
        if node.operation == "state" or node in words:
            return {"address": self.state[words.get(node, node.label)], "kind": STATE + stage}
        if self._turned(node):
            return {"address": self.addresses[node] + stage % 2, "kind": TURNED}
        return {"address": self.addresses[node], "kind": PLAIN}

    @cached_property
    def words(self):
        """The program: one dict, nested as ``layout``, a cycle."""
        words: list[dict] = [{} for _ in range(self.length)]
        units = {unit.name: unit for unit in self.units}
        graph, bus = self.schedule.graph, self.schedule.bus
        for step in self.schedule.steps:
            issue, write = words[step.issue % self.length], words[step.write % self.length]
            write[step.bus] = {
                "enable": 1, "source": self.sources[step.bus].index(step.unit),
                # What is on the bus is judged a cycle later.
                "stage": (step.write + 1) // self.length, **self._place(step.node, step.write)}
            if step.unit == "input":
                issue["input"] = graph.inputs.index(step.node.label)
                continue
            unit = units[step.unit]
            issue.setdefault("start", {})[unit.name] = 1
            if step.node.operation in unit.modes:
                issue.setdefault("mode", {})[f"{unit.name}_{unit.modes[step.node.operation]}"] = 1
            operands = step.node.operands
            port = f"port{self.schedule.read_port(unit.name)}"
            # A single operand goes to both ports, which makes a copy of a choice.
            for side, operand in zip("ab", (operands[0], operands[min(1, len(operands) - 1)]), strict=True):
                early = words[(step.issue - 1) % self.length].setdefault(port, {}).setdefault(side, {})
                early |= self._place(operand.node, step.issue - 1)
                fields = issue.setdefault(port, {}).setdefault(side, {})
                fields |= {"negate": int(operand.negated), "side": int(bus.get(operand.node) == "side")}
            if len(operands) == 3:
                issue["condition"] = {"index": self.conditions.index(operands[2].node),
                                      "negate": int(operands[2].negated)}
        return words
