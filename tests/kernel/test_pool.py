import re
from dataclasses import dataclass

import numpy as np
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
    TableArctangent,
    TableReciprocal,
)
from strapdown.kernel.pool import RESERVED, MemoryStyle, Pool


def test_every_operation_of_a_kernel_has_its_units():
    pool = Pool().with_operators(Adder(count=2), Divider(count=3))
    assert {operation: [unit.name for unit in units] for operation, units in pool.operations.items()} == {
        "add": ["adder_0", "adder_1"], "multiply": ["multiplier"], "atan2": ["arctangent"],
        "divide": ["divider_0", "divider_1", "divider_2"], "sqrt": ["divider_0", "divider_1", "divider_2"],
        "select": ["selector"], "copy": ["selector"]}
    assert "atan2" not in Pool(operators=(Adder(), Multiplier(), Divider(), Selector())).operations


@pytest.mark.parametrize("operator", [Adder, Multiplier, Divider, Arctangent, Extremes, ReciprocalRoot, TableReciprocal,
                                      TableArctangent])
def test_counts_are_checked(operator):
    with pytest.raises(ValueError, match=f"^count of {operator.name} must be at least 1, not 0$"):
        operator(count=0)


@pytest.mark.parametrize(("operator", "parameter"), [
    (Adder, "latency"), (Multiplier, "latency"), (Divider, "bits_per_cycle"), (Arctangent, "steps_per_cycle"),
    (Extremes, "latency"), (ReciprocalRoot, "bits_per_cycle"),
    (TableReciprocal, "latency"), (TableArctangent, "latency")])
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


def test_parameters_are_changed_by_name():
    pool = Pool().with_parameters(adders=2, adder_latency=4, dividers=0, reciprocal_roots=2, forwarding=False)
    assert pool == Pool(operators=(Adder(count=2, latency=4), Multiplier(), Arctangent(), Selector(),
                                   ReciprocalRoot(count=2)), forwarding=False)
    assert Pool().with_parameters(**Pool().parameters) == Pool()


