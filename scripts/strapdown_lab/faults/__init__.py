"""Faults: single bits of a core that flip during a recording, and what follows from them."""
