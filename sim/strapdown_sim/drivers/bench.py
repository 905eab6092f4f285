"""Runs cocotb benches on a generated core: builds, runs, raises an error if a test in the simulator failed."""

import json
import os
import shutil
import time
from contextlib import contextmanager
from functools import cache

from cocotb_tools.runner import get_results, get_runner

from strapdown.cores import CONFIGS, axi_core, main_module, make_core
from strapdown.export import write_core
from strapdown.files import written_whole

from .toolchain import verilator_environment

__all__ = ["core_under_test", "run_bench"]

MODULE, CONFIG, CHANGES = "STRAPDOWN_MODULE", "STRAPDOWN_CONFIG", "STRAPDOWN_CHANGES"
SEED = 20151
MONTH_S = 30 * 24 * 3600


@cache
def core_under_test():
    """For benches: the core under simulation, and its configuration."""
    config = CONFIGS[os.environ[CONFIG]].replace(**json.loads(os.environ[CHANGES]))
    return _made(os.environ[MODULE], config), config


def _made(module, config):
    """A module of a configuration, or its main module behind a bus."""
    return axi_core(config) if module == f"{main_module(config)}_axi" else make_core(module, config)


def run_bench(benches, module, config, simulator, directory, *, changes=None, waves=False, language="2001"):
    """Run cocotb benches on a module.

    Parameters
    ----------
    benches : list of str
        Names of the Python modules with the benches.
    module, config : str
        Verilog module and named configuration. The main module with ``_axi`` is the core behind its bus.
    simulator : str
        "icarus" or "verilator".
    directory : Path
        Folder for Verilog, build, log and, if ``waves``, the waveform.
    changes : dict or None
        Fields of the configuration to change, and their values.
    language : str
        Language version for Icarus, "2001" or "2012"; with ``waves`` always "2012", because cocotb adds
        SystemVerilog to write waveforms.

    Returns
    -------
    int
        Number of tests that ran. Raises: RuntimeError if one failed or none ran.
    """
    changes = changes or {}
    changed = CONFIGS[config].replace(**changes)
    verilog = write_core(_made(module, changed), changed, directory, "")
    build = directory / "build"
    runtime = directory.parent / ("runtime-waves" if waves else "runtime")
    _copy_objects(runtime, build)
    environment = {}
    if simulator == "icarus":
        flags = ["-g2012" if waves else f"-g{language}"]
    else:
        # One file, because parts would share a precompiled header, which the wheel's make rules cannot include.
        flags = ["-Wno-fatal", "--no-timing", "--output-split", "0"]
        # Benches are short: optimising Verilator's output would take longer than running it.
        environment = verilator_environment() | {"MAKEFLAGS": "OPT_GLOBAL=-O0 OPT_FAST=-O1 OPT_SLOW=-O0"}
    with _environment(environment):
        runner = get_runner(simulator)
        runner.build(sources=[verilog], hdl_toplevel=module, build_dir=build, build_args=flags,
                     timescale=("1ns", "1ps"), waves=waves, log_file=directory / "build.log")
        _copy_objects(build, runtime)
        results = runner.test(
            test_module=benches, hdl_toplevel=module, build_dir=build, test_dir=directory, seed=SEED,
            waves=waves, timescale=("1ns", "1ps"), log_file=directory / "test.log",
            extra_env={MODULE: module, CONFIG: config, CHANGES: json.dumps(changes)},
            results_xml=str(directory / "results.xml"))
    count, failed = get_results(results)
    if failed or not count:
        raise RuntimeError(f"{module} on {simulator}: {failed} of {count} tests failed, see {directory / 'test.log'}")
    return count


def _copy_objects(source, target):
    """Keep the objects of Verilator's runtime for the next build; they are the same for every module."""
    target.mkdir(parents=True, exist_ok=True)
    for path in source.glob("verilated*.o"):
        copy = target / path.name
        if not copy.exists():
            # Benches may run in parallel.
            with written_whole(copy) as partial:
                shutil.copyfile(path, partial)
        # The objects depend on the makefile that Verilator rewrites, so make would compile older objects again.
        os.utime(copy, (time.time() + MONTH_S,) * 2)


@contextmanager
def _environment(changes):
    """Context manager: the process environment with some variables changed."""
    before = dict(os.environ)
    os.environ.update(changes)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
