"""The table of what binary32 costs the attitude core is that of this commit."""

import json

from strapdown_lab.studies import attitude_binary32


def test_figures_are_those_of_this_commits_equations(root):
    result = json.loads((root / "docs" / "report" / "attitude_binary32.json").read_text(encoding="utf-8"))
    assert result["equations_sha256"] == attitude_binary32.digests(), (
        "python -m strapdown_lab.studies.attitude_binary32 FOLDER measures them again")
