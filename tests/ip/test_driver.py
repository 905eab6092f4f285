"""The driver in C: each error, and updates through a native build against the model, with outputs of the twin."""

import shutil
import subprocess

import numpy as np
import pytest

from strapdown.cores import FLIGHT, QUATERNION_J2, SINS, THESIS, THESIS_X8, main_module
from strapdown.cores.registers import register_table
from strapdown_sim.drivers.bus import answer_words, sample_words

from .support import DRIVER, HERE, STRICT, assert_answers, build, run, tool

REFUSED = -6

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is missing: the driver is not compiled.")


def updates(top, count, *, seed=15):
    """Words of random samples, of which some are refused, and of their answers by the twin."""
    rng, system = np.random.default_rng(seed), top.component.system
    inputs = {port: rng.normal(size=count).astype(np.float32) for port in system.input_ports}
    inputs[system.input_ports[0]][7::50] = np.nan
    result, _ = system.run(top.component.program.schedule.pool, inputs)
    assert result["refused"].sum() == len(range(7, count, 50))
    answers = answer_words(top, result)
    assert len(np.unique(answers, axis=0)) > count // 2
    return sample_words(top, inputs), answers


def check(top, model, tmp_path, count, **options):
    """Updates through the native driver."""
    table = top.component.table
    samples, answers = updates(top, count)
    program, _ = build(table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, samples, **options)
    assert (done.returncode, done.stderr) == (0, b"")
    read, flags = assert_answers(words, answers)
    refused = answers[:, -1] & table["SNAPSHOT_STATUS"]["refused"].mask != 0
    assert np.array_equal(read == REFUSED, refused)
    assert np.array_equal(flags, np.where(refused, 0b11, 0b01))


def test_updates_equal_the_twin(make_bus, tmp_path):
    check(*make_bus(THESIS), tmp_path, 300, seed=4, stalls=30)


@pytest.mark.ip
def test_ten_thousand_updates_equal_the_twin(make_bus, tmp_path):
    check(*make_bus(THESIS), tmp_path, 10_000, seed=5, stalls=40)


@pytest.mark.ip
def test_words_of_64_bits_equal_the_twin(make_bus, tmp_path):
    top, model = make_bus(SINS)
    samples, answers = updates(top, 60)
    program, _ = build(top.component.table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, samples, seed=7, stalls=20)
    assert (done.returncode, done.stderr) == (0, b"")
    assert_answers(words, answers)


@pytest.mark.ip
def test_channels_equal_the_twin(make_bus, tmp_path):
    """One sample for each channel in turn; each channel has a state of its own."""
    top, model = make_bus(THESIS_X8)
    component, rng = top.component, np.random.default_rng(18)
    inputs = {port: rng.normal(size=(40, component.channels)).astype(np.float32)
              for port in component.system.input_ports}
    result, _ = component.system.run(component.program.schedule.pool, inputs)
    inputs, result = ({name: np.ravel(values) for name, values in each.items()} for each in (inputs, result))
    answers = answer_words(top, result)
    program, _ = build(component.table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, sample_words(top, inputs), seed=8, stalls=20)
    assert (done.returncode, done.stderr) == (0, b"")
    assert_answers(words, answers)


@pytest.mark.ip
def test_gains_at_run_time(make_bus, tmp_path):
    """Gains that are parameters, with other values than those of the configuration, equal those of the twin."""
    gains = {"field_tolerance": 0.25, "magnetometer_gain": 0.125}
    top, model = make_bus(FLIGHT.replace(inputs=tuple(gains)))
    component, rng = top.component, np.random.default_rng(16)
    parameters = [word.port for word in component.table.parameters]
    assert len(parameters) == len(gains)
    inputs = {port: rng.normal(size=300) for port in component.system.input_ports}
    inputs |= {f"in_{name}": np.full(300, value) for name, value in gains.items()}
    results = [component.system.run(component.program.schedule.pool, inputs | changed)[0]
               for changed in ({}, {parameters[0]: np.ones(300)})]
    answers, others = (answer_words(top, result) for result in results)
    assert not np.array_equal(answers, others)
    values = np.float32([inputs[port][0] for port in parameters]).view("<u4")
    program, _ = build(component.table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, np.concatenate([values, sample_words(top, inputs).ravel()]), seed=6, stalls=20)
    assert (done.returncode, done.stderr) == (0, b"")
    assert_answers(words, answers)


def test_another_configuration_is_found(make_bus, make_core, tmp_path):
    """Also the header of another core."""
    _, model = make_bus(THESIS)
    program, _ = build(register_table(make_core("QUAT_direct", QUATERNION_J2), QUATERNION_J2), tmp_path, ["hooks.c"],
                       "-DSTRAPDOWN_HOOKS")
    words, done = run(program, model, [])
    assert (words.astype(np.int32).tolist(), done.returncode) == ([-3], 1)


@pytest.mark.parametrize("config", [THESIS, THESIS_X8], ids=lambda config: config.name)
def test_errors(make_core, tmp_path, config):
    table = register_table(make_core(main_module(config), config), config)
    build(table, tmp_path, ["hooks.c"], "-DSTRAPDOWN_HOOKS")
    tool("gcc", *STRICT, *DRIVER, f"-I{tmp_path}", f'-DCORE_HEADER="{table.name}.h"',
         f"-DCORE_MAP={table.name.upper()}_MAP", "-o", tmp_path / "errors", HERE / "errors.c", tmp_path / "strapdown.c")
    done = subprocess.run([tmp_path / "errors"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
