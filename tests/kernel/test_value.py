from typing import ClassVar

import numpy as np
import pytest

from strapdown.fp import FpMinMax
from strapdown.kernel.numeric import Float64, Twin
from strapdown.kernel.operators import (
    FUNCTIONS,
    OPERATIONS,
    Adder,
    Comparator,
    Divider,
    Extremes,
    Multiplier,
    Operation,
    Operator,
    ReciprocalRoot,
    Selector,
    TableReciprocal,
)
from strapdown.kernel.pool import Pool
from strapdown.kernel.trace import Tracer

NAMESPACES = {"trace": lambda: Tracer(Pool(), ("ONLY",)), "twin": lambda: Twin(Pool())}


@pytest.mark.parametrize("make", NAMESPACES.values(), ids=NAMESPACES)
def test_truth_of_a_value_is_refused(make):
    value = make().lift(1.0)
    with pytest.raises(TypeError, match=r"^a kernel's value is not known while the kernel runs: use xp.select$"):
        bool(value)


def test_truth_of_a_traced_condition_is_refused():
    value = Tracer(Pool(), ("ONLY",)).source("input", "x")
    with pytest.raises(TypeError, match=r"use xp.select$"):
        bool(value < 1.0)


@pytest.mark.parametrize("make", NAMESPACES.values(), ids=NAMESPACES)
def test_values_of_two_namespaces_do_not_mix(make):
    with pytest.raises(TypeError, match=r"^a kernel must not mix values of two namespaces$"):
        make().lift(1.0) + make().lift(1.0)


@pytest.mark.parametrize("make", NAMESPACES.values(), ids=NAMESPACES)
def test_only_numbers_are_lifted(make):
    with pytest.raises(TypeError, match=r"^a kernel computes with numbers, not with '1'$"):
        make().lift(1.0) * "1"


@pytest.mark.parametrize("pool", [Pool(), Pool().with_operators(Extremes()), Pool().with_operators(Comparator())],
                         ids=["choice", "operator", "comparator"])
def test_extremes_mean_the_same_in_all_namespaces(pool):
    exact, twin = Float64(), Twin(pool)
    for a, b in ((1.0, 2.0), (2.0, 1.0), (-1.0, -1.0), (-2.0, 0.0)):
        assert exact.maximum(a, b) == twin.maximum(a, twin.lift(b)).array == max(a, b)
        assert exact.minimum(a, b) == twin.minimum(a, twin.lift(b)).array == min(a, b)


@pytest.mark.parametrize("make", [*NAMESPACES.values(), Float64], ids=[*NAMESPACES, "float64"])
def test_an_unknown_operation_is_refused(make):
    with pytest.raises(AttributeError, match=r"^kernels have no operation 'tan': choose from add, atan2, .*, sqrt"):
        make().tan(1.0)


@pytest.mark.parametrize("make", NAMESPACES.values(), ids=NAMESPACES)
def test_an_operation_without_an_operator_is_refused(make):
    with pytest.raises(ValueError, match=r"^the pool has no operator for from_integer: add one to its operators$"):
        make().from_integer(1.0)


@pytest.mark.parametrize("make", [*NAMESPACES.values(), Float64], ids=[*NAMESPACES, "float64"])
@pytest.mark.parametrize(("name", "operands", "wanted"), [
    ("sqrt", (), "1 operand, not 0"), ("sqrt", (1.0, 4.0), "1 operand, not 2"), ("atan2", (1.0,), "2 operands, not 1"),
    ("maximum", (1.0, 2.0, 3.0), "2 operands, not 3"), ("sin", (1.0, 2.0), "1 operand, not 2")])
def test_a_wrong_number_of_operands_is_refused(make, name, operands, wanted):
    with pytest.raises(TypeError, match=f"^xp.{name} takes {wanted}$"):
        getattr(make(), name)(*operands)


@pytest.mark.parametrize("make", [*NAMESPACES.values(), Float64], ids=[*NAMESPACES, "float64"])
def test_a_choice_has_two_numbers(make):
    xp = make()
    with pytest.raises(TypeError, match=r"select\(\) missing 1 required positional argument: 'b'$"):
        xp.select(xp.less(1.0, 2.0), 1.0)


