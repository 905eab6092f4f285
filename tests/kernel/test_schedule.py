from dataclasses import replace
from itertools import pairwise
from time import process_time

import pytest

from strapdown.cores import ATTITUDE_CORES, THESIS
from strapdown.kernel.list_scheduler import list_schedule
from strapdown.kernel.machine import UpdateMachine
from strapdown.kernel.operators import Adder, Divider, Multiplier
from strapdown.kernel.pool import Pool
from strapdown.kernel.trace import Tracer
from strapdown_sim.cache import Cache

from ..schedules import searched_once
from .kalman import kalman_graph

POOL = Pool()


def schedule(graph, pool):
    """The schedule of an engine on a pool."""
    return list_schedule(graph, UpdateMachine(pool))


def small_graph():
    """(x·y + x, x·x) from two inputs."""
    xp = Tracer(Pool(), ("ONLY",))
    x, y = xp.source("input", "x"), xp.source("input", "y")
    outputs = {"a": xp.settled(x * y + x), "b": xp.settled(x * x)}
    return xp.graph(inputs=("x", "y"), outputs=outputs)


def moved(result, index, by):
    """A schedule with one step moved in time."""
    steps = list(result.steps)
    step = steps[index]
    steps[index] = replace(step, issue=step.issue + by, write=step.write + by)
    return replace(result, steps=tuple(sorted(steps, key=lambda step: step.issue)))


def index_of(result, operation, which=0):
    return [index for index, step in enumerate(result.steps) if step.node.operation == operation][which]


def test_chain_takes_the_sum_of_its_latencies():
    result = schedule(small_graph(), POOL)
    # Both inputs are registered and use the bus in two cycles; product and sum are each forwarded.
    assert result.length == 1 + 2 + (Multiplier().latency + 1) + (Adder().latency + 1)


@pytest.mark.parametrize("name", ATTITUDE_CORES)
@pytest.mark.parametrize("pool", [POOL, POOL.with_operators(Adder(latency=6), Multiplier(latency=1))],
                         ids=["default", "other"])
def test_every_core_has_a_valid_schedule(name, pool):
    result = schedule(ATTITUDE_CORES[name](THESIS).trace(pool), pool)
    result.verify()
    ends = result.section_ends
    assert list(ends) == sorted(set(ends))
    assert ends[-1] == result.length - 1


def test_schedule_is_the_same_every_time():
    first, second = (schedule(ATTITUDE_CORES["INS_top"](THESIS).trace(POOL), POOL) for _ in range(2))
    assert [(step.unit, step.issue) for step in first.steps] == [(step.unit, step.issue) for step in second.steps]


def test_verify_finds_two_results_in_one_cycle():
    result = schedule(small_graph(), POOL)
    first, second = index_of(result, "input", 0), index_of(result, "input", 1)
    with pytest.raises(AssertionError, match="result bus"):
        moved(result, second, result.steps[first].issue - result.steps[second].issue).verify()


def test_verify_finds_a_read_before_the_write():
    result = schedule(small_graph(), POOL)
    with pytest.raises(AssertionError, match=r"cannot read multiply\(x, y\) after -1 cycles"):
        moved(result, index_of(result, "add"), -1).verify()


def test_verify_finds_two_reads_of_one_port():
    xp = Tracer(Pool(), ("ONLY",))
    x, y = xp.source("input", "x"), xp.source("input", "y")
    graph = xp.graph(inputs=("x", "y"), outputs={"a": xp.settled(x * y), "b": xp.settled(xp.sqrt(y))})
    result = schedule(graph, POOL)
    root, product = index_of(result, "sqrt"), index_of(result, "multiply")
    with pytest.raises(AssertionError, match="read port"):
        moved(result, product, result.steps[root].issue - result.steps[product].issue).verify()


def test_verify_finds_a_busy_unit():
    xp = Tracer(Pool(), ("ONLY",))
    x, y = xp.source("input", "x"), xp.source("input", "y")
    graph = xp.graph(inputs=("x", "y"), outputs={"a": xp.settled(xp.sqrt(x)), "b": xp.settled(xp.sqrt(y))})
    result = schedule(graph, POOL.with_operators(Divider()))
    with pytest.raises(AssertionError, match="divider is used 2 times"):
        moved(result, index_of(result, "sqrt", 1), -1).verify()


def test_verify_finds_a_missing_node():
    result = schedule(small_graph(), POOL)
    with pytest.raises(AssertionError, match="missing"):
        replace(result, steps=result.steps[:-1]).verify()


def test_a_result_that_is_taken_as_it_comes_out_is_not_stored():
    result = schedule(small_graph(), POOL)
    product = result.steps[index_of(result, "multiply", 0)]
    total = result.steps[index_of(result, "add")]
    fed = product if product.write == total.issue else result.steps[index_of(result, "multiply", 1)]
    assert fed.write == total.issue
    assert not fed.stored
    assert schedule(small_graph(), Pool(forwarding=False)).length > result.length


