"""Figures in the README and in docs/ are those of this commit; its links lead somewhere."""

import re

import pytest

from strapdown_lab import docs
from strapdown_lab.checkout import block


def test_table_of_modules(root, make_core):
    found = block((root / "README.md").read_text(encoding="utf-8"), "modules")
    assert found[1].strip() == docs.modules_block(make_core)


def test_table_of_configurations(root, make_module):
    found = block((root / "README.md").read_text(encoding="utf-8"), "configurations")
    assert found[1].strip() == docs.configurations_block(make_module)


@pytest.mark.parametrize(("page", "blocks"), [
    ("cores", lambda make_core: {"channels": docs.channels_block(make_core)}),
    ("notation", lambda make_core: {"pole": docs.pole_block()}),
    ("kernels", lambda make_core: {"bounds": docs.bounds_block(make_core)}),
    ("operators", lambda make_core: {"vendor operators": docs.vendor_block()}),
    ("quaternion", docs.quaternion_blocks),
    ("sins", lambda make_core: {"configurations": docs.sins_block(make_core)}),
    ("optical", lambda make_core: docs.optical_module_blocks()),
])
def test_tables_of_pages(root, make_core, page, blocks):
    text = (root / "docs" / f"{page}.md").read_text(encoding="utf-8")
    for name, content in blocks(make_core).items():
        assert block(text, name)[1].strip() == content, name


def test_links_lead_somewhere(root):
    for target in re.findall(r"\]\(([^)]+)\)", (root / "README.md").read_text(encoding="utf-8")):
        file, _, section = target.partition("#")
        assert (root / file).exists(), target
        if section:
            titles = re.findall(r"^#+ (.+)", (root / file).read_text(encoding="utf-8"), re.MULTILINE)
            assert section in [title.lower().replace(" ", "-") for title in titles], target
