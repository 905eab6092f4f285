"""The words of the ROM, run by an interpreter that was written from the documentation of ``StreamProgram`` alone."""

from collections import defaultdict, namedtuple

import numpy as np
import pytest

from strapdown.cores import ATTITUDE_CORES, FLIGHT, QUATERNION_J3, THESIS, THESIS_FAST_X16, THESIS_X8
from strapdown.cores.attitude import ins_top
from strapdown.cores.flight import ins_flight
from strapdown.cores.quaternion import quat_direct
from strapdown.kernel.machine import StreamMachine
from strapdown.kernel.modulo_scheduler import modulo_schedule
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector, meaning
from strapdown.kernel.pool import Pool
from strapdown.kernel.program import CONSTANT, NEXT, PLAIN, STATE, TURNED, StreamProgram

POOL, CHANNELS, INTERVAL = THESIS_X8.pool, THESIS_X8.channels, THESIS_X8.interval
FORMAT = POOL.format
SYSTEM = ins_top(THESIS_X8)
# One pair of read ports, one bus.
NARROW = Pool(private_ports=False, side_memory=False)
WIDE = Pool(operators=(Adder(count=2), Multiplier(count=2), Divider(), Selector()))
CASES = {
    # Next-state values are read in the update that makes them, and signs of the state are conditions.
    "flight": (ins_flight(FLIGHT), FLIGHT.pool, 8),
    "one read port and one bus": (quat_direct(QUATERNION_J3), NARROW, 2),
    "two adders and multipliers": (quat_direct(QUATERNION_J3), WIDE, 64),
    "three side buses": (SYSTEM, THESIS_FAST_X16.pool, 16),
    "no status port": (ATTITUDE_CORES["INS_quat"](THESIS), THESIS.pool, 4),
}

Update = namedtuple("Update", "channel bank fresh inputs")


@pytest.fixture(scope="module")
def program():
    return StreamProgram(modulo_schedule(SYSTEM.trace(POOL), StreamMachine(POOL), INTERVAL), CHANNELS)


def number_bits(constants):
    """Bits of the number of a constant, at least one."""
    return max(len(constants) - 1, 1).bit_length()


