"""QUAT_direct: its ports, its latency, and its circuit against the twin in Verilator."""

import numpy as np
import pytest

from strapdown.cores import QUATERNION_J2, QUATERNION_J3
from strapdown.export import write_core
from strapdown.fp import BINARY64, Subnormals
from strapdown.kernel.pool import Pool
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.reference import quaternion as exact

UPDATES = 20_000
BINARY64_POOL = Pool(format=BINARY64.with_subnormals(Subnormals.FLUSH))
OPTIONS = {
    "j2": QUATERNION_J2,
    "j3 renormalised every third": QUATERNION_J3.model_copy(update={"renormalise_every": 3}),
    "j2 coning": QUATERNION_J2.model_copy(update={"coning": True}),
    "j3 binary64": QUATERNION_J3.model_copy(update={"pool": BINARY64_POOL}),
}


def stimulus(core, rng):
    """Rates up to 2,000 deg/s in body axes, and a load of a random attitude in one update in a hundred."""
    rates = {name: rng.uniform(-20, 20, (UPDATES, 3)) for name in core.system.inputs if name not in ("load", "start")}
    e = rng.standard_normal((UPDATES, 4))
    return core.system.bind(**rates, load=(rng.random(UPDATES) < 0.01).astype(float),
                            start=e / np.linalg.norm(e, axis=1, keepdims=True))


def test_ports(make_core):
    members = make_core("QUAT_direct", QUATERNION_J2).signature.members
    flow = {port: member.flow.name for port, member in members.items()}
    assert flow == dict.fromkeys(("clk", "rst_n", "in_rate_en", "in_p", "in_q", "in_r", "in_load_en", "in_e0", "in_e1",
                                  "in_e2", "in_e3"), "In") | dict.fromkeys(
        ("out_e0", "out_e1", "out_e2", "out_e3", "out_quat_finish", "out_status"), "Out")


@pytest.mark.parametrize("config", [QUATERNION_J2, QUATERNION_J3], ids=lambda config: config.name)
def test_an_update_takes_at_most_70_cycles(make_core, config):
    assert make_core("QUAT_direct", config).latency <= 70


def test_a_rate_that_turns_too_far_is_refused(make_core):
    with pytest.raises(ValueError, match="at most 3 rad, not 4 rad: sample faster"):
        make_core("QUAT_direct", QUATERNION_J2.model_copy(update={"rate_max_deg_s": float(np.degrees(2000))}))


@pytest.mark.verilator
@pytest.mark.parametrize("config", OPTIONS.values(), ids=OPTIONS)
def test_circuit_is_the_twin_in_every_bit(make_core, models, tmp_path, config):
    core = make_core("QUAT_direct", config)
    model = CoreModel(core, write_core(core, config, tmp_path, ""), models)
    inputs = stimulus(core, np.random.default_rng(20101))
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert model.differing_bits(inputs, result) == 0
    # Between loads the circuit follows the exact rotation: no run of updates is longer than about a thousand.
    q = core.system.read(result)["e"].astype(float)
    if not config.coning:
        fmt = config.pool.format
        rates = fmt.array(core.system.read(inputs, core.system.inputs)["omega"]).astype(float)
        truth = exact.product(q[:-1], exact.increment(rates[1:], config.period_s))
        going = fmt.array(inputs["in_load_en"])[1:] == 0
        # As in tests/algorithms/test_quaternion.py, with one more rounding of a and d if the update renormalises.
        bound = 4 * 2.0**-fmt.precision + config.coefficients.worst()[0]
        norm = np.linalg.norm(q[:-1], axis=-1, keepdims=True)
        ahead = truth / norm if config.renormalise_every else truth
        slack = np.abs(norm - 1).max() if config.renormalise_every else 0
        assert np.abs(q[1:] - ahead)[going].max() <= bound + 2 * slack
