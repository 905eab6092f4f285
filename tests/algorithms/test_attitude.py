"""The kernels in float64 against the textbook model, which was written from the source, not from the kernels."""

import numpy as np
import pytest

from strapdown.cores import ATTITUDE_CORES, MAHONY, THESIS
from strapdown_sim.stimuli.thesis import TABLES
from strapdown_sim.truth import module_outputs

MODULES = [name for name in ATTITUDE_CORES if name != "INS_top"]
RNG = np.random.default_rng(11)


def random_rotation(count):
    q = RNG.standard_normal((count, 4))
    return module_outputs("INS_matx", {"q": q / np.linalg.norm(q, axis=1, keepdims=True)}, THESIS)["c"]


def of_a_matrix(c):
    """The elements of C that are inputs of INS_euler."""
    return c[..., (0, 0, 0, 1, 2), (0, 1, 2, 2, 2)]


@pytest.mark.parametrize("config", [THESIS, MAHONY], ids=lambda config: config.name)
@pytest.mark.parametrize("name", MODULES)
def test_kernel_is_the_textbook_equation(name, config):
    system = ATTITUDE_CORES[name](config)
    ports = {port: RNG.standard_normal(1000) * 10 for port in system.input_ports}
    inputs = system.read(ports, system.inputs)
    if name == "INS_euler":
        inputs = {"c": of_a_matrix(random_rotation(1000))}
    kernel = system.read(system.update_float64(system.bind(**inputs)))
    expected = module_outputs(name, inputs, config)
    scale = max(np.abs(values).max() for values in expected.values())
    assert kernel.keys() == expected.keys()
    for output, values in expected.items():
        # Both are sums of at most about thirty products in different orders: 2**-52 of the largest term each.
        np.testing.assert_allclose(kernel[output], values, rtol=1e-12, atol=1e-14 * scale)


@pytest.mark.parametrize("name", TABLES)
def test_published_values(name):
    inputs, printed = TABLES[name]
    system = ATTITUDE_CORES[name](THESIS)
    result = system.read(system.update_float64(system.bind(**inputs)))
    for output, values in printed.items():
        np.testing.assert_allclose(result[output], values, rtol=0, atol=5.1e-5)  # half a unit of the fourth decimal


def test_vector_without_length_does_not_correct():
    system = ATTITUDE_CORES["INS_acc"](THESIS)
    assert set(system.update_float64(system.bind(a=np.zeros(3), v=(0.6, 0.0, 0.8))).values()) == {0.0}
    system = ATTITUDE_CORES["INS_mag"](THESIS)
    assert set(system.update_float64(system.bind(m=np.zeros(3), c=random_rotation(1)[0])).values()) == {0.0}


@pytest.mark.parametrize(("c11", "c12", "yaw"), [
    (1.0, 0.0, 0.0), (1.0, -0.0, 0.0), (0.0, 1.0, 90.0), (-1.0, 0.0, 180.0), (-1.0, -0.0, 180.0), (0.0, -1.0, 270.0),
    (1.0, -1e-9, 0.0), (1.0, -1e-30, 0.0), (1.0, -1e-5, 360 - np.degrees(1e-5))])
def test_yaw_is_in_0_to_360(c11, c12, yaw):
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    inputs = system.bind(c=(c11, c12, 0.0, 0.0, 1.0))
    assert system.update_float64(inputs)["out_yaw"] == pytest.approx(yaw, abs=1e-9)
    twin = system.update_twin(THESIS.pool, inputs)["out_yaw"]
    assert 0 <= twin < 360
    assert twin == pytest.approx(yaw, abs=2.0**-15)  # one unit in the last place below 360


@pytest.mark.parametrize("c13", [1.0, -1.0, 1 + 2.0**-23, -1 - 2.0**-23])
def test_gimbal_lock(c13):
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    result = system.update_float64(system.bind(c=(0.0, 0.0, c13, 0.0, 0.0)))
    assert result["out_pitch"] == pytest.approx(np.copysign(90.0, -c13))
