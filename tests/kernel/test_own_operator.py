"""The operator of docs/kernels.md, in a user's file: in the twin, in both schedules and in both circuits."""

from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cli.common import named_configuration
from strapdown.cores import main_module, make_core
from strapdown.export import write
from strapdown.kernel.list_scheduler import list_schedule
from strapdown.kernel.machine import UpdateMachine, reads
from strapdown.kernel.numeric import Float64
from strapdown.kernel.operators import OPERATIONS, Multiplier
from strapdown.kernel.trace import Tracer
from strapdown_lab.docs import own_operator
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel

COUNT = 400
BIG = 3e38
"""A difference of two such numbers may overflow."""


@pytest.fixture
def config(root, tmp_path, monkeypatch):
    """The configuration in the page's file, which is loaded anew for each test."""
    monkeypatch.chdir(tmp_path)
    page = (root / "docs" / "kernels.md").read_text(encoding="utf-8")
    (tmp_path / "my_operator.py").write_text(own_operator(page), encoding="utf-8")
    return named_configuration("my_operator.py:PERIMETER")


def stimulus(seed):
    values = np.random.default_rng(seed).uniform(-100, 100, (3, COUNT))
    values[:, 50], values[:, 60] = (BIG, -BIG, 0), (1, np.inf, 2)
    return {f"in_{axis}": row for axis, row in zip("xyz", values, strict=True)}


def exact(inputs, last):
    """Total and change by NumPy in float64, from the numbers that the circuit gets."""
    x, y, z = (np.float64(np.float32(inputs[f"in_{axis}"])) for axis in "xyz")
    total = abs(x - y) + abs(y - z) + abs(z - x)
    return total, abs(abs(total - last) - 1) / 2


def test_the_twin_is_the_equation(config):
    system = config.systems()["PERIMETER_top"](config)
    inputs = stimulus(1)
    with np.errstate(all="ignore"):
        twin = system.update_twin(config.pool, inputs, {"last": 7.0})
        total, change = exact(inputs, 7.0)
    assert np.flatnonzero(twin["refused"]).tolist() == [50, 60]
    good = ~twin["refused"]
    # Five roundings of numbers below 512, by at most 2**-16 each.
    assert np.abs(twin["out_total"][good] - total[good]).max() < 5 * 2.0**-16
    assert np.abs(twin["out_change"][good] - change[good]).max() < 5 * 2.0**-16
    assert Float64().distance(3.0, -5.0) == 8


def test_results_on_their_way_to_a_reader_take_the_bus(config):
    """Chains of such results beside each other: the schedule verifies that each has the result bus to itself."""
    pool = config.pool.with_operators(Multiplier(count=2))
    xp = Tracer(pool, ("ONLY",))
    ports = [f"x{index}" for index in range(8)]
    x = [xp.source("input", port) for port in ports]
    outputs = {f"y{index}": xp.settled(xp.distance(xp.distance(a, b) * b, a * b) + a)
               for index, (a, b) in enumerate(pairwise(x))}
    schedule = list_schedule(xp.graph(inputs=tuple(ports), outputs=outputs), UpdateMachine(pool))
    distances = [step for step in schedule.steps if step.unit == "distance"]
    assert len(distances) == 14
    assert all(schedule.on_bus(step) for step in distances)
    assert any(schedule.forwarded(step, read) for step in schedule.steps for read in reads(step.node)
               if read.node.operation == "distance")


@pytest.mark.verilator
def test_the_circuit_is_the_twin_in_every_bit(config, models, tmp_path):
    core = make_core(main_module(config), config)
    model = CoreModel(core, write(core, tmp_path, command=""), models)
    inputs = stimulus(2)
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert model.differing_bits(inputs, result) == 0
    assert np.flatnonzero(result["out_status"] >> 1 & 1).tolist() == [50, 60]


@pytest.mark.verilator
def test_eight_channels_are_the_twin_in_every_bit(config, models, tmp_path):
    config = config.replace(channels=8)
    core = make_core(main_module(config), config)
    model = StreamModel(core, write(core, tmp_path, command=""), models)
    inputs, channels = stimulus(3), np.random.default_rng(4).integers(8, size=COUNT)
    result = model.update(channels, inputs)
    assert len(result["row"]) == COUNT
    assert model.differing_bits(inputs, result) == 0


def test_the_command_line_takes_it_again_and_again(config):
    first = OPERATIONS["distance"]
    for _ in range(2):
        result = CliRunner().invoke(main, ["schedule", "my_operator.py:PERIMETER"], catch_exceptions=False)
        assert result.exit_code == 0, result.output
    assert OPERATIONS["distance"] is not first
