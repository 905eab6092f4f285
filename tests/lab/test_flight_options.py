"""The table of the options of the flight core is that of this commit, and the options are those that it names."""

import json

import numpy as np
import pytest

from strapdown.algorithms.flight import NO_CALIBRATION
from strapdown.cores import FLIGHT, ins_flight, main_module
from strapdown_lab.studies import flight_options


@pytest.fixture(scope="module")
def result(root):
    """The figures in docs/report."""
    return json.loads((root / "docs" / "report" / "flight_options.json").read_text(encoding="utf-8"))


def test_figures_are_those_of_this_commits_circuits(result, make_core):
    again = "python -m strapdown_lab.studies.flight_options measures them again"
    assert result["verilog_sha256"] == flight_options.circuit_digest(make_core(main_module(FLIGHT), FLIGHT)), again
    assert result["equations_sha256"] == flight_options.digest_of_options(), again
    assert list(result["options"]) == list(flight_options.OPTIONS)


def test_options_differ_and_their_constants_are_not_free(result):
    assert len(set(result["equations_sha256"].values())) == len(flight_options.OPTIONS)
    constants = flight_options.BIASES | flight_options.MATRICES
    assert constants.keys() == set(NO_CALIBRATION._fields)
    assert not np.isin(np.concatenate([np.abs(value).ravel() for value in constants.values()]), (0, 1)).any()


def test_every_option_of_the_core_has_a_price():
    """Those that change ports or equations, and all parameters that can be inputs."""
    alone = set(ins_flight(FLIGHT).input_ports)
    added = set().union(*(ins_flight(flight_options.config_of(changes)).input_ports
                          for changes in flight_options.OPTIONS.values())) - alone
    everything = FLIGHT.replace(period_input=True, external_input=True, mag_valid_input=True, inputs=FLIGHT.tunable)
    assert added == set(ins_flight(everything).input_ports) - alone


def test_the_table_has_differences():
    rows = {name: {"cycles": cycles, "xc7": {"lut": lut, "dsp": 2}} for name, cycles, lut in (
        ("none", 400, 3000), ("more", 410, 3100), ("less", 400, 2990))}
    *_, alone, more, less = flight_options.options_table({"options": rows}).splitlines()
    assert alone == "| `flight` | 400 | 3,000 | 2 |"
    assert more == "| more | +10 | +100 | +0 |"
    assert less == "| less | +0 | -10 | +0 |"


def test_the_core_alone_is_that_of_the_report(root, result):
    cores = json.loads((root / "docs" / "report" / "cores.json").read_text(encoding="utf-8"))["cores"]
    (row,) = (row for row in cores if row["config"] == "flight")
    assert row["verilog_sha256"] == result["verilog_sha256"]
    alone = result["options"]["none"]
    assert (alone["cycles"], alone["xc7"]) == (row["cycles"], row["xc7"])
