"""The table of the parts of the flight filter is that of this commit, and its variants are those that they say."""

import json

import numpy as np
import pytest

from strapdown.cores import FLIGHT
from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_lab.studies import flight_parts
from strapdown_sim.recordings import Recording, ReferenceOrientation


@pytest.fixture(scope="module")
def result(root):
    """The figures in docs/report."""
    return json.loads((root / "docs" / "report" / "flight_parts.json").read_text(encoding="utf-8"))


def test_figures_are_those_of_this_commits_equations(result):
    assert result["equations_sha256"] == flight_parts.parts_digest(), (
        "python -m strapdown_lab.studies.flight_parts measures them again")
    assert result["parts"].keys() == flight_parts.PARTS.keys()


def test_another_equation_has_another_digest(monkeypatch):
    before = flight_parts.parts_digest()
    monkeypatch.setattr(flight_parts, "FLIGHT", FLIGHT.replace(accelerometer_gain=0.51))
    assert flight_parts.parts_digest() != before


def test_the_table_in_the_docs_is_that_of_the_figures(root):
    text = (root / "docs" / "flight.md").read_text(encoding="utf-8")
    assert block(text, "parts")[1].strip() == docs.parts_block()
