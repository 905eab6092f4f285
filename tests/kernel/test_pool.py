import pytest

from strapdown.kernel.operators import (
    OPERATIONS,
    Adder,
    Arctangent,
    Divider,
    Extremes,
    Multiplier,
    Operation,
    Operator,
    ReciprocalRoot,
    Selector,
)
from strapdown.kernel.pool import Pool


def test_every_operation_of_a_kernel_has_its_units():
    pool = Pool().with_operators(Adder(count=2), Divider(count=3))
    assert {operation: [unit.name for unit in units] for operation, units in pool.operations.items()} == {
        "add": ["adder_0", "adder_1"], "multiply": ["multiplier"], "atan2": ["arctangent"],
        "divide": ["divider_0", "divider_1", "divider_2"], "sqrt": ["divider_0", "divider_1", "divider_2"],
        "select": ["selector"], "copy": ["selector"]}
    assert "atan2" not in Pool(operators=(Adder(), Multiplier(), Divider(), Selector())).operations


@pytest.mark.parametrize("operator", [Adder, Multiplier, Divider, Arctangent, Extremes, ReciprocalRoot])
def test_counts_are_checked(operator):
    with pytest.raises(ValueError, match=f"^count of {operator.name} must be at least 1, not 0$"):
        operator(count=0)


@pytest.mark.parametrize(("operator", "parameter"), [
    (Adder, "latency"), (Multiplier, "latency"), (Divider, "bits_per_cycle"), (Arctangent, "steps_per_cycle"),
    (Extremes, "latency"), (ReciprocalRoot, "bits_per_cycle")])
def test_parameters_that_an_operator_refuses_are_refused(operator, parameter):
    with pytest.raises(ValueError, match="must be"):
        Pool().with_operators(operator(**{parameter: 0}))
    with pytest.raises(TypeError):
        Pool().with_operators(operator(**{parameter: "four"}))


def test_latencies_follow_the_parameters():
    assert Pool().with_operators(Adder(latency=6)).operations["add"][0].latency == 6
    slow, fast = (Pool().with_operators(Divider(bits_per_cycle=bits)).operations["sqrt"][0].latency for bits in (1, 2))
    assert slow > fast


def test_operators_beside_another_take_its_read_ports_in_turn():
    pool = Pool().with_operators(Adder(count=2), Multiplier(count=3), Extremes(count=2), ReciprocalRoot())
    ports = {unit.name: unit.read_port for unit in pool.units}
    assert [ports[f"multiplier_{index}"] for index in range(3)] == [2, 3, 4]
    assert [ports[name] for name in ("divider_0", "divider_1", "arctangent", "reciprocal_root")] == [2, 3, 4, 2]
    assert [ports[name] for name in ("adder_0", "adder_1", "selector", "extremes_0", "extremes_1")] == [0, 1, 0, 1, 0]


def test_parameters_are_told_by_name():
    parameters = Pool(forwarding=False).with_operators(Adder(count=2, latency=4)).parameters
    assert parameters["adders"] == 2
    assert parameters["adder_latency"] == 4
    assert parameters["divider_bits_per_cycle"] == 1
    assert parameters["forwarding"] is False


def test_an_operation_has_one_operator():
    with pytest.raises(ValueError, match=r"^operators must offer add once: adder and adder do$"):
        Pool(operators=(Adder(), Adder(latency=4), Selector()))


def test_what_is_no_operator_is_refused():
    with pytest.raises(TypeError, match=r"^operators must be instances of Operator, not 'adder'$"):
        Pool(operators=("adder",))


def test_numbers_can_be_copied():
    with pytest.raises(ValueError, match=r"^operators must include a Selector, which copies numbers$"):
        Pool(operators=(Adder(), Multiplier()))


def test_an_operation_is_defined_once():
    with pytest.raises(ValueError, match=r"^Other must not define add anew: another operator has it already$"):
        class Other(Operator):
            name = "other"
            operations = (Operation("add", twin=None, float64=None),)
    assert OPERATIONS["add"] is Adder.operations[0]
