"""The tables of the studies in the docs are those of their figures."""

import pytest

from strapdown_lab import docs
from strapdown_lab.checkout import block


@pytest.mark.parametrize(("name", "page", "blocks"), docs.STUDIES,
                         ids=[f"{name} in {page}" for name, page, _ in docs.STUDIES])
def test_tables_in_the_docs_are_those_of_the_figures(name, page, blocks, root):
    text = (root / page).read_text(encoding="utf-8")
    tables = docs.study_blocks(name, blocks)
    assert tables
    for title, table in tables.items():
        assert block(text, title)[1] == f"{table}\n", title
