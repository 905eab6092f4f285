import pytest

from strapdown.kernel.pool import MemoryStyle, Pool


def test_every_operation_of_a_kernel_has_its_units():
    pool = Pool(adders=2, dividers=3)
    assert {operation: [unit.name for unit in units] for operation, units in pool.operations.items()} == {
        "add": ["adder_0", "adder_1"], "multiply": ["multiplier"], "atan2": ["arctangent"],
        "divide": ["divider_0", "divider_1", "divider_2"], "sqrt": ["divider_0", "divider_1", "divider_2"],
        "select": ["selector"], "copy": ["selector"]}
    assert "atan2" not in Pool(arctangents=0).operations


@pytest.mark.parametrize(("field", "least"), [("adders", 1), ("multipliers", 1), ("dividers", 1), ("arctangents", 0)])
def test_counts_are_checked(field, least):
    with pytest.raises(ValueError, match=f"^{field} must be at least {least}, not {least - 1}$"):
        Pool(**{field: least - 1})


@pytest.mark.parametrize("field", ["adder_latency", "multiplier_latency", "divider_bits_per_cycle",
                                   "arctangent_steps_per_cycle"])
def test_parameters_that_an_operator_refuses_are_refused(field):
    with pytest.raises(ValueError, match="must be"):
        Pool(**{field: 0})
    with pytest.raises(TypeError):
        Pool(**{field: "four"})


def test_latencies_follow_the_parameters():
    assert Pool(adder_latency=6).operations["add"][0].latency == 6
    slow, fast = (Pool(divider_bits_per_cycle=bits).operations["sqrt"][0].latency for bits in (1, 2))
    assert slow > fast


def test_a_side_memory_wants_operands_in_luts():
    with pytest.raises(ValueError, match=r"^operand_memory must be distributed if there is a side memory$"):
        Pool(operand_memory=MemoryStyle.BLOCK, side_memory=True)
