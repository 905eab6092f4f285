"""Figures in the README are those of this commit; its links lead somewhere."""

import re

from strapdown_lab import docs
from strapdown_lab.checkout import block


def test_table_of_modules(root, make_core):
    found = block((root / "README.md").read_text(), "modules")
    assert found[1].strip() == docs.modules_block(make_core)


def test_table_of_configurations(root, make_core):
    found = block((root / "README.md").read_text(), "configurations")
    assert found[1].strip() == docs.configurations_block(make_core)


def test_linked_files_exist(root):
    for target in re.findall(r"\]\(([^)]+)\)", (root / "README.md").read_text()):
        assert (root / target).exists(), target