def test_what_might_hide_an_infinity_gets_its_operands_over_the_bus():
    for core in ATTITUDE_CORES.values():
        result = schedule(core(THESIS).trace(POOL), POOL)
        on_bus = {step.node for step in result.steps if result.on_bus(step)}
        for step in result.steps:
            if step.node.operation not in ("add", "multiply"):
                assert {operand.node for operand in step.node.operands if operand.node.computed} <= on_bus


def test_no_schedule_is_shorter_than_its_bounds():
    for core in ATTITUDE_CORES.values():
        result = schedule(core(THESIS).trace(POOL), POOL)
        assert max(result.bounds.values()) <= result.length
    chain = schedule(small_graph(), POOL)
    # Only the second input, which is one cycle late, makes the chain longer than its bound.
    assert chain.length == chain.bounds["dependences"] + 1


def test_critical_path_leads_from_a_source_to_the_last_result():
    result = schedule(ATTITUDE_CORES["INS_top"](THESIS).trace(POOL), POOL)
    path = [step for step, _ in result.critical_path]
    assert not path[0].node.computed
    assert path[-1].write == result.length - 1
    for before, step in pairwise(path):
        assert before.node in {operand.node for operand in step.node.operands}
    assert all(wait >= 0 for _, wait in result.critical_path)


def test_what_lasts_or_decides_is_not_put_aside():
    graph = ATTITUDE_CORES["INS_top"](THESIS).trace(POOL)
    result = schedule(graph, replace(POOL, side_memory=True))
    aside = {step.node for step in result.steps if step.stored and step.bus == "side"}
    assert aside
    assert aside.isdisjoint({*graph.outputs.values(), *graph.next_state.values()})
    assert aside.isdisjoint(operand.node for node in graph.nodes for operand in node.operands[2:])
    kept = next(index for index, step in enumerate(result.steps) if step.node in graph.next_state.values())
    steps = list(result.steps)
    steps[kept] = replace(steps[kept], bus="side")
    with pytest.raises(AssertionError, match="cannot go over the side bus"):
        replace(result, steps=tuple(steps)).verify()


def test_constants_and_choices_are_put_aside_if_they_may_be():
    graph = ATTITUDE_CORES["INS_top"](THESIS).trace(POOL)
    plain, wide = (schedule(graph, replace(POOL, side_memory=True, side_registered=registered))
                   for registered in (False, True))
    kinds = [{step.node.operation for step in result.steps if step.bus == "side"} for result in (plain, wide)]
    assert kinds[0] == {"add", "multiply"}
    assert {"add", "multiply", "constant", "select"} <= kinds[1]
    assert kinds[1].isdisjoint({"input", "state"})
    assert "register before the buses" in wide.bounds
    assert "register before the buses" not in plain.bounds


def test_two_results_cannot_pass_the_register_in_the_same_cycle():
    result = schedule(ATTITUDE_CORES["INS_top"](THESIS).trace(POOL),
                      replace(POOL, side_memory=True, side_registered=True))
    first, last = (next(index for index, step in order if step.node.operation == "constant" and step.bus == bus)
                   for order, bus in ((list(enumerate(result.steps)), "side"),
                                      (list(enumerate(result.steps))[::-1], "main")))
    steps = list(result.steps)
    steps[last] = replace(steps[last], issue=steps[first].issue, write=steps[first].write)
    with pytest.raises(AssertionError, match="register before the buses is used 2 times"):
        replace(result, steps=tuple(steps)).verify()


def test_a_large_graph_is_scheduled_in_seconds():
    """3,500 operations, like an INS/GNSS filter: within a fifth of the bound, and within a minute on one core."""
    graph = kalman_graph(POOL)
    assert sum(graph.count().values()) > 3400
    begin = process_time()
    result = schedule(graph, POOL)
    assert process_time() - begin < 60
    assert max(result.bounds.values()) <= result.length < 1.2 * max(result.bounds.values())


def test_a_schedule_that_was_searched_before_is_that_of_the_search(tmp_path):
    """What engines take in other tests: an earlier result, on the nodes of another graph of the same operations."""
    searched = []

    def search(graph, machine):
        searched.append(graph)
        return list_schedule(graph, machine)

    first, second = (searched_once(search, Cache(tmp_path))(small_graph(), UpdateMachine(POOL)) for _ in range(2))
    (graph,) = searched
    assert [step.node for step in second.steps] != [step.node for step in first.steps]
    facts = [[(replace(step, node=None), result.graph.nodes.index(step.node)) for step in result.steps]
             for result in (schedule(graph, POOL), first, second)]
    assert facts[0] == facts[1] == facts[2]
    searched_once(search, Cache(tmp_path))(small_graph(), UpdateMachine(POOL.with_operators(Adder(latency=6))))
    assert len(searched) == 2
