"""Arrays with the nesting of the kernel, and runs of the twin."""

import re
from dataclasses import replace

import numpy as np
import pytest

from strapdown.algorithms.attitude import Update
from strapdown.cores import (
    CONFIGS,
    FLIGHT,
    QUATERNION_J3,
    SINS,
    THESIS,
    ins_flight,
    main_module,
    quat_direct,
    system_of,
)
from strapdown.kernel.system import System, matrix, vector

INS_TOP = system_of("INS_top", THESIS)
INS_MAG = system_of("INS_mag", THESIS)
RNG = np.random.default_rng(6)


def test_names_of_vectors_and_matrices():
    assert vector("in_acc{}") == ("in_accx", "in_accy", "in_accz")
    assert vector("q{}", "0123") == ("q0", "q1", "q2", "q3")
    assert matrix("c{}") == (("c11", "c12", "c13"), ("c21", "c22", "c23"), ("c31", "c32", "c33"))


def test_bind_gives_each_port_its_component():
    m, c = RNG.standard_normal((5, 3)), RNG.standard_normal((5, 3, 3))
    inputs = INS_MAG.bind(m=m, c=c)
    assert tuple(inputs) == INS_MAG.input_ports
    assert inputs["in_magy"].tolist() == m[:, 1].tolist()
    assert inputs["in_c31"].tolist() == c[:, 2, 0].tolist()


def test_bind_broadcasts_leading_axes():
    system = ins_flight(FLIGHT.replace(period_input=True))
    inputs = system.bind(a=RNG.standard_normal((4, 1, 3)), m=np.zeros((2, 3)), g=(1, 2, 3), period=0.01)
    assert {values.shape for values in inputs.values()} == {(4, 2)}
    assert (inputs["in_gyroz"] == 3).all()
    assert (inputs["in_period"] == 0.01).all()


def test_read_is_the_inverse_of_bind():
    values = {"m": RNG.standard_normal((7, 3)), "c": RNG.standard_normal((7, 3, 3))}
    told = INS_MAG.read(INS_MAG.bind(**values), INS_MAG.inputs)
    assert all((told[name] == array).all() for name, array in values.items())
    assert told.keys() == values.keys()


def test_read_gives_outputs_by_the_kernels_names():
    result = {port: np.full(2, index) for index, port in enumerate(INS_TOP.output_ports)}
    told = INS_TOP.read(result)
    assert told["c"].tolist() == 2 * [[[0, 1, 2], [3, 4, 5], [6, 7, 8]]]
    assert told["angles"].tolist() == 2 * [[9, 10, 11]]


def test_read_gives_single_numbers_as_arrays_without_axes():
    told = system_of("INS_atan", THESIS).read({"out_result": 0.5})["angle"]
    assert (told.shape, float(told)) == ((), 0.5)


def test_the_state_is_bound_over_its_reset():
    state = INS_TOP.bind_state(s=RNG.standard_normal((3, 4)))
    assert state.keys() == INS_TOP.reset.keys()
    assert state["c22"].tolist() == [1, 1, 1]
    assert INS_TOP.bind_state()["sa"] == 1


@pytest.mark.parametrize(("values", "error", "message"), [
    ({"m": (1, 2, 3)}, TypeError, "INS_mag lacks the input 'c': give m, c"),
    ({"m": (1, 2, 3), "c": np.eye(3), "acc": 1}, TypeError, "INS_mag has no input 'acc': choose from m, c"),
    ({"m": (1, 2), "c": np.eye(3)}, ValueError, "INS_mag: input m must have the shape (..., 3), not (2,)"),
    ({"m": (1, 2, 3), "c": np.eye(4)}, ValueError, "INS_mag: input c must have the shape (..., 3, 3), not (4, 4)"),
    ({"m": 1, "c": np.eye(3)}, ValueError, "INS_mag: input m must have the shape (..., 3), not ()"),
    ({"m": np.zeros((2, 3)), "c": np.zeros((4, 3, 3))}, ValueError,
     "INS_mag: the leading axes must broadcast, not m (2,), c (4,)"),
])
def test_wrong_names_and_shapes_are_told_in_one_line(values, error, message):
    with pytest.raises(error) as caught:
        INS_MAG.bind(**values)
    assert str(caught.value) == message


