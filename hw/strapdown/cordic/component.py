"""Base of the floating-point CORDIC operators: parameters, and register ranks of the pipelined ones."""

import operator
from types import SimpleNamespace

import numpy as np
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.component import Described

from ..fp.format import FloatFormat

__all__ = ["CordicComponent", "blockwise"]


class CordicComponent(Described):
    """Base of the operators that make several CORDIC steps per cycle, iterative or pipelined.

    A subclass checks and stores its parameters with ``_take`` before it calls ``__init__`` with its
    data members. It defines ``latency``.
    """

    def _take(self, format, *, least_exponent_width, iterations, steps_per_cycle, iterative,
              most_steps_per_cycle=None):
        if not isinstance(format, FloatFormat):
            raise TypeError(f"format must be a FloatFormat, not {format!r}")
        if format.exponent_width < least_exponent_width:
            raise ValueError(f"format must have at least {least_exponent_width} exponent bits, "
                             f"not {format.exponent_width!r}")
        self._format = format
        self._iterative = bool(iterative)
        default = 2 if self._iterative else 1
        self._steps_per_cycle = default if steps_per_cycle is None else operator.index(steps_per_cycle)
        if self._steps_per_cycle < 1 or (most_steps_per_cycle and self._steps_per_cycle > most_steps_per_cycle):
            range_ = f"from 1 to {most_steps_per_cycle}" if most_steps_per_cycle else "at least 1"
            raise ValueError(f"steps_per_cycle must be {range_}, not {steps_per_cycle!r}")
        steps = format.precision + 6 if iterations is None else operator.index(iterations)
        if steps < format.precision + 2:
            raise ValueError(f"iterations must be at least {format.precision + 2}, not {iterations!r}")
        self._cycles = -(-steps // self._steps_per_cycle)

    def __init__(self, operands, results):
        layout = self._format.layout
        super().__init__({**dict.fromkeys(operands, In(layout)), "start": In(1),
                          **dict.fromkeys(results, Out(layout)), "done": Out(1)})

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
        """Steps between two register ranks."""
        return self._steps_per_cycle

    @property
    def iterative(self):
        """True if one set of registers serves all cycles of an operation, in place of a pipeline."""
        return self._iterative

    @property
    def interval(self):
        """Least number of cycles between two starts. If iterative, a load overlaps with the previous rounding."""
        return self.latency - 1 if self._iterative else 1

    @property
    def error_bound_ulp(self):
        """Upper bound of a result's error in ulp, its final rounding included."""
        return 0.5 + self.error_bound

    @staticmethod
    def _lead_back(m, fsm):
        """Lead a state machine to its first state if its register has a code that stands for no state.

        A synthesis tool that chose other codes would remove this, so an attribute keeps the codes.
        """
        fsm.state.attrs["fsm_encoding"] = "none"
        with m.If(fsm.state >= len(fsm.encoding)):
            m.d.sync += fsm.state.eq(fsm.state.init)

    @staticmethod
    def _rank(m, name, values):
        """The same values one cycle later; only ``valid`` has a reset."""
        registered = SimpleNamespace()
        for key, value in vars(values).items():
            register = Signal.like(value, name=f"{name}_{key}", reset_less=key != "valid")
            m.d.sync += register.eq(value)
            setattr(registered, key, register)
        return registered


def blockwise(function, *arrays):
    """``function`` of arrays of one shape, computed in blocks that fit the cache; returns a tuple of arrays."""
    flat = [np.ravel(array) for array in arrays]
    block = 1 << 13
    parts = [function(*(array[start:start + block] for array in flat))
             for start in range(0, max(len(flat[0]), 1), block)]
    return tuple(np.concatenate(result).reshape(arrays[0].shape) for result in zip(*parts, strict=True))
