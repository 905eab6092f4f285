"""Proofs of the blocks of a bus; the faults of mutants.py in these blocks must break one of them."""

import pytest

from strapdown_lab.proof import formal
from strapdown_lab.proof.catalogue import bus
from strapdown_lab.proof.solver import solver_missing

pytestmark = [pytest.mark.formal, pytest.mark.skipif(bool(solver_missing()), reason=solver_missing())]

MOST_EDGES = 8


@pytest.mark.parametrize("subject", list(dict.fromkeys(prop.subject for prop in bus())))
def test_properties_hold(subject, tmp_path):
    props = [prop for prop in bus() if prop.subject == subject]
    for prop, outcome in zip(props, formal.run(props, tmp_path), strict=True):
        assert outcome.passed, f"{prop.subject}: {prop.claim}\n{outcome.report}"
        assert prop.depth <= MOST_EDGES
