"""Proofs and exhaustive checks of the operators, and faults that their tests must detect: docs/proof.md."""
