import inspect

import pytest

from strapdown.algorithms import attitude
from strapdown.cores import THESIS, THESIS_X8, make_core
from strapdown.export.explain import explain_cycle, explain_line, program_listing

PROGRAM = make_core("INS_matx", THESIS).engine.program


def line_of(function, text):
    lines, first = inspect.getsourcelines(function)
    return first + next(index for index, line in enumerate(lines) if text in line)


def test_listing_has_every_start_and_every_write():
    listing = "\n".join(program_listing(PROGRAM))
    assert listing.count("multiplier: multiply") == 9
    assert listing.count(":=") == sum(step.stored for step in PROGRAM.schedule.steps)


def test_a_cycle_leads_to_its_kernel_line():
    step = next(step for step in PROGRAM.schedule.steps if step.node.operation == "multiply")
    text = "\n".join(explain_cycle(PROGRAM, step.issue))
    assert "starts multiplier: multiply" in text
    assert "algorithms/attitude.py:" in text
    assert "matrix_from_quaternion" in text


def test_a_cycle_shows_the_bits_of_its_word():
    first = next(iter(explain_cycle(PROGRAM, 3)))
    assert int(first.split()[-1], 16) == PROGRAM.layout.const(PROGRAM.words[3]).as_bits()


def test_a_kernel_function_leads_to_its_operations():
    found = list(explain_line(PROGRAM, "attitude.py", "matrix_from_quaternion"))
    assert len(found) == PROGRAM.schedule.graph.count()["add"] + PROGRAM.schedule.graph.count()["multiply"]


def test_a_kernel_line_leads_to_its_operations():
    line = line_of(attitude.matrix_from_quaternion, "d0, d1, d2, d3 = add(q, q)")
    found = list(explain_line(PROGRAM, "attitude.py", line))
    assert len(found) == 4
    assert all("adder: add" in text for text in found)


@pytest.fixture(scope="module")
def streamed():
    return make_core("INS_top_x8", THESIS_X8).engine.program


def test_a_program_of_several_updates_is_listed_by_slot_and_stage(streamed):
    listing = list(program_listing(streamed))
    assert len(listing) <= streamed.length
    assert sum(line.count(":=") for line in listing) == len(streamed.schedule.steps)
    step = max(streamed.schedule.steps, key=lambda step: step.issue)
    stage, slot = divmod(step.issue, streamed.length)
    assert stage
    assert f"{step.unit}@{stage}: {step.node.operation} " in next(
        line for line in listing if line.split()[0] == str(slot))


def test_a_cycle_and_a_line_of_several_updates_lead_to_each_other(streamed):
    step = next(step for step in streamed.schedule.steps if step.node.operation == "atan2_degrees")
    text = "\n".join(explain_cycle(streamed, step.issue % streamed.length))
    assert f"starts table_arctangent@{step.issue // streamed.length}: atan2_degrees" in text
    file, line = step.node.origin[0].file.rpartition("/")[2], step.node.origin[0].line
    assert any(f"cycles {step.issue:>4} to {step.write:>4}" in found for found in explain_line(streamed, file, line))
