"""Every module's cocotb bench on both simulators: `make sim`."""

import os
from pathlib import Path

import pytest
from strapdown_sim.drivers.bench import run_bench
from strapdown_sim.drivers.toolchain import icarus_missing

from strapdown.cores import ATTITUDE_CORES

BUILD = Path(__file__).parents[2] / "build" / "sim"
SIMULATORS = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ("icarus", "verilator")]
BENCHES = {module: ["strapdown_sim.bench.bench_core"] for module in ATTITUDE_CORES}
BENCHES["INS_top"].append("strapdown_sim.bench.bench_ins_top")


@pytest.mark.icarus
@pytest.mark.parametrize("module", ["INS_acc", "INS_atan"])
def test_file_compiled_as_systemverilog_behaves_alike(module):
    if missing := icarus_missing():
        pytest.skip(missing)
    run_bench(BENCHES[module], module, "thesis", "icarus", BUILD / "icarus-2012" / module, language="2012")


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("module", BENCHES)
def test_bench(module, simulator):
    if simulator == "icarus" and (missing := icarus_missing()):
        pytest.skip(missing)
    run_bench(BENCHES[module], module, "thesis", simulator, BUILD / simulator / module,
              waves=bool(os.environ.get("WAVES")))
