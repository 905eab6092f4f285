"""The generated parts of docs/proof.md are those of the code; `make docs` writes them."""

from strapdown_sim.proof.__main__ import documented


def test_document_is_up_to_date(root):
    page = (root / "docs" / "proof.md").read_text()
    assert documented(page) == page
