"""A schedule as words of a ROM, with an address for every value."""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

from amaranth import unsigned
from amaranth.lib import data

from .schedule import Schedule
from .trace import Node

__all__ = ["Microprogram"]


@dataclass(frozen=True)
class Microprogram:
    """The ROM of an engine, one word a cycle, and the map of its operand memory.

    The memory begins with the state: words ``2k`` and ``2k + 1`` are the two banks of state
    word k. Programs say ``2k`` for the state as it is and ``2k + 1`` for the state to be; the
    engine turns the lowest bit of these addresses from update to update. Constants follow, then
    the values of one update, each in place from the cycle after its write to its last read.

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
    def length(self):
        """Words, that is cycles of an update."""
        return self.schedule.length

    @cached_property
    def units(self):
        """Units that the program uses, in the pool's order."""
        used = {step.unit for step in self.schedule.steps}
        return tuple(unit for unit in self.schedule.pool.units if unit.name in used)

    @cached_property
    def sources(self):
        """What can be put on the result bus: the direct units' names, and "other"."""
        return self._sources("main")

    @cached_property
    def side_sources(self):
        """What can be put on the side bus: direct units' names."""
        return self._sources("side")

    def _sources(self, bus):
        seen = {step.unit if step.unit in self.schedule.direct else "other"
                for step in self.schedule.steps if self.schedule.on_bus(step) and step.bus == bus}
        return tuple(name for name in (*(unit.name for unit in self.units), "other") if name in seen)

    @cached_property
    def other_sources(self):
        """What can be registered on the way to the bus: the other units' names, and the input ports."""
        return (*(unit.name for unit in self.units if not unit.direct), *self.schedule.graph.inputs)

    @cached_property
    def operand_sources(self):
        """Where an operand can come from: "memory", "side" memory, the pipelined units whose results are taken
        as they come out, and "bus" for all other results."""
        found = {self.operand_source(step, operand) for step in self.schedule.steps
                 for operand in step.node.operands[:2]} | {"memory"}
        return tuple(name for name in ("memory", "side", *(unit.name for unit in self.units), "bus") if name in found)

    def operand_source(self, step, operand):
        """One of ``operand_sources``: where ``step`` takes an operand from."""
        if not self.schedule.forwarded(step, operand):
            return "side" if operand.node in self.schedule.aside else "memory"
        producer = self._unit_of[operand.node]
        return producer if producer in self.schedule.direct else "bus"

    @cached_property
    def _unit_of(self):
        return {step.node: step.unit for step in self.schedule.steps}

    @cached_property
    def read_ports(self):
        """Pairs of read ports that the program uses."""
        return tuple(sorted({unit.read_port for unit in self.units}))

    @property
    def state_words(self):
        """Addresses below this belong to the state."""
        return 2 * len(self.schedule.graph.state)

    # The memory.

    @cached_property
    def constants(self):
        """Constants that must lie in the memory: magnitude to address."""
        graph = self.schedule.graph
        values = dict.fromkeys(node.value for node in graph.nodes if node.operation == "constant")
        values |= dict.fromkeys(graph.state.values())
        return {value: self.state_words + index for index, value in enumerate(values)}

    @cached_property
    def addresses(self) -> dict[Node, int]:
        """Address of every node."""
        graph = self.schedule.graph
        state = {word: 2 * index for index, word in enumerate(graph.state)}
        addresses = {node: self.constants[node.value] for node in graph.nodes if node.operation == "constant"}
        addresses |= {node: state[node.label] for node in graph.nodes if node.operation == "state"}
        addresses |= {node: state[word] + 1 for word, node in graph.next_state.items()}

        # What outputs and status bits wait for is the last thing written to its address.
        kept = {*graph.outputs.values(), *(operand.node for operand in graph.status.values())}
        last_read: dict[Node, int] = defaultdict(int)
        for step in self.schedule.steps:
            for operand in step.node.operands:
                if not self.schedule.forwarded(step, operand):
                    last_read[operand.node] = max(last_read[operand.node], step.issue)
        free_from: dict[str, list[int]] = {"main": [], "side": []}
        base = {"main": self.state_words + len(self.constants), "side": 0}
        for step in sorted(self.schedule.steps, key=lambda step: step.write):
            if step.node in addresses or not step.stored:
                continue
            # An address may be written in the very cycle of its last read.
            slots = free_from[step.bus]
            slot = next((slot for slot, free in enumerate(slots) if free <= step.write), len(slots))
            if slot == len(slots):
                slots.append(0)
            slots[slot] = self.length if step.node in kept else max(last_read[step.node], step.write + 1)
            addresses[step.node] = base[step.bus] + slot
        return addresses

    @cached_property
    def used(self):
        """Words of memory in use, but for the side memory."""
        return max([*(address for node, address in self.addresses.items() if node not in self.schedule.aside),
                    *self.constants.values(), self.state_words - 1]) + 1

    @cached_property
    def side_depth(self):
        """Words of side memory: a power of two, or 0 if there is none."""
        used = max((self.addresses[node] for node in self.schedule.aside), default=-1) + 1
        return 1 << (used - 1).bit_length() if used else 0

    @cached_property
    def depth(self):
        """Words of memory: the next power of two, as the memories of an FPGA come."""
        return 1 << (self.used - 1).bit_length()

    @cached_property
    def initial(self):
        """Contents of the memory when the device is configured, as encodings."""
        words = [0] * self.depth
        for value, address in self.constants.items():
            words[address] = self.format.encode(value)
        return tuple(words)

    # The words.

    @cached_property
    def layout(self):
        """Layout of a word."""
        address = unsigned((self.depth - 1).bit_length())
        modes = [f"{unit.name}_{mode}" for unit in self.units for mode in unit.modes.values()]
        operand = data.StructLayout({
            "address": address, "negate": 1, "source": unsigned((len(self.operand_sources) - 1).bit_length())})
        fields: dict = {f"port{port}": data.StructLayout({"a": operand, "b": operand}) for port in self.read_ports}
        fields["start"] = data.StructLayout({unit.name: 1 for unit in self.units})
        if modes:
            fields["mode"] = data.StructLayout(dict.fromkeys(modes, 1))
        if any(unit.name == "selector" for unit in self.units):
            fields["condition"] = data.StructLayout({"address": address, "negate": 1})
        fields |= {
            "write": data.StructLayout({"enable": 1, "restore": 1, "address": address,
                                        "source": unsigned((len(self.sources) - 1).bit_length())}),
            **({"side": data.StructLayout({"enable": 1, "address": unsigned((self.side_depth - 1).bit_length()),
                                           "source": unsigned((len(self.side_sources) - 1).bit_length())})}
               if self.side_depth else {}),
            "other": unsigned(max(1, (len(self.other_sources) - 1).bit_length())),
            "advance": 1,
        }
        return data.StructLayout(fields)

    @property
    def address_fields(self):
        """Paths of those parts of ``layout`` that have an ``address`` in the operand memory."""
        operands = [(f"port{port}", side) for port in self.read_ports for side in "ab"]
        conditions = [("condition",)] if "condition" in self.layout.members else []
        return (*operands, *conditions, ("write",))

    @cached_property
    def words(self):
        """The program: one dict, nested as ``layout``, a cycle."""
        words: list[dict] = [{} for _ in range(self.length)]
        units = {unit.name: unit for unit in self.units}
        graph = self.schedule.graph
        for step in self.schedule.steps:
            issue, write = words[step.issue], words[step.write]
            if step.node in self.schedule.aside:
                write["side"] = {"enable": 1, "source": self.side_sources.index(step.unit),
                                 "address": self.addresses[step.node]}
            elif self.schedule.on_bus(step):
                direct = step.unit in self.schedule.direct
                write["write"] = {"source": self.sources.index(step.unit if direct else "other")}
                if not direct:
                    name = step.node.label if step.unit == "input" else step.unit
                    words[step.write - 1]["other"] = self.other_sources.index(name)
                if step.stored:
                    write["write"] |= {"enable": 1, "restore": int(step.node.operation == "state"),
                                       "address": self.addresses[step.node]}
            if step.unit == "input":
                continue
            unit = units[step.unit]
            issue.setdefault("start", {})[unit.name] = 1
            if step.node.operation in unit.modes:
                issue.setdefault("mode", {})[f"{unit.name}_{unit.modes[step.node.operation]}"] = 1
            if step.node.operation == "state":
                operands = [("memory", self.constants[graph.state[step.node.label]], False)]
            else:
                operands = [(self.operand_source(step, operand), self.addresses.get(operand.node), operand.negated)
                            for operand in step.node.operands]
            # A single operand goes to both ports, which makes a copy of a choice.
            for side, operand in zip("ab", (operands[0], operands[min(1, len(operands) - 1)]), strict=True):
                source, address, negated = operand
                fields = issue.setdefault(f"port{unit.read_port}", {}).setdefault(side, {})
                fields |= {"negate": int(negated), "source": self.operand_sources.index(source)}
                if source == "side":
                    # Beside the addresses that turn with the bank.
                    fields["address"] = self.depth - self.side_depth + address
                elif source == "memory":
                    early = words[step.issue - (self.schedule.pool.memory_delay - 1)]
                    early.setdefault(f"port{unit.read_port}", {}).setdefault(side, {})["address"] = address
            if len(operands) == 3:
                _, address, negated = operands[2]
                issue["condition"] = {"address": address, "negate": int(negated)}
        for end in self.schedule.section_ends:
            words[end]["advance"] = 1
        return words