@pytest.mark.parametrize(("values", "message"), [
    ({"format": 1}, "a pool has no parameter 'format'"),
    ({"extremes_latency": 2}, "the pool has no extremes: extremess=1 adds one"),
    ({"adder_latency": 99}, "latency must be from 1 to 8, not 99"),
    ({"adders": -1}, "count of adder must be at least 1, not -1"),
])
def test_wrong_changes_of_parameters_are_refused(values, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        Pool().with_parameters(**values)


def test_an_operation_has_one_operator():
    with pytest.raises(ValueError, match=r"^operators must offer add once: adder and adder do$"):
        Pool(operators=(Adder(), Adder(latency=4), Selector()))


def test_what_is_no_operator_is_refused():
    with pytest.raises(TypeError, match=r"^operators must be instances of Operator, not 'adder'$"):
        Pool(operators=("adder",))


def test_numbers_can_be_copied():
    with pytest.raises(ValueError, match=r"^operators must include a Selector, which copies numbers$"):
        Pool(operators=(Adder(), Multiplier()))


@pytest.mark.parametrize(("fields", "error", "message"), [
    ({"format": "binary32"}, TypeError, "format must be a FloatFormat, not 'binary32'"),
    ({"operators": Adder()}, TypeError,
     "operators must be a tuple of operators, not Adder(latency=5, dsp_shifts=False, two_paths=False, count=1)"),
    ({"forwarding": "no"}, TypeError, "forwarding must be True or False, not 'no'"),
    ({"private_ports": None}, TypeError, "private_ports must be True or False, not None"),
    ({"horizontal": 1}, TypeError, "horizontal must be True or False, not 1"),
    ({"side_registered": None}, TypeError, "side_registered must be True or False, not None"),
    ({"side_memory": 1}, ValueError, "side_memory must be False, auto, distributed or block, not 1"),
    ({"side_buses": True}, TypeError, "side_buses must be a whole number, not True"),
    ({"side_buses": 4}, ValueError, "side_buses must be from 1 to 3, not 4"),
    ({"read_ranks": 0}, ValueError, "read_ranks must be from 1 to 2, not 0"),
    ({"operand_memory": "lut"}, ValueError, "operand_memory must be auto, distributed or block, not 'lut'"),
    ({"operand_memory": False}, ValueError, "operand_memory must be auto, distributed or block, not False"),
    ({"microcode": None}, ValueError, "microcode must be auto, distributed or block, not None")])
def test_fields_of_another_type_are_refused(fields, error, message):
    with pytest.raises(error, match=f"^{re.escape(message)}$"):
        Pool(**fields)


def test_a_memory_style_may_be_its_value():
    assert Pool(operand_memory="block", microcode="distributed") == Pool(
        operand_memory=MemoryStyle.BLOCK, microcode=MemoryStyle.DISTRIBUTED)
    assert Pool(side_memory=True) == Pool(side_memory="auto") == Pool(side_memory=MemoryStyle.AUTO)


@pytest.fixture(autouse=True)
def forgotten():
    """After a test, kernels know nothing of its operator ``Own``."""
    yield
    type("Own", (Operator,), {"operations": ()})


def named(kind, name, **members):
    """An operator ``Own`` that differs from another one in its name and in the given members."""
    return dataclass(frozen=True, kw_only=True)(type("Own", (kind,), {"name": name, "operations": (), **members}))


@pytest.mark.parametrize("name", sorted(RESERVED))
def test_names_that_the_engines_use_are_refused(name):
    with pytest.raises(ValueError, match=f"^an operator must not have the name {name}: the engines use it themselves$"):
        Pool().with_operators(named(Adder, name)())


@pytest.mark.parametrize("name", ["my-adder", "2nd", "", "größe"])
def test_names_that_are_no_identifiers_are_refused(name):
    with pytest.raises(ValueError, match=r"^an operator must have letters, digits and underscores for a name, not '"):
        Pool().with_operators(named(Adder, name)())


def test_names_of_units_differ():
    with pytest.raises(ValueError, match=r"^operators must have different names: there are two units divider_1$"):
        Pool().with_operators(named(Adder, "divider_1")())


def test_names_of_modes_differ():
    slow, fast = (Operation(name, twin=np.add, float64=np.add, mode=mode)
                  for name, mode in (("p", "fast_up"), ("q", "up")))
    operators = named(Adder, "own", operations=(slow,)), named(Multiplier, "own_fast", operations=(fast,))
    with pytest.raises(ValueError, match=r"^operators must have different names: there are two modes own_fast_up$"):
        Pool().with_operators(*(operator() for operator in operators))


@pytest.mark.parametrize(("count", "units"), [(1, "selector and chooser"), (2, "selector and chooser_0 and chooser_1")])
def test_one_unit_takes_a_condition(count, units):
    blend = Operation("blend", twin=np.add, float64=np.add, takes_condition=True)
    chooser = named(Adder, "chooser", operations=(blend,))
    with pytest.raises(ValueError, match=f"^one unit of a pool can take a condition, not {units}$"):
        Pool().with_operators(chooser(count=count))


@pytest.mark.parametrize("operands", [(), ("a", "b", "c"), "a", ["a", "b"]])
def test_an_operator_has_one_or_two_members_for_operands(operands):
    with pytest.raises(ValueError, match=r"^operands of Own must be a tuple of one or two members, not [\[('a]"):
        named(Adder, "own", operands=operands)


@pytest.mark.parametrize(("members", "operands"), [(1, 2), (2, 3), (2, 0)])
def test_an_operation_has_no_more_operands_than_its_operator(members, operands):
    message = f"operation odd must take 1 to {members} operands, as Own has, not {operands}"
    with pytest.raises(ValueError, match=f"^{message}$"):
        named(Adder, "own", operands=("a", "b")[:members],
              operations=(Operation("odd", twin=None, float64=None, operands=operands),))


@pytest.mark.parametrize("name", ["input", "state", "constant", "section", "negate"])
def test_names_with_another_meaning_are_no_operations(name):
    with pytest.raises(ValueError, match=f"^Own must not define {name}: the name has another meaning in kernels$"):
        named(Adder, "own", operations=(Operation(name, twin=None, float64=None),))


def test_a_class_can_be_defined_again():
    """As after a reload: what it does not offer any more is forgotten."""
    def defined(*names):
        operations = tuple(Operation(name, twin=None, float64=None) for name in names)
        return named(Adder, "own", operations=operations)

    defined("again", "gone")
    new = defined("again")
    assert OPERATIONS["again"] is new.operations[0]
    assert "gone" not in OPERATIONS
    with pytest.raises(ValueError, match=r"^Other must not define again: another operator already defines it$"):
        type("Other", (Operator,), {"operations": (Operation("again", twin=None, float64=np.add),)})


def test_operators_may_offer_the_same_operation():
    assert ReciprocalRoot.operations[0] == TableReciprocal.operations[1]
    assert OPERATIONS["rsqrt"] is ReciprocalRoot.operations[0]
    with pytest.raises(ValueError, match=r"^operators must offer rsqrt once: reciprocal_root and table_reciprocal do$"):
        Pool().with_operators(ReciprocalRoot(), TableReciprocal())


def test_an_operation_is_defined_once():
    with pytest.raises(ValueError, match=r"^Other must not define add: another operator already defines it$"):
        class Other(Operator):
            name = "other"
            operations = (Operation("add", twin=None, float64=None),)
    assert OPERATIONS["add"] is Adder.operations[0]
