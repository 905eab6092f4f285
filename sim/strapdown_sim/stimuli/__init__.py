"""Stimuli: published check values and seeded random samples."""
