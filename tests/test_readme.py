"""Figures in the README and in docs/cores.md are those of this commit; its links lead somewhere."""

import re

from strapdown_lab import docs
from strapdown_lab.checkout import block


def test_table_of_modules(root, make_core):
    found = block((root / "README.md").read_text(), "modules")
    assert found[1].strip() == docs.modules_block(make_core)


def test_table_of_configurations(root, make_core):
    found = block((root / "README.md").read_text(), "configurations")
    assert found[1].strip() == docs.configurations_block(make_core)


def test_links_lead_somewhere(root):
    for target in re.findall(r"\]\(([^)]+)\)", (root / "README.md").read_text()):
        file, _, section = target.partition("#")
        assert (root / file).exists(), target
        if section:
            titles = re.findall(r"^#+ (.+)", (root / file).read_text(), re.MULTILINE)
            assert section in [title.lower().replace(" ", "-") for title in titles], target
