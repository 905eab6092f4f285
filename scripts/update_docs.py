"""Write the generated figures into README.md, and the picture of the demo into docs/.

Run by `make docs`, after `make demo`. `blocks` is also what the tests hold the README against.
"""

import json
import re
import shutil
from pathlib import Path

from strapdown.config import THESIS
from strapdown.cores import ATTITUDE_CORES, attitude_core

ROOT = Path(__file__).parents[1]


def modules_block():
    """Table of the modules with their latency."""
    rows = ["| module | what it gives | cycles | µs at 100 MHz |", "|---|---|---:|---:|"]
    for name in ATTITUDE_CORES:
        core = attitude_core(name, THESIS)
        rows.append(f"| `{name}` | {core.system.title} | {core.latency} | {core.latency / 100:.2f} |")
    return "\n".join(rows)


def demo_block(summary):
    """Table of what a replay's summary says."""
    difference = summary["against_float64_reference_deg"]
    return "\n".join([
        "| samples | cycles per update | µs at 100 MHz | largest difference from float64 | RMS difference "
        "| bits that differ from the twin |", "|---:|---:|---:|---:|---:|---:|",
        f"| {summary['samples']:,} | {summary['cycles_per_update']} "
        f"| {summary['microseconds_per_update_at_100_mhz']:.2f} | {difference['max']:.6f}° | {difference['rms']:.6f}° "
        f"| {summary['bits_differing_from_twin']} |"])


def block(text, name):
    """The text between the markers of a generated block."""
    return re.search(rf"<!-- generated: {name} -->\n(.*?)<!-- end -->", text, re.DOTALL)


def main():
    """Update README.md and docs/attitude.png from build/demo."""
    readme = ROOT / "README.md"
    text = readme.read_text()
    summary = json.loads((ROOT / "build" / "demo" / "summary.json").read_text())
    for name, content in ("demo", demo_block(summary)), ("modules", modules_block()):
        found = block(text, name)
        text = text[:found.start(1)] + content + "\n" + text[found.end(1):]
    readme.write_text(text)
    shutil.copyfile(ROOT / "build" / "demo" / "attitude.png", ROOT / "docs" / "attitude.png")


if __name__ == "__main__":
    main()
