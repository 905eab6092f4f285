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
AXI_CONFIGS = {"INS_top_axi": "thesis", "INS_flight_axi": "flight", "QUAT_direct_axi": "quaternion_j2",
               "SINS_top_axi": "sins", "INS_top_x8_axi": "thesis_x8"}
OWN_BENCHES = {module: f"strapdown_sim.bench.bench_{module.lower()}"
               for module in ("INS_top", "INS_flight", "QUAT_direct", "SINS_top")}
# `make test` has most modules on Icarus only, because tests/cores runs their circuits in Verilator anyway.
RUNS = [pytest.param(module, simulator, marks=[
            getattr(pytest.mark, simulator),
            *([pytest.mark.sim_only] if simulator == "verilator" and module not in OWN_BENCHES else [])])
        for module in CONFIGS for simulator in ("icarus", "verilator")]
FIELDS = "strapdown_sim.bench.bench_axi_fields"
# The bench of the bus that `make test` has.
QUICK = "QUAT_direct_axi", "icarus"
AXI_RUNS = [pytest.param(module, simulator, marks=[
                getattr(pytest.mark, simulator),
                *([] if (module, simulator) == QUICK else [pytest.mark.sim_only])])
            for module in AXI_CONFIGS for simulator in ("icarus", "verilator")]
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


@pytest.mark.parametrize(("module", "simulator"), AXI_RUNS)
def test_bench_of_the_bus(module, simulator):
    if simulator == "icarus" and (missing := icarus_missing()):
        pytest.skip(missing)
    run_bench(["strapdown_sim.bench.bench_axi", *([FIELDS] if (module, simulator) == QUICK else [])], module,
              AXI_CONFIGS[module], simulator, BUILD / simulator / module, waves=bool(os.environ.get("WAVES")))


@pytest.mark.icarus
@pytest.mark.parametrize("module", ["INS_top_axi", "INS_flight_axi", "SINS_top_axi"])
def test_every_field_of_the_registers(module):
    if missing := icarus_missing():
        pytest.skip(missing)
    run_bench([FIELDS], module, AXI_CONFIGS[module], "icarus",
              BUILD / "icarus-fields" / module)
