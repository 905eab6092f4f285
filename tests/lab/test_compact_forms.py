"""The table of the forms of the smallest attitude core is that of this commit."""

import json

from strapdown_lab.studies import compact_forms


def test_figures_are_those_of_this_commits_circuits(root):
    result = json.loads((root / "docs" / "report" / "compact_forms.json").read_text(encoding="utf-8"))
    assert {name: row["verilog_sha256"] for name, row in result["forms"].items()} == compact_forms.digests(), (
        "python -m strapdown_lab.studies.compact_forms measures them again")
