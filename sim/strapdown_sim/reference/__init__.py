"""Textbook models in float64, written from the source documents; they import nothing from the generator."""
