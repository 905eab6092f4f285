import pytest

from strapdown.kernel.pool import Pool


def test_every_operation_of_a_kernel_has_one_unit():
    operations = [operation for unit in Pool().units for operation in unit.operations]
    assert sorted(operations) == ["add", "atan2", "copy", "divide", "multiply", "select", "sqrt"]


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
