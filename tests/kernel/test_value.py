import pytest

from strapdown.kernel.numeric import Float64, Twin
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


def test_maximum_means_the_same_in_all_namespaces():
    twin = Twin(Pool())
    for a, b in ((1.0, 2.0), (2.0, 1.0), (-1.0, -1.0), (-2.0, 0.0)):
        assert Float64.maximum(a, b) == twin.maximum(a, twin.lift(b)).array == max(a, b)
