"""What horizontal microcode and shifts by DSP blocks make of the smallest attitude core.

The script writes docs/report/compact_forms.json and the table in docs/cores.md, with the tools of ``make report``. It
takes some minutes.
"""

from functools import partial
from pathlib import Path
from typing import Any

from strapdown.cores import THESIS_COMPACT, make_module
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.report.cores import CoreEntry
from strapdown_lab.report.measure import core_circuit, core_design, measure, provenance
from strapdown_lab.report.report import write_json
from strapdown_lab.report.tables import microseconds
from strapdown_sim.cache import Cache, digest

__all__ = ["FORMS", "digests", "table"]

FORMS: dict[str, dict[str, Any]] = {
    "`horizontal=false`": {"horizontal": False},
    "its own fields": {},
    "`adder_dsp_shifts=true`, `adder_latency=6`": {"adder_dsp_shifts": True, "adder_latency": 6},
}
"""Maps the words of a row to the fields that it changes."""


def entries():
    """The core in each form."""
    for changes in FORMS.values():
        config = THESIS_COMPACT.replace(**changes)
        yield CoreEntry("INS_top", config, partial(make_module, "INS_top", config))


def digests():
    """Digest of the circuit of each form."""
    return {name: digest(core_circuit(entry.make(), entry.config))
            for name, entry in zip(FORMS, entries(), strict=True)}


def table(result):
    """The rows as a Markdown table."""
    return markdown_table(
        ["`thesis_compact` with", "cycles:", "LUT, 7 series:", "FF:", "DSP48E1:", "MHz, ECP5:", "µs:"],
        [[name, row["cycles"], row["xc7"]["lut"], f"{row['xc7']['ff']:,}", row["xc7"]["dsp"],
          f"{row['ecp5']['fmax_mhz']:.0f}", f"{microseconds(row):.2f}"] for name, row in result["forms"].items()])


def main():
    """Measure, and write the JSON file and the table."""
    build = Path("build") / "report"
    rows = measure([core_design(entry, build) for entry in entries()], Cache(build / "cache"))
    result = {**provenance(place=True), "forms": dict(zip(FORMS, rows, strict=True))}
    write_json(ROOT / "docs" / "report" / "compact_forms.json", result)
    write_blocks(ROOT / "docs" / "cores.md", {"compact forms": table(result)})


if __name__ == "__main__":
    main()
