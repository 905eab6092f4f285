"""Every module's cocotb bench on both simulators: `make sim`."""

import os
from pathlib import Path

import pytest

from strapdown.cores import ATTITUDE_CORES
from strapdown_sim.drivers.bench import run_bench
from strapdown_sim.drivers.toolchain import icarus_missing

BUILD = Path(__file__).parents[2] / "build" / "sim"
CONFIGS = dict.fromkeys(ATTITUDE_CORES, "thesis") | {
    "INS_flight": "flight", "QUAT_direct": "quaternion_j2", "SINS_top": "sins", "OPT_attitude": "optical_tcd1304"}
OWN_BENCHES = {module: f"strapdown_sim.bench.bench_{module.lower()}"
               for module in ("INS_top", "INS_flight", "QUAT_direct", "SINS_top")}
# `make test` has most modules on Icarus only, because tests/cores runs their circuits in Verilator anyway.
RUNS = [pytest.param(module, simulator, marks=[
            getattr(pytest.mark, simulator),
            *([pytest.mark.sim_only] if simulator == "verilator" and module not in OWN_BENCHES else [])])
        for module in CONFIGS for simulator in ("icarus", "verilator")]
# A short alignment.
CHANGES = {"SINS_top": {"alignment_samples": 3}}


def benches(module):
    """The bench for all cores, and the bench of the module."""
    return ["strapdown_sim.bench.bench_core", *([OWN_BENCHES[module]] if module in OWN_BENCHES else [])]


@pytest.mark.icarus
@pytest.mark.parametrize("module", ["INS_acc", "INS_atan"])
def test_file_compiled_as_systemverilog_behaves_alike(module):
    if missing := icarus_missing():
        pytest.skip(missing)
    run_bench(benches(module), module, "thesis", "icarus", BUILD / "icarus-2012" / module, language="2012")


@pytest.mark.parametrize(("module", "simulator"), RUNS)
def test_bench(module, simulator):
    if simulator == "icarus" and (missing := icarus_missing()):
        pytest.skip(missing)
    run_bench(benches(module), module, CONFIGS[module], simulator, BUILD / simulator / module,
              changes=CHANGES.get(module), waves=bool(os.environ.get("WAVES")))
