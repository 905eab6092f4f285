"""Timing diagrams of WaveDrom as SVG."""

import xml.etree.ElementTree as ET
from pathlib import Path

import wavedrom

__all__ = ["write_wave"]

SVG, LINK = "http://www.w3.org/2000/svg", "{http://www.w3.org/1999/xlink}href"


def write_wave(text: str, path: Path) -> None:
    """Draw a diagram, given as WaveJSON. Symbols that it does not use are left out. Two runs give equal bytes."""
    ET.register_namespace("", SVG)
    ET.register_namespace("xlink", LINK[1:].partition("}")[0])
    root = ET.fromstring(wavedrom.render(text).tostring())
    used = {element.get(LINK, "").removeprefix("#") for element in root.iter()}
    for symbols in root.iter(f"{{{SVG}}}defs"):
        for symbol in list(symbols):
            if symbol.tag == f"{{{SVG}}}g" and symbol.get("id") not in used:
                symbols.remove(symbol)
    path.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