def test_an_unknown_state_is_told_in_one_line():
    with pytest.raises(TypeError) as caught:
        INS_TOP.bind_state(omega=0)
    assert str(caught.value) == "INS_top has no state 'omega': choose from s, c, i"


def test_a_reset_of_no_word_is_refused():
    with pytest.raises(ValueError, match=r"^reset names 'w', which is not a word of the state$"):
        replace(INS_TOP, reset={"w": 1.0})


def test_an_order_of_status_bits_must_name_those_of_the_engine():
    with pytest.raises(ValueError, match=r"^status_order must name 'ignored', which is a status bit$"):
        replace(INS_TOP, status_order=("refused", *INS_TOP.status))


def sequential(system, pool, inputs):
    """The twin, sample by sample: (result, refused), the expected results of `run`. The rule of restarts is written
    once more."""
    fmt = pool.format
    state = {word: fmt.array(value) for word, value in system.reset.items()}
    shown = {port: fmt.array(value) for port, value in system.trace(pool).reset_outputs.items()}
    rows, refusals, in_a_row = [], [], 0
    for sample in zip(*inputs.values(), strict=True):
        twin = system.update_twin(pool, dict(zip(inputs, sample, strict=True)), state)
        refused = bool(twin.get("refused", False))
        if not refused:
            state, shown = {word: twin[word] for word in state}, {port: twin[port] for port in shown}
            in_a_row = 0
        elif all(np.isfinite(sample)):
            in_a_row += 1
        restarted = in_a_row > 0 and in_a_row == system.restart_after
        if restarted:
            state, in_a_row = {word: fmt.array(value) for word, value in system.reset.items()}, 0
        rows.append(shown | state | {name: twin[name] and not refused for name in system.status}
                    | ({"restarted": restarted} if system.restart_after else {}))
        refusals.append(refused)
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, refusals


def random_inputs(system, shape):
    """Numbers with a NaN, an overflow and a subnormal number among them; switches are seldom on."""
    inputs = {port: RNG.standard_normal(shape) for port in system.input_ports}
    for port in ("in_load", "in_load_en", "in_align"):
        if port in inputs:
            inputs[port] = (RNG.random(shape) < 0.1).astype(float)
    port = system.input_ports[0]
    inputs[port][[0, 5, 6, 9]] = np.nan, np.inf, 1e38, 1e-40
    return inputs


@pytest.mark.parametrize("name", ["thesis", "flight", "quaternion_j3", "sins_damped"])
def test_a_run_is_the_twin_sample_by_sample(name):
    config = CONFIGS[name]
    system, pool = system_of(main_module(config), config), config.pool
    inputs = random_inputs(system, 25)
    result, state = system.run(pool, inputs)
    expected, refused = sequential(system, pool, inputs)
    assert result["refused"].tolist() == refused
    assert refused[0]
    assert result.keys() == expected.keys() | {"refused"}
    assert ("restarted" in result) == (name != "sins_damped")
    for key, values in expected.items():
        assert result[key].dtype == values.dtype
        assert result[key].tobytes() == values.tobytes(), key
    assert all(state[key] == result[key][-1] for key in (*system.output_ports, *system.reset))


def refused_inputs(system, shape):
    """Numbers with many samples that overflow or have a NaN, so that restarts come at all distances."""
    inputs = {port: RNG.standard_normal(shape) for port in system.input_ports} | {"in_load_en": np.zeros(shape)}
    inputs["in_p"] = np.where(RNG.random(shape) < 0.6, 1e38, inputs["in_p"])
    inputs["in_q"] = np.where(RNG.random(shape) < 0.2, np.nan, inputs["in_q"])
    return inputs


def test_a_run_with_restarts_is_the_twin_sample_by_sample():
    system, pool = replace(quat_direct(QUATERNION_J3), restart_after=2), QUATERNION_J3.pool
    inputs = refused_inputs(system, 60)
    result, state = system.run(pool, inputs)
    expected, _ = sequential(system, pool, inputs)
    assert result["restarted"].sum() > 5
    for key, values in expected.items():
        assert result[key].tobytes() == values.tobytes(), key
    cut = 1 + np.flatnonzero(result["refused"] & ~result["restarted"] & np.isfinite(inputs["in_q"]))[2]
    first, middle = system.run(pool, {port: values[:cut] for port, values in inputs.items()})
    second, last = system.run(pool, {port: values[cut:] for port, values in inputs.items()}, middle)
    assert middle["refusals in a row"] == 1
    assert last == state
    for key, values in result.items():
        assert values.tobytes() == np.concatenate((first[key], second[key])).tobytes(), key


