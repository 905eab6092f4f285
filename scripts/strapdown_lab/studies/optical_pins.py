"""OPT_top from the pins of sensors and ADCs over thousands of lines: bits against the twin, angles against the truth.

`make accuracy` runs the script, which writes docs/report/optical_pins.json and a table of docs/optical.md. It takes
a quarter of an hour: a line of TCD1304 has 740,000 clock cycles. With the slowest clock it has 59,200, too few for a
serial ADC.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from strapdown.cores import CONFIGS, OpticalConfig
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_sim.drivers.optical import PinBench
from strapdown_sim.errors import largest, rms
from strapdown_sim.instrument.flights import FLIGHTS
from strapdown_sim.instrument.pins import ADCS
from strapdown_sim.instrument.pins import SENSORS as MODELS
from strapdown_sim.optical import flight_scene, inertial_samples, judged, scene_source

__all__ = ["RUNS", "Run", "measured", "pins_table", "rules_table", "run_from_pins"]

FLIGHT = "f"


class Run(NamedTuple):
    """Lines of a configuration in Verilator, how many of them run in Icarus Verilog too, and fields that change."""

    config: str
    lines: int
    icarus: int = 0
    changes: tuple[tuple[str, Any], ...] = ()

    @property
    def name(self):
        """The configuration with its changes, for tables."""
        return " ".join((self.config, *(f"{field}={value}" for field, value in self.changes)))


SLOW = (("clock_hz", 8_000_000), ("adc", "parallel"), ("baud_rate", 500_000))
"""Changes of a TCD1304 with the slowest clock for its preset."""

RUNS = (Run("optical_s11639", 10_000, 10), Run("optical_tcd1304", 300, 1), Run("optical_tcd1304", 10_000, 0, SLOW),
        Run("optical_erected", 20), Run("optical_s11639", 200, 0, (("mode", "buffered"),)),
        Run("optical_s11639", 200, 0, (("compensation", "patent"),)),
        Run("optical_s11639", 500, 0, (("sensor", "tsl1402"), ("send_every", 3))))
"""The runs of the table; the first three are those for which errors have limits."""


def run_from_pins(run: Run, build: Path) -> dict[str, Any]:
    """Figures of a run, as JSON values."""
    config = CONFIGS[run.config].replace(**dict(run.changes))
    assert isinstance(config, OpticalConfig)
    bench, scene = PinBench(config, build), flight_scene(FLIGHTS[FLIGHT], config, run.lines)
    source = scene_source(FLIGHT, scene)
    found = bench.run(run.lines, scene.image, calibration=source.calibration.ports(),
                      inertial=inertial_samples(scene, bench, run.lines))
    judgement = judged(source, bench, found)
    assert judgement.position_error_px is not None
    return {
        "config": run.name, "flight": FLIGHT, "lines": run.lines, "updates": len(found.cycle),
        "seconds": run.lines / config.sample_rate_hz, "icarus_lines": run.icarus,
        "icarus_differences": _icarus_differences(bench, scene, source, run.icarus) if run.icarus else 0,
        "differing_bits": judgement.differing_bits, "timing_violations": len(found.pins.violations),
        "frames": len(judgement.frames), "frames_lost": judgement.decoder.lost,
        "frames_differing": judgement.frames_differing,
        "line_periods": sorted({int(period) for period in np.diff(found.cycle)}),
        "position_rms_px": rms(np.concatenate(judgement.position_error_px)),
        "errors_deg": {name: {"largest": largest(part), "rms": rms(part)}
                       for name, part in judgement.parts.items()}}


def _icarus_differences(bench, scene, source, lines):
    """Number of values of all outputs, at the finishes of some lines, that differ between Icarus and Verilator."""
    inertial = inertial_samples(scene, bench, lines)
    found = bench.run(lines, scene.image, calibration=source.calibration.ports(), inertial=inertial)
    with TemporaryDirectory() as folder:
        events = bench.driver.events_in_icarus(bench.actions(source.calibration.ports(), inertial), found.pins,
                                               Path(folder), cycles=bench.cycles(lines))
    return sum(int((values != found.pins.events[name]).sum()) for name, values in events.items())


def measured(build: Path) -> dict[str, Any]:
    """All figures of the study."""
    return {"runs": [run_from_pins(run, build) for run in RUNS]}


def pins_table(result: dict[str, Any]) -> str:
    """The runs as a Markdown table."""
    return markdown_table(
        ["configuration", "lines:", "bits that differ from the twin:", "violations of the timing:",
         "frames lost or different:", "lines in Icarus:", "differences in Icarus:", "position, px rms:",
         "circuit − float64:", "float64 − physics:", "circuit − truth:"],
        [[f"`{row['config']}`", f"{row['lines']:,}", row["differing_bits"], row["timing_violations"],
          row["frames_lost"] + row["frames_differing"], row["icarus_lines"], row["icarus_differences"],
          f"{row['position_rms_px']:.3f}",
          *(f"{row['errors_deg'][part]['largest']:.2g}°" for part in ("arithmetic", "equations", "total"))]
         for row in result["runs"]])


def rules_table() -> str:
    """The rules that the models of sensors and ADCs check, as a Markdown table."""
    return markdown_table(["model", "rules"], [
        [model.title, "; ".join(filter(None, model.rules))] for model in (*MODELS.values(), *ADCS.values())])


def main():
    """Measure, and write the JSON file and the table."""
    result = measured(ROOT / "build" / "sim" / "verilated")
    (ROOT / "docs" / "report" / "optical_pins.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "optical.md", {"pins": pins_table(result), "rules": rules_table()})


if __name__ == "__main__":
    main()
