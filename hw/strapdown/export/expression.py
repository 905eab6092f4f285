"""Values and operations of a netlist as Verilog expressions.

The text of a value or operation has the width of its result. No operand is left for Verilog to extend: the text itself
adds the missing bits. So it means the same wherever the other operands have the same width.
"""

from itertools import pairwise

from .netlist import Operation
from .rtlil import Bits, Slice

__all__ = ["constant", "pattern", "Expressions"]

BINARY = {"$add": "+", "$sub": "-", "$mul": "*", "$divfloor": "/", "$modfloor": "%", "$and": "&", "$or": "|",
          "$xor": "^", "$eq": "==", "$ne": "!=", "$lt": "<", "$le": "<=", "$gt": ">", "$ge": ">=", "$shl": "<<",
          "$shr": ">>", "$sshr": ">>>"}
UNARY = {"$not": "~", "$neg": "-", "$reduce_or": "|", "$reduce_and": "&", "$reduce_xor": "^", "$reduce_bool": "|"}
# A chain of these needs no brackets.
ASSOCIATIVE = {"$and", "$or", "$xor", "$add"}


WIDEST = 256
"""Bits of a number that is written in one piece."""


def constant(digits):
    """A number: in binary up to three bits, else in hexadecimal; in pieces if it is very long."""
    width = len(digits)
    if width > WIDEST:
        if len(set(digits)) == 1:
            return f"{{{width}{{{constant(digits[0])}}}}}"
        cuts = [0, *range(width % WIDEST or WIDEST, width + 1, WIDEST)]
        return f"{{{', '.join(constant(digits[first:last]) for first, last in pairwise(cuts))}}}"
    return f"{width}'b{digits}" if width <= 3 else f"{width}'h{int(digits, 2):0{-(-width // 4)}x}"


def pattern(digits):
    """The label of a case, in which - matches both levels."""
    return f"{len(digits)}'b{digits.replace('-', '?')}" if "-" in digits else constant(digits)


class Expressions:
    """Texts of the values in a circuit.

    Parameters
    ----------
    circuit : Circuit
        Where wires are driven.
    inlined : set of str
        Wires whose operation is written where they are read.
    names : dict
        Names of the other wires.
    """

    def __init__(self, circuit, inlined, names):
        self._circuit, self._inlined, self._names = circuit, inlined, names

    def value(self, value, inside=""):
        """A value in an operation of the kind ``inside``, with brackets if it needs them there."""
        if len(value) == 1:
            return self._part(value[0], inside)
        parts: list[list] = []
        for part in reversed(value):
            text = self._part(part)
            if parts and parts[-1][0] == text and part.width == parts[-1][2]:
                parts[-1][1] += 1
            else:
                parts.append([text, 1, part.width])
        texts = [text if count == 1 else f"{{{count}{{{text}}}}}" for text, count, _ in parts]
        return texts[0] if len(texts) == 1 else f"{{{', '.join(texts)}}}"

    def _part(self, part, inside=""):
        if isinstance(part, Bits):
            return constant(part.digits)
        wire, low, width = part
        if wire in self._inlined:
            driver = self._circuit.drivers[wire]
            text = self.operation(driver)
            kind = driver.kind
            if inside and kind not in ("value", inside if inside in ASSOCIATIVE else ""):
                return text if kind == "$not" and inside not in UNARY else f"({text})"
            return text
        name = self._names[wire]
        if width == self._circuit.widths[wire]:
            return name
        return f"{name}[{low}]" if width == 1 else f"{name}[{low + width - 1}:{low}]"

    def operation(self, driver: Operation):
        """The text of an operation."""
        kind, operands = driver.kind, driver.operands
        if kind == "value":
            return self.value(operands[0])
        if kind == "$memrd_v2":
            return f"{self._names[driver.memory]}[{self.value(operands[0])}]"
        if kind == "$mux":
            # A chain of choices reads from top to bottom.
            condition, other, then = operands
            return f"{self.value(condition, kind)} ? {self.value(then, kind)} : {self.value(other, self._tail(other))}"
        if kind in UNARY:
            return f"{UNARY[kind]}{self.value(operands[0], kind)}"
        left, right = (self.value(value, "" if driver.signed else kind) for value in operands)
        if driver.signed:
            left = f"$signed({left})"
            right = self.value(operands[1], kind) if kind == "$sshr" else f"$signed({right})"
        return f"{left} {BINARY[kind]} {right}"

    def _tail(self, value):
        last = value[0]
        chained = isinstance(last, Slice) and last.wire in self._inlined and \
            self._circuit.drivers[last.wire].kind == "$mux"
        return "" if chained else "$mux"