def test_runs_side_by_side_restart_by_themselves():
    system, pool = replace(quat_direct(QUATERNION_J3), restart_after=2), QUATERNION_J3.pool
    inputs = refused_inputs(system, (30, 3))
    result, _ = system.run(pool, inputs)
    assert result["restarted"].any(axis=0).all()
    for lane in range(3):
        expected, _ = sequential(system, pool, {port: values[:, lane] for port, values in inputs.items()})
        assert all(result[key][:, lane].tobytes() == values.tobytes() for key, values in expected.items())


def test_a_run_in_float64_restarts_as_well():
    system = replace(INS_TOP, restart_after=3)
    inputs = {port: RNG.standard_normal(9) for port in system.input_ports}
    state = dict(system.reset) | {"ix": np.inf}
    inputs["in_accx"][1] = np.nan
    result, last = system.run_float64(inputs, state)
    assert result["refused"].tolist() == [True] * 4 + [False] * 5
    assert np.flatnonzero(result["restarted"]).tolist() == [3]
    assert (result["sa"][3], result["c12"][3]) == (1, 0)
    assert last["refusals in a row"] == 0


@pytest.mark.parametrize(("changes", "message"), [
    ({"restart_after": -1}, r"^restart_after must be 0 or more, not -1$"),
    ({"restart_after": 8, "status_port": ""},
     r"^restart_after must be 0, not 8: INS_top has no state, or no status port and so no refused updates$")])
def test_a_restart_needs_refusals(changes, message):
    with pytest.raises(ValueError, match=message):
        replace(INS_TOP, **changes)


def test_a_run_goes_on_where_another_ended():
    inputs = random_inputs(INS_TOP, 20)
    inputs["in_accx"][10] = np.nan  # refused: the second part begins with the outputs of the first part
    whole, _ = INS_TOP.run(THESIS.pool, inputs)
    first, state = INS_TOP.run(THESIS.pool, {port: values[:10] for port, values in inputs.items()})
    second, _ = INS_TOP.run(THESIS.pool, {port: values[10:] for port, values in inputs.items()}, state)
    for name, values in whole.items():
        assert values.tobytes() == np.concatenate((first[name], second[name])).tobytes(), name


def test_runs_side_by_side_are_runs_of_their_own():
    system = quat_direct(QUATERNION_J3)
    e = RNG.standard_normal((3, 4))
    state = system.bind_state(e=e / np.linalg.norm(e, axis=1, keepdims=True))
    omega = RNG.standard_normal((30, 3, 3))
    omega[7, 1, 0] = np.nan
    inputs = system.bind(omega=omega, load=0.0, start=np.zeros(4))
    result, _ = system.run(QUATERNION_J3.pool, inputs, state)
    assert result["out_e0"].shape == (30, 3)
    assert np.flatnonzero(result["refused"].any(axis=0)).tolist() == [1]
    for lane in range(3):
        own, _ = system.run(QUATERNION_J3.pool, {port: values[:, lane] for port, values in inputs.items()},
                            {word: values[lane] for word, values in state.items()})
        assert all(result[name][:, lane].tobytes() == values.tobytes() for name, values in own.items())


def test_wrong_predictions_cost_time_only(monkeypatch):
    inputs = random_inputs(INS_TOP, 20)
    expected, _ = INS_TOP.run(THESIS.pool, inputs)
    predicted = System._predicted

    def wrong(self, pool, inputs, state, refusals):
        return {word: np.concatenate((values[:1], values[1:] + pool.format.dtype.type(1)))
                for word, values in predicted(self, pool, inputs, state, refusals).items()}

    monkeypatch.setattr(System, "_predicted", wrong)
    result, _ = INS_TOP.run(THESIS.pool, inputs)
    assert all(values.tobytes() == expected[name].tobytes() for name, values in result.items())


