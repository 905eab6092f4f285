"""How fast a vector that is fixed to the earth turns in axes of a sensor, against what its rates say.

Such a vector, as the magnetic field and the mean specific force are, changes by -rate x vector.
"""

from typing import NamedTuple

import numpy as np

__all__ = ["AGREEMENT", "RATIO", "Turning", "turning"]

SMOOTHED_S = 0.2
"""Length of the means of samples that are compared: shocks are shorter."""

FEWEST = 10
"""Fewest means that say anything."""

AGREEMENT = 0.7
"""Least size of the correlation that decides; that of noise is near zero."""

RATIO = 3.0
"""Largest ratio of both turnings that disturbances explain."""


class Turning(NamedTuple):
    """Ratio of the turning of a vector to that of the rates, and their correlation."""

    ratio: float
    agreement: float


def turning(time_s: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> Turning | None:
    """Compare rates, shape (N, 3), rad/s, with vectors, shape (N, 3), of any unit; None without motion."""
    good = np.isfinite(time_s) & np.isfinite(rates).all(axis=1) & np.isfinite(vectors).all(axis=1) & vectors.any(axis=1)
    time_s, rates, vectors = time_s[good], rates[good], vectors[good]
    step = np.diff(time_s)
    if not (step > 0).any():
        return None
    length = max(round(SMOOTHED_S / float(np.median(step[step > 0]))), 1)
    count = len(time_s) // length
    if count < FEWEST:
        return None
    time_s, rates, vectors = (array[:count * length].reshape(count, length, -1).mean(axis=1)
                              for array in (time_s, rates, vectors))
    change = np.diff(vectors, axis=0)
    turned = -np.cross((rates[1:] + rates[:-1]) / 2, (vectors[1:] + vectors[:-1]) / 2) * np.diff(time_s, axis=0)
    both, own, other = (float((first * second).sum()) for first, second in (
        (change, turned), (turned, turned), (change, change)))
    return Turning(both / own, both / np.sqrt(own * other)) if own > 0 and other > 0 else None
