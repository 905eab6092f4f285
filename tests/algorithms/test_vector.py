import numpy as np
import pytest

from strapdown.algorithms import vector

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("length", [1, 2, 3, 4])
def test_dot(length):
    a, b = RNG.standard_normal((2, length))
    assert vector.dot(tuple(a), tuple(b)) == pytest.approx(np.dot(a, b))


def test_cross():
    a, b = RNG.standard_normal((2, 3))
    assert vector.cross(tuple(a), tuple(b)) == pytest.approx(np.cross(a, b))


def test_matrix_times_vector():
    c, a = RNG.standard_normal((3, 3)), RNG.standard_normal(3)
    rows = [tuple(row) for row in c]
    assert vector.matrix_vector(rows, tuple(a)) == pytest.approx(c @ a)
    assert vector.transposed_vector(rows, tuple(a)) == pytest.approx(c.T @ a)


def test_lengths_must_agree():
    with pytest.raises(ValueError, match="zip"):
        vector.add((1, 2, 3), (1, 2))


def test_permute_lays_sensor_axes_along_the_body():
    # The thesis's magnetometer: body x = +sensor y, body y = -sensor x, body z = +sensor z.
    assert vector.permute(("+y", "-x", "+z"), (1, 2, 3)) == (2, -1, 3)


def test_sums_are_balanced():
    class Term:
        def __init__(self, depth=0):
            self.depth = depth

        def __mul__(self, other):
            return Term()

        def __add__(self, other):
            return Term(1 + max(self.depth, other.depth))

    four = (Term(),) * 4
    assert vector.dot(four, four).depth == 2