def test_a_system_without_state_or_status_port():
    system = system_of("INS_atan", THESIS)
    result, state = system.run(THESIS.pool, system.bind(sine=np.array([1.0, np.nan]), cosine=1.0))
    assert result.keys() == {"out_result"}
    assert result["out_result"][0] == pytest.approx(np.pi / 4)
    assert np.isnan(state["out_result"])


def test_a_prediction_is_nearly_always_right(monkeypatch):
    """Otherwise a run would be as slow as the twin on single samples."""
    for config in (THESIS, FLIGHT, QUATERNION_J3, SINS):
        system = system_of(main_module(config), config)
        inputs = {port: RNG.standard_normal(40) for port in system.input_ports}
        # A core is loaded once. What is loaded in later samples is predicted less often.
        for port in ("in_load", "in_load_en"):
            if port in inputs:
                inputs[port] = np.eye(40)[0]
        blocks = []

        def counted(*arguments, update=System.update_twin, blocks=blocks):
            blocks.append(1)
            return update(*arguments)

        with monkeypatch.context() as patch:
            patch.setattr(System, "update_twin", counted)
            system.run(config.pool, inputs)
        assert len(blocks) <= 3, config.name


def test_equations_may_give_constants():
    system = System("ONE", "one", lambda xp, x: Update({"y": x, "one": xp.lift(1.0)}), sections=("S",), start="in_en",
                    finish="out_finish", inputs={"x": "in_x"}, outputs={"y": "out_y", "one": "out_one"})
    result, _ = system.run(THESIS.pool, {"in_x": np.arange(3.0)})
    assert result["out_one"].tolist() == [1, 1, 1]


def test_a_run_in_float64_is_the_kernel_sample_by_sample():
    system = quat_direct(QUATERNION_J3)
    inputs = system.bind(omega=RNG.standard_normal((6, 2, 3)), load=0.0, start=np.zeros(4))
    inputs["in_p"][3, 1] = np.nan
    result, last = system.run_float64(inputs, system.bind_state(e=np.array([(1.0, 0, 0, 0), (0, 0, 1.0, 0)])))
    assert result["refused"].tolist() == [[False, k == 3] for k in range(6)]
    for lane, e in enumerate(([1.0, 0, 0, 0], [0, 0, 1.0, 0])):
        state = dict(zip(system.reset, e, strict=True))
        for k in range(6):
            update = system.update_float64({port: values[k, lane] for port, values in inputs.items()}, state)
            if (k, lane) != (3, 1):
                state = {word: update[word] for word in state}
            assert [result[word][k, lane] for word in state] == list(state.values())
            assert [result[port][k, lane] for port in system.output_ports] == list(state.values())
    assert all((last[name] == values[-1]).all() for name, values in result.items() if name in last)


def test_a_first_update_that_is_refused_in_float64_shows_zeros():
    result, _ = INS_TOP.run_float64(INS_TOP.bind(a=[(np.inf, 0, 0)], m=np.ones(3), g=np.zeros(3)))
    assert INS_TOP.read(result)["c"].tolist() == np.zeros((1, 3, 3)).tolist()
    assert result["refused"].tolist() == [True]
    assert result["sa"].tolist() == [1]


def test_two_ports_of_one_name_are_refused():
    with pytest.raises(ValueError, match=r"^INS_mag has two ports called 'in_magx'$"):
        replace(INS_MAG, outputs={"e_m": ("in_magx", "out_eym", "out_ezm")})
    with pytest.raises(ValueError, match=r"^INS_mag has two ports called 'in_mag_en'$"):
        replace(INS_MAG, finish="in_mag_en")


@pytest.mark.parametrize("shape", [(), (0,)])
def test_a_run_without_samples_is_refused(shape):
    inputs = INS_MAG.bind(m=np.zeros((*shape, 3)), c=np.zeros((*shape, 3, 3)))
    message = "^INS_mag: a run needs at least one sample along the first axis, not numbers of shape " \
        rf"{re.escape(str(shape))}$"
    with pytest.raises(ValueError, match=message):
        INS_MAG.run(THESIS.pool, inputs)
    with pytest.raises(ValueError, match=message):
        INS_MAG.run_float64(inputs)
