"""The generated parts of docs/proof.md agree with the code; `make docs` writes them."""

from strapdown_lab.checkout import replaced
from strapdown_lab.proof.__main__ import blocks


def test_document_is_up_to_date(root):
    page = (root / "docs" / "proof.md").read_text(encoding="utf-8")
    assert replaced(page, blocks()) == page
