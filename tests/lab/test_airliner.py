"""The table of the position errors of SINS_top after an hour of flight is that of this commit."""

import json

from strapdown_lab.studies import airliner


def test_figures_are_those_of_this_commits_equations(root):
    result = json.loads((root / "docs" / "report" / "airliner.json").read_text(encoding="utf-8"))
    assert result["equations_sha256"] == airliner.airliner_digest(), (
        "python -m strapdown_lab.studies.airliner measures them again")
    # An error in an equation would be larger: that of the reference's own test is 10 m at a tenth of the rate.
    horizontal = [values[:2] for values in result["errors_m"].values()]
    assert max(abs(value) for values in horizontal for value in values) < 10
