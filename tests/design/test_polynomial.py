"""The coefficients in the kernels: computed again, and compared with the functions of float64."""

import numpy as np
import pytest

from strapdown.algorithms import arctangent, sine
from strapdown.design import arctangent_coefficients, sine_coefficients


def test_the_kernels_contain_what_the_design_gives():
    assert tuple(float(f"{c:.10g}") for c in arctangent_coefficients(7)[0]) == arctangent.COEFFICIENTS
    assert tuple(map(float, sine_coefficients(7)[0])) == sine.COEFFICIENTS


@pytest.mark.parametrize(("design", "function", "last"), [
    (arctangent_coefficients, np.arctan, 1.0), (sine_coefficients, np.sin, np.pi / 2)], ids=["arctangent", "sine"])
def test_the_error_alternates_with_one_magnitude(design, function, last):
    # A low order, so that float64 resolves the error: it has one more extreme than coefficients, all of equal size.
    coefficients, told = design(2)
    t = np.linspace(0, last, 20_001)[1:]
    u = t * t
    error = (t + t * u * np.polynomial.polynomial.polyval(u, [float(c) for c in coefficients])) / function(t) - 1
    inner = np.flatnonzero((error[1:-1] - error[:-2]) * (error[2:] - error[1:-1]) < 0) + 1
    extremes = error[[*inner[np.abs(error[inner]) > 0.5 * float(told)], -1]]
    assert len(extremes) == len(coefficients) + 1
    assert (np.diff(np.sign(extremes)) != 0).all()
    np.testing.assert_allclose(np.abs(extremes), float(told), rtol=1e-3)
