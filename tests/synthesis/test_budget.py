# amaranth: UnusedElaboratable=no
"""Cores stay within their budget of a 7-series part."""

import pytest
from strapdown_sim.report.cores import CORES
from strapdown_sim.report.measure import core_circuit

from strapdown.synthesis import synthesise_xc7

BUDGETS = {("INS_top", "thesis"): {"lut": 2500, "dsp": 6, "bram": 2}}
"""Module and configuration to the most that it may take, as ``synthesise_xc7`` counts."""


@pytest.mark.parametrize(("module", "config"), BUDGETS)
def test_core_stays_within_its_budget(module, config, yosys, cache):
    entry = next(entry for entry in CORES if (entry.module, entry.config.name) == (module, config))
    resources = synthesise_xc7(core_circuit(entry.make(), entry.config), module, cache)
    for kind, most in BUDGETS[module, config].items():
        assert getattr(resources, kind) <= most, kind
