"""Drivers: they find simulators, compile modules and run transactions."""