@pytest.fixture
def own_operator(monkeypatch):
    """A user's operator outside this package: the definition of its class makes its operations available."""
    for known in OPERATIONS, FUNCTIONS:
        for name in ("smaller", "span"):
            monkeypatch.setitem(known, name, None)
            del known[name]

    class Smaller(Operator):
        name = "smaller"
        component = FpMinMax
        operations = (Operation("smaller", twin=lambda component, a, b: component.compute(a, b, False),
                                float64=np.minimum),)
        functions: ClassVar = {"span": lambda xp, a, b: xp.maximum(a, b) - xp.smaller(a, b)}

    return Smaller


def test_an_operator_of_ones_own_is_known_to_kernels(own_operator):
    pool = Pool().with_operators(own_operator())
    twin, tracer = Twin(pool), Tracer(pool, ("ONLY",))
    assert Float64().span(3.0, -5.0) == twin.span(twin.lift(3.0), -5.0).array == 8
    node = tracer.settled(tracer.span(tracer.source("input", "x"), 0.5))
    assert [operand.node.operation for operand in node.operands] == ["select", "smaller"]
    assert [unit.name for unit in pool.operations["smaller"]] == ["smaller"]


def test_an_operation_of_the_pool_takes_the_place_of_its_fallback():
    def count(*operators):
        pool = Pool().with_operators(*operators)
        xp = Tracer(pool, ("ONLY",))
        x, y = xp.source("input", "x"), xp.source("input", "y")
        result = xp.select(x > y, xp.maximum(x, y), xp.rsqrt(x))
        return xp.graph(inputs=("x", "y"), outputs={"a": xp.settled(result)}).count()

    assert count() == {"add": 2, "select": 2, "sqrt": 1, "divide": 1}
    for root in ReciprocalRoot(), TableReciprocal():
        assert count(Comparator(), Extremes(), root) == {"less": 1, "maximum": 1, "rsqrt": 1, "select": 1}


def test_a_quotient_is_a_product_with_a_reciprocal_or_the_other_way_round():
    def count(operator):
        xp = Tracer(Pool(operators=(Adder(), Multiplier(), operator, Selector())), ("ONLY",))
        x, y = xp.source("input", "x"), xp.source("input", "y")
        return xp.graph(inputs=("x", "y"), outputs={"a": xp.settled(x / y), "b": xp.settled(xp.reciprocal(y))}).count()

    assert count(TableReciprocal()) == {"multiply": 1, "reciprocal": 1}
    assert count(Divider()) == {"divide": 2}


@pytest.mark.parametrize("operator", [TableReciprocal(), Divider(), Divider(bits_per_cycle=2)])
def test_a_root_is_a_product_with_a_reciprocal_root_or_of_its_operator(operator):
    """The product has 0.88 units in the last place of the table, and half a unit of the product, each up to 2**-23."""
    xp = Twin(Pool(operators=(Adder(), Multiplier(), operator, Selector())))
    squares = np.array([0.0, 2.0**-70, 0.3, 1.0, 2.0, 3.999, 1e30], np.float32)
    found = [float(xp.sqrt(xp.lift(float(square))).array) for square in squares]
    assert found == pytest.approx(np.sqrt(squares.astype(float)), rel=1.38 * 2.0**-23, abs=0)


@pytest.mark.parametrize(("compute", "missing"), [
    (lambda xp, x: 1 / x, "divide"), (lambda xp, x: xp.reciprocal(x), "reciprocal"), (lambda xp, x: xp.sqrt(x), "sqrt"),
    (lambda xp, x: xp.rsqrt(x), "rsqrt")])
def test_a_pool_without_divider_and_table_cannot_divide(compute, missing):
    xp = Twin(Pool(operators=(Adder(), Multiplier(), Selector())))
    for _ in range(2):
        with pytest.raises(ValueError, match=f"^the pool has no operator for {missing}: add one to its operators$"):
            compute(xp, xp.lift(3.0))


def test_an_angle_in_degrees_is_a_product_without_its_operator():
    xp = Tracer(Pool(), ("ONLY",))
    x, y = xp.source("input", "x"), xp.source("input", "y")
    graph = xp.graph(inputs=("x", "y"), outputs={"a": xp.settled(xp.atan2_degrees(y, x))})
    assert graph.count() == {"atan2": 1, "multiply": 1}
    assert Float64().atan2_degrees(1.0, -1.0) == 135
