"""The words of the ROM, run by an interpreter that was written from the engine's documentation alone."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.cores import ATTITUDE_CORES, THESIS, THESIS_COMPACT
from strapdown.kernel.list_scheduler import list_schedule
from strapdown.kernel.machine import UpdateMachine
from strapdown.kernel.operators import Adder, Arctangent, Divider, Extremes, Multiplier, Selector, meaning
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.program import UpdateProgram

POOL = THESIS.pool
FORMAT = POOL.format


def interpret(program, inputs, memory, bank, fresh):
    """Run the words of a program on a memory of encodings, in place; inputs are numbers."""
    units = {unit.name: unit for unit in program.units}
    lead = program.schedule.pool.memory_delay - 1  # the address of an operand is in an earlier word
    ports = dict(zip(program.schedule.graph.inputs, FORMAT.array(inputs), strict=True))
    aside = {}
    horizontal = program.schedule.pool.horizontal
    coming = {}  # maps (unit, cycle) to the result that comes out in it
    for cycle, word in enumerate(program.words):
        def physical(address):
            return address ^ (bank if address < program.state_words else 0)

        def stored(address):
            return FORMAT.from_bits(memory[physical(address)])

        write = word.get("write", {})
        if horizontal:
            # Nothing selects: the bus has the only result that comes out in this cycle, or zero.
            (bus,) = [value for (_, at), value in coming.items() if at == cycle] or [FORMAT.array(0.0)]
            for name, muted in word["mute"].items():
                if not muted:
                    coming[name, cycle + 2] = ports[name]
            if number := word.get("constant", 0):
                coming["constant", cycle + 2] = FORMAT.array(program.constants[number])
            for name in word.get("arrives", {}):
                assert program.addresses[program.arrivals[name]] == write["address"]
        else:
            bus = coming.get((program.sources["main"][write.get("source", 0)], cycle))
            number = word.get("other", 0)
            if number < len(program.other_sources):
                name = program.other_sources[number]
                coming["other", cycle + 1] = ports[name] if name in ports else coming.get((name, cycle))
            if number < len(program.constants):
                coming["constant", cycle + 1] = FORMAT.array(program.constants[number])

        def operand(port, side, cycle=cycle, bus=bus):
            fields, early = (program.words[c].get(port, {}).get(side, {}) for c in (cycle, cycle - lead))
            source = program.operand_sources[fields["source"]]
            if source == "memory":
                value = stored(early["address"])
            elif source == "side":
                value = aside[fields["address"] % program.side_depth]
            else:
                value = bus if source == "bus" else coming[source, cycle]
            return -value if fields["negate"] else value

        for name in word.get("start", {}):
            unit = units[name]
            a, b = (operand(f"port{unit.read_port}", side) for side in "ab")
            if name == "selector":
                condition = word.get("condition")
                chosen = condition is None or np.signbit(stored(condition["address"])) != condition["negate"]
                result = a if chosen else b
            else:
                modes = [mode for mode in unit.modes.values() if f"{name}_{mode}" in word.get("mode", {})]
                operation = next(operation for operation in unit.operations
                                 if [unit.modes[name] for name in [operation] if name in unit.modes] == modes)
                result = unit.operations[operation](*(a, b)[:meaning(operation).operands])
            coming[name, cycle + 1 + unit.latency + (horizontal and not unit.direct)] = result
        if write.get("enable") and (fresh or not write["restore"]):
            memory[physical(write["address"])] = int(FORMAT.to_bits(bus))
        if (side := word.get("side", {})).get("enable"):
            aside[side["address"]] = coming[program.sources["side"][side["source"]], cycle]


POOLS = {
    "default": POOL,
    "no forwarding": Pool(forwarding=False),
    "one port, block memory, no arctangent": Pool(
        operators=(Adder(), Multiplier(), Divider(count=2), Selector()),
        private_ports=False, forwarding=False, operand_memory=MemoryStyle.BLOCK),
    "horizontal": replace(THESIS_COMPACT.pool, operators=(*THESIS_COMPACT.pool.operators, Divider(), Arctangent())),
    "forwarding past a block memory": Pool(operand_memory=MemoryStyle.BLOCK),
    "two of each": Pool().with_operators(Adder(count=2), Multiplier(count=2), Arctangent(count=2)),
    "two buses": Pool(side_memory=True).with_operators(Adder(count=2), Multiplier(count=3)),
    "two buses for registered results": Pool(side_memory=True, side_registered=True).with_operators(
        Adder(count=2), Multiplier(count=2), Extremes()),
    "one bus, although registered results may go aside": Pool(side_registered=True),
}


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_words_compute_what_the_twin_computes(name):
    check_words(name, POOL)


@pytest.mark.parametrize("pool", POOLS)
def test_words_of_every_kind_of_pool(pool):
    check_words("INS_top", POOLS[pool])


def check_words(name, pool):
    system = ATTITUDE_CORES[name](THESIS)
    program = UpdateProgram(list_schedule(system.trace(pool), UpdateMachine(pool)))
    rng = np.random.default_rng(7)
    # What the memory contains at first is never read.
    memory, bank, fresh = rng.integers(1 << 32, size=program.depth).tolist(), 0, True
    state = {word: FORMAT.array(value) for word, value in system.reset.items()}
    for _ in range(5):
        values = rng.standard_normal(len(system.input_ports)) * 10
        interpret(program, values, memory, bank, fresh)
        bank, fresh = 1 - bank, False
        twin = system.update_twin(pool, dict(zip(system.input_ports, values, strict=True)), state)
        state = {word: twin[word] for word in state}
        for port, node in program.schedule.graph.outputs.items():
            address = program.addresses[node]
            if address < program.state_words:
                address ^= 1 - bank
            assert memory[address] == int(FORMAT.to_bits(twin[port])), port
        for index, word in enumerate(state):
            assert memory[2 * index + bank] == int(FORMAT.to_bits(state[word])), word


def test_state_words_come_in_pairs_before_everything_else():
    program = UpdateProgram(list_schedule(ATTITUDE_CORES["INS_top"](THESIS).trace(POOL), UpdateMachine(POOL)))
    assert program.state_words == 32
    assert set(program.state.values()) == set(range(0, 32, 2))
    assert program.used <= program.depth == 64


def test_constants_are_rounded_numbers_of_the_kernel():
    program = UpdateProgram(list_schedule(ATTITUDE_CORES["INS_top"](THESIS).trace(POOL), UpdateMachine(POOL)))
    numbers = set(program.constants)
    gain = (THESIS.kp + THESIS.ki * THESIS.period_s) * THESIS.period_s / 2
    assert {1.0, 360.0, float(np.float32(gain)), float(np.float32(THESIS.period_s / 2 * np.pi / 180))} <= numbers
