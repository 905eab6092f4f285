import pytest

from strapdown.algorithms import vector
from strapdown.kernel.pool import Pool
from strapdown.kernel.trace import Tracer


@pytest.fixture
def xp():
    return Tracer(Pool(), ("FIRST", "SECOND"))


def graph(xp, **outputs):
    return xp.graph(inputs=("x", "y"), outputs={name: xp.settled(symbol) for name, symbol in outputs.items()})


def test_equal_operations_are_one(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    assert graph(xp, a=x * y + 1, b=x * y + 1.0).count() == {"add": 1, "multiply": 1}


def test_operand_order_is_part_of_the_kernel(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    assert graph(xp, a=x + y, b=y + x).count() == {"add": 2}


def test_sign_changes_are_free(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    assert graph(xp, a=-x * -y - (-x)).count() == {"add": 1, "multiply": 1}


def test_subtracting_zero_is_free(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    assert graph(xp, a=xp.maximum(x * y, 0.0)).count() == {"multiply": 1, "select": 1}


def test_adding_zero_is_not(xp):
    # -0 + 0 is +0.
    x = xp.source("input", "x")
    assert graph(xp, a=x * x + 0.0).count() == {"add": 1, "multiply": 1}


def test_what_no_output_needs_is_left_out(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    _ = xp.sqrt(x) / y
    assert graph(xp, a=x * y).count() == {"multiply": 1}


def test_outputs_that_are_only_read_or_negated_are_copied(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    assert graph(xp, a=x, b=-(x * y)).count() == {"copy": 2, "multiply": 1}


def test_each_state_word_has_a_node_of_its_own(xp):
    x = xp.source("input", "x")
    product = x * x
    first, second = xp.settled(product, "p"), xp.settled(product, "q")
    assert first is not second
    assert second.operation == "copy"
    assert xp.settled(product, "p") is first


def test_constants_are_rounded_to_the_format(xp):
    x = xp.source("input", "x")
    constants = [node for node in graph(xp, a=x * 0.1, b=x * -0.1).nodes if node.operation == "constant"]
    assert [node.value for node in constants] == [float.fromhex("0x1.99999ap-4")]


def test_operations_know_their_section_and_their_kernel_line(xp):
    x, y = xp.source("input", "x"), xp.source("input", "y")
    with xp.section("SECOND"):
        product = vector.dot((x,), (y,))
    node = xp.settled(product)
    assert node.section == "SECOND"
    assert xp.settled(x + y).section == "FIRST"
    assert [(origin.file, origin.function) for origin in node.origin] == [("algorithms/vector.py", "dot")]


def test_unknown_section_is_refused(xp):
    with pytest.raises(ValueError, match=r"^section must be one of FIRST, SECOND, not 'THIRD'$"), xp.section("THIRD"):
        pass


def test_a_graph_can_be_shown(xp):
    # 2^20 paths lead from the last of these sums to the input.
    value = xp.source("input", "x")
    for _ in range(20):
        value = value + value
    assert len(repr(graph(xp, a=value))) < 20_000
