"""Product guides of the cores: docs/guides, a page and two drawings for each configuration."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from strapdown.cores import axi_core, main_module, make_core
from strapdown.ip.diagram import block_diagram
from strapdown.ip.guide import guide_text, handshake_wave
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT
from strapdown_lab.studies.number_format import accuracy_rows, core_configs
from strapdown_lab.waves import write_wave

__all__ = ["index_table", "write_guides"]


def write_guides(folder: Path, make_core: Callable = make_core) -> Iterator[Path]:
    """Write the pages and drawings to a folder, and yield their paths. ``make_core`` may keep the cores it has made."""
    report = ROOT / "docs" / "report"
    measured = {row["config"]: row for row in _json(report / "cores.json")["cores"]}
    differences = _json(report / "number_format.json")
    folder.mkdir(exist_ok=True)
    for config in core_configs():
        name = config.name
        bus = axi_core(config, core=make_core(main_module(config), config))
        page, blocks, wave = folder / f"{name}.md", folder / f"{name}.svg", folder / f"{name}_update.svg"
        page.write_text(guide_text(config, bus, picture=blocks.name, wave=wave.name, figures=measured.get(name),
                                   accuracy=accuracy_rows(differences, config)), encoding="utf-8")
        block_diagram(bus, blocks)
        write_wave(handshake_wave(bus), wave)
        yield from (page, blocks, wave)


def index_table() -> str:
    """Table of the guides, for the page that lists them."""
    return markdown_table(["configuration", "module", "what it is"], [
        [f"[`{config.name}`](guides/{config.name}.md)", f"`{main_module(config)}`", config.description]
        for config in core_configs()])


def _json(path):
    return json.loads(path.read_text(encoding="utf-8"))
