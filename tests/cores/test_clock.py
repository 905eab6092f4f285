"""What a core does with its clock: reset, power-up without one, and clock enable, row by row in Verilator."""

import numpy as np
import pytest

from strapdown.config import ConfigError
from strapdown.cores import QUATERNION_J2, THESIS, main_module
from strapdown.export import write_core
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

CONFIGS = {
    "one channel": QUATERNION_J2.replace(clock_enable=True),
    "two channels": QUATERNION_J2.replace(clock_enable="true", channels=2),
}
ROWS = 3000
RESET = 2
"""Edges after power-up, or after the end of a reset, until it no longer acts."""


def release(core):
    """Edges after power-up, or after the end of a reset, at which no start is taken."""
    return RESET + core.engine.recovery


@pytest.fixture(scope="module", params=CONFIGS)
def timed(request, make_core, models, tmp_path_factory):
    """A core, its model with reset and clock enable as inputs, and random stimulus that starts whenever it can."""
    config = CONFIGS[request.param]
    core = make_core(main_module(config), config)
    path = write_core(core, config, tmp_path_factory.mktemp("clock"), "")
    members = {name: member for name, member in core.signature.members.items() if name != "clk"}
    inputs, outputs = ([name for name, member in members.items() if member.flow.name == flow] for flow in ("In", "Out"))
    try:
        model = VerilatedModel(path, Interface(core.system.name, tuple(inputs), tuple(outputs), reset=""), models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))
    rng = np.random.default_rng(5)
    stimulus = {name: np.float32(rng.uniform(-20, 20, ROWS)).view(np.uint32) for name in core.system.input_ports}
    stimulus["in_load_en"] = np.float32(rng.random(ROWS) < 0.05).view(np.uint32)
    stimulus |= {core.system.start: rng.integers(2, size=ROWS), "ce": np.ones(ROWS, int), "rst_n": np.ones(ROWS, int)}
    if config.channels > 1:
        stimulus["in_channel"] = rng.integers(config.channels, size=ROWS)
    return core, model, stimulus


def visible(answer, rows):
    return {name: values[rows] for name, values in answer.items()}


def assert_equal(one, other):
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.verilator
def test_a_core_that_never_sees_a_reset_works(timed):
    core, model, stimulus = timed
    powered = model.stream(stimulus)
    # The same stimulus after a reset in the middle of an update.
    late = 1000
    again = {name: np.concatenate((values[:late], values)) for name, values in stimulus.items()}
    again["rst_n"][late - 3:late] = 0
    # A start while the reset acts would set its bit.
    again[core.system.start][late - 3:late] = 0
    assert_equal(visible(model.stream(again), slice(late, None)), powered)
    finishes = powered[core.system.finish]
    assert (np.diff(finishes.astype(int)) == 1).sum() > ROWS / core.latency / 3
    first = np.flatnonzero(finishes)[0]
    taken = release(core) + np.flatnonzero(stimulus[core.system.start][release(core):])[0]
    assert first == taken + 1 + core.latency


@pytest.mark.verilator
def test_the_first_start_that_is_taken(timed):
    core, model, stimulus = timed
    edges = release(core)
    assert edges == (3 if core.engine.channels == 1 else 4 + len(core.engine.program.constants))
    for end in 0, 700:
        for waits in range(edges + 1):
            rows = {name: np.array(values[:end + 3 * core.latency]) for name, values in stimulus.items()}
            rows["rst_n"][max(end - 3, 0):end] = 0
            rows[core.system.start][max(end - 3, 0):] = 0
            rows[core.system.start][end + waits] = 1
            answer = model.stream(rows)
            finishes = np.flatnonzero(answer[core.system.finish][end:])
            if waits < edges:
                assert not finishes.size
            else:
                assert finishes[0] == waits + 1 + core.latency
            if "ignored" in core.engine.status_names:
                bit = core.engine.status_names.index("ignored")
                ignored = answer[core.system.status_port][end:] >> bit & 1
                assert not ignored[0]
                assert ignored[edges] == ignored[-1] == (waits < edges)


@pytest.mark.verilator
def test_a_reset_acts_at_the_third_edge_and_whatever_the_clock_enable(timed):
    core, model, stimulus = timed
    rows = {name: np.array(values[:1000]) for name, values in stimulus.items()}
    rows["rst_n"][900:903] = 0
    undisturbed = model.stream(stimulus)
    rows["ce"][900:] = 0
    answer = model.stream(rows)
    shown = {port.name: port.init for port in core.component.ports if port.name in answer and port.name != "in_ready"}
    for name, init in shown.items():
        assert set(answer[name][900:903]) == {undisturbed[name][900]}, name
        assert set(answer[name][903:]) == {init}, name
    assert any(undisturbed[name][900] != init for name, init in shown.items())


@pytest.mark.verilator
def test_with_a_clock_enable_enabled_edges_count(timed):
    _, model, stimulus = timed
    expected = model.stream(stimulus)
    rng = np.random.default_rng(6)
    steps = rng.integers(1, 4, size=ROWS)
    # The reset at power-up ends after two edges, enabled or not.
    steps[:RESET + 1] = 1
    enabled = np.cumsum(steps) - 1
    held = {name: rng.integers(2, size=enabled[-1] + 1) for name in stimulus}
    held["ce"][:] = 0
    held["rst_n"][:] = 1
    for name, values in stimulus.items():
        held[name][enabled] = values
    answer = model.stream(held)
    assert_equal(visible(answer, enabled), expected)
    # While the enable is low, all outputs hold but the one that depends on inputs at once.
    following = np.searchsorted(enabled, np.arange(len(held["ce"])))
    for name in answer:
        if name != "in_ready":
            np.testing.assert_array_equal(answer[name], expected[name][following], err_msg=name)


def test_only_cores_that_ask_for_it_have_a_clock_enable(make_core):
    assert "ce" not in make_core("INS_atan", THESIS).signature.members
    with_enable = make_core("INS_atan", THESIS.replace(clock_enable=True))
    assert [port.name for port in with_enable.ports][:3] == ["clk", "rst_n", "ce"]
    assert with_enable.latency == make_core("INS_atan", THESIS).latency
    with pytest.raises(ConfigError, match=r"^configuration thesis: clock_enable must be a valid bool.*, not 'maybe'$"):
        THESIS.replace(clock_enable="maybe")
