"""The product guides are those of this commit."""

import json

from strapdown_lab import docs, guides
from strapdown_lab.checkout import block
from strapdown_lab.studies.number_format import core_configs, digest_of


def test_guides_are_those_of_this_commit(tmp_path, root, make_core):
    def texts(paths):
        return {path.name: path.read_text(encoding="utf-8") for path in paths}

    written = texts(guides.write_guides(tmp_path / "guides", make_core))
    kept = texts((root / "docs" / "guides").iterdir())
    assert written.keys() == kept.keys()
    assert [name for name in written if written[name] != kept[name]] == [], "run make docs"


def test_the_list_of_guides(root):
    text = (root / "docs" / "guides.md").read_text(encoding="utf-8")
    assert block(text, "guides")[1].strip() == docs.guides_table()


def test_differences_are_those_of_these_equations(root):
    result = json.loads((root / "docs" / "report" / "number_format.json").read_text(encoding="utf-8"))
    assert {config.name: digest_of(config) for config in core_configs()} == {
        name: row["equations_sha256"] for name, row in result.items()}, (
        "python -m strapdown_lab.studies.number_format measures them again")
