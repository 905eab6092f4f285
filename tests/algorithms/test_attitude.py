"""The kernels in float64 against the textbook model, which was written from the source and not from them."""

import numpy as np
import pytest

from strapdown.cores import ATTITUDE_CORES, MAHONY, THESIS
from strapdown_sim.reference.ports import reference_outputs
from strapdown_sim.stimuli.thesis import TABLES

MODULES = [name for name in ATTITUDE_CORES if name != "INS_top"]
RNG = np.random.default_rng(11)


def reference(name, inputs, config):
    return reference_outputs(name, inputs, kp=config.kp, ki=config.ki, period_s=config.period_s,
                             mag_axes=config.magnetometer_axes)


def random_rotation(count):
    q = RNG.standard_normal((count, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return reference("INS_matx", {f"in_q{k}": q[:, k] for k in range(4)}, THESIS)


@pytest.mark.parametrize("config", [THESIS, MAHONY], ids=lambda config: config.name)
@pytest.mark.parametrize("name", MODULES)
def test_kernel_is_the_textbook_equation(name, config):
    system = ATTITUDE_CORES[name](config)
    inputs = {port: RNG.standard_normal(1000) * 10 for port in system.input_ports}
    if name == "INS_euler":
        inputs |= {port.replace("out", "in"): value for port, value in random_rotation(1000).items()
                   if port.replace("out", "in") in inputs}
    kernel, expected = system.update_float64(inputs), reference(name, inputs, config)
    scale = max(np.abs(value).max() for value in expected.values())
    for port, value in expected.items():
        # Both are sums of at most some thirty products in another order: 2**-52 each, of the largest term.
        np.testing.assert_allclose(kernel[port], value, rtol=1e-12, atol=1e-14 * scale)


@pytest.mark.parametrize("name", TABLES)
def test_published_values(name):
    inputs, printed = TABLES[name]
    result = ATTITUDE_CORES[name](THESIS).update_float64(inputs)
    for port, value in printed.items():
        assert result[port] == pytest.approx(value, abs=5.1e-5)  # half a unit of the fourth decimal


def test_vector_without_length_does_not_correct():
    zero = dict.fromkeys(("in_accx", "in_accy", "in_accz"), 0.0)
    result = ATTITUDE_CORES["INS_acc"](THESIS).update_float64(zero | {"in_c13": 0.6, "in_c23": 0.0, "in_c33": 0.8})
    assert set(result.values()) == {0.0}
    zero = dict.fromkeys(("in_magx", "in_magy", "in_magz"), 0.0)
    matrix = {port.replace("out", "in"): float(value[0]) for port, value in random_rotation(1).items()}
    result = ATTITUDE_CORES["INS_mag"](THESIS).update_float64(zero | matrix)
    assert set(result.values()) == {0.0}


@pytest.mark.parametrize(("c11", "c12", "yaw"), [
    (1.0, 0.0, 0.0), (1.0, -0.0, 0.0), (0.0, 1.0, 90.0), (-1.0, 0.0, 180.0), (-1.0, -0.0, 180.0), (0.0, -1.0, 270.0),
    (1.0, -1e-9, 0.0), (1.0, -1e-30, 0.0), (1.0, -1e-5, 360 - np.degrees(1e-5))])
def test_yaw_is_in_0_to_360(c11, c12, yaw):
    system = ATTITUDE_CORES["INS_euler"](THESIS)
    inputs = {"in_c11": c11, "in_c12": c12, "in_c13": 0.0, "in_c23": 0.0, "in_c33": 1.0}
    assert system.update_float64(inputs)["out_yaw"] == pytest.approx(yaw, abs=1e-9)
    twin = system.update_twin(THESIS.pool, {port: np.array([value]) for port, value in inputs.items()})["out_yaw"][0]
    assert 0 <= twin < 360
    assert twin == pytest.approx(yaw, abs=2.0**-15)  # one unit in the last place below 360


@pytest.mark.parametrize("c13", [1.0, -1.0, 1 + 2.0**-23, -1 - 2.0**-23])
def test_gimbal_lock(c13):
    inputs = {"in_c11": 0.0, "in_c12": 0.0, "in_c13": c13, "in_c23": 0.0, "in_c33": 0.0}
    result = ATTITUDE_CORES["INS_euler"](THESIS).update_float64(inputs)
    assert result["out_pitch"] == pytest.approx(np.copysign(90.0, -c13))
