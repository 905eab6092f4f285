"""The laboratory: proofs, reports, studies, and the generated parts of the documents. It needs a checkout."""