class Machine:
    """Runs words for successive updates; the result of a unit is stored by the cycle in which it comes out."""

    def __init__(self, program):
        self.program = program
        # What the memories contain at first is never read, but for the constants: they are written before a sample.
        rng = np.random.default_rng(8)
        self.memories = {bus: rng.integers(1 << 32, size=depth).tolist() for bus, depth in program.depths.items()}
        self.main = self.memories["main"]
        self.constants = [int(FORMAT.to_bits(value)) for value in program.constants]
        self.main[program.upper:program.upper + len(self.constants)] = self.constants
        self.units = {unit.name: unit for unit in program.units}
        self.coming, self.refreshed = {}, set()
        self.buses = {}
        # The values that all memories give, by port, side and the cycle in which they are chosen.
        self.operands = defaultdict(lambda: [0] * len(self.memories))

    def run(self, begins):
        """Run cycle by cycle; ``begins`` has an Update or None for each start of an interval."""
        for cycle in range(self.program.length * len(begins)):
            self.cycle(cycle, begins)

    def address(self, fields, cycle, begins, *, to_be=False):
        (kind, parameter), address = self.program.kinds[fields["kind"]], fields["address"]
        # Computed in the previous cycle, from the updates in each stage and the number of intervals.
        period = (cycle - 1) // self.program.length
        if kind == PLAIN:
            return address
        if kind == CONSTANT:
            return address + period % (1 << number_bits(self.program.constants))
        if kind == TURNED:
            low = (1 << parameter) - 1
            return address & ~low | (address + period) & low
        assert kind in (STATE, NEXT)
        update = begins[period - parameter] if period >= parameter else None
        if update is None:
            return None
        to_be = to_be or kind == NEXT
        number = address & (1 << self.program.index_bits) - 1
        if update.fresh and not to_be:
            return self.program.upper + number
        return address - number | update.channel << 1 | update.bank ^ to_be

    def cycle(self, cycle, begins):
        program, word = self.program, self.program.words[cycle % self.program.length]
        begin = begins[cycle // program.length]
        if begin is not None:
            self.coming["input", cycle] = FORMAT.to_bits(begin.inputs[word.get("input", 0)])
        for name in self.memories:
            if name in word:
                source = program.sources[name][word[name]["source"]]
                value = int(self.coming.get((source, cycle), 0x7FC00000))
                if source == "constant":
                    number = self.address(word[name], cycle, begins) - program.upper
                    value = self.constants[number] if number < len(self.constants) else 0x7FC00000
                    self.refreshed.add(number)
                self.buses[name, cycle] = value
        for name, unit in self.units.items():
            if not word.get("start", {}).get(name):
                continue
            values = []
            for side in "ab":
                fields = word[f"port{program.schedule.machine.port(unit)}"][side]
                read = self.operands[program.schedule.machine.port(unit), side, cycle]
                bits = read[fields.get("side", 0)]
                values.append(FORMAT.from_bits(bits ^ fields["negate"] << FORMAT.width - 1))
            if name == "selector" and "condition" not in word:
                result = values[0]
            elif name == "selector":
                node, age = program.conditions[word["condition"]["index"]]
                written = program.schedule.written[node]
                signs = [c for c in range(cycle) if (c - written) % program.length == 0]
                last = signs[-1 - age] if len(signs) > age else None
                sign = 0 if last is None else self.buses[program.schedule.bus[node], last] >> FORMAT.width - 1
                result = values[0] if sign != word["condition"]["negate"] else values[1]
            else:
                modes = {mode for mode in unit.modes.values() if word.get("mode", {}).get(f"{name}_{mode}")}
                operation = next(operation for operation in unit.operations
                                 if {unit.modes.get(operation)} - {None} == modes)
                with np.errstate(all="ignore"):
                    result = unit.operations[operation](*values[:meaning(operation).operands])
            self.coming[name, cycle + 1 + unit.latency] = FORMAT.to_bits(result)
        # No word is read and written in the same cycle, so the order does not matter.
        read, chosen = set(), cycle + program.schedule.pool.read_ranks
        for port in program.read_ports:
            for side in "ab":
                fields = word.get(f"port{port}", {}).get(side, {})
                if "address" in fields:
                    address = self.address(fields, cycle, begins)
                    if address is None:
                        self.operands[port, side, chosen] = [0] * len(self.memories)
                        continue
                    self.operands[port, side, chosen] = [
                        memory[address % len(memory)] for memory in self.memories.values()]
                    following = program.words[chosen % program.length][f"port{port}"][side]
                    read.add(([*self.memories][following.get("side", 0)], address))
        for name, memory in self.memories.items():
            if name in word:
                address = self.address(word[name], cycle, begins, to_be=True)
                if address is not None:
                    # A constant may be read while the same number is written.
                    assert (name, address) not in read or memory[address] == self.buses[name, cycle]
                    memory[address] = self.buses[name, cycle]


def test_words_compute_what_the_twin_computes_while_updates_overlap(program):
    check_words(SYSTEM, program)


@pytest.mark.parametrize("case", CASES)
def test_every_system_can_be_streamed_on_every_kind_of_pool(case):
    system, pool, channels = CASES[case]
    program = StreamProgram(modulo_schedule(system.trace(pool), StreamMachine(pool)), channels)
    kinds = {kind for kind, _ in program.kinds}
    assert NEXT in kinds or case != "flight"
    assert len(program.side_depths) == (0 if pool is NARROW else pool.side_buses)
    check_words(system, program)


def check_words(system, program):
    """Updates of several channels, one after another, with gaps: outputs and states against the twin."""
    rng = np.random.default_rng(7)
    machine = Machine(program)
    stages = program.schedule.stages
    state = {}
    begins, expected = [], []
    running = []
    for begin in range(20 + stages):
        running = [channel for start, channel in running if begin - start < stages] if begin else []
        choices = [channel for channel in range(min(program.channels, 8)) if channel not in running]
        running = [(start, channel) for start, channel in zip(range(begin - len(running), begin), running, strict=True)]
        if begin >= 20 or rng.random() < 0.2 or not choices:
            begins.append(None)
            expected.append(None)
            continue
        channel = int(rng.choice(choices))
        bank, values = state.get(channel, (0, None))
        inputs = [FORMAT.array(value) for value in rng.standard_normal(len(system.input_ports)) * 10]
        before = values or {word: FORMAT.array(value) for word, value in program.graph.state.items()}
        twin = system.update_twin(program.schedule.pool, dict(zip(system.input_ports, inputs, strict=True)), before)
        begins.append(Update(channel, bank, values is None, inputs))
        expected.append(twin)
        state[channel] = 1 - bank, {word: twin[word] for word in program.graph.state}
        running.append((begin, channel))
    machine.run(begins)
    assert len(machine.refreshed) == min(len(begins), 1 << number_bits(program.constants))
    for begin, twin in enumerate(expected):
        if twin is not None:
            for port, node in program.schedule.graph.outputs.items():
                cycle = begin * program.length + program.schedule.written[node]
                assert machine.buses[program.schedule.bus[node], cycle] == FORMAT.to_bits(twin[port]), (begin, port)
    for channel, (bank, values) in state.items():
        for word, value in values.items():
            address = program.state[word] + 2 * channel + bank
            assert machine.main[address] == FORMAT.to_bits(value), (channel, word)
    assert len(state) > 4 or len(state) == program.channels


def test_memories_are_as_small_as_block_ram_and_luts_come(program):
    # 13 words of state, twice for each of eight channels, take no more than the half of 512.
    assert program.depth == 512
    assert max(program.side_depths.values()) <= 64


def test_bad_channels_are_refused(program):
    for channels in 0, 1, 3, 12, 128:
        with pytest.raises(ValueError, match=f"^channels must be a power of two from 2 to 64, not {channels}$"):
            StreamProgram(program.schedule, channels)
