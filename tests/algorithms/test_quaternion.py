"""Quaternion directly from rates, in float64 and in the bits of the circuit, against exact rotations."""

import numpy as np
import pytest

from strapdown.algorithms import quaternion, vector
from strapdown.cores import QUATERNION_J2, QUATERNION_J3, quat_direct
from strapdown.kernel.numeric import Float64
from strapdown_sim.reference import quaternion as exact

RNG = np.random.default_rng(7)


def samples(count, rate_max_deg_s):
    """Unit quaternions (4, count) and rates (3, count) up to the largest, rad/s."""
    e = RNG.standard_normal((4, count))
    omega = RNG.standard_normal((3, count))
    length = np.radians(rate_max_deg_s) * RNG.random(count)
    return e / np.linalg.norm(e, axis=0), omega * length / np.linalg.norm(omega, axis=0)


@pytest.mark.parametrize("config", [QUATERNION_J2, QUATERNION_J3], ids=lambda config: config.name)
@pytest.mark.parametrize("method", ["least-squares", "minimax"])
def test_an_update_is_the_exact_rotation_within_the_designed_error(config, method):
    # 1.7 rad in an update: much more than in practice, so that the error is far above that of float64.
    config = config.model_copy(update={"method": method, "rate_max_deg_s": 100_000, "sample_rate_hz": 1000})
    e, omega = samples(2000, config.rate_max_deg_s)
    c = config.coefficients
    q = np.stack(quaternion.quaternion_step(Float64(), tuple(e), tuple(omega), a0=c.a0, d0=c.d0,
                                            period=config.period_s))
    truth = exact.product(e.T, exact.increment(omega.T, config.period_s))
    angle, norm = c.worst()
    error = exact.angle_between(q.T, truth)
    # `worst` evaluates 257 points: an extreme between two of them is higher by a relative 1e-3 at most.
    assert error.max() <= angle * (1 + 1e-3) + 1e-14
    assert error.max() > 0.5 * angle
    assert np.abs(np.linalg.norm(q, axis=0) - 1).max() <= norm * (1 + 1e-3) + 1e-14


def test_the_matrix_is_the_patents():
    p, q, r, a, d = RNG.standard_normal(5)
    e = RNG.standard_normal(4)
    p_, q_, r_ = d * p, d * q, d * r
    phi = np.array([[a, -p_, -q_, -r_], [p_, a, r_, -q_], [q_, -r_, a, p_], [r_, q_, -p_, a]])
    np.testing.assert_allclose(quaternion.transition(Float64(), a, d, (p, q, r), tuple(e)), phi @ e, rtol=0, atol=1e-14)


@pytest.mark.parametrize("order", range(1, 9))
def test_polynomial(order):
    coefficients, u = RNG.standard_normal(order + 1), RNG.random(100)
    np.testing.assert_allclose(vector.polynomial(list(coefficients), u),
                               np.polynomial.polynomial.polyval(u, coefficients), rtol=0, atol=1e-14)


@pytest.mark.parametrize("config", [QUATERNION_J2, QUATERNION_J3], ids=lambda config: config.name)
def test_the_twin_is_near_the_exact_rotation(config):
    e, omega = (config.pool.format.array(x) for x in samples(5000, config.rate_max_deg_s))
    system = quat_direct(config)
    inputs = system.bind(omega=omega.T, load=0.0, start=np.zeros(4))
    q = system.read(system.update_twin(config.pool, inputs, system.bind_state(e=e.T)))["e"].astype(float)
    truth = exact.product(e.T.astype(float), exact.increment(omega.T.astype(float), config.period_s))
    # Each component is a·e + d·w: two products and their sum, at most 1; a and d are each rounded once or twice;
    # d·w is below half the largest angle, 0.035. a·e and the sum give 1.5 * 2**-24, the other errors less than 2**-24.
    assert np.abs(q - truth).max() <= 2.5 * 2.0**-24


def test_renormalisation_brings_the_norm_back():
    e = tuple(1.01 * np.array([0.5, 0.5, -0.5, 0.5]))
    for expected in (1.5 * 0.01**2, 1.5 * (1.5 * 0.01**2) ** 2):
        # One Newton step: 1 + x becomes 1 − 3/2·x² − x³/2.
        e = tuple(quaternion.renormalisation(Float64(), e) * x for x in e)
        assert 1 - np.linalg.norm(e) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("every", [1, 2, 5])
def test_renormalised_every_so_many_updates(every):
    config = QUATERNION_J3.model_copy(update={"renormalise_every": every})
    system = quat_direct(config)
    rest = system.bind(omega=np.zeros((4 * every, 3)), load=0.0, start=np.zeros(4))
    result, _ = system.run_float64(rest, {"e0": 1.01})
    norms = np.append(1.01, np.linalg.norm(system.read(result)["e"], axis=1))
    changed = np.flatnonzero(np.abs(np.diff(norms)) > 1e-12) + 1
    # At rest only renormalisations change the quaternion; the fourth has no visible effect.
    np.testing.assert_array_equal(changed, [every, 2 * every, 3 * every])


def test_a_load_takes_the_start_value():
    system = quat_direct(QUATERNION_J3)
    start = 0.1, 0.7, -0.1, 0.7
    inputs = system.bind(omega=(1.0, 2.0, 3.0), load=(1.0, 0.0), start=start)
    loaded, propagated = system.read(system.update_float64(inputs, system.reset))["e"]
    assert tuple(loaded) == start
    assert propagated[1] == pytest.approx(0.001, rel=1e-3)


@pytest.mark.parametrize("coning", [False, True])
def test_classical_coning(coning):
    # Half angle 1 degree at 10 Hz, updates at 100 Hz from two rates each: Ω·T = 0.63.
    beta, frequency, period, count = np.radians(1.0), 2 * np.pi * 10, 0.01, 2000
    motion = {"half_angle": beta, "frequency": frequency}
    begins = np.arange(count) * period
    rates = [exact.coning_mean_rate(begins + k * period / 2, begins + (k + 1) * period / 2, **motion) for k in (0, 1)]
    config = QUATERNION_J3.model_copy(update={"sample_rate_hz": 1 / period, "coning": coning, "order": 5})
    system = quat_direct(config)
    q = exact.coning_attitude(np.arange(count + 1) * period, **motion)
    given = {"first": rates[0], "second": rates[1]} if coning else {"omega": (rates[0] + rates[1]) / 2}
    updated = system.update_float64(system.bind(**given, load=0.0, start=np.zeros(4)), system.bind_state(e=q[:-1]))
    left = exact.product(q[1:] * [1, -1, -1, -1], system.read(updated)["e"])
    error = 2 * left[:, 3].mean()
    # Per update, for small β: the coning term is β²/2·(ΩT − sin ΩT); with h = ΩT/2 the error after correction is
    # β²·((2h − sin 2h)/2 − 8/3·sin²(h/2)·sin h) (Miller 1983 gives its first term, β²(ΩT)⁵/960).
    h = frequency * period / 2
    missing = beta**2 / 2 * (2 * h - np.sin(2 * h))
    if coning:
        missing -= beta**2 * 8 / 3 * np.sin(h / 2) ** 2 * np.sin(h)
        assert missing == pytest.approx(beta**2 * (2 * h) ** 5 / 960, rel=0.05)
    # Terms in β⁴ are omitted: relative to β²·(ΩT)³, a few β².
    assert abs(error) == pytest.approx(missing, rel=0.01)
