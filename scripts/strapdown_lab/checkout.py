"""The folder of the checkout, and the generated blocks of its documents."""

import re
from pathlib import Path

__all__ = ["ROOT", "block", "replaced", "write_blocks"]

ROOT = Path(__file__).resolve().parents[2]
"""Folder of the checkout."""


def block(text, name):
    """The text between the markers of a generated block."""
    found = re.search(rf"<!-- generated: {name} -->\n(.*?)<!-- end -->", text, re.DOTALL)
    if found is None:
        raise ValueError(f"there is no generated block {name!r}")
    return found


def replaced(text, blocks):
    """The text with new contents in its generated blocks, by their names."""
    for name, content in blocks.items():
        found = block(text, name)
        text = text[:found.start(1)] + content + "\n" + text[found.end(1):]
    return text


def write_blocks(path, blocks):
    """Write contents, by the name of their block, into a file."""
    path.write_text(replaced(path.read_text(encoding="utf-8"), blocks), encoding="utf-8")
