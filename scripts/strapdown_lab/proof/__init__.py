"""Proofs and exhaustive checks of the operators, and faults that their tests must notice: docs/proof.md."""
