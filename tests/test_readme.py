"""Figures in the README are those of this commit; its links lead somewhere."""

import re


def test_table_of_modules(root, update_docs):
    block = update_docs.block((root / "README.md").read_text(), "modules")
    assert block[1].strip() == update_docs.modules_block()


def test_table_of_configurations(root, update_docs):
    block = update_docs.block((root / "README.md").read_text(), "configurations")
    assert block[1].strip() == update_docs.configurations_block()


def test_linked_files_exist(root):
    for target in re.findall(r"\]\(([^)]+)\)", (root / "README.md").read_text()):
        assert (root / target).exists(), target
