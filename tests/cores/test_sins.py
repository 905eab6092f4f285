"""SINS_top: its ports, and its circuit against the twin in Verilator."""

import numpy as np
import pytest

from strapdown.cores import SINS, SINS_DAMPED, sins_top
from strapdown.export import write_core
from strapdown.fp import BINARY32, Subnormals
from strapdown.kernel.pool import Pool
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.stimuli.flight import airliner, sensor_errors

INPUTS = {"in_wx", "in_wy", "in_wz", "in_fx", "in_fy", "in_fz", "in_load", "in_align", "in_lat", "in_lon",
          "in_veast", "in_vnorth", "in_vup", "in_height", "in_q0", "in_q1", "in_q2", "in_q3"}
OUTPUTS = {"out_pitch", "out_roll", "out_heading", "out_veast", "out_vnorth", "out_vup", "out_latitude",
           "out_longitude", "out_height", "out_wander"}
CONFIGS = {
    "binary64": SINS_DAMPED,
    "binary32": SINS.model_copy(update={"pool": Pool(format=BINARY32.with_subnormals(Subnormals.FLUSH))}),
}
ALIGNMENT = 40


def stimulus(system):
    """A flight with sensor errors: noise before a load, an alignment, a take-off, a load in the air, a lost sample.

    The samples are far apart in the flight, so that it reaches turns and climb in few updates.
    """
    flight = airliner(rest_s=4)
    omega_b, f_b, truth = flight.sample(1.0)
    count = len(omega_b)
    omega_b = omega_b + sensor_errors(count, 1.0, constant=5e-6, white=1e-7, seed=1)
    f_b = f_b + sensor_errors(count, 1.0, constant=1e-4, white=5e-4, seed=2)
    # The alignment uses the first sample of the flight.
    still = [0] * (ALIGNMENT + 10)
    omega_b, f_b = (np.concatenate((values[still], values)) for values in (omega_b, f_b))
    total = len(omega_b)
    f_b[700, 1] = np.nan
    omega_b[800, 0] = 8.0
    load, align, velocity = np.zeros(total), np.zeros(total), np.zeros((total, 3))
    load[[5, 1000]] = align[5] = 1.0
    # The last number is subnormal in binary64: no operator flushes a number that is only loaded.
    velocity[1000] = 0.0, 200.0, 1e-310
    values = {"omega": omega_b, "f": f_b, "load": load, "align": align, "start_v": velocity, "start_h": 150.0,
              "place": (flight.latitude_deg, flight.longitude_deg), "start_q": (2.0, 0.0, 0.0, -0.5),
              "altitude": np.concatenate((np.full(len(still), 150.0), truth.height_m))}
    return system.bind(**{name: values[name] for name in system.inputs})


@pytest.mark.parametrize("config", [SINS, SINS_DAMPED], ids=lambda config: config.name)
def test_ports(make_core, config):
    core = make_core("SINS_top", config)
    flow = {port: member.flow.name for port, member in core.signature.members.items()}
    inputs = INPUTS | ({"in_altitude"} if config.damping_s else set())
    assert flow == dict.fromkeys({"clk", "rst_n", "in_data_en"} | inputs, "In") | dict.fromkeys(
        OUTPUTS | {"out_SINS_finish", "out_status"}, "Out")
    assert {len(getattr(core, port)) for port in inputs | OUTPUTS} == {64}
    assert core.engine.status_names == ("aligning", "navigating", "out_of_range", "refused", "ignored")


def test_an_update_is_done_long_before_the_next_sample_at_1_khz(make_core):
    # At 100 MHz.
    assert make_core("SINS_top", SINS_DAMPED).latency < 100_000 / 100


def test_a_rate_that_turns_too_far_is_refused():
    with pytest.raises(ValueError, match="sample faster"):
        sins_top(SINS.model_copy(update={"rate_max_deg_s": 20_000.0}))


@pytest.mark.verilator
@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
def test_circuit_is_the_twin_in_every_bit(make_core, models, tmp_path, config):
    config = config.model_copy(update={"alignment_samples": ALIGNMENT})
    core = make_core("SINS_top", config)
    model = CoreModel(core, write_core(core, config, tmp_path, ""), models)
    inputs = stimulus(core.system)
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert model.differing_bits(inputs, result) == 0
    status = {name: result["out_status"] >> bit & 1 for bit, name in enumerate(core.engine.status_names)}
    assert np.flatnonzero(status["aligning"]).tolist() == list(range(5, 5 + ALIGNMENT - 1))
    navigating = np.flatnonzero(status["navigating"])
    # A refused update sets no other bit.
    assert navigating[0] == 5 + ALIGNMENT - 1
    assert np.flatnonzero(status["refused"]).tolist() == [700]
    assert 800 in np.flatnonzero(status["out_of_range"])
    assert set(range(navigating[0], len(status["navigating"]))) - set(navigating.tolist()) == {700}
    assert (result["out_vnorth"][1000], result["out_height"][1000]) == (200, 150)
