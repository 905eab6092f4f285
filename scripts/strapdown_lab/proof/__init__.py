"""Proofs and exhaustive checks of operators and engines, and faults that their tests must detect: docs/proof.md."""
