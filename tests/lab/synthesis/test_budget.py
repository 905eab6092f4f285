"""Cores stay within their budgets of cycles and of a 7-series part."""

import json

import pytest

from strapdown_lab.report.cores import CORES
from strapdown_lab.report.measure import cycles_of, digest
from strapdown_lab.synthesis import Xc7Resources, synthesise_xc7

BUDGETS = {
    "thesis": {"cycles": 132, "lut": 1950, "dsp": 12, "bram": 4},
    "thesis_compact": {"cycles": 350, "lut": 750, "dsp": 4, "bram": 3},
    "thesis_fast": {"cycles": 108, "lut": 3450, "dsp": 14, "bram": 5},
    "thesis_x8": {"cycles": 67, "lut": 2200, "dsp": 14, "bram": 14},
    "thesis_x64": {"cycles": 67, "lut": 2300, "dsp": 14, "bram": 35.5},
    "thesis_fast_x16": {"cycles": 45, "lut": 3000, "dsp": 14, "bram": 26},
    "flight": {"cycles": 286, "lut": 5300, "dsp": 14, "bram": 5},
    "quaternion_j2": {"cycles": 70, "lut": 1500},
    "sins": {"cycles": 670, "lut": 6000},
    "optical_tcd1304": {"lut": 3500, "dsp": 5, "bram": 2},
    "optical_s11639": {"lut": 3500, "dsp": 5, "bram": 2},
    "optical_erected": {"lut": 3500, "dsp": 5, "bram": 2},
}
"""Maps each configuration to the budget of its main core: cycles per update, and resources of ``synthesise_xc7``."""


@pytest.mark.parametrize("config", BUDGETS)
def test_core_stays_within_its_budget(config, root, make_module, circuit_of, request):
    entry = next(entry for entry in CORES if entry.config.name == config)
    core = make_module(entry.module, entry.config)
    resources = _resources(circuit_of(entry.module, entry.config), entry, root, request)
    taken = vars(resources) | {"cycles": cycles_of(core)}
    assert {kind: taken[kind] for kind, most in BUDGETS[config].items() if taken[kind] > most} == {}


def _resources(circuit, entry, root, request):
    """Figures in docs/ if they are those of this circuit, else the figures of Yosys."""
    report = root / "docs" / "report" / "cores.json"
    rows = json.loads(report.read_text(encoding="utf-8"))["cores"] if report.exists() else []
    for row in rows:
        if row["verilog_sha256"] == digest(circuit):
            return Xc7Resources(**row["xc7"])
    request.getfixturevalue("yosys")
    return synthesise_xc7(circuit, entry.module, request.getfixturevalue("cache"))
