"""The count of refused updates after which a state starts again from its reset values."""

import numpy as np

__all__ = ["Refusals"]


class Refusals:
    """Counts updates that are refused in a row although every input is finite; the software twin of the engines' count.

    An update that is not refused clears the count. A refused update with an input that is NaN or infinite does not
    change it.

    Parameters
    ----------
    limit : int
        Number of refusals after which the state starts again; 0: never.
    count : int or ndarray of int
        Refusals so far, for each of several independent runs.

    Attributes
    ----------
    count : ndarray of int
    """

    def __init__(self, limit, count=0):
        self._limit, self.count = limit, np.asarray(count)

    def update(self, refused, finite):
        """Count an update; True where the state starts again after it.

        ``refused`` tells whether the update is refused, ``finite`` whether all its inputs are finite; the shapes are
        those of the count, or broadcast with it.
        """
        count = np.where(refused, self.count + finite, 0)
        restarts = count == self._limit if self._limit else np.zeros(np.shape(count), bool)
        self.count = np.where(restarts | (self._limit == 0), 0, count)
        return restarts

    def updates(self, refused, finite):
        """Count updates in the order of the first axis: what ``update`` gives for each, and the count after each."""
        restarts, counts = np.zeros(refused.shape, bool), np.zeros(refused.shape, int)
        if self._limit and refused.any():
            for row in range(len(refused)):
                restarts[row] = self.update(refused[row], finite[row])
                counts[row] = self.count
        return restarts, counts
