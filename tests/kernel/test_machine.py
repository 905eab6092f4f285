"""The rules of both engines, and the bounds that follow from them."""

from dataclasses import replace

import pytest

from strapdown.cores import ATTITUDE_CORES, FLIGHT, THESIS, THESIS_COMPACT, THESIS_FAST_X16, THESIS_X8, make_core
from strapdown.cores.flight import ins_flight
from strapdown.kernel.list_scheduler import list_schedule
from strapdown.kernel.machine import Problem, StreamMachine, UpdateMachine
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.trace import Tracer


@pytest.mark.parametrize("pool", [Pool(operand_memory=MemoryStyle.BLOCK, side_memory=True),
                                  Pool(side_memory=MemoryStyle.BLOCK)])
def test_with_a_side_memory_one_channel_reads_without_a_clock_edge(pool):
    with pytest.raises(ValueError, match=r"^operand_memory and side_memory must be auto or distributed for one channel "
                                         r"with a side memory$"):
        UpdateMachine(pool)
    StreamMachine(replace(pool, forwarding=False))


@pytest.mark.parametrize("field", ["side_buses", "read_ranks"])
def test_one_channel_has_two_buses_and_memories_without_further_ranks(field):
    with pytest.raises(ValueError, match=f"^{field} must be 1 for one channel, not 2$"):
        UpdateMachine(Pool(side_memory=True, **{field: 2}))


def test_each_pair_of_read_ports_but_the_first_has_a_side_bus():
    machine = StreamMachine(THESIS_FAST_X16.pool)
    assert {name: machine.links(unit) for name, unit in machine.unit.items()} == {
        "adder_0": ("main", "side"), "adder_1": ("side", "main"), "multiplier_0": ("side2", "main"),
        "multiplier_1": ("side3", "main"),
        **dict.fromkeys(("table_reciprocal", "table_arctangent", "selector"), ("main",))}
    assert StreamMachine(replace(machine.pool, side_memory=False)).side_buses == ()


def test_what_has_no_read_ports_of_its_own_shares_those_of_the_more_plentiful_kind():
    for config, host in (THESIS_FAST_X16, "adder_0"), (THESIS_X8, "multiplier_0"):
        machine = StreamMachine(config.pool)
        assert {machine.port(machine.unit[name]) for name in ("table_reciprocal", "table_arctangent", "selector", host)
                } == {machine.unit[host].read_port}


def test_a_rank_after_the_memories_delays_all_operands():
    slow, fast = (StreamMachine(replace(THESIS_X8.pool, read_ranks=ranks)) for ranks in (2, 1))
    assert (slow.lead, slow.first_issue) == (fast.lead + 1, fast.first_issue + 1)
    graph = ATTITUDE_CORES["INS_top"](THESIS_X8).trace(THESIS_X8.pool)
    reads = [Problem(graph, machine).lengths()["dependences"] for machine in (slow, fast)]
    assert reads[0] > reads[1]


def test_several_channels_do_without_forwarding():
    with pytest.raises(ValueError, match=r"^forwarding must be False for several channels: all operands come from me"):
        StreamMachine(Pool(forwarding=True))


def test_what_a_pool_leaves_open_suits_the_number_of_channels():
    assert UpdateMachine(Pool()).pool == Pool().settled(1) == Pool(
        forwarding=True, operand_memory=MemoryStyle.AUTO, side_memory=False)
    assert StreamMachine(Pool()).pool == Pool().settled(8) == Pool(
        forwarding=False, operand_memory=MemoryStyle.BLOCK, side_memory=MemoryStyle.AUTO)
    for config in THESIS_X8, THESIS_COMPACT:
        assert config.pool.settled(1) is config.pool.settled(8) is config.pool


@pytest.mark.parametrize(("field", "value"), [("operand_memory", MemoryStyle.DISTRIBUTED), ("side_memory", False)])
def test_what_a_pool_says_is_obeyed_with_several_channels(field, value):
    config = THESIS.replace(pool=Pool(**{field: value}), channels=8)
    assert getattr(StreamMachine(config.pool).pool, field) is getattr(config.engine_pool, field) is value
    assert config.engine_pool == replace(Pool().settled(8), **{field: value})


