"""Modulo scheduling: every resource is used at most once per cycle, for all overlaps of updates."""

from collections import Counter
from dataclasses import replace

import pytest

from strapdown.cores import THESIS_FAST_X16, THESIS_X8
from strapdown.cores.attitude import ins_acc, ins_top
from strapdown.kernel.machine import Problem, StreamMachine
from strapdown.kernel.modulo_scheduler import modulo_schedule
from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector

from .kalman import kalman_graph

POOL, INTERVAL = THESIS_X8.pool, THESIS_X8.interval
MACHINE = StreamMachine(POOL)
ITERATIVE = replace(POOL, operators=(Adder(latency=5), Multiplier(latency=4), Divider(count=2, bits_per_cycle=1),
                                     Arctangent(steps_per_cycle=1), Selector()))


@pytest.fixture(scope="module")
def graph():
    return ins_top(THESIS_X8).trace(POOL)


@pytest.fixture(scope="module")
def small():
    """A schedule of a small graph."""
    return modulo_schedule(ins_acc(THESIS_X8).trace(POOL), MACHINE, 60)


@pytest.fixture(scope="module")
def schedule(graph):
    return modulo_schedule(graph, MACHINE, INTERVAL)


def test_updates_that_overlap_never_meet(schedule):
    # Twelve updates are superimposed, cycle by cycle, from the steps alone.
    units = {unit.name: unit for unit in POOL.units}
    taken = Counter()
    for update in range(12):
        for step in schedule.steps:
            begin = update * INTERVAL + step.issue
            taken[step.bus, update * INTERVAL + step.write] += 1
            if step.unit != "input":
                # All other units share the read ports of a multiplier: there are more multipliers than adders.
                own = step.unit in ("adder", "multiplier_1")
                taken[f"read ports of {step.unit if own else 'multiplier_0'}", begin] += 1
                for cycle in range(begin, begin + units[step.unit].interval):
                    taken[step.unit, cycle] += 1
    assert set(taken.values()) == {1}


def test_operands_are_written_before_they_are_read(schedule):
    written = {step.node: step.write for step in schedule.steps}
    for step in schedule.steps:
        for operand in step.node.operands[:2]:
            assert operand.node not in written or written[operand.node] + 2 <= step.issue


def test_state_goes_to_the_main_memory(schedule, graph):
    assert {schedule.bus[node] for node in graph.next_state.values()} == {"main"}


def test_no_interval_is_shorter_than_the_divisions():
    """There are two units for them."""
    graph, machine = ins_top(THESIS_X8).trace(ITERATIVE), StreamMachine(ITERATIVE)
    operations = graph.count()
    most = -(-(operations["divide"] + operations["sqrt"]) // 2)
    least = most * ITERATIVE.operations["divide"][0].interval
    assert least > operations["multiply"]
    with pytest.raises(ValueError, match=r"^interval must be at least \d+, which .* needs, not 60$") as refusal:
        modulo_schedule(graph, machine, 60)
    assert int(str(refusal.value).split()[5].rstrip(",")) >= least
    with pytest.raises(ValueError, match=r"^interval must be at least"):
        modulo_schedule(graph, machine, least - 1)


def test_equal_on_every_run(small):
    again = modulo_schedule(small.graph, small.machine, small.interval)
    assert again.steps == small.steps


@pytest.mark.parametrize(("change", "message"), [
    (lambda step: {"issue": step.issue - 1, "write": step.write - 1},
     r"is used 2 times in cycle|cannot read .* after 1 cycles"),
    (lambda step: {"write": step.write + 1}, "is not ready when it is written"),
    (lambda step: {"unit": "adder"}, "cannot compute"),
    (lambda step: {"bus": "nowhere"}, "cannot go over the nowhere bus"),
    (lambda step: {"unit": "multiplier_1", "bus": "side"}, "the side bus does not take .* from multiplier_1"),
])
def test_a_step_out_of_place_is_found(small, change, message):
    index, step = max(((index, step) for index, step in enumerate(small.steps) if step.unit == "multiplier_0"),
                      key=lambda pair: pair[1].issue)
    # At the first cycle in which the operand can be read, so that one cycle earlier is too early.
    issue = max(small.written[operand.node] for operand in step.node.operands if operand.node in small.written) + 2
    steps = list(small.steps)
    placed = replace(step, issue=issue, write=issue + step.write - step.issue)
    steps[index] = replace(placed, **change(placed))
    with pytest.raises(AssertionError, match=message):
        replace(small, steps=tuple(steps)).verify()


def test_a_missing_and_a_doubled_step_are_found(small):
    with pytest.raises(AssertionError, match="a node is missing"):
        replace(small, steps=small.steps[1:]).verify()
    with pytest.raises(AssertionError, match="scheduled twice"):
        replace(small, steps=(*small.steps, small.steps[0])).verify()


def test_a_large_graph_is_scheduled_near_its_bound():
    graph = kalman_graph(ITERATIVE, states=6, measurements=3)
    assert sum(graph.count().values()) > 500
    result = modulo_schedule(graph, StreamMachine(ITERATIVE))
    assert max(result.bounds.values()) <= result.interval < 1.1 * max(result.bounds.values())


def test_the_shortest_interval_is_found_again(small):
    shortest = modulo_schedule(small.graph, MACHINE)
    assert max(shortest.bounds.values()) <= shortest.interval <= small.interval
    assert modulo_schedule(small.graph, MACHINE, shortest.interval).steps == shortest.steps


def test_an_interval_without_a_schedule_is_refused():
    # The four buses would be busy in all cycles but two.
    pool = THESIS_FAST_X16.pool
    graph, machine = ins_top(THESIS_FAST_X16).trace(pool), StreamMachine(pool)
    bounds = Problem(graph, machine).intervals()
    assert max(bounds.values()) == bounds["4 buses"] == 43
    with pytest.raises(ValueError, match=r"^interval must be longer than 43: no schedule was found$"):
        modulo_schedule(graph, machine, 43)
