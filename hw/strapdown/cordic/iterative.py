"""What the iterative CORDIC operators share: the checks and the names of their parameters."""

import operator

from amaranth.lib import wiring

from ..fp.format import FloatFormat

__all__ = ["IterativeCordic"]


class IterativeCordic(wiring.Component):
    """Base of the operators that do some CORDIC steps in each of a number of cycles.

    A subclass checks and keeps its parameters by ``_take`` before it makes its signature, sets
    ``_width``, and supplies ``latency``.
    """

    def _take(self, format, *, least_exponent_width, iterations, steps_per_cycle, most_steps_per_cycle=None):
        if not isinstance(format, FloatFormat):
            raise TypeError(f"format must be a FloatFormat, not {format!r}")
        if format.exponent_width < least_exponent_width:
            raise ValueError(f"format must have at least {least_exponent_width} exponent bits, "
                             f"not {format.exponent_width!r}")
        self._format = format
        self._steps_per_cycle = operator.index(steps_per_cycle)
        if self._steps_per_cycle < 1 or (most_steps_per_cycle and self._steps_per_cycle > most_steps_per_cycle):
            range_ = f"from 1 to {most_steps_per_cycle}" if most_steps_per_cycle else "at least 1"
            raise ValueError(f"steps_per_cycle must be {range_}, not {steps_per_cycle!r}")
        steps = format.precision + 6 if iterations is None else operator.index(iterations)
        if steps < format.precision + 2:
            raise ValueError(f"iterations must be at least {format.precision + 2}, not {iterations!r}")
        self._cycles = -(-steps // self._steps_per_cycle)

    @property
    def format(self):
        """Format of operands and results."""
        return self._format

    @property
    def width(self):
        """Fraction bits of the data path."""
        return self._width

    @property
    def iterations(self):
        """CORDIC steps, a multiple of ``steps_per_cycle``."""
        return self._cycles * self._steps_per_cycle

    @property
    def steps_per_cycle(self):
        """Steps done in one clock cycle."""
        return self._steps_per_cycle

    @property
    def interval(self):
        """Least number of cycles between two starts: a load overlaps with the rounding before it."""
        return self.latency - 1
