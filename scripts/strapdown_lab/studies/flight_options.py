"""The price of each option of the flight core: cycles of an update, and cells of a 7-series part.

A value that is a constant may cost less than any other, such as 0 and 1 in a matrix. So the constants of a calibration
are those of the example in docs/calibration.md, and no element is 0 or 1. The script writes
docs/report/flight_options.json and the table in docs/flight.md. It takes a quarter of an hour: Yosys without place and
route, as in docs/report.md.
"""

import json
from typing import Any

import numpy as np

from strapdown.algorithms.flight import Calibration, Parameters
from strapdown.cores import FLIGHT, Top, main_module, make_module, system_of
from strapdown.cores.flight import FlightConfig
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.report.measure import Design, core_circuit, cycles_of, measure, provenance
from strapdown_lab.studies.calibration import (
    ACCELEROMETER_BIAS,
    ACCELEROMETER_MATRIX,
    GYRO_BIAS,
    HARD_IRON,
    SOFT_IRON,
)
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.cache import Cache, digest

__all__ = ["OPTIONS", "circuit_digest", "digest_of_options", "measured", "options_table"]

BIASES = {"accelerometer_bias": ACCELEROMETER_BIAS, "gyro_bias": GYRO_BIAS, "magnetometer_bias": HARD_IRON}
MATRICES = {"accelerometer_matrix": ACCELEROMETER_MATRIX,
            "gyro_matrix": np.array([[1.003, 0.004, -0.002], [-0.003, 0.996, 0.005], [0.002, -0.006, 1.002]]),
            "magnetometer_matrix": SOFT_IRON}

OPTIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "`period_input`": {"period_input": True},
    "`external_input`": {"external_input": True},
    "`stale_field`": {"stale_field": True},
    "`mag_valid_input`": {"mag_valid_input": True},
    "`magnetic_declination`, a constant": {"magnetic_declination": 3.0},
    "the three biases of the calibration, constants": BIASES,
    "the whole calibration, constants": BIASES | MATRICES,
    "the whole calibration, inputs": {"inputs": Calibration._fields},
    "all other parameters, inputs": {"inputs": Parameters._fields},
}
"""Maps each option to the fields that differ from FLIGHT."""


def config_of(changes: dict[str, Any]) -> FlightConfig:
    """FLIGHT with an option."""
    return FLIGHT.replace(**{name: np.asarray(value).tolist() if isinstance(value, np.ndarray) else value
                             for name, value in changes.items()})


def circuit_digest(core: Top) -> str:
    """SHA-256 of the circuit of FLIGHT alone, as in docs/report/cores.json."""
    return digest(core_circuit(core, FLIGHT))


def digest_of_options() -> dict[str, str]:
    """Digests of the equations of FLIGHT with each option: cheap, because nothing is scheduled."""
    found = {}
    for name, changes in OPTIONS.items():
        config = config_of(changes)
        found[name] = equations_digest(system_of(main_module(config), config), config.engine_pool)
    return found


def measured(cache: Cache) -> dict[str, Any]:
    """Cycles and cells of FLIGHT with each option."""
    def designs():
        for changes in OPTIONS.values():
            config = config_of(changes)
            module = main_module(config)
            core = make_module(module, config)
            yield Design({"cycles": cycles_of(core)}, core_circuit(core, config), module)

    rows = measure(designs(), cache, place=False, jobs=1)
    return {**provenance(place=False), "options": dict(zip(OPTIONS, rows, strict=True))}


def options_table(result: dict[str, Any]) -> str:
    """The figures of FLIGHT, and what each option adds, as a Markdown table."""
    (_, alone), *others = result["options"].items()
    cells = alone["xc7"]
    rows = [["`flight`", *(f"{value:,}" for value in (alone["cycles"], cells["lut"], cells["dsp"]))]]
    for name, row in others:
        more = row["cycles"] - alone["cycles"], *(row["xc7"][kind] - cells[kind] for kind in ("lut", "dsp"))
        rows.append([name, *(f"{value:+,}" for value in more)])
    return markdown_table(["option", "cycles:", "LUT:", "DSP:"], rows)


def main() -> None:
    """Measure, and write the JSON file and the table."""
    alone = make_module(main_module(FLIGHT), FLIGHT)
    result = {"verilog_sha256": circuit_digest(alone), "equations_sha256": digest_of_options(),
              **measured(Cache(ROOT / "build" / "report" / "cache"))}
    (ROOT / "docs" / "report" / "flight_options.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "flight.md", {"options": options_table(result)})


if __name__ == "__main__":
    main()