def test_a_pool_that_must_forward_is_refused_with_several_channels():
    config = FLIGHT.replace(pool=Pool(forwarding=True), channels=8)
    with pytest.raises(ValueError, match=r"^forwarding must be False for several channels: all operands come from me"):
        make_core("INS_flight_x8", config)


def test_one_read_port_and_one_bus_are_obeyed():
    pool = Pool(private_ports=False, side_memory=False)
    machine, graph = StreamMachine(pool), ATTITUDE_CORES["INS_quat"](THESIS).trace(pool)
    problem = Problem(graph, machine)
    operations = sum(graph.count().values())
    assert {machine.port(unit) for unit in pool.units} == {0}
    assert problem.intervals()["read port 0"] == operations
    # In one more cycle the bus takes a constant.
    assert problem.intervals()["result bus"] == len(problem.nodes) + 1 > operations


def test_signs_that_several_channels_cannot_keep_are_copied():
    pool = FLIGHT.pool.settled(8)
    machine, graph = StreamMachine(pool), ins_flight(FLIGHT).trace(pool)
    prepared = machine.prepared(graph)
    signs = {node.condition.node for node in graph.nodes if node.condition is not None}
    states = {node.label for node in signs if node.operation == "state"}
    copies = [node for node in prepared.nodes if node.operation == "copy" and node not in graph.nodes
              and node.operands[0].node.label in states]
    assert states
    assert {node.operands[0].node.label for node in copies} == states
    assert all(machine.needs_step(node.condition.node) for node in prepared.nodes if node.condition is not None)
    assert {word: str(node) for word, node in prepared.next_state.items()} == {
        word: str(node) for word, node in graph.next_state.items()}
    # Nothing to copy, nothing changed.
    graph = ATTITUDE_CORES["INS_top"](THESIS).trace(pool)
    assert machine.prepared(graph) is graph


def test_a_status_bit_of_the_state_is_copied():
    pool = Pool().settled(8)
    xp = Tracer(pool, ("ONLY",))
    count = xp.source("state", "count")
    graph = xp.graph(inputs=(), outputs={}, state={"count": 0.0}, next_state={"count": xp.settled(count + 1, "count")},
                     status={"positive": (-count).operand})
    shown = StreamMachine(pool).prepared(graph).status["positive"]
    assert shown.negated
    assert (shown.node.operation, shown.node.operands[0].node.label) == ("copy", "count")


@pytest.mark.parametrize("pool", [Pool(forwarding=False), Pool()], ids=["memory", "forwarding"])
def test_bounds_count_results_on_the_bus(pool):
    xp = Tracer(pool, ("ONLY",))
    ports = [f"x{index}" for index in range(20)]
    first, *others = [xp.source("input", port) for port in ports]
    graph = xp.graph(inputs=tuple(ports), outputs={
        f"y{index}": xp.settled(first * value) for index, value in enumerate(others)})
    # All inputs and products use the bus, one per cycle; the first input is ready after a cycle.
    bounds = Problem(graph, UpdateMachine(pool)).lengths()
    assert bounds["result bus"] == 1 + 20 + 19
    assert bounds["result bus"] == max(bounds.values()) <= list_schedule(graph, UpdateMachine(pool)).length


def test_bounds_count_results_on_both_buses():
    pool = Pool(forwarding=False, side_memory=True)
    graph = ATTITUDE_CORES["INS_top"](THESIS).trace(pool)
    machine = UpdateMachine(pool)
    bounds, result = Problem(graph, machine).lengths(), list_schedule(graph, machine)
    nodes = len(Problem(graph, machine).nodes)
    assert nodes // 2 < bounds["2 buses"] < nodes
    assert max(bounds.values()) <= result.length
    # With one bus, a bound for both buses does not exist.
    assert "2 buses" not in Problem(graph, UpdateMachine(replace(pool, side_memory=False))).lengths()
