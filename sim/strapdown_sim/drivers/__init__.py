"""Drivers: simulators found, modules compiled, transactions run."""
