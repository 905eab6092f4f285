"""Simulation of the generated cores: reference models, recordings, drivers and benches."""
