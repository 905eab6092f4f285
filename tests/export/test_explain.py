import inspect

from strapdown.algorithms import attitude
from strapdown.cores import THESIS, make_core
from strapdown.export.explain import explain_cycle, explain_line, microprogram_listing

PROGRAM = make_core("INS_matx", THESIS).engine.program


def line_of(function, text):
    lines, first = inspect.getsourcelines(function)
    return first + next(index for index, line in enumerate(lines) if text in line)


def test_listing_has_every_start_and_every_write():
    listing = "\n".join(microprogram_listing(PROGRAM))
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


def test_a_kernel_line_leads_to_its_operations():
    line = line_of(attitude.matrix_from_quaternion, "d0, d1, d2, d3 = add(q, q)")
    found = list(explain_line(PROGRAM, "attitude.py", line))
    assert len(found) == 4
    assert all("adder: add" in text for text in found)
